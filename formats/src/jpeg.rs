//! Whether a JPEG is whole. Its decoder fills what is missing with grey and says nothing.
//!
//! A JPEG is segments (ITU-T T.81, B.1): 0xff and a code, then for most codes a length and so many bytes. After a start of scan come
//! entropy-coded bytes, in which 0xff is followed by 0 or is a marker without content. The end-of-image marker closes it; what
//! cameras append after it is not looked at.

const START_OF_IMAGE: [u8; 2] = [0xff, 0xd8];
const END_OF_IMAGE: u8 = 0xd9;

/// Whether the file goes on to its end-of-image marker.
pub(crate) fn is_whole_jpeg(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.strip_prefix(&START_OF_IMAGE) else { return false };
    loop {
        rest = match *rest {
            [0xff, END_OF_IMAGE, ..] => return true,
            // A fill byte.
            [0xff, 0xff, ..] => &rest[1..],
            // A stuffed 0xff, a temporary marker, a restart.
            [0xff, 0x00 | 0x01 | 0xd0..=0xd7, ..] => &rest[2..],
            [0xff, _, high, low, ..] => {
                let length = usize::from(u16::from_be_bytes([high, low]));
                rest.get(2 + length..).unwrap_or_default()
            }
            [0xff, ..] | [] => return false,
            // Entropy-coded.
            [..] => &rest[rest.iter().position(|byte| *byte == 0xff).unwrap_or(rest.len())..],
        };
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::{ImageFormat, Rgb, RgbImage};

    use super::*;

    fn encoded() -> Vec<u8> {
        let picture = RgbImage::from_fn(40, 30, |x, y| Rgb([(x * 37) as u8, (y * 91) as u8, (x * y) as u8]));
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn a_jpeg_is_whole_with_its_last_byte() {
        let whole = encoded();
        assert!(is_whole_jpeg(&whole));
        assert!(is_whole_jpeg(&[&whole[..], b"what a camera appends"].concat()));
        for length in 0..whole.len() {
            assert!(!is_whole_jpeg(&whole[..length]), "{length} of {} bytes", whole.len());
        }
    }

    // A thumbnail is a JPEG inside a segment: its end is not the picture's.
    #[test]
    fn the_end_of_a_thumbnail_is_not_the_end() {
        let (whole, thumbnail) = (encoded(), encoded());
        let segment = [&[0xff, 0xe1][..], &(thumbnail.len() as u16 + 2).to_be_bytes(), &thumbnail].concat();
        let with_thumbnail = [&START_OF_IMAGE[..], &segment, &whole[2..]].concat();
        assert!(is_whole_jpeg(&with_thumbnail));
        assert!(!is_whole_jpeg(&with_thumbnail[..segment.len() + 100]));
    }
}

//! Pictures: every format that is decoded; PNG once more with its checksums put right, so that mutations reach the decoder.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use xavatar::formats::decode_picture;

const SIGNATURE: usize = 8;

pub(super) fn picture(bytes: &[u8]) -> bool {
    decode_picture(bytes, None).is_ok()
}

pub(super) fn picture_seeds() -> Vec<Vec<u8>> {
    [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Bmp].map(encoded).into()
}

pub(super) fn png(bytes: &[u8]) -> bool {
    picture(&with_checksums(bytes))
}

pub(super) fn png_seeds() -> Vec<Vec<u8>> {
    // One pixel of a palette of two colours.
    let palette = [
        &b"\x89PNG\r\n\x1a\n"[..],
        b"\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01\x08\x03\0\0\0....",
        b"\0\0\0\x06PLTE\0\0\0\xff\xff\xff....",
        b"\0\0\0\x0aIDAT\x78\x9c\x63\x60\0\0\0\x02\0\x01....",
        b"\0\0\0\0IEND....",
    ];
    vec![encoded(ImageFormat::Png), with_checksums(&palette.concat())]
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let picture = RgbImage::from_fn(7, 5, |x, y| Rgb([40 * x as u8, 50 * y as u8, 90]));
    let mut bytes = Cursor::new(Vec::new());
    // A seed that cannot be made would be missed where seeds are checked.
    let _ = picture.write_to(&mut bytes, format);
    bytes.into_inner()
}

/// The same chunks (length, name, data, checksum), each with the checksum of what it holds.
fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut begin = SIGNATURE;
    while let Some(length) = bytes.get(begin..begin + 4).and_then(|length| length.try_into().ok()) {
        let end = (begin + 8).saturating_add(u32::from_be_bytes(length) as usize);
        let Some(content) = bytes.get(begin + 4..end) else { break };
        let checksum = crc32fast::hash(content).to_be_bytes();
        let Some(place) = bytes.get_mut(end..end + 4) else { break };
        place.copy_from_slice(&checksum);
        begin = end + 4;
    }
    bytes
}

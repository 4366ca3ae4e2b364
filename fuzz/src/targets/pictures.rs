//! Pictures: every format that is decoded; PNG once more as its chunks, so that mutations reach what their checksums guard.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use xavatar::data::{DepthFormat, parse_depth, write_depth};
use xavatar::formats::decode_picture;

/// What stands between chunks, so that those which grow or shrink leave the others whole.
const BETWEEN: &[u8] = b"|PNG";
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

pub(super) fn picture(bytes: &[u8]) -> bool {
    decode_picture(bytes, None).is_ok()
}

pub(super) fn picture_seeds() -> Vec<Vec<u8>> {
    [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Bmp].map(encoded).into()
}

/// A PNG of these chunks: names with their contents, between [`BETWEEN`].
pub(super) fn png(bytes: &[u8]) -> bool {
    let mut file = SIGNATURE.to_vec();
    let mut rest = bytes;
    while !rest.is_empty() {
        let end = rest.windows(BETWEEN.len()).position(|window| window == BETWEEN);
        let chunk = &rest[..end.unwrap_or(rest.len())];
        rest = rest.get(chunk.len() + BETWEEN.len()..).unwrap_or_default();
        file.extend((chunk.len().saturating_sub(4) as u32).to_be_bytes());
        file.extend(chunk);
        file.extend(crc32fast::hash(chunk).to_be_bytes());
    }
    picture(&file)
}

pub(super) fn png_seeds() -> Vec<Vec<u8>> {
    let chunk = |name: &[u8; 4], content: &[u8]| [name, content, BETWEEN].concat();
    let file = |kind: u8, palette: &[u8], rows: &[u8]| {
        let begin = chunk(b"IHDR", &[0, 0, 0, 2, 0, 0, 0, 2, 8, kind, 0, 0, 0]);
        let palette = if palette.is_empty() { Vec::new() } else { chunk(b"PLTE", palette) };
        // A zlib stream of one stored block.
        let length = rows.len() as u16;
        let stored = [&[0x78, 0x01, 0x01][..], &length.to_le_bytes(), &(!length).to_le_bytes(), rows].concat();
        let pixels = chunk(b"IDAT", &[&stored[..], &adler32(rows).to_be_bytes()].concat());
        [begin, palette, pixels, chunk(b"IEND", &[])].concat()
    };
    // Each row begins with its filter.
    vec![
        file(3, &[0, 0, 0, 255, 255, 255], &[0, 0, 1, 0, 1, 0]),
        file(2, &[], &[1, 10, 20, 30, 5, 5, 5, 4, 10, 20, 30, 1, 1, 1]),
        file(0, &[], &[2, 10, 20, 3, 30, 40]),
    ]
}

/// The checksum of a zlib stream's content (RFC 1950).
fn adler32(bytes: &[u8]) -> u32 {
    const PRIME: u32 = 65_521;
    let (a, b) = bytes.iter().fold((1, 0), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % PRIME;
        (a, (b + a) % PRIME)
    });
    b << 16 | a
}

pub(super) fn depth(bytes: &[u8]) -> bool {
    parse_depth(bytes).is_ok()
}

/// A ramp in each format that depth is written in.
pub(super) fn depth_seeds() -> Vec<Vec<u8>> {
    let depths = [1.5, 1.75, 2.0, 0.5, 3.0, 4.0];
    let path = |format: DepthFormat| {
        let name = format!("xavatar-fuzz-{}-{format:?}", std::process::id());
        std::env::temp_dir().join(name).with_extension(format.extension())
    };
    let written = |format: DepthFormat| {
        let path = path(format);
        write_depth(&path, &depths, [3, 2], format).ok()?;
        let bytes = std::fs::read(&path).ok();
        let _ = std::fs::remove_file(&path);
        bytes
    };
    [DepthFormat::Png, DepthFormat::Tiff, DepthFormat::Exr].into_iter().filter_map(written).collect()
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let picture = RgbImage::from_fn(7, 5, |x, y| Rgb([40 * x as u8, 50 * y as u8, 90]));
    let mut bytes = Cursor::new(Vec::new());
    // A seed that cannot be made would be missed where seeds are checked.
    let _ = picture.write_to(&mut bytes, format);
    bytes.into_inner()
}

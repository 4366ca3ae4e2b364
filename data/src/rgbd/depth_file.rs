//! Depth pictures: 16-bit PNG, TIFF of floats or integers, OpenEXR; recognised by their content, whatever their name.
//!
//! Values are what the file holds, times the unit that the data set declares. Integers at the end of their range are what a
//! sensor writes for "beyond my range": infinite. Sizes are checked before pixels are decoded, so that a hostile header cannot
//! ask for more memory than the largest picture takes.

use std::io::Cursor;
use std::path::Path;

use exr::image::FlatSamples;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers};
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use tiff::decoder::{Decoder, DecodingResult, Limits};

use xavatar_formats::{Fault, Result, guarded, read_bytes};
use xavatar_mesh::camera::LARGEST_SIDE;

const FORMAT: &str = "depth picture";
/// Bytes of the widest sample of any format.
const WIDEST_SAMPLE: usize = 8;
/// Pixels of the largest picture read: 67 million floats are 268 MB.
const MOST_PIXELS: usize = LARGEST_SIDE as usize * LARGEST_SIDE as usize;
/// Channels of all layers of an OpenEXR file that are decoded: colour, alpha, normals and depth of a renderer.
const MOST_CHANNELS: usize = 64;
/// Names under which renderers store depth, in the order of preference; compared after the last dot, in lower case.
const DEPTH_CHANNELS: [&str; 4] = ["z", "depth", "v", "y"];

/// A depth picture as stored, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthPicture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Depths (height x width) in the file's unit; NaN, zero, negative or infinite where nothing was measured.
    pub values: Vec<f32>,
}

/// Reads a depth picture.
///
/// # Errors
/// [`Error::Io`](xavatar_formats::Error::Io); [`Error::Malformed`](xavatar_formats::Error::Malformed) if the file is truncated or
/// damaged, in no known format, larger than [`LARGEST_SIDE`] a side, or has no channel that is depth (8-bit pictures are previews, not
/// depth).
pub fn read_depth(path: impl AsRef<Path>) -> Result<DepthPicture> {
    let path = path.as_ref();
    parse_depth(&read_bytes(path)?).map_err(|fault| fault.in_file(path, FORMAT))
}

type Parsed<T> = std::result::Result<T, Fault>;

/// The depth picture of a file's bytes.
///
/// # Errors
/// As [`read_depth`], without the file's name.
pub fn parse_depth(bytes: &[u8]) -> std::result::Result<DepthPicture, Fault> {
    let decode = || match bytes {
        [0x89, b'P', b'N', b'G', ..] => parse_png(bytes),
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => parse_tiff(bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => parse_exr(bytes),
        _ => Err(Fault::malformed("the start of the file", "no known signature", "a 16-bit PNG, a TIFF or an OpenEXR")),
    };
    guarded(decode).unwrap_or_else(|| Err(Fault::malformed("the file", "broken", "a whole picture")))
}

/// The size, if no side is zero or too long.
fn checked_size(width: usize, height: usize) -> Parsed<(u32, u32)> {
    let side = |length: usize| u32::try_from(length).ok().filter(|length| (1..=LARGEST_SIDE).contains(length));
    side(width).zip(side(height)).ok_or_else(|| {
        Fault::malformed("the size", format_args!("{width} x {height}"), format_args!("1 to {LARGEST_SIDE} a side"))
    })
}

fn parse_png(bytes: &[u8]) -> Parsed<DepthPicture> {
    let broken = |error: image::ImageError| Fault::malformed("PNG data", error, "a whole 16-bit grey PNG");
    let decoder = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png).into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = checked_size(width as usize, height as usize)?;
    if decoder.color_type() != ColorType::L16 {
        let found = format!("{:?}", decoder.color_type());
        return Err(Fault::malformed("the kind of PNG", found, "16-bit grey (L16)"));
    }
    match DynamicImage::from_decoder(decoder).map_err(broken)? {
        DynamicImage::ImageLuma16(image) => {
            Ok(DepthPicture { width, height, values: integers(image.as_raw(), u16::MAX, f32::from) })
        }
        other => Err(Fault::malformed("the kind of PNG", format_args!("{:?}", other.color()), "16-bit grey (L16)")),
    }
}

fn parse_tiff(bytes: &[u8]) -> Parsed<DepthPicture> {
    let broken = |error: tiff::TiffError| Fault::malformed("TIFF data", error, "a whole TIFF");
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MOST_PIXELS * WIDEST_SAMPLE;
    limits.intermediate_buffer_size = MOST_PIXELS * WIDEST_SAMPLE;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(broken)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(broken)?;
    let (width, height) = checked_size(width as usize, height as usize)?;
    let kind = decoder.colortype().map_err(broken)?;
    let expected = "one channel of 16 bits or more";
    if !matches!(kind, tiff::ColorType::Gray(16 | 32 | 64)) {
        return Err(Fault::malformed("the kind of TIFF", format_args!("{kind:?}"), expected));
    }
    let values = match decoder.read_image().map_err(broken)? {
        DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(|value| value as f32).collect(),
        DecodingResult::U16(values) => integers(&values, u16::MAX, f32::from),
        DecodingResult::U32(values) => integers(&values, u32::MAX, |value| value as f32),
        DecodingResult::I16(values) => integers(&values, i16::MAX, f32::from),
        DecodingResult::I32(values) => integers(&values, i32::MAX, |value| value as f32),
        _ => return Err(Fault::malformed("the kind of TIFF", format_args!("{kind:?}"), expected)),
    };
    complete(width, height, values)
}

fn parse_exr(bytes: &[u8]) -> Parsed<DepthPicture> {
    let broken = |error: exr::error::Error| Fault::malformed("OpenEXR data", error, "a whole OpenEXR file");
    let headers = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?.headers;
    let mut pixels: usize = 0;
    let mut channels: usize = 0;
    for header in &headers {
        checked_size(header.layer_size.width(), header.layer_size.height())?;
        pixels = pixels.saturating_add(header.layer_size.area().saturating_mul(header.channels.list.len()));
        channels += header.channels.list.len();
    }
    let names = || headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    if channels > MOST_CHANNELS || pixels > MOST_PIXELS * 4 {
        let found = format!("{channels} channels of {pixels} samples");
        return Err(Fault::malformed(
            "the layers",
            found,
            format_args!("at most {MOST_CHANNELS} and {}", MOST_PIXELS * 4),
        ));
    }
    let image = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().all_layers();
    let image = image.all_attributes().non_parallel().from_buffered(Cursor::new(bytes)).map_err(broken)?;
    let channels = || image.layer_data.iter().flat_map(|layer| layer.channel_data.list.iter().map(move |c| (layer, c)));
    let named = DEPTH_CHANNELS.iter().find_map(|known| {
        channels().find(|(_, channel)| {
            let name = channel.name.to_string().to_lowercase();
            name.rsplit('.').next() == Some(known)
        })
    });
    let only = channels().next().filter(|_| channels().count() == 1);
    let Some((layer, channel)) = named.or(only) else {
        let found = names().collect::<Vec<_>>().join(", ");
        return Err(Fault::malformed("the channels", found, "one named Z or depth, or a single one"));
    };
    let values = match &channel.sample_data {
        FlatSamples::F16(values) => values.iter().map(|value| value.to_f32()).collect(),
        FlatSamples::F32(values) => values.clone(),
        FlatSamples::U32(values) => integers(values, u32::MAX, |value| value as f32),
    };
    let (width, height) = checked_size(layer.size.width(), layer.size.height())?;
    complete(width, height, values)
}

/// Integers as floats; the largest of their type, which sensors write beyond their range, as infinity.
fn integers<T: Copy + PartialEq>(values: &[T], largest: T, to_float: impl Fn(T) -> f32) -> Vec<f32> {
    values.iter().map(|&value| if value == largest { f32::INFINITY } else { to_float(value) }).collect()
}

fn complete(width: u32, height: u32, values: Vec<f32>) -> Parsed<DepthPicture> {
    let pixels = width as usize * height as usize;
    if values.len() != pixels {
        // As of a subsampled channel.
        return Err(Fault::malformed("the samples", values.len(), format_args!("{width} x {height}, one a pixel")));
    }
    Ok(DepthPicture { width, height, values })
}

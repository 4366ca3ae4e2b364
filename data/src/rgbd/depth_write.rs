//! Writing depth pictures in the formats that are read.

use std::io::{self, Cursor, Write};
use std::path::Path;

use exr::prelude::{Blocks, Compression, Encoding, Image, LineOrder, SpecificChannels, WritableImage};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::{Compression as TiffCompression, DeflateLevel, TiffEncoder};

use super::frame::BACKGROUND;
use xavatar_formats::{Result, write_atomically};

/// What float formats hold where there is nothing, metres: the far plane of X-Humans.
const FAR_PLANE: f32 = 1000.0;

/// A format for depth pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthFormat {
    /// 16-bit integers in fifths of a millimetre, which reach 13.1 m; the largest number is background.
    Png,
    /// 32-bit floats in metres, deflated.
    Tiff,
    /// 32-bit floats in metres, in a channel `Z`.
    Exr,
}

impl DepthFormat {
    /// The files' extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Tiff => "tiff",
            Self::Exr => "exr",
        }
    }

    /// Metres in one unit of a picture.
    pub fn metres_per_unit(self) -> f32 {
        match self {
            Self::Png => 2e-4,
            Self::Tiff | Self::Exr => 1.0,
        }
    }
}

/// Writes the depths of [`RgbdFrame`](super::RgbdFrame) (height x width, metres); the file appears whole or not at all.
///
/// # Errors
/// [`Error::Io`](xavatar_formats::Error::Io) if the file cannot be written.
pub fn write_depth(
    path: impl AsRef<Path>,
    depth: &[f32],
    [width, height]: [u32; 2],
    format: DepthFormat,
) -> Result<()> {
    let floats = || depth.iter().map(|&metres| if metres == BACKGROUND { FAR_PLANE } else { metres });
    let mut file = Cursor::new(Vec::new());
    let encoded = match format {
        DepthFormat::Png => {
            let units =
                depth.iter().flat_map(|metres| ((metres / format.metres_per_unit()).round() as u16).to_ne_bytes());
            PngEncoder::new(&mut file)
                .write_image(&units.collect::<Vec<u8>>(), width, height, ExtendedColorType::L16)
                .map_err(io::Error::other)
        }
        DepthFormat::Tiff => TiffEncoder::new(&mut file)
            .map(|encoder| encoder.with_compression(TiffCompression::Deflate(DeflateLevel::Balanced)))
            .and_then(|mut encoder| encoder.write_image::<Gray32Float>(width, height, &floats().collect::<Vec<f32>>()))
            .map_err(io::Error::other),
        DepthFormat::Exr => {
            let values: Vec<f32> = floats().collect();
            let pixel = |at: exr::math::Vec2<usize>| (values[at.y() * width as usize + at.x()],);
            let channels = SpecificChannels::build().with_channel("Z").with_pixel_fn(pixel);
            let encoding = Encoding {
                compression: Compression::ZIP16,
                blocks: Blocks::ScanLines,
                line_order: LineOrder::Increasing,
            };
            Image::from_encoded_channels((width as usize, height as usize), encoding, channels)
                .write()
                .non_parallel()
                .to_buffered(&mut file)
                .map_err(io::Error::other)
        }
    };
    write_atomically(path.as_ref(), |writer| {
        encoded?;
        writer.write_all(file.get_ref())
    })
}

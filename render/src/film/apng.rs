//! APNG: the pictures as they are; viewers that do not know it show the first.

use std::io::{self, Write};

use png::{BitDepth, BlendOp, ColorType, Compression, DisposeOp, Encoder};

use super::{Area, Pictures};

/// Milliseconds.
const UNITS: f64 = 1000.0;

pub(super) fn write(writer: &mut impl Write, pictures: &mut Pictures) -> io::Result<()> {
    let (width, height) = pictures.size;
    let mut encoder = Encoder::new(writer, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    let count = u32::try_from(pictures.count).map_err(io::Error::other)?;
    encoder.set_animated(count, 0)?;
    encoder.set_dispose_op(DisposeOp::None)?;
    encoder.set_blend_op(BlendOp::Source)?;
    let mut writer = encoder.write_header()?;
    let times: Vec<u64> = (0..=pictures.count).map(|number| pictures.time(number, UNITS)).collect();
    let mut shown: Vec<u8> = Vec::new();
    pictures.for_each(|number, picture| {
        let delay = times[number + 1] - times[number];
        writer.set_frame_delay(delay.min(u64::from(u16::MAX)) as u16, UNITS as u16)?;
        let pixels = picture.as_chunks::<3>().0;
        let area = Area::of_changes(shown.as_chunks().0, pixels, width as usize);
        // The first picture is whole, and its place is the film's.
        if number > 0 {
            writer.reset_frame_position()?;
            writer.set_frame_dimension(area.columns as u32, area.rows as u32)?;
            writer.set_frame_position(area.left as u32, area.top as u32)?;
        }
        let bytes: Vec<u8> = area.pixels(width as usize).flat_map(|index| pixels[index]).collect();
        writer.write_image_data(&bytes)?;
        shown = picture.to_vec();
        Ok(())
    })?;
    writer.finish()?;
    Ok(())
}

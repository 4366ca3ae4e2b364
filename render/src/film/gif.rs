//! GIF: one palette for the whole film, so that still things stay still, and only what changes is stored again.
//!
//! The palette is NeuQuant's (Dekker 1994) over samples of all pictures, with white exact. Between its colours a fixed 4 x 4
//! pattern (Bayer) alternates: unlike error diffusion it does not crawl from picture to picture.

use std::io::{self, Write};

use color_quant::NeuQuant;
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;

use super::{Area, Pictures};

/// Pixels that the palette is learned from.
const SAMPLES: usize = 300_000;
/// NeuQuant's thoroughness from 1 (best) to 30.
const SAMPLE_FACTOR: i32 = 3;
/// The palette's entry for what does not change, and that for white.
const UNCHANGED: u8 = 255;
const WHITE: u8 = 254;
/// Colours besides these two.
const COLOURS: usize = 254;
/// How far the pattern moves a colour, of 255: about the distance of neighbouring colours in the palette.
const PATTERN_STRENGTH: f32 = 7.0;
#[rustfmt::skip]
const PATTERN: [[f32; 4]; 4] = [[0.0, 8.0, 2.0, 10.0], [12.0, 4.0, 14.0, 6.0], [3.0, 11.0, 1.0, 9.0], [15.0, 7.0, 13.0, 5.0]];
/// Bits of a channel by which the nearest entry is looked up.
const BITS: u32 = 6;
/// Hundredths of a second: what GIF counts time in.
const UNITS: f64 = 100.0;

pub(super) fn write(writer: &mut impl Write, pictures: &mut Pictures) -> io::Result<()> {
    let palette = Palette::of(pictures)?;
    let (width, height) = (pictures.size.0 as u16, pictures.size.1 as u16);
    let mut encoder = Encoder::new(writer, width, height, &palette.bytes).map_err(io::Error::other)?;
    encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
    let times: Vec<u64> = (0..=pictures.count).map(|number| pictures.time(number, UNITS)).collect();
    let mut shown: Vec<u8> = Vec::new();
    pictures.for_each(|number, picture| {
        let indices = palette.indices(picture, usize::from(width));
        // Viewers slow down frames of less than two hundredths.
        let delay = (times[number + 1] - times[number]).max(2) as u16;
        let frame = Frame { delay, dispose: DisposalMethod::Keep, ..changes(&shown, &indices, width) };
        shown = indices;
        encoder.write_frame(&frame).map_err(io::Error::other)
    })
}

/// The smallest frame that turns what is `shown` into `wanted`.
fn changes(shown: &[u8], wanted: &[u8], width: u16) -> Frame<'static> {
    let area = Area::of_changes(shown, wanted, width.into());
    let differs = |index: usize| shown.get(index) != Some(&wanted[index]);
    let buffer: Vec<u8> =
        area.pixels(width.into()).map(|index| if differs(index) { wanted[index] } else { UNCHANGED }).collect();
    Frame {
        left: area.left as u16,
        top: area.top as u16,
        width: area.columns as u16,
        height: area.rows as u16,
        transparent: Some(UNCHANGED),
        buffer: buffer.into(),
        ..Frame::default()
    }
}

struct Palette {
    /// 256 x 3.
    bytes: Vec<u8>,
    /// The nearest entry to each colour of `BITS` bits a channel.
    nearest: Vec<u8>,
}

impl Palette {
    fn of(pictures: &mut Pictures) -> io::Result<Self> {
        let pixels = pictures.count * pictures.size.0 as usize * pictures.size.1 as usize;
        // An odd step wanders over the columns.
        let step = (pixels / SAMPLES) | 1;
        let mut samples = Vec::new();
        let mut seen = 0;
        pictures.for_each(|_, picture| {
            for pixel in picture.as_chunks::<3>().0 {
                seen += 1;
                if seen % step == 0 && *pixel != [255; 3] {
                    samples.extend([pixel[0], pixel[1], pixel[2], 255]);
                }
            }
            Ok(())
        })?;
        // NeuQuant reads in strides and wants more pixels than its largest.
        while samples.len() < 4 * 4096 {
            samples.extend_from_within(..);
            if samples.is_empty() {
                samples.extend([255; 4]);
            }
        }
        let mut bytes = NeuQuant::new(SAMPLE_FACTOR, COLOURS, &samples).color_map_rgb();
        bytes.resize(3 * COLOURS, 0);
        bytes.extend([255; 6]);
        let entries: Vec<[i32; 3]> = bytes.as_chunks::<3>().0.iter().map(|entry| entry.map(i32::from)).collect();
        let nearest = (0..1_u32 << (3 * BITS))
            .into_par_iter()
            .map(|code| {
                let channel = |index: u32| {
                    let value = code >> (BITS * (2 - index)) & ((1 << BITS) - 1);
                    (value * 255 / ((1 << BITS) - 1)) as i32
                };
                let colour = [channel(0), channel(1), channel(2)];
                let distance = |entry: &[i32; 3]| -> i32 {
                    entry.iter().zip(colour).zip([2, 4, 3]).map(|((a, b), weight)| weight * (a - b) * (a - b)).sum()
                };
                let entries = entries[..=usize::from(WHITE)].iter().zip(0_u8..);
                entries.min_by_key(|(entry, _)| distance(entry)).map_or(0, |(_, index)| index)
            })
            .collect();
        Ok(Self { bytes, nearest })
    }

    /// The entry of each pixel of a picture.
    fn indices(&self, picture: &[u8], width: usize) -> Vec<u8> {
        let pixels = picture.as_chunks::<3>().0;
        let mut indices = vec![0; pixels.len()];
        indices.par_chunks_mut(width).zip(pixels.par_chunks(width)).enumerate().for_each(|(y, (indices, pixels))| {
            for (x, (index, pixel)) in indices.iter_mut().zip(pixels).enumerate() {
                if *pixel == [255; 3] {
                    *index = WHITE;
                    continue;
                }
                let shift = (PATTERN[y % 4][x % 4] / 15.0 - 0.5) * PATTERN_STRENGTH;
                let code = pixel.iter().fold(0, |code, &channel| {
                    let moved = (f32::from(channel) + shift).clamp(0.0, 255.0);
                    code << BITS | (moved / 255.0 * ((1 << BITS) - 1) as f32 + 0.5) as usize
                });
                *index = self.nearest[code];
            }
        });
        indices
    }
}

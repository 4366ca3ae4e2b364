//! Films: pictures of one size in a row, as a GIF, an APNG, an MP4 (by ffmpeg, where it is found) or a folder of PNGs.
//!
//! Pictures wait in an unnamed file in the film's folder, so that memory does not grow with the film. The film appears whole or
//! not at all; a folder's pictures one by one.

mod apng;
mod gif;
mod mp4;

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use image::RgbImage;

use super::png::write_png;
use xavatar_formats::write_atomically;
use xavatar_formats::{Error, Result};

/// Frames a second that players of every format keep up with.
const FASTEST: f64 = 100.0;

/// How a film is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// 256 colours, plays everywhere.
    Gif,
    /// All colours, plays in browsers.
    Apng,
    /// Small, lossy; needs ffmpeg on the PATH.
    Mp4,
    /// A folder of PNGs, frame-f00001.png and so on.
    Folder,
}

impl FilmFormat {
    /// Whether films of this format can be made here.
    ///
    /// # Errors
    /// [`Error::Missing`] for an MP4 if there is no ffmpeg.
    pub fn check_available(self) -> Result<()> {
        match self {
            Self::Mp4 => mp4::check_for_ffmpeg(),
            Self::Gif | Self::Apng | Self::Folder => Ok(()),
        }
    }

    /// By the extension `gif`, `apng` or `mp4`; a path without extension is a folder.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for other extensions.
    pub fn of_path(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("gif") => Ok(Self::Gif),
            Some("apng") => Ok(Self::Apng),
            Some("mp4") => Ok(Self::Mp4),
            None => Ok(Self::Folder),
            Some(other) => Err(Error::Mismatch {
                path: path.into(),
                found: format!("a name that ends in .{other}"),
                expected: "a film: .gif, .apng, .mp4 or, for a folder of PNGs, no extension".into(),
                remedy: "choose one of these names".into(),
            }),
        }
    }
}

/// A film that is being made.
pub struct Film {
    path: PathBuf,
    format: FilmFormat,
    frames_per_second: f64,
    /// Raw pictures, one after the other; none for a folder.
    waiting: Option<File>,
    size: (u32, u32),
    count: usize,
}

impl Film {
    /// Begins a film of pictures of `size` columns and rows at `path`, in the format of its name.
    ///
    /// # Errors
    /// [`Error::Value`] for an impossible size or frame rate, [`Error::Missing`] for an MP4 if there is no ffmpeg,
    /// [`Error::Io`] if nothing can be written there.
    pub fn begin(path: &Path, size: (u32, u32), frames_per_second: f64) -> Result<Self> {
        let format = FilmFormat::of_path(path)?;
        // GIF counts sides in 16 bits.
        let largest = u32::from(u16::MAX);
        if !(1..=largest).contains(&size.0) || !(1..=largest).contains(&size.1) {
            return Err(Error::Value {
                name: "size of a film".into(),
                found: format!("{} x {} pixels", size.0, size.1),
                expected: format!("1 to {largest} a side"),
            });
        }
        if !(0.1..=FASTEST).contains(&frames_per_second) {
            return Err(Error::Value {
                name: "frame rate".into(),
                found: format!("{frames_per_second} frames a second"),
                expected: format!("0.1 to {FASTEST}"),
            });
        }
        format.check_available()?;
        let waiting = match format {
            FilmFormat::Folder => {
                std::fs::create_dir_all(path).map_err(Error::io(path))?;
                None
            }
            _ => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
                Some(tempfile::tempfile_in(folder).map_err(Error::io(path))?)
            }
        };
        Ok(Self { path: path.into(), format, frames_per_second, waiting, size, count: 0 })
    }

    /// Appends a picture.
    ///
    /// # Errors
    /// [`Error::Value`] for one of another size, [`Error::Io`] if the disk is full.
    pub fn add(&mut self, picture: &RgbImage) -> Result<()> {
        if picture.dimensions() != self.size {
            return Err(Error::Value {
                name: format!("size of picture {}", self.count + 1),
                found: format!("{:?}", picture.dimensions()),
                expected: format!("{:?}, that of the film", self.size),
            });
        }
        self.count += 1;
        match &mut self.waiting {
            Some(file) => file.write_all(picture.as_raw()).map_err(Error::io(&self.path)),
            None => write_png(self.path.join(format!("frame-f{:05}.png", self.count)), picture),
        }
    }

    /// Writes the film.
    ///
    /// # Errors
    /// [`Error::Value`] if it has no picture, [`Error::Io`] if it cannot be written.
    pub fn finish(self) -> Result<()> {
        if self.count == 0 {
            return Err(Error::Value {
                name: format!("film {}", self.path.display()),
                found: "0 pictures".into(),
                expected: "at least one".into(),
            });
        }
        let Some(file) = self.waiting else { return Ok(()) };
        let mut pictures =
            Pictures { file, size: self.size, count: self.count, frames_per_second: self.frames_per_second };
        match self.format {
            FilmFormat::Folder => Ok(()),
            FilmFormat::Gif => write_atomically(&self.path, |writer| gif::write(writer, &mut pictures)),
            FilmFormat::Apng => write_atomically(&self.path, |writer| apng::write(writer, &mut pictures)),
            FilmFormat::Mp4 => mp4::write(&self.path, &mut pictures),
        }
    }
}

/// A film's pictures, to be read as often as a format needs.
struct Pictures {
    file: File,
    size: (u32, u32),
    count: usize,
    frames_per_second: f64,
}

impl Pictures {
    /// Hands every picture's bytes to `each`, with its number from 0.
    fn for_each(&mut self, mut each: impl FnMut(usize, &[u8]) -> std::io::Result<()>) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(0))?;
        let mut picture = vec![0; 3 * self.size.0 as usize * self.size.1 as usize];
        let mut reader = BufReader::new(&self.file);
        for number in 0..self.count {
            reader.read_exact(&mut picture)?;
            each(number, &picture)?;
        }
        Ok(())
    }

    /// When picture `number` appears, in units of 1 / `units` second, rounded: durations do not drift.
    fn time(&self, number: usize, units: f64) -> u64 {
        (number as f64 * units / self.frames_per_second).round() as u64
    }
}

/// The smallest rectangle that holds all that changes from one picture to the next.
struct Area {
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

impl Area {
    /// `shown` is empty before the first picture, of which all is new. Of equal pictures, one pixel: the second takes its time too.
    fn of_changes<T: PartialEq>(shown: &[T], wanted: &[T], width: usize) -> Self {
        if shown.is_empty() {
            return Self { left: 0, top: 0, columns: width, rows: wanted.len() / width };
        }
        let mut sides = None;
        for index in (0..wanted.len()).filter(|index| shown[*index] != wanted[*index]) {
            let (x, y) = (index % width, index / width);
            let [left, top, right, _] = sides.unwrap_or([x, y, x, y]);
            sides = Some([left.min(x), top, right.max(x), y]);
        }
        let [left, top, right, bottom] = sides.unwrap_or_default();
        Self { left, top, columns: right - left + 1, rows: bottom - top + 1 }
    }

    /// The places of its pixels in pictures of this width.
    fn pixels(&self, width: usize) -> impl Iterator<Item = usize> {
        let (left, right) = (self.left, self.left + self.columns);
        (self.top..self.top + self.rows).flat_map(move |y| (left..right).map(move |x| y * width + x))
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use image::{AnimationDecoder, Rgb, codecs};

    use super::*;

    /// A white picture with a coloured square that moves.
    fn picture(number: u32) -> RgbImage {
        RgbImage::from_fn(40, 30, |x, y| match (x.wrapping_sub(number * 5), y) {
            (0..10, 8..20) => Rgb([200, 30 + 9 * y as u8, 90]),
            _ => Rgb([255; 3]),
        })
    }

    fn film(name: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut film = Film::begin(&path, (40, 30), 30.0).unwrap();
        // The last two are equal.
        [0, 1, 2, 2].into_iter().for_each(|number| film.add(&picture(number)).unwrap());
        assert!(film.add(&RgbImage::new(3, 3)).is_err());
        film.finish().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else stays");
        (folder, path)
    }

    #[test]
    fn a_gif_shows_the_pictures_at_their_times() {
        let (_folder, path) = film("film.gif");
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(File::open(path).unwrap()).unwrap();
        let mut shown = RgbImage::new(40, 30);
        for (number, delay) in [(0, 3), (1, 4), (2, 3), (2, 3)] {
            let frame = decoder.read_next_frame().unwrap().unwrap();
            assert_eq!(frame.delay, delay, "1/30 s each, without drift");
            for (index, pixel) in frame.buffer.as_chunks::<4>().0.iter().enumerate().filter(|(_, pixel)| pixel[3] > 0) {
                let (x, y) = (index as u32 % u32::from(frame.width), index as u32 / u32::from(frame.width));
                shown.put_pixel(
                    x + u32::from(frame.left),
                    y + u32::from(frame.top),
                    Rgb([pixel[0], pixel[1], pixel[2]]),
                );
            }
            for (x, y, Rgb(expected)) in picture(number).enumerate_pixels() {
                let found = shown.get_pixel(x, y).0;
                let tolerance = if *expected == [255; 3] { 0 } else { 14 };
                let close = expected.iter().zip(found).all(|(a, b)| a.abs_diff(b) <= tolerance);
                assert!(close, "picture {number} at {x}, {y}: {found:?}, expected {expected:?}");
            }
        }
        assert!(decoder.read_next_frame().unwrap().is_none());
    }

    #[test]
    fn an_apng_keeps_every_colour() {
        let (_folder, path) = film("film.apng");
        let decoder = codecs::png::PngDecoder::new(BufReader::new(File::open(&path).unwrap())).unwrap();
        let frames = decoder.apng().unwrap().into_frames().collect_frames().unwrap();
        assert_eq!(frames.len(), 4);
        for (frame, number) in frames.iter().zip([0, 1, 2, 2]) {
            let shown = image::DynamicImage::from(frame.buffer().clone()).to_rgb8();
            assert_eq!(shown, picture(number));
        }
        let first = image::ImageReader::open(&path).unwrap().with_guessed_format().unwrap().decode().unwrap();
        assert_eq!(first.to_rgb8(), picture(0), "other viewers show the first");
    }

    #[test]
    fn a_folder_holds_a_png_a_picture() {
        let (_folder, path) = film("film");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 4);
        assert_eq!(image::open(path.join("frame-f00002.png")).unwrap().to_rgb8(), picture(1));
    }

    #[test]
    fn what_is_no_film_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |name: &str, size, rate| Film::begin(&folder.path().join(name), size, rate).map(drop);
        let message = begin("film.avi", (4, 4), 25.0).unwrap_err().to_string();
        assert!(message.contains(".avi") && message.contains(".mp4"), "{message}");
        assert!(begin("film.gif", (0, 4), 25.0).is_err());
        assert!(begin("film.gif", (4, 4), f64::NAN).is_err());
        assert!(begin("film.gif", (4, 4), 1000.0).is_err());
        assert!(Film::begin(&folder.path().join("film.gif"), (4, 4), 25.0).unwrap().finish().is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

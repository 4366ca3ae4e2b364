//! `xavatar render`: pictures and films of an avatar, made without a GPU.

mod cameras;
mod exhibit;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::bail;
use serde::Serialize;
use xavatar::avatar::Avatar;
use xavatar::body::{BodyModel, PartLabels, Pose};
use xavatar::data::{ScanFrames, Source, Subject};
use xavatar::mesh::TriangleMesh;
use xavatar::mesh::camera::{PinholeCamera, THREE_QUARTER, framing_row};
use xavatar::render::{Film, FilmFormat, Tile, contact_sheet, write_png};
use xavatar::synthetic::DANCE;

use self::cameras::{FilmCameras, Stance, turn};
use self::exhibit::{Exhibit, Panel, Panels};
use crate::cli::options::inputs::Split;
use crate::cli::options::posing::{Poser, PosingArguments};
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, WrongUsage, stop};

/// Columns of a PNG: poses of a motion or sides of a turntable.
const COLUMNS: usize = 6;
/// A turntable's time for one turn, seconds.
const TURN: f32 = 4.0;
/// Frames a second where no motion has a rate: scans of a subject.
const SCANS_PER_SECOND: f32 = 10.0;

/// Picture an avatar: poses side by side as a PNG, a motion or a turntable as a film
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar render runs/demo --out dance.gif\n  \
    xavatar render runs/00016 --body models/smplx --turntable --view colour,normals,weights --out turntable.apng\n  \
    xavatar render runs/00016 --body models/smplx --motion walk.bvh --frames 1..90 --fps 25 --out walk.mp4\n  \
    xavatar render runs/00016 --body models/smplx --against data/00016 --out errors.png\n\n\
    A film is a .gif, an .apng, an .mp4 (where ffmpeg is installed) or, without extension, a folder of PNGs.")]
pub struct Render {
    #[command(flatten)]
    posing: PosingArguments,
    /// What to write: FILE.png, FILE.gif, FILE.apng, FILE.mp4 or a folder
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// A motion of any format (docs/motion.md), or `dance`, a built-in one
    #[arg(long, value_name = "MOTION", default_value = DANCE)]
    motion: PathBuf,
    /// What to show (weights only of a --fixed-topology); several stand side by side in a film and below each other in a PNG
    #[arg(long, value_name = "VIEW", value_enum, value_delimiter = ',', default_value = "colour")]
    view: Vec<Panel>,
    /// Hold the first pose (--frames chooses) and go once around it
    #[arg(long)]
    turntable: bool,
    /// Show the scans of a subject beside the avatar in the same poses, and how far they are apart
    #[arg(long, value_name = "DATA", conflicts_with_all = ["motion", "up", "hands", "source_fps", "smooth", "ground"])]
    against: Option<PathBuf>,
    /// Which frames of --against
    #[arg(long, value_enum, default_value_t = Split::Test, requires = "against")]
    split: Split,
    /// The distance of the error's darkest colour, millimetres
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = millimetres, requires = "against")]
    largest_error: f32,
    /// Columns and rows of a film's picture; a PNG's pictures are that high and as wide as they need to be
    #[arg(long, value_name = "WxH", default_value = "400x640", value_parser = size)]
    size: (u32, u32),
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Rendered<'a> {
    out: &'a Path,
    pictures: usize,
}

/// A pose, and the scan that shows the same, by its place in the subject's frames.
struct Moment {
    pose: Pose,
    scan: Option<usize>,
}

/// What all pictures share.
struct Studio<'a> {
    body: &'a BodyModel,
    labels: &'a PartLabels,
    betas: Vec<f32>,
    poser: Poser<'a>,
    scans: Option<ScanFrames>,
    panels: Panels,
}

impl Render {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let is_picture = self.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        if is_picture {
            files::new_file(&self.out)?;
        } else {
            let format = FilmFormat::of_path(&self.out).map_err(|error| WrongUsage(error.into()))?;
            format.check_available()?;
            match format {
                FilmFormat::Folder => files::new_folder(&self.out, "give a new --out")?,
                FilmFormat::Gif | FilmFormat::Apng | FilmFormat::Mp4 => files::new_file(&self.out)?,
            }
        }
        let (avatar, body, labels) = self.posing.load()?;
        let (scans, mut moments, rate) = self.moments(&avatar, &body)?;
        if self.turntable {
            moments.truncate(1);
        }
        let shows_weights = self.view.contains(&Panel::Weights);
        if shows_weights && !self.posing.fixed_topology {
            log::info!("weights belong to the canonical mesh, which is skinned to every pose");
        }
        let poser = self.posing.poser(&avatar, &body, &labels, self.posing.fixed_topology || shows_weights)?;
        let panels = Panels::new(&self.view, self.against.is_some(), self.largest_error);
        let betas = avatar.subject.betas.clone();
        let studio = Studio { body: &body, labels: &labels, betas, poser, scans, panels };
        let stop = stop::on_interrupt()?;
        let mut progress = Progress::new();
        let done = if is_picture {
            self.picture(&studio, &moments, stop, &mut progress)?
        } else {
            self.film(&studio, &moments, rate, stop, &mut progress)?
        };
        progress.finish();
        match done {
            Some(pictures) => {
                let rendered = Rendered { out: &self.out, pictures };
                self.json.print(&rendered, &format!("{}: {pictures} pictures", self.out.display()))?;
            }
            None => log::info!("stopped: {} is not complete", self.out.display()),
        }
        Ok(if done.is_some() { Outcome::Done } else { Outcome::Stopped })
    }

    /// The poses to be pictured, the scans that they are compared with, and how many a second.
    fn moments(&self, avatar: &Avatar, body: &BodyModel) -> anyhow::Result<(Option<ScanFrames>, Vec<Moment>, f32)> {
        let Some(data) = &self.against else {
            let clip = self.posing.motion.load(&self.motion, avatar, Some(body))?;
            let rate = clip.frames_per_second;
            let moments = clip.poses.into_iter().map(|pose| Moment { pose, scan: None }).collect();
            return Ok((None, moments, rate));
        };
        let subject = Subject::open(data)?.settled(body)?;
        let files = subject.files(self.split.into());
        let chosen = self.posing.motion.range_within(files.len())?;
        let frames = ScanFrames::new(&subject, &files[chosen]);
        let moments = (0..frames.ids().len())
            .map(|index| Ok(Moment { pose: body.resolve(&frames.scan(index)?.parameters)?, scan: Some(index) }))
            .collect::<anyhow::Result<Vec<_>>>()?;
        if moments.is_empty() {
            bail!("{}: no frames in its {:?} split; choose another --split", data.display(), self.split);
        }
        Ok((Some(frames), moments, self.posing.motion.rate().unwrap_or(SCANS_PER_SECOND)))
    }

    /// One sheet: a row a panel, a column a pose or a side.
    fn picture(
        &self,
        studio: &Studio,
        moments: &[Moment],
        stop: &AtomicBool,
        progress: &mut Progress,
    ) -> anyhow::Result<Option<usize>> {
        let chosen = evenly(moments, COLUMNS);
        let mut exhibits = Vec::new();
        for (index, moment) in chosen.iter().enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            progress.show("meshes", index as f64 / chosen.len() as f64, &format!("{} of {}", index + 1, chosen.len()));
            exhibits.push(studio.exhibit(moment)?);
        }
        let places: Vec<Vec<glam::Vec3>> = exhibits.iter().map(Exhibit::vertices).collect();
        let bodies: Vec<&[glam::Vec3]> = places.iter().map(Vec::as_slice).collect();
        // One pose turned, or each pose from the same side.
        let shown: Vec<(&Exhibit, PinholeCamera)> = if self.turntable {
            let camera = FilmCameras::around(bodies[0], self.size)?;
            (0..COLUMNS).map(|side| (&exhibits[0], camera.turned(turn(side, COLUMNS)))).collect()
        } else {
            exhibits.iter().zip(framing_row(&bodies, THREE_QUARTER, self.size.1)?).collect()
        };
        let mut rows: Vec<Vec<Tile>> = Vec::new();
        for (index, (exhibit, camera)) in shown.iter().enumerate() {
            progress.show("pictures", index as f64 / shown.len() as f64, &format!("{} of {}", index + 1, shown.len()));
            let tiles = exhibit.scenes(&studio.panels, exhibit.lowest())?.tiles(&studio.panels, camera)?;
            rows.resize_with(tiles.len(), Vec::new);
            rows.iter_mut().zip(tiles).for_each(|(row, tile)| row.push(tile));
        }
        write_png(&self.out, &contact_sheet(&rows)?)?;
        Ok(Some(shown.len() * rows.len()))
    }

    /// A film: the panels side by side, one picture a frame or a step of the turntable.
    fn film(
        &self,
        studio: &Studio,
        moments: &[Moment],
        rate: f32,
        stop: &AtomicBool,
        progress: &mut Progress,
    ) -> anyhow::Result<Option<usize>> {
        let stance = |moment: &Moment| {
            let (body, pelvis) = studio.posed(&moment.pose)?;
            Ok(Stance::new(&body, pelvis))
        };
        let (cameras, total) = if self.turntable {
            let (body, _) = studio.posed(&moments[0].pose)?;
            (FilmCameras::around(&body, self.size)?, (TURN * rate).ceil() as usize)
        } else {
            let stances = moments.iter().map(stance).collect::<xavatar::Result<Vec<_>>>()?;
            (FilmCameras::of(&stances, self.size)?, moments.len())
        };
        let mut film: Option<Film> = None;
        let mut add = |tiles: Vec<Tile>| -> anyhow::Result<()> {
            let picture = side_by_side(tiles)?;
            let film = match &mut film {
                Some(film) => film,
                None => film.insert(Film::begin(&self.out, picture.dimensions(), f64::from(rate))?),
            };
            Ok(film.add(&picture)?)
        };
        let mut show =
            |done: usize| progress.show("pictures", done as f64 / total as f64, &format!("{done} of {total}"));
        if self.turntable {
            let exhibit = studio.exhibit(&moments[0])?;
            let scenes = exhibit.scenes(&studio.panels, cameras.floor)?;
            for step in 0..total {
                if stop.load(Ordering::Relaxed) {
                    return Ok(None);
                }
                add(scenes.tiles(&studio.panels, &cameras.turned(turn(step, total)))?)?;
                show(step + 1);
            }
        } else {
            for (index, moment) in moments.iter().enumerate() {
                if stop.load(Ordering::Relaxed) {
                    return Ok(None);
                }
                let exhibit = studio.exhibit(moment)?;
                let scenes = exhibit.scenes(&studio.panels, cameras.floor)?;
                add(scenes.tiles(&studio.panels, &cameras.at(index))?)?;
                show(index + 1);
            }
        }
        progress.show("film", 0.0, "encoding");
        if let Some(film) = film {
            film.finish()?;
        }
        Ok(Some(total))
    }
}

impl Studio<'_> {
    /// The vertices and the root's joint of the body in the avatar's shape.
    fn posed(&self, pose: &Pose) -> xavatar::Result<(Vec<glam::Vec3>, glam::Vec3)> {
        let posed = self.body.pose(&pose.in_shape(&self.betas))?;
        Ok((posed.vertices, posed.joints[0]))
    }

    fn exhibit(&self, moment: &Moment) -> anyhow::Result<Exhibit> {
        let mesh = self.poser.extraction(&moment.pose)?.mesh;
        let weights = match &self.poser {
            Poser::Extracted(..) => None,
            Poser::Skinned(topology) => Some(topology.weights()),
        };
        let scan: Option<TriangleMesh> = match (&self.scans, moment.scan) {
            (Some(scans), Some(index)) => Some(scans.scan(index)?.scan),
            _ => None,
        };
        let (vertices, _) = self.posed(&moment.pose)?;
        Ok(Exhibit::new(&self.panels, mesh, weights, scan, &vertices, self.labels, self.body.skeleton())?)
    }
}

/// One picture; several get labels.
fn side_by_side(mut tiles: Vec<Tile>) -> xavatar::Result<image::RgbImage> {
    match tiles.len() {
        1 => Ok(tiles.remove(0).picture),
        _ => Ok(contact_sheet(&[tiles])?),
    }
}

/// At most `count` of the items, from the first to the last.
fn evenly<T>(items: &[T], count: usize) -> Vec<&T> {
    let count = count.min(items.len());
    (0..count).map(|index| &items[index * (items.len() - 1) / (count - 1).max(1)]).collect()
}

fn millimetres(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value: &f32| (0.01..=1000.0).contains(value));
    value.ok_or_else(|| "expected millimetres from 0.01 to 1000".into())
}

pub fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|side| (16..=4096).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some((side(width)?, side(height)?)));
    sides.ok_or_else(|| "expected WIDTHxHEIGHT, each from 16 to 4096 pixels, such as 400x640".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_spread_from_the_first_to_the_last() {
        let items: Vec<usize> = (0..11).collect();
        assert_eq!(evenly(&items, 6), [&0, &2, &4, &6, &8, &10]);
        assert_eq!(evenly(&items[..3], 6), [&0, &1, &2]);
        assert_eq!(evenly(&items[..1], 6), [&0]);
        assert!(evenly(&items[..0], 6).is_empty());
    }

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(size("400x640"), Ok((400, 640)));
        for wrong in ["", "400", "400x", "x400", "0x10", "400x99999", "-5x50", "400x640x3"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}

//! `xavatar render-dataset`: labelled pictures of an avatar or of scans, to train detectors on.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;
use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::{BodyModel, PartLabels, Pose};
use xavatar::data::{ScanFrames, Source, Subject};
use xavatar::synthetic::{Backdrops, DANCE, LabelledPictures, People, Person, PictureFolder, Recipe, RegisteredPeople};

use crate::cli::options::inputs::{body_of, load_body};
use crate::cli::options::meshes::resolution;
use crate::cli::options::motion::MotionArguments;
use crate::cli::options::posing::Poser;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, WrongUsage, stop, wrong_usage};

/// Pictures between looks at whether to stop, for each that is made at the same time.
const IN_A_ROW: usize = 2;

/// Make labelled pictures of an avatar, or of a subject's scans, before backgrounds of yours
///
/// Pose, camera, light and background are drawn by chance. Of each picture there are the mask, each pixel's joint, depth and normal, every joint in
/// the picture and in space, COCO-WholeBody's points, and the body's parameters. The same command goes on where it was stopped; a larger --count adds.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar render-dataset runs/00016 --body models/smplx --backgrounds rooms --count 1000 --out pictures\n  \
    xavatar render-dataset runs/00016 --body models/smplx --motion takes.npz --backgrounds rooms --count 1000 --out pictures\n  \
    xavatar render-dataset data/00016 --body models/smplx --backgrounds rooms --count 1000 --out scans\n  \
    xavatar render-dataset data/00016 --body models/smplx --registered --backgrounds rooms --count 1000 --out bodies\n\n\
    docs/labelled-pictures.md describes the folder.")]
pub struct RenderDataset {
    /// An avatar.safetensors, a run's folder, or a subject's folder of scans
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// Folder with pictures of places without people
    #[arg(long, value_name = "FOLDER")]
    backgrounds: PathBuf,
    /// How many pictures the folder is to have
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// Folder to write, or to go on with
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Body model file of any family, or a folder that holds SMPLX_{GENDER}.npz or .pkl; the demo's avatar needs none
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// An avatar's poses: a motion of any format (docs/motion.md), or `dance`, a built-in one
    #[arg(long, value_name = "MOTION", default_value = DANCE)]
    motion: PathBuf,
    /// Columns and rows of the pictures
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = crate::cli::verbs::render::size)]
    size: (u32, u32),
    /// Other pictures than those of another number
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = resolution)]
    resolution: usize,
    /// Of scans: draw the bodies registered to them in the scans' colours, where the data have them those moved onto the scans (register --offsets)
    #[arg(long)]
    registered: bool,
    /// Extract the avatar's surface in every pose instead of skinning one: seconds a picture, but nothing stays that a pose hides
    #[arg(long)]
    extract: bool,
    #[command(flatten)]
    motion_options: MotionArguments,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was made.
#[derive(Serialize)]
struct Made<'a> {
    folder: &'a Path,
    pictures: usize,
    /// Of these, how many this call made.
    made: usize,
    pictures_per_second: f64,
}

/// An avatar in the poses of a motion.
struct Posed<'a> {
    poser: Poser<'a>,
    poses: Vec<Pose>,
}

impl People for Posed<'_> {
    fn count(&self) -> usize {
        self.poses.len()
    }

    fn person(&self, index: usize) -> xavatar::Result<Person> {
        let pose = self.poses[index].clone();
        Ok(Person { name: format!("pose {}", index + 1), mesh: self.poser.extraction(&pose)?.mesh, pose })
    }
}

/// A subject's scans.
struct Scanned<'a> {
    frames: ScanFrames,
    body: &'a BodyModel,
}

impl People for Scanned<'_> {
    fn count(&self) -> usize {
        self.frames.ids().len()
    }

    fn person(&self, index: usize) -> xavatar::Result<Person> {
        let frame = self.frames.scan(index)?;
        let pose = self.body.resolve(&frame.parameters)?;
        Ok(Person { name: frame.id.to_string(), mesh: frame.scan, pose })
    }
}

impl RenderDataset {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let backdrops = Backdrops::of_folder(&self.backgrounds)?;
        if self.source.is_file() || self.source.join(Avatar::FILE).is_file() {
            if self.registered {
                wrong_usage!("--registered is for the scans of a subject: {} is an avatar", self.source.display())
            }
            let avatar = Avatar::load(&self.source)?;
            let (body, parts) = body_of(&avatar, self.body.as_deref())?;
            let clip = self.motion_options.load(&self.motion, &avatar, Some(&body))?;
            let poses = clip.poses.iter().map(|pose| pose.in_shape(&avatar.subject.betas)).collect();
            let poser = match self.extract {
                true => Poser::Extracted(Box::new(Animator::new(&avatar, &body, &parts)?), self.resolution),
                false => Poser::Skinned(Box::new(FixedTopology::new(&avatar, &body, self.resolution)?)),
            };
            let at_once = poser.at_once();
            return self.make(&Posed { poser, poses }, at_once, &body, &parts, &backdrops);
        }
        let subject = Subject::open(&self.source)?;
        let Some(body) = &self.body else {
            wrong_usage!("scans take the body model that they are registered with: --body FILE or FOLDER")
        };
        let (body, parts) = load_body(body, subject.gender)?;
        let subject = subject.settled(&body)?;
        let frames = ScanFrames::new(&subject, &[&subject.train[..], &subject.test[..]].concat());
        if frames.ids().is_empty() {
            return Err(WrongUsage(anyhow::anyhow!("{}: no scans", self.source.display())).into());
        }
        let at_once = rayon::current_num_threads();
        if self.registered {
            let people = RegisteredPeople::new(&self.source, frames, &body)?;
            return self.make(&people, at_once, &body, &parts, &backdrops);
        }
        self.make(&Scanned { frames, body: &body }, at_once, &body, &parts, &backdrops)
    }

    fn make(
        &self,
        people: &dyn People,
        at_once: usize,
        body: &BodyModel,
        parts: &PartLabels,
        backdrops: &Backdrops,
    ) -> anyhow::Result<Outcome> {
        let size = [self.size.0, self.size.1];
        let recipe = Recipe {
            people: format!("{}{}", self.source.display(), if self.registered { ", registered bodies" } else { "" }),
            poses: people.count(),
            backdrops: (0..backdrops.count()).map(|index| backdrops.name(index)).collect(),
            size,
            seed: self.seed,
        };
        let folder = PictureFolder::open(&self.out, &recipe, body.skeleton())?;
        let pictures = LabelledPictures::new(people, body, parts, backdrops, size, self.seed);
        let count = self.count as usize;
        let missing: Vec<usize> = (0..count).filter(|number| !folder.has(*number)).collect();
        if missing.len() < count {
            log::info!("{} of {count} pictures are there already", count - missing.len());
        }
        let stop = stop::on_interrupt()?;
        let (began, mut progress) = (Instant::now(), Progress::new());
        for (done, numbers) in missing.chunks(IN_A_ROW * at_once).enumerate() {
            if stop.load(Ordering::Relaxed) {
                log::info!("stopped: the same command goes on with {}", self.out.display());
                return Ok(Outcome::Stopped);
            }
            let done = done * IN_A_ROW * at_once;
            progress.show("pictures", done as f64 / missing.len() as f64, &format!("{done} of {}", missing.len()));
            let make = |number: &usize| folder.write(&pictures.picture(*number)?);
            match at_once {
                1 => numbers.iter().try_for_each(make)?,
                _ => numbers.par_iter().try_for_each(make)?,
            }
        }
        let seconds = began.elapsed().as_secs_f64();
        folder.finish(count)?;
        progress.finish();
        let made = Made {
            folder: &self.out,
            pictures: count,
            made: missing.len(),
            pictures_per_second: missing.len() as f64 / seconds,
        };
        let speed = match made.made {
            0 => String::new(),
            made_now => format!("; {made_now} made now, {:.2} a second", made.pictures_per_second),
        };
        self.json.print(&made, &format!("{}: {count} labelled pictures{speed}", self.out.display()))?;
        Ok(Outcome::Done)
    }
}

//! `xavatar render-rgbd`: films scans with a virtual RGB-D camera, so that the depth path can be tried on them.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use xavatar::data::{DepthFormat, RgbdLayout, ScanFrames, Source, Subject, write_rgbd_subject};
use xavatar::synthetic::{FilmedScans, Turntable};

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;

/// Film a subject's scans with a virtual RGB-D camera that circles around them
///
/// The camera of the thesis: 800 x 1200 pixels, 30 degrees from top to bottom, 6 m away, one view a frame. The result is a
/// subject's folder of its own, which `check`, `pointcloud` and `train` take.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar render-rgbd data/00016 --out data/00016-rgbd\n  \
    xavatar render-rgbd data/00016 --layout plain --depth exr --steps-per-turn 40 --out data/00016-plain\n\n\
    docs/rgbd.md describes the layouts.")]
pub struct RenderRgbd {
    /// The subject's folder of scans, in the X-Humans layout
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// The folder to write: new or empty
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// How the folder is laid out
    #[arg(long, value_enum, default_value_t = Layout::Xhumans)]
    layout: Layout,
    /// The format of depth pictures in a plain folder
    #[arg(long, value_enum, default_value_t = Depth::Png)]
    depth: Depth,
    /// Frames in which the camera goes around once
    #[arg(long, value_name = "N", default_value_t = Turntable::default().steps_per_turn, value_parser = clap::value_parser!(u32).range(1..))]
    steps_per_turn: u32,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Filmed<'a> {
    folder: &'a Path,
    frames: usize,
}

#[derive(Clone, Copy, ValueEnum)]
enum Layout {
    /// `render` folders of X-Humans: depth as TIFF
    Xhumans,
    /// Folders of pictures described by a rgbd.toml
    Plain,
}

#[derive(Clone, Copy, ValueEnum)]
enum Depth {
    /// 16 bits, a fifth of a millimetre each
    Png,
    /// 32-bit floats, metres
    Tiff,
    /// OpenEXR, metres
    Exr,
}

impl RenderRgbd {
    pub fn run(self) -> anyhow::Result<Outcome> {
        self.json.check()?;
        let subject = Subject::open(&self.data)?;
        files::new_folder(&self.out, "give a new one")?;
        let layout = match (self.layout, self.depth) {
            (Layout::Xhumans, _) => RgbdLayout::XHumans,
            (Layout::Plain, Depth::Png) => RgbdLayout::Plain(DepthFormat::Png),
            (Layout::Plain, Depth::Tiff) => RgbdLayout::Plain(DepthFormat::Tiff),
            (Layout::Plain, Depth::Exr) => RgbdLayout::Plain(DepthFormat::Exr),
        };
        let table = Turntable { steps_per_turn: self.steps_per_turn, ..Turntable::default() };
        let scans = ScanFrames::new(&subject, &[&subject.train[..], &subject.test[..]].concat());
        let filmed = FilmedScans::new(&scans, table)?;
        let total = filmed.ids().len();
        let mut progress = Progress::new();
        let frames = (0..total).map(|index| {
            progress.show("filming", index as f64 / total as f64, &format!("{index} of {total} frames"));
            filmed.picture(index)
        });
        write_rgbd_subject(&self.out, layout, subject.gender, &subject.betas, frames)?;
        progress.finish();
        let filmed = Filmed { folder: &self.out, frames: total };
        self.json.print(&filmed, &format!("{}: {total} frames", self.out.display()))?;
        Ok(Outcome::Done)
    }
}

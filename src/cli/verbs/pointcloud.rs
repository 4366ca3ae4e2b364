//! `xavatar pointcloud`: the surface points of an RGB-D frame as a PLY, to be looked at.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use xavatar::body::Registration;
use xavatar::data::{PointCloud, RgbdFiles, RgbdSubject};
use xavatar::mesh::write_ply;
use xavatar::report::part_colour;

use crate::cli::options::inputs::load_body;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::{Outcome, wrong_usage};

/// Write what one RGB-D frame shows as coloured points with normals
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar pointcloud data/00016 --out frame.ply\n  \
    xavatar pointcloud data/00016 --frame test/Take4/f00012 --parts --body models/smplx --out parts.ply\n\n\
    docs/rgbd.md describes the layouts that are read.")]
pub struct PointCloudOf {
    /// The subject's folder: X-Humans with `render` folders, or any with a rgbd.toml
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// The frame, as `xavatar check` names it [default: the first]
    #[arg(long, value_name = "SPLIT/SEQUENCE/fNUMBER")]
    frame: Option<String>,
    /// Colour the points by the part of the body that each belongs to
    #[arg(long, requires = "body")]
    parts: bool,
    /// Body model file of any family, or a folder that holds SMPLX_{GENDER}.npz or .pkl
    #[arg(long, value_name = "BODY", requires = "parts")]
    body: Option<PathBuf>,
    /// The PLY file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written. `Display` is for people, serde for scripts.
#[derive(Serialize)]
struct Written<'a> {
    file: &'a Path,
    frame: String,
    points: usize,
    /// Points by part, where parts were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    parts: Option<BTreeMap<String, usize>>,
}

impl PointCloudOf {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        let subject = RgbdSubject::open(&self.data)?;
        let frame = self.files(&subject)?.read(&subject.betas)?;
        let mut cloud = PointCloud::of(&frame)?;
        let mut counts = None;
        if let Some(body) = &self.body {
            let (body, labels) = load_body(body, subject.gender)?;
            let registered = body.pose(&body.resolve(&frame.parameters)?)?;
            let parts = cloud.parts(&Registration::new(&registered.vertices, &labels)?);
            cloud.colours = parts.iter().map(|part| part_colour(*part)).collect();
            let count = |part| parts.iter().filter(|found| **found == part).count();
            let counted = body.skeleton().parts().map(|(part, group)| (group.name.clone(), count(part)));
            counts = Some(counted.collect());
        }
        write_ply(&self.out, &cloud.to_mesh())?;
        let (frame, points) = (frame.id.to_string(), cloud.points.len());
        let written = Written { file: &self.out, frame, points, parts: counts };
        self.json.print(&written, &written)?;
        Ok(Outcome::Done)
    }

    fn files<'a>(&self, subject: &'a RgbdSubject) -> anyhow::Result<&'a RgbdFiles> {
        let mut frames = subject.train.iter().chain(&subject.test);
        match &self.frame {
            None => frames.next().context("the subject has no frame"),
            Some(name) => match frames.find(|files| files.id.to_string() == *name) {
                Some(files) => Ok(files),
                None => {
                    let of_split = |split: &str, frames: &[RgbdFiles]| match frames {
                        [] => format!("no {split} frame"),
                        [only] => only.id.to_string(),
                        [first, .., last] => format!("{} to {}", first.id, last.id),
                    };
                    let there = [of_split("training", &subject.train), of_split("test", &subject.test)].join(", ");
                    wrong_usage!("{}: no frame {name:?}; there are {there}", self.data.display())
                }
            },
        }
    }
}

impl fmt::Display for Written<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}: {} points of frame {}", self.file.display(), self.points, self.frame)?;
        for (part, points) in self.parts.iter().flatten() {
            writeln!(formatter, "  {:<10} {points:>8}", part.replace('_', " "))?;
        }
        Ok(())
    }
}

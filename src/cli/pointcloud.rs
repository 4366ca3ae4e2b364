//! `xavatar pointcloud`: the surface points of an RGB-D frame as a PLY, to be looked at.

use std::path::PathBuf;

use anyhow::{Context, bail};
use xavatar::body::{Part, Registration};
use xavatar::data::{PointCloud, RgbdFiles, RgbdSubject};
use xavatar::mesh::write_ply;

use super::inputs::load_body;
use super::{Outcome, outputs};

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
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl
    #[arg(long, value_name = "BODY", requires = "parts")]
    body: Option<PathBuf>,
    /// The PLY file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl PointCloudOf {
    pub fn run(self) -> anyhow::Result<Outcome> {
        outputs::new_file(&self.out)?;
        let subject = RgbdSubject::open(&self.data)?;
        let frame = self.files(&subject)?.read(&subject.betas)?;
        let mut cloud = PointCloud::of(&frame)?;
        if let Some(body) = &self.body {
            let (body, labels) = load_body(body, subject.gender)?;
            let registered = body.pose(&frame.parameters)?;
            let parts = cloud.parts(&Registration::new(&registered.vertices, &labels)?);
            cloud.colours = parts.iter().map(|part| colour_of(*part)).collect();
            for part in Part::ALL {
                println!("{part:?} {} points", parts.iter().filter(|found| **found == part).count());
            }
        }
        write_ply(&self.out, &cloud.to_mesh())?;
        println!("{}: {} points of frame {}", self.out.display(), cloud.points.len(), frame.id);
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
                    bail!("{}: no frame {name:?}; there are {there}", self.data.display())
                }
            },
        }
    }
}

fn colour_of(part: Part) -> [u8; 3] {
    match part {
        Part::Body => [150, 150, 155],
        Part::Face => [225, 170, 60],
        Part::LeftHand => [60, 140, 210],
        Part::RightHand => [200, 80, 80],
    }
}

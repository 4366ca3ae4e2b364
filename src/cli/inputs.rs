//! What several verbs take: a subject's folder with the body model that fits it.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::data::{self, Subject};

/// A subject's folder and its body model.
#[derive(clap::Args)]
pub struct SubjectArguments {
    /// The subject's folder, in the X-Humans layout or with a rgbd.toml
    #[arg(value_name = "DATA")]
    pub data: PathBuf,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl (the subject's gender.txt chooses)
    #[arg(long, value_name = "BODY")]
    pub body: PathBuf,
}

/// Frames of a subject that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Split {
    Train,
    Test,
}

impl Split {
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "training",
            Self::Test => "test",
        }
    }
}

impl From<Split> for data::Split {
    fn from(split: Split) -> Self {
        match split {
            Split::Train => Self::Train,
            Split::Test => Self::Test,
        }
    }
}

/// A subject with its body model.
pub struct Registered {
    pub subject: Subject,
    pub body: BodyModel,
    pub labels: PartLabels,
}

impl SubjectArguments {
    pub fn open(&self) -> xavatar::Result<Registered> {
        let subject = Subject::open(&self.data)?;
        let (body, labels) = load_body(&self.body, subject.gender)?;
        Ok(Registered { subject, body, labels })
    }
}

/// The model of a gender and its part labels.
pub fn load_body(path: &Path, gender: Gender) -> xavatar::Result<(BodyModel, PartLabels)> {
    let body = BodyModel::load(path, gender)?;
    let labels = PartLabels::find(&body)?;
    Ok((body, labels))
}

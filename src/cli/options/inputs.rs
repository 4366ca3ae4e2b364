//! What several verbs take: a subject's folder with the body model that fits it.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::ValueEnum;
use xavatar::avatar::Avatar;
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::data::{self, Defect, Subject};
use xavatar::synthetic::BuiltInSubject;

use crate::cli::WrongUsage;

/// A subject's folder and its body model.
#[derive(clap::Args)]
pub struct SubjectArguments {
    /// The subject's folder, in any layout of docs/formats.md or with a rgbd.toml
    #[arg(value_name = "DATA")]
    pub data: PathBuf,
    /// Body model file of any family, or a folder that holds SMPLX_{GENDER}.npz or .pkl (the subject's gender chooses)
    #[arg(long, value_name = "BODY")]
    pub body: PathBuf,
}

/// Faults of scans that are trained on all the same.
#[derive(clap::Args)]
pub struct AcceptArguments {
    /// Train in spite of what `xavatar check` finds under this name, such as slipped; may be given again
    #[arg(long = "accept", value_name = "NAME", value_parser = |text: &str| text.parse::<Defect>())]
    accepted: Vec<Defect>,
}

impl AcceptArguments {
    /// What is accepted.
    pub fn defects(&self) -> impl Iterator<Item = Defect> {
        self.accepted.iter().copied()
    }
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
        Ok(Registered { subject: subject.settled(&body)?, body, labels })
    }
}

/// The model of a gender and its part labels.
pub fn load_body(path: &Path, gender: Gender) -> xavatar::Result<(BodyModel, PartLabels)> {
    let body = BodyModel::load(path, gender)?;
    let labels = PartLabels::find(&body)?;
    Ok((body, labels))
}

/// The body model of an avatar: the one that is given, or the built-in subject's, if the avatar is of that.
pub fn body_of(avatar: &Avatar, path: Option<&Path>) -> anyhow::Result<(BodyModel, PartLabels)> {
    match path {
        Some(path) => Ok(load_body(path, avatar.subject.gender)?),
        None => built_in_body(avatar)?.ok_or_else(|| {
            WrongUsage(anyhow!(
                "the avatar is not the demo's, so its body model has to be given: --body FILE or FOLDER"
            ))
            .into()
        }),
    }
}

/// The built-in subject's body, if the avatar has its skeleton.
pub fn built_in_body(avatar: &Avatar) -> anyhow::Result<Option<(BodyModel, PartLabels)>> {
    let subject = BuiltInSubject::new()?;
    let is_its = avatar.subject.is_on(subject.model())?;
    Ok(is_its.then(|| (subject.model().clone(), subject.part_labels().clone())))
}

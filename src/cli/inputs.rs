//! What several verbs take: a subject's folder with the body model that fits it, and frames to be read on demand.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use xavatar::avatar::Avatar;
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::data::{Defect, FrameFiles, FrameId, FrameSource, ScanFrame, Subject, read_frame};
use xavatar::synthetic::BuiltInSubject;

use super::WrongUsage;

/// A subject's folder and its body model.
#[derive(clap::Args)]
pub struct SubjectArguments {
    /// The subject's folder, in any layout of docs/formats.md or with a rgbd.toml
    #[arg(value_name = "DATA")]
    pub data: PathBuf,
    /// SMPL-X model file, or the folder that holds SMPLX_{GENDER}.npz or .pkl (the subject's gender chooses)
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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

    pub fn files(self, subject: &Subject) -> &[FrameFiles] {
        match self {
            Self::Train => &subject.train,
            Self::Test => &subject.test,
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
    /// Joints closer than this are the same, metres.
    const SAME_JOINT: f32 = 1e-4;
    let subject = BuiltInSubject::new()?;
    let joints = subject.model().canonical_joints(&avatar.subject.betas)?;
    let is_same = joints.len() == avatar.subject.joints.len()
        && joints.iter().zip(&avatar.subject.joints).all(|(joint, own)| joint.distance(*own) < SAME_JOINT);
    Ok(is_same.then(|| (subject.model().clone(), subject.part_labels().clone())))
}

/// Frames of a subject, read when they are asked for.
pub struct SubjectFrames {
    files: Vec<FrameFiles>,
    ids: Vec<FrameId>,
    betas: Vec<f32>,
    gender: Gender,
}

impl SubjectFrames {
    /// The frames of one split.
    pub fn new(subject: &Subject, files: &[FrameFiles]) -> Self {
        Self {
            files: files.to_vec(),
            ids: files.iter().map(|files| files.id.clone()).collect(),
            betas: subject.betas.clone(),
            gender: subject.gender,
        }
    }

    /// The frame of this name (`split/sequence/number`), if there is one.
    pub fn named(&self, name: &str) -> Option<xavatar::formats::Result<ScanFrame>> {
        let index = self.ids.iter().position(|id| id.to_string() == name)?;
        Some(self.read(index))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// All frames, one at a time.
    pub fn iter(&self) -> impl Iterator<Item = xavatar::formats::Result<ScanFrame>> {
        (0..self.files.len()).map(|index| self.read(index))
    }
}

impl FrameSource for SubjectFrames {
    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> xavatar::formats::Result<ScanFrame> {
        read_frame(&self.files[index], &self.betas)
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        self.gender
    }
}

//! Frames that are inspected as they are read, so that nothing is trained on a scan that a check would refuse.

use std::collections::BTreeSet;

use super::finding::Defect;
use super::inspection::Inspector;
use super::judgement::Looked;
use super::wording::described;
use crate::{Capture, CaptureKind, FrameId, ScanFrame, Source};
use xavatar_body::{BodyModel, Gender};
use xavatar_formats::{Choice, Error, Remedy, Result};

/// A source of captures, of which each scan is refused if something is wrong with it that was not accepted by name.
pub struct CheckedFrames<'a> {
    source: &'a dyn Source,
    body: &'a BodyModel,
    inspector: Inspector<'a>,
    accepted: BTreeSet<Defect>,
}

impl<'a> CheckedFrames<'a> {
    /// The frames of `source`, whose bodies are those of `body`; defects in `accepted` are let pass.
    pub fn new(source: &'a dyn Source, body: &'a BodyModel, accepted: impl IntoIterator<Item = Defect>) -> Self {
        Self { source, body, inspector: Inspector::new(body), accepted: accepted.into_iter().collect() }
    }

    fn inspect(&self, frame: &ScanFrame) -> Result<()> {
        let looked = Looked {
            frame: frame.id.to_string(),
            inspection: self.inspector.inspect(frame, false)?,
            translation: frame.parameters.translation(),
            pelvis: self.body.pose(&self.body.resolve(&frame.parameters)?)?.joints[0],
            fits_instead: None,
            fits_too: None,
        };
        let found = looked.inspection.observations.iter().map(|observation| described(observation, &looked));
        match found.into_iter().find(|(defect, _)| defect.is_problem() && !self.accepted.contains(defect)) {
            None => Ok(()),
            Some((defect, message)) => {
                let words = "leave the frame out, or accept this of all frames";
                Err(Error::Unfit { message, remedy: Remedy::choosing(Choice::Accept(defect.name()), words) })
            }
        }
    }
}

impl Source for CheckedFrames<'_> {
    fn kind(&self) -> CaptureKind {
        self.source.kind()
    }

    fn ids(&self) -> &[FrameId] {
        self.source.ids()
    }

    fn read(&self, index: usize) -> Result<Capture> {
        let capture = self.source.read(index)?;
        if let Capture::Scan(frame) = &capture {
            self.inspect(frame).map_err(|error| error.in_frame(frame.id.to_string()))?;
        }
        Ok(capture)
    }

    fn betas(&self) -> &[f32] {
        self.source.betas()
    }

    fn gender(&self) -> Gender {
        self.source.gender()
    }
}

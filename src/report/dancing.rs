//! The avatar for a page's viewer: rigged, in a motion that its skeleton can make.

use crate::avatar::Avatar;
use crate::body::{BodyModel, Pose, smplx};
use crate::export::{RiggedMesh, Rigging};
use crate::synthetic::dance;
use crate::{Error, Result};

/// Cells along the body of the viewer's mesh: about 40,000 vertices, a few megabytes of page.
const RIG_RESOLUTION: usize = 224;
/// Of a page that is made while training goes on: a quarter of the vertices, an eighth of the time.
const QUICK_RESOLUTION: usize = 112;
/// What the viewer's shader knows.
const RIG_INFLUENCES: usize = 4;

/// The avatar with the built-in dance, or in its canonical pose if its skeleton cannot dance; none if it was trained so little that it has
/// no surface.
///
/// # Errors
/// As [`Rigging::rig`].
pub fn dancing_rig(avatar: &Avatar, body: &BodyModel) -> Result<Option<RiggedMesh>> {
    let rigged = danced(avatar, body, RIG_RESOLUTION)?;
    if rigged.is_none() {
        log::warn!("the avatar has no surface yet, so the report cannot show it; train longer");
    }
    Ok(rigged)
}

/// The same, coarser and sooner.
///
/// # Errors
/// As [`Rigging::rig`].
pub(crate) fn quick_dancing_rig(avatar: &Avatar, body: &BodyModel) -> Result<Option<RiggedMesh>> {
    danced(avatar, body, QUICK_RESOLUTION)
}

fn danced(avatar: &Avatar, body: &BodyModel, resolution: usize) -> Result<Option<RiggedMesh>> {
    let (poses, rate) = danced_poses(avatar, body)?;
    match rigged(avatar, Some(body), &poses, rate, resolution) {
        Err(Error::NoSurface { .. }) => Ok(None),
        rigged => rigged.map(Some),
    }
}

/// The avatar for the viewer, with a motion of so many poses a second.
///
/// # Errors
/// As [`Rigging::rig`].
pub fn viewer_rig(avatar: &Avatar, body: Option<&BodyModel>, poses: &[Pose], rate: f32) -> Result<RiggedMesh> {
    rigged(avatar, body, poses, rate, RIG_RESOLUTION)
}

fn rigged(
    avatar: &Avatar,
    body: Option<&BodyModel>,
    poses: &[Pose],
    rate: f32,
    resolution: usize,
) -> Result<RiggedMesh> {
    let rigging = Rigging { resolution, influences: RIG_INFLUENCES, correctives: 0 };
    rigging.rig_to_look_at(avatar, body, poses, rate)
}

/// The built-in dance as the avatar's skeleton makes it, and its poses a second; the canonical pose alone if it cannot.
///
/// # Errors
/// If the body is not the avatar's.
pub fn danced_poses(avatar: &Avatar, body: &BodyModel) -> Result<(Vec<Pose>, f32)> {
    let clip = dance();
    let subject = &avatar.subject;
    let poses = match smplx::skeleton().corresponds_to(&subject.skeleton) {
        true => clip.onto(&subject.skeleton, Some(body))?.poses,
        false => vec![subject.skeleton.canonical_pose(&subject.betas)],
    };
    Ok((poses, clip.frames_per_second))
}

//! Whether a skeleton is a mirror image: of a body whose left is where its bones are called left, toes and knees point forward.

use glam::DVec3;

use super::stance::Stance;
use xavatar_body::smplx::joint::sides::{ANKLES, HIPS, KNEES};

/// Means above this, of cosines with forward, say which way.
const CLEAR: f64 = 0.5;
/// A knee tells if it is this far from the straight line, by the length of the leg.
const BENT: f64 = 0.05;

/// What toes and knees say about left and right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Handedness {
    /// They are where the names say, or nothing tells.
    Own,
    /// Toes and knees point backward: left and right are exchanged.
    Mirrored,
    /// Toes point backward, knees forward.
    Contradictory,
}

impl Handedness {
    pub(super) fn of(frames: &[Stance]) -> Self {
        let toes = mean(frames, |stance, forward| {
            let directions = ANKLES.into_iter().filter_map(|ankle| stance.direction(ankle));
            directions.map(|direction| direction.dot(forward)).collect()
        });
        let knees = mean(frames, |stance, forward| {
            let legs = HIPS.into_iter().zip(KNEES).zip(ANKLES);
            legs.filter_map(|((hip, middle), ankle)| knee(stance, (hip, middle, ankle)))
                .map(|ahead| ahead.dot(forward))
                .collect()
        });
        match (toes, knees) {
            (Some(toes), Some(knees)) if toes < -CLEAR && knees > CLEAR => Self::Contradictory,
            (Some(toes), _) if toes < -CLEAR => Self::Mirrored,
            (None, Some(knees)) if knees < -CLEAR => Self::Mirrored,
            _ => Self::Own,
        }
    }
}

/// The mean of what the frames tell, if they tell anything.
fn mean(frames: &[Stance], tell: impl Fn(&Stance, DVec3) -> Vec<f64>) -> Option<f64> {
    let told: Vec<f64> =
        frames.iter().filter_map(|stance| Some(tell(stance, stance.body()? * DVec3::Z))).flatten().collect();
    (!told.is_empty()).then(|| told.iter().sum::<f64>() / told.len() as f64)
}

/// Which way a knee is off the straight line from hip to ankle, if it is bent.
fn knee(stance: &Stance, (hip, knee, ankle): (usize, usize, usize)) -> Option<DVec3> {
    let (leg, thigh) = (stance.between(hip, ankle)?, stance.between(hip, knee)?);
    let along = leg.try_normalize()?;
    let aside = thigh - along * thigh.dot(along);
    (aside.length() > BENT * leg.length()).then(|| aside.normalize())
}

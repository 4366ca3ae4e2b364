//! Places that one bone explains and the body model does not: hair that hangs over the back, a bag, a tail.
//!
//! A place is explained by weights under which, in most frames, the subject is there. Space that nothing explains takes the weights
//! of the explained places around it, so that the two join smoothly.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::{Places, Row, View};
use crate::train::supervision::PreparedFrame;

/// Nearer to the body than this, its own weights are where to begin, metres.
const NEAR_BODY: f32 = 0.04;
/// The subject is at a place if its surface is no farther than this, and what is worn if the body is no nearer than that, metres.
const THERE: f32 = 0.025;
const OFF_BODY: f32 = 0.02;
/// Share of the frames in which the subject is at an explained place.
const EXPLAINED: f32 = 0.7;
/// By how much a bone explains more frames than the body model's weights, to take its place.
const ADVANTAGE: f32 = 0.2;
/// Steps over which weights spread into unexplained space.
const STEPS: usize = 2;

/// Replaces the rows (R) of places that one bone explains better, and spreads them; the views are of these frames. `distances` (R) are those to the body.
pub(super) fn settle(
    rows: &mut [Row],
    views: &[View],
    frames: &[Arc<PreparedFrame>],
    places: &Places,
    distances: &[f32],
) {
    let Places { may_move, bones, neighbours } = places;
    let is_asked = |node: usize| may_move[node] && distances[node] > NEAR_BODY;
    let votes: Vec<Option<Vote>> = (0..rows.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|node| is_asked(node).then(|| Vote::of(node, &rows[node], views, frames, bones)))
        .collect();
    let mut is_open: Vec<bool> = votes.iter().map(|vote| matches!(vote, Some(Vote::Nothing))).collect();
    let mut front = Vec::new();
    for (node, vote) in votes.iter().enumerate() {
        if let Some(Vote::Bone(bone)) = vote {
            rows[node] = vec![(*bone, 1.0)];
            front.push(node);
        }
    }
    for _ in 0..STEPS {
        let reached =
            |node: usize| neighbours[node].iter().map(|other| *other as usize).filter(|other| is_open[*other]);
        let mut next: Vec<usize> = front.iter().flat_map(|node| reached(*node)).collect();
        next.sort_unstable();
        next.dedup();
        let spread: Vec<Row> = next
            .iter()
            .map(|node| {
                let settled = neighbours[*node].iter().map(|other| *other as usize);
                mean(settled.filter(|other| !is_open[*other]).map(|other| &rows[other]))
            })
            .collect();
        for (node, row) in next.iter().zip(spread) {
            rows[*node] = row;
        }
        next.iter().for_each(|node| is_open[*node] = false);
        front = next;
    }
}

/// What explains a place.
#[derive(Clone, Copy, Debug)]
enum Vote {
    BodyModel,
    Bone(usize),
    Nothing,
}

impl Vote {
    fn of(node: usize, row: &Row, views: &[View], frames: &[Arc<PreparedFrame>], bones: &[usize]) -> Self {
        let share = |there: usize| there as f32 / views.len() as f32;
        let own = share(views.iter().filter(|view| view.distance(node, row) < THERE).count());
        if own >= EXPLAINED {
            return Self::BodyModel;
        }
        let needed = EXPLAINED.max(own + ADVANTAGE);
        // The share of the frames that a bone explains, and how far its distances to the scans spread.
        let of_bone = |bone: usize| {
            let (mut there, mut misses, mut sum, mut squares) = (0, 0, 0.0, 0.0);
            for (view, frame) in views.iter().zip(frames) {
                let image = view.image(node, bone);
                let distance = view.volume.at(image).0;
                if distance < THERE && is_off_body(frame, image) {
                    there += 1;
                } else {
                    misses += 1;
                }
                if share(views.len() - misses) < needed {
                    return None;
                }
                sum += distance;
                squares += distance * distance;
            }
            let count = views.len() as f32;
            (share(there) >= needed).then_some((bone, squares / count - (sum / count).powi(2)))
        };
        // Of bones that explain it the one that keeps it most nearly in place.
        match bones.iter().filter_map(|bone| of_bone(*bone)).min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((bone, _)) => Self::Bone(bone),
            None => Self::Nothing,
        }
    }
}

/// Whether a point is outside a frame's registered body, and not close to it.
fn is_off_body(frame: &PreparedFrame, point: Vec3) -> bool {
    let scan = frame.supervision.scan();
    scan.is_some_and(|scan| {
        scan.body.surface().closest_within(point, OFF_BODY).is_none() && !scan.body.is_inside(point)
    })
}

/// The mean of rows, at least one.
fn mean<'a>(rows: impl Iterator<Item = &'a Row>) -> Row {
    let mut sum = Row::new();
    for (bone, weight) in rows.flatten() {
        match sum.iter_mut().find(|(known, _)| known == bone) {
            Some((_, total)) => *total += weight,
            None => sum.push((*bone, *weight)),
        }
    }
    let total: f32 = sum.iter().map(|(_, weight)| weight).sum();
    sum.iter_mut().for_each(|(_, weight)| *weight /= total);
    sum
}

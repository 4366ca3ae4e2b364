//! Places that one bone explains and the body model does not: hair that hangs over the back, a bag, a tail.
//!
//! A place is explained by weights under which, in most frames, something worn is there. Where several bones explain a place, it is the
//! one that explains most places: what is worn goes with few. What is seen at a place where another bone has already brought it is no
//! reason for a place to go with a further bone: behind a neck that is bowed in canonical space alone, every bone of the trunk would find
//! hair in all frames. Space that nothing explains takes the weights of the explained places around it, so that the two join smoothly.

use std::cmp::Reverse;

use glam::Vec3;
use rayon::prelude::*;

use super::worn::{FEWEST_OFF_BODY, THERE};
use super::{Places, Row, View};

/// Nearer to the body than this, its own weights are where to begin, metres.
const NEAR_BODY: f32 = 0.025;
/// Share of the frames in which the subject is at an explained place.
const EXPLAINED: f32 = 0.7;
/// By how much nearer to the subject a bone keeps a place than the body model's weights, to take it, metres; a mean over the frames.
const GAIN: f32 = 0.01;
/// Fewest places that a bone explains: fewer are chance, or a fold.
const FEWEST_PLACES: usize = 12;
/// A bone with more weight than this leads a place.
const LEADING: f32 = 0.5;
/// Steps over which weights spread into unexplained space.
const STEPS: usize = 2;

/// Replaces the rows (R) of places that one bone explains better, and spreads them. `distances` (R) are those to the body; `nearest` is
/// the place nearest to a canonical point.
pub(super) fn settle(
    rows: &mut [Row],
    views: &[View],
    places: &Places,
    distances: &[f32],
    nearest: impl Fn(Vec3) -> Option<usize> + Sync,
) {
    let Places { may_move, bones, neighbours } = places;
    let is_asked = |place: usize| may_move[place] && distances[place] > NEAR_BODY;
    let votes: Vec<Option<Vote>> = (0..rows.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|place| is_asked(place).then(|| Vote::of(place, &rows[place], views, bones)))
        .collect();
    let winners = winners(rows, views, bones, &votes, nearest);
    let mut front = Vec::new();
    let mut is_open = vec![false; rows.len()];
    for (place, vote) in votes.iter().enumerate() {
        let Some(vote) = vote else { continue };
        match winners[place] {
            Some(bone) => {
                rows[place] = vec![(bone, 1.0)];
                front.push(place);
            }
            None => is_open[place] = !vote.body_model,
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

/// The bone that each place (R) goes with, if one explains it and what is seen there is not explained yet.
fn winners(
    rows: &[Row],
    views: &[View],
    bones: &[usize],
    votes: &[Option<Vote>],
    nearest: impl Fn(Vec3) -> Option<usize> + Sync,
) -> Vec<Option<usize>> {
    let mut winners = vec![None; rows.len()];
    let mut explained = Explained { bones: Vec::new(), nearest };
    for bone in leading_bones(bones, votes) {
        let is_won = |place: &usize| {
            let explains = votes[*place].as_ref().is_some_and(|vote| vote.bones.contains(&bone));
            winners[*place].is_none() && explains && explained.leaves(views, *place, bone)
        };
        let won: Vec<usize> = (0..rows.len()).into_par_iter().with_min_len(256).filter(is_won).collect();
        if won.len() < FEWEST_PLACES {
            continue;
        }
        won.iter().for_each(|place| winners[*place] = Some(bone));
        let leads = |row: &Row| row.iter().any(|(own, weight)| *own == bone && *weight > LEADING);
        let follows = |place: usize| {
            let is_explained = votes[place].as_ref().is_some_and(|vote| vote.body_model && leads(&rows[place]));
            winners[place] == Some(bone) || is_explained
        };
        explained.bones.push((bone, (0..rows.len()).map(follows).collect()));
    }
    winners
}

/// What is at its place in the frames, since it goes with one of some bones.
struct Explained<F> {
    /// The bones, each with whether a place goes with it (R).
    bones: Vec<(usize, Vec<bool>)>,
    /// The place nearest to a canonical point.
    nearest: F,
}

impl<F: Fn(Vec3) -> Option<usize> + Sync> Explained<F> {
    /// Whether a bone takes a place to something worn that is not explained, in enough of the frames.
    fn leaves(&self, views: &[View], place: usize, bone: usize) -> bool {
        let is_worn = |view: &View| {
            let image = view.image(place, bone);
            let is_worn = view.is_worn(image, view.volume.at(image).0)?;
            (!self.is_at(view, image)).then_some(is_worn)
        };
        let seen: Vec<bool> = views.iter().filter_map(is_worn).collect();
        let worn = seen.iter().filter(|is_worn| **is_worn).count();
        seen.len() as f32 >= FEWEST_OFF_BODY * views.len() as f32 && worn as f32 >= EXPLAINED * seen.len() as f32
    }

    /// Whether what is at a point of a frame is explained.
    fn is_at(&self, view: &View, point: Vec3) -> bool {
        self.bones.iter().any(|(bone, follows)| {
            let (linear, translation) = view.bones[*bone];
            let origin = (self.nearest)(linear.inverse() * (point - translation));
            origin.is_some_and(|origin| follows[origin])
        })
    }
}

/// The bones that explain enough places, those that explain most of them first.
fn leading_bones(bones: &[usize], votes: &[Option<Vote>]) -> Vec<usize> {
    let explained = |bone: usize| votes.iter().flatten().filter(|vote| vote.bones.contains(&bone)).count();
    let counted = bones.iter().map(|bone| (Reverse(explained(*bone)), *bone));
    let mut leading: Vec<_> = counted.filter(|(Reverse(count), _)| *count >= FEWEST_PLACES).collect();
    leading.sort_unstable();
    leading.into_iter().map(|(_, bone)| bone).collect()
}

/// What explains a place.
#[derive(Clone, Debug)]
struct Vote {
    /// Whether the body model's weights do.
    body_model: bool,
    /// The bones that do, and better.
    bones: Vec<usize>,
}

impl Vote {
    fn of(place: usize, row: &Row, views: &[View], bones: &[usize]) -> Self {
        let count = views.len() as f32;
        let under_body_model: Vec<f32> = views.iter().map(|view| view.distance(place, row)).collect();
        let there = under_body_model.iter().filter(|distance| **distance < THERE).count();
        let outside = under_body_model.iter().map(|distance| distance.max(0.0)).sum::<f32>() / count;
        let explains = |bone: &usize| {
            let (mut off_body, mut worn, mut left) = (0, 0, count * (outside - GAIN));
            for view in views {
                let image = view.image(place, *bone);
                let distance = view.volume.at(image).0;
                left -= distance.max(0.0);
                if left < 0.0 {
                    return false;
                }
                // Where the body is, anything would be: those frames tell nothing.
                if let Some(is_worn) = view.is_worn(image, distance) {
                    off_body += 1;
                    worn += usize::from(is_worn);
                }
            }
            off_body as f32 >= FEWEST_OFF_BODY * count && worn as f32 >= EXPLAINED * off_body as f32
        };
        let bones = bones.iter().copied().filter(explains).collect();
        Self { body_model: there as f32 >= EXPLAINED * count, bones }
    }
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::volume::cuboid;
    use super::super::worn::{BESIDE, views};
    use super::*;
    use crate::mesh::SolidIndex;

    /// The rows of places that began with the first of three bones, the second of which carries a block far from the body; `distances` (R)
    /// are those to the body, which is registered as a box this many times its size.
    fn settled(at: &[Vec3], distances: &[f32], size: f32) -> Vec<Row> {
        let mut mesh = cuboid();
        mesh.vertices.iter_mut().for_each(|vertex| *vertex *= size);
        let body = SolidIndex::new(&mesh).unwrap();
        let alone = (0..at.len() as u32).map(|place| [place; 6]).collect();
        let places = Places { may_move: vec![true; at.len()], bones: vec![0, 1, 2], neighbours: alone };
        let mut rows = vec![vec![(0, 1.0)]; at.len()];
        settle(&mut rows, &views(at, &body), &places, distances, |point| nearest(at, point));
        rows
    }

    fn nearest(at: &[Vec3], point: Vec3) -> Option<usize> {
        (0..at.len()).filter(|place| at[*place].distance(point) < 0.02).min_by(|a, b| {
            let distance = |place: &usize| at[*place].distance(point);
            distance(a).total_cmp(&distance(b))
        })
    }

    fn in_block(count: usize) -> Vec<Vec3> {
        (0..count).map(|place| Vec3::new(0.01 * place as f32, 0.0, 1.0)).collect()
    }

    #[test]
    fn what_a_bone_carries_goes_with_it() {
        let mut at = in_block(FEWEST_PLACES + 1);
        at.push(Vec3::new(1.5, 0.0, 1.0));
        let mut distances = vec![0.5; at.len()];
        distances[0] = NEAR_BODY / 2.0;
        let rows = settled(&at, &distances, 1.0);
        assert!(rows[1..=FEWEST_PLACES].iter().all(|row| *row == [(1, 1.0)]), "{rows:?}");
        assert_eq!(rows[0], [(0, 1.0)], "near the body its own weights are kept");
        assert_eq!(rows[FEWEST_PLACES + 1], [(0, 1.0)], "where nothing is, nothing is carried");
    }

    #[test]
    fn a_few_places_are_chance() {
        let at = in_block(FEWEST_PLACES - 1);
        assert!(settled(&at, &vec![0.5; at.len()], 1.0).iter().all(|row| *row == [(0, 1.0)]));
    }

    // The third bone finds the block at other places in every frame: by itself it would carry it there, but the second has brought it.
    #[test]
    fn what_one_bone_has_brought_no_other_brings_again() {
        let beside: Vec<Vec3> = in_block(FEWEST_PLACES).into_iter().map(|place| place + BESIDE).collect();
        let alone = settled(&beside, &vec![0.5; beside.len()], 1.0);
        assert!(alone.iter().all(|row| *row == [(2, 1.0)]), "{alone:?}");
        let mut at = in_block(FEWEST_PLACES + 1);
        at.extend(&beside);
        let rows = settled(&at, &vec![0.5; at.len()], 1.0);
        let (first, second) = rows.split_at(FEWEST_PLACES + 1);
        assert!(first.iter().all(|row| *row == [(1, 1.0)]), "{first:?}");
        assert!(second.iter().all(|row| *row == [(0, 1.0)]), "{second:?}");
    }

    // A bone under which a place lies in the body says nothing of what is worn there.
    #[test]
    fn what_is_in_the_body_is_not_worn() {
        let at = in_block(FEWEST_PLACES);
        assert!(settled(&at, &vec![0.5; at.len()], 20.0).iter().all(|row| *row == [(0, 1.0)]));
    }
}

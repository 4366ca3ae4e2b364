//! The turn, unit and shift that bring a scan onto its registered body: x_body = s R x_scan + t.
//!
//! The 24 turns of a cube, and as many with a mirror, are tried about the centres of both surfaces; the best are refined by
//! iterated closest points (Besl & McKay 1992), in both directions, with pairs that are far apart left out. What is close to a
//! turn of the cube, to a known unit, or to no shift is taken to be that, since data are not turned by 89.7 degrees.
//! P points of the scan, Q of the body, metres.

use glam::{Mat3, Vec3};

use super::statistics::percentile;
use super::surface_points::SurfacePoints;

/// Points of each surface that are compared.
const POINTS: usize = 500;
/// A distance counts no more than this, metres, so that a missing limb decides nothing.
const FARTHEST: f32 = 0.15;
/// Turns that are refined.
const REFINED: usize = 5;
const ITERATIONS: usize = 30;
/// A step that moves the scan less ends the refinement, metres.
const SETTLED: f32 = 2e-4;
/// Pairs farther apart than so many medians are left out of a step.
const OUTLIER: f32 = 2.5;
/// A turn within this of a turn of the cube is that, radians.
const SAME_TURN: f32 = 0.12;
/// A shift below this is none, metres.
const SAME_PLACE: f32 = 0.02;
/// What is simpler may fit worse by this factor.
const SIMPLER: f32 = 1.15;
/// Another size than that of a unit has to fit better by this factor.
const RESIZED: f32 = 0.8;
/// Pairs that a size is told from.
const FEWEST_PAIRS: usize = 20;
/// Sizes within this factor are one size: people differ, and wear shoes and hats.
const SAME_SIZE: f32 = 1.25;
/// Units by how many of them a metre has.
pub(crate) const UNITS: [(&str, f32); 4] =
    [("metres", 1.0), ("inches", 39.37), ("centimetres", 100.0), ("millimetres", 1000.0)];

/// x_body = scale * turn * x_scan + shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Similarity {
    pub scale: f32,
    /// Orthogonal; a mirror image where its determinant is negative.
    pub turn: Mat3,
    pub shift: Vec3,
}

impl Similarity {
    pub const IDENTITY: Self = Self { scale: 1.0, turn: Mat3::IDENTITY, shift: Vec3::ZERO };

    pub fn of(&self, point: Vec3) -> Vec3 {
        self.turn * point * self.scale + self.shift
    }

    /// The point of the scan that is brought to this one.
    pub fn inverse_of(&self, point: Vec3) -> Vec3 {
        self.turn.transpose() * (point - self.shift) / self.scale
    }
}

/// How a scan comes to lie on its body.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub placement: Similarity,
    /// Others that fit about as well, as a mirror image of a body in a symmetric pose does.
    pub alternatives: Vec<Similarity>,
    /// Median distance of the scan from the body as it is, and at best; metres.
    pub before: f32,
    pub after: f32,
}

impl Alignment {
    /// The best placement, and those that fit about as well.
    pub fn placements(&self) -> impl Iterator<Item = &Similarity> {
        std::iter::once(&self.placement).chain(&self.alternatives)
    }
}

/// A scan and a body to be brought together.
pub(super) struct Pair<'a> {
    scan: &'a SurfacePoints,
    body: &'a SurfacePoints,
    /// Points of the scan (P) and of the body (Q) that are compared.
    scan_points: Vec<Vec3>,
    body_points: Vec<Vec3>,
    /// Points of the body that no clothes hold the scan away from: those tell its size.
    bare_points: Vec<Vec3>,
}

impl<'a> Pair<'a> {
    /// `bare` are points of the body that no clothes cover.
    pub fn new(scan: &'a SurfacePoints, body: &'a SurfacePoints, bare: impl Iterator<Item = Vec3>) -> Self {
        let some = |points: &[Vec3]| points.iter().step_by(points.len().div_ceil(POINTS).max(1)).copied().collect();
        let bare_points = some(&bare.collect::<Vec<_>>());
        Self { scan_points: some(&scan.points), body_points: some(&body.points), bare_points, scan, body }
    }

    /// The best placement of the scan.
    pub fn align(&self) -> Alignment {
        let (scan_centre, scan_size) = centre_and_size(&self.scan.points);
        let (body_centre, body_size) = centre_and_size(&self.body.points);
        let scale = likely_scale(body_size / scan_size);
        let about_centres = |turn: Mat3| Similarity { scale, turn, shift: body_centre - turn * scan_centre * scale };
        let starts = turns_of_the_cube().chain(turns_of_the_cube().map(|turn| turn * MIRROR)).map(about_centres);
        let mut tried: Vec<(f32, Similarity)> = starts.map(|start| (self.misfit(&start), start)).collect();
        tried.sort_by(|one, other| one.0.total_cmp(&other.0));
        tried.truncate(REFINED);
        let standing = Similarity { scale, ..Similarity::IDENTITY };
        tried.push((0.0, standing));
        let mut found: Vec<(f32, Similarity)> =
            tried.into_iter().map(|(_, start)| self.simplified(self.refined(start))).collect();
        let best = keep_equals(&mut found);
        // Another size has to be worth it, unless no unit explains this one.
        let mut resized: Vec<(f32, Similarity)> =
            found.iter().map(|(_, placement)| self.simplified(self.resized(*placement))).collect();
        let best_resized = keep_equals(&mut resized);
        if best_resized.0 < RESIZED * best.0 || !is_unit(scale) {
            found = resized;
        }
        let best = found[0];
        // What mirrors less and turns less comes first among equals.
        found.sort_by(|one, other| effort(&one.1).total_cmp(&effort(&other.1)));
        let mut different: Vec<Similarity> = Vec::new();
        for (_, placement) in found {
            if different.iter().all(|other| angle_between(other.turn, placement.turn) > SAME_TURN) {
                different.push(placement);
            }
        }
        Alignment {
            placement: different[0],
            alternatives: different[1..].to_vec(),
            before: self.apart(&Similarity::IDENTITY),
            after: self.apart(&best.1),
        }
    }

    /// The median distance of the scan from the body.
    fn apart(&self, placement: &Similarity) -> f32 {
        let distances = self.scan_points.iter().map(|point| self.body.nearest(placement.of(*point)).1);
        percentile(distances.collect(), 0.5).unwrap_or(0.0)
    }

    /// The mean distance between the surfaces, both ways.
    pub fn misfit(&self, placement: &Similarity) -> f32 {
        let mean = |distances: f32, count: usize| distances / count.max(1) as f32;
        let forth = self.scan_points.iter().map(|point| self.body.nearest(placement.of(*point)).1.min(FARTHEST));
        let back = self
            .body_points
            .iter()
            .map(|point| (self.scan.nearest(placement.inverse_of(*point)).1 * placement.scale).min(FARTHEST));
        (mean(forth.sum(), self.scan_points.len()) + mean(back.sum(), self.body_points.len())) / 2.0
    }

    fn refined(&self, start: Similarity) -> Similarity {
        self.settled(start, |placement| self.step(placement, true))
    }

    /// The placement after steps that move the scan no more.
    fn settled(&self, start: Similarity, step: impl Fn(&Similarity) -> Similarity) -> Similarity {
        let (middle, size) = centre_and_size(&self.scan_points);
        let probes = [middle, middle + Vec3::X * size, middle + Vec3::Y * size];
        let mut placement = start;
        for _ in 0..ITERATIONS {
            let next = step(&placement);
            let moved = probes.iter().map(|probe| next.of(*probe).distance(placement.of(*probe))).fold(0.0, f32::max);
            placement = next;
            if moved < SETTLED {
                break;
            }
        }
        placement
    }

    /// The placement in the size that the bare parts of the body tell.
    fn resized(&self, start: Similarity) -> Similarity {
        self.settled(start, |&placement| {
            let pairs = self.bare_points.iter().map(|&point| {
                let (nearest, distance) = self.scan.nearest(placement.inverse_of(point));
                (self.scan.points[nearest], point, distance * placement.scale)
            });
            let near = near_pairs(pairs.collect());
            if near.len() < FEWEST_PAIRS {
                return placement;
            }
            let (from, to) = (mean(near.iter().map(|pair| pair.0)), mean(near.iter().map(|pair| pair.1)));
            let spread = |square: fn(&(Vec3, Vec3, f32), Vec3, Vec3) -> f32| -> f32 {
                near.iter().map(|pair| square(pair, from, to)).sum()
            };
            let body = spread(|pair, _, to| pair.1.distance_squared(to));
            let scan = spread(|pair, from, _| pair.0.distance_squared(from));
            let scale = (body / scan).sqrt();
            if !(scale.is_finite() && scale > 0.0) {
                return placement;
            }
            self.step(&Similarity { scale, shift: to - placement.turn * from * scale, ..placement }, true)
        })
    }

    /// The placement, or a simpler one that is as good, with its misfit.
    fn simplified(&self, refined: Similarity) -> (f32, Similarity) {
        let mut best = (self.misfit(&refined), refined);
        let mut prefer = |candidate: Similarity| {
            let misfit = self.misfit(&candidate);
            if misfit < SIMPLER * best.0 {
                best = (misfit.min(best.0), candidate);
                return true;
            }
            false
        };
        let all = turns_of_the_cube().chain(turns_of_the_cube().map(|turn| turn * MIRROR));
        if let Some(turn) = all.into_iter().find(|turn| angle_between(*turn, refined.turn) < SAME_TURN) {
            let turned = Similarity { turn, shift: self.shift_for(&refined, turn), ..refined };
            let snapped = self.settled(turned, |placement| self.step(placement, false));
            if prefer(snapped) && snapped.shift.length() < SAME_PLACE {
                prefer(Similarity { shift: Vec3::ZERO, ..snapped });
            }
        }
        best
    }

    /// The shift that keeps the scan's centre in its place under another turn.
    fn shift_for(&self, placement: &Similarity, turn: Mat3) -> Vec3 {
        let (centre, _) = centre_and_size(&self.scan.points);
        placement.of(centre) - turn * centre * placement.scale
    }

    /// One step of iterated closest points; the turn stays if it is not to change.
    fn step(&self, placement: &Similarity, turns: bool) -> Similarity {
        let mut pairs: Vec<(Vec3, Vec3, f32)> = Vec::with_capacity(self.scan_points.len() + self.body_points.len());
        for &point in &self.scan_points {
            let (nearest, distance) = self.body.nearest(placement.of(point));
            pairs.push((point, self.body.points[nearest], distance));
        }
        for &point in &self.body_points {
            let (nearest, distance) = self.scan.nearest(placement.inverse_of(point));
            pairs.push((self.scan.points[nearest], point, distance * placement.scale));
        }
        let pairs = near_pairs(pairs);
        let (from, to) = (mean(pairs.iter().map(|pair| pair.0)), mean(pairs.iter().map(|pair| pair.1)));
        let turn = match turns {
            true => {
                let outer = |a: Vec3, b: Vec3| Mat3::from_cols(a * b.x, a * b.y, a * b.z);
                let sum = pairs.iter().fold(Mat3::ZERO, |sum, (one, other, _)| sum + outer(*other - to, *one - from));
                nearest_rotation(sum).unwrap_or(placement.turn)
            }
            false => placement.turn,
        };
        Similarity { turn, shift: to - turn * from * placement.scale, ..*placement }
    }
}

/// Leaves the placements that fit about as well as the best, the best first; returns that.
fn keep_equals(found: &mut Vec<(f32, Similarity)>) -> (f32, Similarity) {
    found.sort_by(|one, other| one.0.total_cmp(&other.0));
    let best = found[0];
    found.retain(|(misfit, _)| *misfit < SIMPLER * best.0);
    best
}

/// The pairs that are not much farther apart than most.
fn near_pairs(mut pairs: Vec<(Vec3, Vec3, f32)>) -> Vec<(Vec3, Vec3, f32)> {
    if pairs.is_empty() {
        return pairs;
    }
    let middle = pairs.len() / 2;
    let (_, &mut (.., median), _) = pairs.select_nth_unstable_by(middle, |one, other| one.2.total_cmp(&other.2));
    pairs.retain(|(.., distance)| *distance <= OUTLIER * median);
    pairs
}

fn mean(points: impl ExactSizeIterator<Item = Vec3>) -> Vec3 {
    let count = points.len().max(1) as f32;
    points.sum::<Vec3>() / count
}

/// How much a placement does to a scan: mirroring is more than any turn.
fn effort(placement: &Similarity) -> f32 {
    let mirrors = if placement.turn.determinant() < 0.0 { 10.0 } else { 0.0 };
    let turn = if mirrors > 0.0 { placement.turn * MIRROR } else { placement.turn };
    mirrors + angle_between(turn, Mat3::IDENTITY)
}

const MIRROR: Mat3 = Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z);

/// The 24 turns that map a cube onto itself.
fn turns_of_the_cube() -> impl Iterator<Item = Mat3> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let pairs = axes.into_iter().flat_map(move |x| axes.into_iter().map(move |y| (x, y)));
    pairs.filter(|(x, y)| x.dot(*y) == 0.0).map(|(x, y)| Mat3::from_cols(x, y, x.cross(y)))
}

/// The centre of evenly spread points, and the root mean square of their distances to it.
fn centre_and_size(points: &[Vec3]) -> (Vec3, f32) {
    let count = points.len().max(1) as f32;
    let centre = points.iter().sum::<Vec3>() / count;
    let squares: f32 = points.iter().map(|point| point.distance_squared(centre)).sum();
    (centre, (squares / count).sqrt())
}

/// The scale of the unit that explains a ratio of sizes, or the ratio itself.
fn likely_scale(body_by_scan: f32) -> f32 {
    let explains = |&&(_, per_metre): &&(&str, f32)| {
        let rest = body_by_scan * per_metre;
        (1.0 / SAME_SIZE..SAME_SIZE).contains(&rest)
    };
    UNITS.iter().find(explains).map_or(body_by_scan, |(_, per_metre)| 1.0 / per_metre)
}

fn is_unit(scale: f32) -> bool {
    UNITS.iter().any(|(_, per_metre)| scale == 1.0 / per_metre)
}

/// The angle of the turn from one orthogonal matrix to another, radians; half a turn if only one of them mirrors.
pub(super) fn angle_between(one: Mat3, other: Mat3) -> f32 {
    let turn = one * other.transpose();
    if turn.determinant() < 0.0 {
        return std::f32::consts::PI;
    }
    ((turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0) / 2.0).clamp(-1.0, 1.0).acos()
}

/// The orthogonal matrix nearest to another one, of the same sign of determinant (Higham 1986); none if it is too singular.
fn nearest_rotation(matrix: Mat3) -> Option<Mat3> {
    let size = matrix.to_cols_array().iter().fold(0.0f32, |size, entry| size.max(entry.abs()));
    let mut turn = matrix * (1.0 / size);
    for _ in 0..30 {
        if turn.determinant().abs() < 1e-6 {
            return None;
        }
        let next = (turn + turn.inverse().transpose()) * 0.5;
        if next.abs_diff_eq(turn, 1e-6) {
            return Some(next);
        }
        turn = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_has_24_turns() {
        let turns: Vec<Mat3> = turns_of_the_cube().collect();
        assert_eq!(turns.len(), 24);
        assert!(turns.iter().all(|turn| turn.determinant() == 1.0));
        let different = |one: usize| turns[one + 1..].iter().all(|other| angle_between(turns[one], *other) > 1.0);
        assert!((0..24).all(different));
    }

    #[test]
    fn the_nearest_rotation_undoes_noise() {
        let turn = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-1.2);
        let noisy = Mat3::from_cols_array(&std::array::from_fn(|entry| {
            turn.to_cols_array()[entry] * 3.0 + 0.05 * ((entry * 7 % 5) as f32 - 2.0)
        }));
        let found = nearest_rotation(noisy).unwrap();
        assert!((found * found.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-5));
        assert!(angle_between(found, turn) < 0.05);
        assert!(nearest_rotation(noisy * MIRROR).unwrap().determinant() < 0.0);
        assert_eq!(nearest_rotation(Mat3::ZERO), None);
    }

    #[test]
    fn scales_are_units_where_one_explains_them() {
        for (_, per_metre) in UNITS {
            for clothing in [0.85, 1.0, 1.15] {
                assert_eq!(likely_scale(clothing / per_metre), 1.0 / per_metre);
            }
        }
        assert_eq!(likely_scale(0.5), 0.5);
    }
}

//! A plane that what a scan shows stands on.

use std::collections::HashSet;

use glam::{IVec2, Vec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::components::{FaceComponents, face_components, with_faces};
use crate::{SurfaceSampler, TriangleMesh};

/// Points of the surface that planes are tried on, and those of them that most planes are rejected by.
const POINTS: usize = 3000;
const FEW: usize = 400;
/// Planes through three of them, and through three of the best plane's.
const TRIALS: (usize, usize) = (1000, 200);
/// Levels that are tried along each axis, in the lowest fifth.
const LEVELS: usize = 50;
/// How flat ground is at least, by the height of what stands on it, and how much is cut at least.
const FLATNESS: (f32, f32) = (0.012, 0.003);
/// What is cut, in typical deviations of the ground from its plane.
const DEVIATIONS: f32 = 6.0;
/// Parts that are connected to nothing higher than this, by the height, are of the ground.
const PARTS: f32 = 0.03;
/// How far under the ground there may be something, a pedestal's foot, by that height.
const DEPTH: f32 = 0.1;
/// What is under it is at most so many times the ground.
const UNDER: f32 = 1.5;
/// The share of points that may be deeper.
const STRAY: f32 = 0.005;
/// The least share of ground in the surface: shoes' soles have less.
const LEAST: f32 = 0.06;
/// What stands on ground begins there: nowhere up to its middle is a gap of more than this, by its height. Beside another person is one.
const GAP: f32 = 0.15;
/// Who stands is no wider than this by his height. Under what one side of a person shows, its foremost place, something wide is.
const WIDEST: f32 = 1.5;
/// The width of the columns that are looked at over the ground, by the height, and the least share of ground that has nothing in them. Over
/// a back that touches a plane is the chest.
const COLUMN: f32 = 0.06;
const FREE: f32 = 1.0 / 3.0;
/// How far its faces are turned to what stands on it, as a mean cosine. Soles, backs and whatever touches a plane face away.
const TURNED: f32 = 0.6;

/// Ground.
pub(super) struct Ground {
    /// Unit, to the side of what stands on it.
    normal: Vec3,
    /// A place on it.
    place: Vec3,
    /// How far above it things still are of it: faces, and parts that are connected to nothing higher.
    thickness: f32,
    of_parts: f32,
}

/// A point of a surface, with the face's normal.
#[derive(Clone, Copy)]
struct Oriented {
    place: Vec3,
    normal: Vec3,
}

/// A plane whose points are ground.
#[derive(Clone, Copy)]
struct Plane {
    normal: Vec3,
    place: Vec3,
    /// Of what stands on it.
    height: f32,
    /// Points of the ground.
    count: usize,
    /// Those, each by how near the plane it is: 1 on it, 0 as far as ground goes.
    score: f32,
}

impl Ground {
    /// The ground that most of a scan's surface is of, if any is.
    pub fn find(scan: &TriangleMesh) -> Option<Self> {
        let sampler = SurfaceSampler::new(scan, None).ok()?;
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let points: Vec<Oriented> = (0..POINTS)
            .map(|_| sampler.sample(&mut rng))
            .map(|point| Oriented { place: scan.position_at(&point), normal: scan.face_normal(point.face) })
            .collect();
        let tried = levels(&points).chain(through_three_of(&points, TRIALS.0, &mut rng));
        let best = best_of(tried, &points)?;
        let on_it: Vec<Oriented> = points.iter().copied().filter(|point| best.has(point.place)).collect();
        let nearby = through_three_of(&on_it, TRIALS.1, &mut rng).chain([(best.place, best.normal)]);
        best_of(nearby, &points).map(|best| best.as_ground(&points))
    }

    /// What is left of a scan without the ground and what is under it.
    pub fn cut(&self, scan: &TriangleMesh) -> TriangleMesh {
        let above = |corner: &Vec3| self.normal.dot(*corner - self.place);
        let rises = |face: &[u32; 3], height: f32| face.iter().any(|&at| above(&scan.vertices[at as usize]) >= height);
        let standing = scan.faces.iter().copied().filter(|face| rises(face, self.thickness)).collect();
        let (standing, _) = with_faces(scan, standing);
        let FaceComponents { of_face, count } = face_components(&standing.merged_by_position());
        let mut is_high = vec![false; count];
        for (face, &part) in of_face.iter().enumerate() {
            is_high[part as usize] |= standing.corners(face as u32).iter().any(|corner| above(corner) >= self.of_parts);
        }
        let high = standing.faces.iter().zip(&of_face).filter(|(_, part)| is_high[**part as usize]);
        with_faces(&standing, high.map(|(face, _)| *face).collect()).0
    }
}

impl Plane {
    /// A plane, if it is ground.
    fn of(place: Vec3, normal: Vec3, points: &[Oriented]) -> Option<Self> {
        let (low, high) = points.iter().fold((0.0_f32, 0.0_f32), |(low, high), point| {
            let above = normal.dot(point.place - place);
            (low.min(above), high.max(above))
        });
        let (normal, height) = if high >= -low { (normal, high) } else { (-normal, -low) };
        let mut plane = Self { normal, place, height, count: 0, score: 0.0 };
        let (mut under, mut deep, mut turned) = (0, 0, 0.0);
        for point in points {
            let off = plane.above(point.place) / (FLATNESS.0 * height);
            if off.abs() < 1.0 {
                plane.count += 1;
                plane.score += 1.0 - off * off;
                turned += normal.dot(point.normal);
            }
            under += usize::from(off <= -1.0);
            deep += usize::from(plane.above(point.place) < -DEPTH * height);
        }
        let share = |count: usize| count as f32 / points.len() as f32;
        let is_flat = share(plane.count) >= LEAST && turned >= TURNED * plane.count as f32;
        let is_lowest = share(deep) <= STRAY && under as f32 <= UNDER * plane.count as f32;
        (is_flat && is_lowest && plane.is_stood_on(points)).then_some(plane)
    }

    /// Whether what is above the plane begins there, is not much wider than tall, and leaves much of the plane free.
    fn is_stood_on(&self, points: &[Oriented]) -> bool {
        let (right, front) = self.normal.any_orthonormal_pair();
        let least = FLATNESS.0 * self.height;
        let all = || points.iter().map(|point| point.place);
        let standing = || all().filter(|place| self.above(*place) >= least);
        let column = |place: Vec3| {
            let from = place - self.place;
            (Vec2::new(right.dot(from), front.dot(from)) / (COLUMN * self.height)).floor().as_ivec2()
        };
        let columns: HashSet<IVec2> = standing().map(column).collect();
        let fold = |of: fn(IVec2, IVec2) -> IVec2| columns.iter().copied().reduce(of).unwrap_or_default();
        let width = COLUMN * (fold(IVec2::max) - fold(IVec2::min)).max_element() as f32;
        let free = all().filter(|place| self.has(*place) && !columns.contains(&column(*place))).count();
        let mut heights: Vec<f32> = standing().map(|place| self.above(place)).collect();
        heights.sort_by(f32::total_cmp);
        let lower = std::iter::once(least).chain(heights.iter().take(heights.len() / 2 + 1).copied());
        let gap = lower.clone().zip(lower.skip(1)).map(|(one, next)| next - one).fold(0.0, f32::max);
        width <= WIDEST && free as f32 >= FREE * self.count as f32 && gap <= GAP * self.height
    }

    fn above(&self, point: Vec3) -> f32 {
        self.normal.dot(point - self.place)
    }

    fn has(&self, point: Vec3) -> bool {
        self.above(point).abs() < FLATNESS.0 * self.height
    }

    fn as_ground(self, points: &[Oriented]) -> Ground {
        let on_it = points.iter().map(|point| point.place).filter(|place| self.has(*place));
        let mut off: Vec<f32> = on_it.map(|place| self.above(place).abs()).collect();
        let middle = off.len() / 2;
        let typical = *off.select_nth_unstable_by(middle, f32::total_cmp).1;
        let thickness = (DEVIATIONS * typical).clamp(FLATNESS.1 * self.height, FLATNESS.0 * self.height);
        Ground { normal: self.normal, place: self.place, thickness, of_parts: PARTS * self.height }
    }
}

/// Of planes, each a place and a normal, the one that lies best on ground.
fn best_of(planes: impl Iterator<Item = (Vec3, Vec3)>, points: &[Oriented]) -> Option<Plane> {
    let is_worth_a_look = |(place, normal): &(Vec3, Vec3)| {
        let above = |point: &Oriented| normal.dot(point.place - *place);
        let few = &points[..FEW.min(points.len())];
        let height = few.iter().map(|point| above(point).abs()).fold(0.0, f32::max);
        let near = few.iter().filter(|point| above(point).abs() < FLATNESS.0 * height).count();
        2.0 * near as f32 >= LEAST * few.len() as f32
    };
    let looked_at = planes.filter(is_worth_a_look);
    looked_at.filter_map(|(place, normal)| Plane::of(place, normal, points)).max_by(|a, b| a.score.total_cmp(&b.score))
}

/// Planes through three points each, drawn at random.
fn through_three_of(points: &[Oriented], count: usize, rng: &mut ChaCha8Rng) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..count).filter_map(|_| {
        let [a, b, c] = std::array::from_fn(|_| points[rng.random_range(0..points.len())].place);
        Some((a, (b - a).cross(c - a).try_normalize()?))
    })
}

/// Planes across the axes, either way up, in the lowest fifth of the points.
fn levels(points: &[Oriented]) -> impl Iterator<Item = (Vec3, Vec3)> {
    let axes = [Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X];
    axes.into_iter().flat_map(|axis| {
        let heights = || points.iter().map(|point| axis.dot(point.place));
        let (low, high) = (heights().fold(f32::INFINITY, f32::min), heights().fold(f32::NEG_INFINITY, f32::max));
        (0..LEVELS).map(move |level| (axis * (low + 0.2 * (high - low) * level as f32 / LEVELS as f32), axis))
    })
}

//! What a scan shows besides its subject: the ground it stands on, and what floats around it.
//!
//! Lengths are taken by the subject's height, so that the unit does not matter, and directions from the ground itself. What is thrown away is
//! only what no person can be: a plane that all the rest stands on, and parts too far from the rest for their size.

mod clusters;
mod ground;

use std::fmt;

use glam::Vec3;

use self::clusters::Clusters;
use self::ground::Ground;
use super::components::with_faces;
use super::{Component, TriangleMesh, largest_component};

/// Parts nearer to each other than this belong together, by the subject's height.
const NEAR: f32 = 0.03;
/// Larger parts do from this far: a hand beyond a hole in the sleeve.
const FAR: f32 = 0.1;
/// What makes a part one of those, by the subject's surface.
const LARGER: f64 = 0.01;
/// What makes it another subject.
const RIVAL: f64 = 0.5;
/// A scan that shows less than this besides its subject, by its surface, is left as it is.
const MATTERS: f64 = 0.005;

/// What of a mesh is not its subject.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// The share of the ground, and of what is under it, in the mesh's surface; 0 if there is none.
    pub ground: f64,
    /// How many parts float around the subject.
    pub loose: usize,
    /// Their share in the surface.
    pub loose_share: f64,
    /// Those of them that are as large as another subject.
    pub rivals: usize,
}

impl Surroundings {
    /// The share of all of it in the mesh's surface.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.ground + self.loose_share
    }
}

impl fmt::Display for Surroundings {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| format!("{:.1} % of the surface", 100.0 * share);
        if self.ground > 0.0 {
            write!(formatter, "the ground ({})", percent(self.ground))?;
        }
        if self.loose > 0 {
            let (and, s) = (if self.ground > 0.0 { " and " } else { "" }, if self.loose == 1 { "" } else { "s" });
            write!(formatter, "{and}{} loose part{s} ({})", self.loose, percent(self.loose_share))?;
        }
        Ok(())
    }
}

/// The subject of a scan alone, and what was taken away; none if the scan shows hardly anything else.
#[must_use]
pub fn without_surroundings(scan: &TriangleMesh) -> Option<(TriangleMesh, Surroundings)> {
    let area = scan.area();
    if !(area.is_finite() && area > 0.0) {
        return None;
    }
    let ground = Ground::find(scan);
    let standing = ground.as_ref().map_or_else(|| scan.clone(), |ground| ground.cut(scan));
    let ground = ground.map_or(0.0, |_| 1.0 - standing.area() / area);

    let Component { mesh: largest, others, .. } = largest_component(&standing);
    let height = height(&largest);
    if others == 0 || height <= 0.0 {
        let found = Surroundings { ground, ..Surroundings::default() };
        return (ground > MATTERS).then_some((standing, found));
    }
    let near = Clusters::of(&standing, NEAR * height);
    let least = LARGER * near.areas[near.largest];
    let is_larger: Vec<bool> = near.areas.iter().map(|area| *area >= least).collect();
    let larger: Vec<u32> =
        (0..near.of_face.len() as u32).filter(|&face| is_larger[near.of_face[face as usize] as usize]).collect();
    let (larger, _) = with_faces(&standing, larger.iter().map(|&face| standing.faces[face as usize]).collect());
    let far = Clusters::of(&larger, FAR * height);
    let (subject, _) = far.largest_of(&larger);

    let rivals = far.areas.iter().filter(|part| **part >= RIVAL * far.areas[far.largest]).count() - 1;
    let loose = is_larger.iter().filter(|is_larger| !**is_larger).count() + far.areas.len() - 1;
    let loose_share = (standing.area() - subject.area()) / area;
    let found = Surroundings { ground, loose, loose_share, rivals };
    (found.share() > MATTERS).then_some((subject, found))
}

/// The longest side of the box around a mesh.
fn height(mesh: &TriangleMesh) -> f32 {
    let fold = |of: fn(Vec3, Vec3) -> Vec3| mesh.vertices.iter().copied().reduce(of).unwrap_or_default();
    (fold(Vec3::max) - fold(Vec3::min)).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::random_points;
    use crate::{ExtractionGrid, Sign, extract};

    /// A figure 1.7 high that stands at y = 0, of capsules: trunk and head, legs, arms stretched out; of its left arm the part at `gap` is missing.
    fn figure(gap: std::ops::Range<f32>) -> TriangleMesh {
        let grid = ExtractionGrid {
            minimum: Vec3::new(-1.0, -0.1, -1.0),
            maximum: Vec3::new(1.0, 1.9, 1.0),
            resolution: 90,
            level: 0.0,
            inside_is: Sign::Negative,
        };
        let bones = [
            ([0.0, 0.9, 0.0], [0.0, 1.55, 0.0], 0.15),
            ([-0.1, 0.08, 0.0], [-0.1, 0.9, 0.0], 0.08),
            ([0.1, 0.08, 0.0], [0.1, 0.9, 0.0], 0.08),
            ([0.0, 1.4, 0.0], [-0.75, 1.4, 0.0], 0.06),
            ([0.0, 1.4, 0.0], [gap.start, 1.4, 0.0], 0.06),
            ([gap.end, 1.4, 0.0], [0.75, 1.4, 0.0], 0.06),
        ];
        let distance = |point: Vec3| {
            let to_bone = |(a, b, radius): &([f32; 3], [f32; 3], f32)| {
                let (a, b) = (Vec3::from(*a), Vec3::from(*b));
                let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                point.distance(a + (b - a) * along) - radius
            };
            bones.iter().map(to_bone).fold(f32::INFINITY, f32::min)
        };
        let field =
            |points: &[Vec3], values: &mut [f32]| points.iter().zip(values).for_each(|(p, v)| *v = distance(*p));
        extract(&field, grid).unwrap().mesh
    }

    fn whole_figure() -> TriangleMesh {
        figure(0.4..0.4)
    }

    fn added(mesh: &TriangleMesh, other: &TriangleMesh, to: Vec3) -> TriangleMesh {
        let first = mesh.vertices.len() as u32;
        let mut both =
            TriangleMesh { vertices: mesh.vertices.clone(), faces: mesh.faces.clone(), ..Default::default() };
        both.vertices.extend(other.vertices.iter().map(|vertex| *vertex + to));
        both.faces.extend(other.faces.iter().map(|face| face.map(|vertex| vertex + first)));
        both
    }

    /// A square of ground, or a disc if it is `round`, whose heights are off by up to `noise`.
    fn ground(width: f32, is_round: bool, noise: f32) -> TriangleMesh {
        const CELLS: u32 = 80;
        let bumps = random_points(((CELLS + 1) * (CELLS + 1)) as usize, noise.max(1e-6), 1);
        let place = |index: u32| {
            let side = |at: u32| width * (at as f32 / CELLS as f32 - 0.5);
            Vec3::new(side(index / (CELLS + 1)), bumps[index as usize].y, side(index % (CELLS + 1)))
        };
        let vertices: Vec<Vec3> = (0..(CELLS + 1) * (CELLS + 1)).map(place).collect();
        let corner = |x: u32, z: u32| x * (CELLS + 1) + z;
        let quad = |index: u32| {
            let (x, z) = (index / CELLS, index % CELLS);
            let [a, b, c, d] = [corner(x, z), corner(x, z + 1), corner(x + 1, z), corner(x + 1, z + 1)];
            [[a, b, c], [b, d, c]]
        };
        let is_in =
            |face: &[u32; 3]| !is_round || face.iter().all(|vertex| vertices[*vertex as usize].length() < width / 2.0);
        let faces: Vec<[u32; 3]> = (0..CELLS * CELLS).flat_map(quad).filter(is_in).collect();
        TriangleMesh { vertices, faces, ..Default::default() }
    }

    /// The share of the figure's surface in a mesh that has nothing else.
    fn kept(found: &TriangleMesh) -> f64 {
        found.area() / whole_figure().area()
    }

    #[test]
    fn a_subject_alone_is_left_as_it_is() {
        assert!(without_surroundings(&whole_figure()).is_none());
        let mut inside_out = whole_figure();
        inside_out.faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert!(without_surroundings(&inside_out).is_none());
        assert!(without_surroundings(&TriangleMesh::default()).is_none());
        // Seen from one side only, as a depth camera does: neither its foremost nor its hindmost places are ground.
        for side in [-1.0, 1.0] {
            let mut seen = whole_figure();
            seen.faces.retain(|face| face.iter().all(|vertex| side * seen.vertices[*vertex as usize].z > 0.0));
            assert!(without_surroundings(&seen).is_none());
        }
        // A crumb or two.
        let crumb = added(&whole_figure(), &ground(0.02, false, 0.0), Vec3::new(0.7, 0.5, 0.7));
        assert!(without_surroundings(&crumb).is_none());
    }

    #[test]
    fn ground_is_cut_away_in_any_direction_and_unit_and_feet_stay() {
        let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.4, 1.0, -0.2);
        for (ground, scale, is_turned) in [
            (ground(3.0, false, 0.004), 1.0, false),
            (ground(3.0, false, 0.004), 1000.0, true),
            (ground(12.0, false, 0.0), 1.0, true),
            (ground(0.9, true, 0.002), 100.0, false),
        ] {
            let mut scan = added(&whole_figure(), &ground, Vec3::ZERO);
            let turn = if is_turned { turn } else { glam::Quat::IDENTITY };
            scan.vertices.iter_mut().for_each(|vertex| *vertex = turn * *vertex * scale);
            let (mut found, surroundings) = without_surroundings(&scan).unwrap();
            found.vertices.iter_mut().for_each(|vertex| *vertex = turn.inverse() * *vertex / scale);
            let share = ground.area() / (ground.area() + whole_figure().area());
            assert!((surroundings.ground - share).abs() < 0.02, "{surroundings:?}, a share of {share}");
            assert_eq!((surroundings.loose, surroundings.rivals), (0, 0));
            assert!((0.975..1.0).contains(&kept(&found)), "{}", kept(&found));
            let lowest = found.vertices.iter().map(|vertex| vertex.y).fold(f32::INFINITY, f32::min);
            assert!((-0.001..0.02).contains(&lowest), "{lowest}");
        }
    }

    #[test]
    fn a_pedestal_goes_with_what_is_under_its_top() {
        let (top, foot) = (ground(1.0, true, 0.0), ground(1.0, true, 0.0));
        let scan = added(&added(&whole_figure(), &top, Vec3::ZERO), &foot, Vec3::NEG_Y * 0.12);
        let (found, surroundings) = without_surroundings(&scan).unwrap();
        assert!((0.975..1.0).contains(&kept(&found)), "{}", kept(&found));
        assert!(surroundings.to_string().starts_with("the ground ("), "{surroundings}");
    }

    #[test]
    fn parts_that_float_go_and_a_hand_beyond_a_hole_stays() {
        let crumb = ground(0.1, false, 0.0);
        let places = [[0.8, 0.4, 0.6], [-0.7, 0.9, -0.5], [0.5, 1.8, 0.4]];
        let torn = figure(0.4..0.62);
        let scan = places.iter().fold(torn.clone(), |scan, place| added(&scan, &crumb, Vec3::from(*place)));
        let (found, surroundings) = without_surroundings(&scan).unwrap();
        assert_eq!((surroundings.ground, surroundings.loose, surroundings.rivals), (0.0, 3, 0));
        assert!((found.area() - torn.area()).abs() < 1e-6);
        assert!(surroundings.to_string().starts_with("3 loose parts ("), "{surroundings}");
    }

    #[test]
    fn another_subject_is_counted() {
        for apart in [0.8, 1.5, 4.0] {
            let scan = added(&whole_figure(), &whole_figure(), Vec3::Z * apart);
            let (found, surroundings) = without_surroundings(&scan).unwrap();
            assert_eq!((surroundings.ground, surroundings.loose, surroundings.rivals), (0.0, 1, 1));
            assert!((kept(&found) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn numbers_that_no_scan_has_do_no_harm() {
        let mut far = whole_figure();
        far.vertices[0] = Vec3::splat(1e30);
        let _ = without_surroundings(&far);
        let mut endless = whole_figure();
        endless.vertices[0] = Vec3::splat(f32::MAX);
        let _ = without_surroundings(&endless);
        let flat = ground(1.0, false, 0.0);
        let _ = without_surroundings(&flat);
    }
}

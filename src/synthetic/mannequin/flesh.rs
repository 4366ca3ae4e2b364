//! The mannequin's body as a signed distance: round cones and ellipsoids under a smooth union, and its surface as a mesh.
//!
//! d = smin(d, d_i, k_i) in the recipe's order, with the polynomial smin of width k (Quilez). Distances are exact for limbs
//! and first-order for ellipsoids; only their zero set is used. The grid is uniform in a space that magnifies hands and
//! head, so that fingers get small triangles and the torso large ones. Metres.

use glam::Vec3;
use rayon::prelude::*;

use super::recipe::{Magnifier, MeshDetail, Recipe, joint_index, malformed, twin};
use crate::formats::Result;
use crate::mesh::{ExtractionGrid, Sign, TriangleMesh, extract};

/// Width over which the flat soles melt into the feet.
const SOLE_BLEND: f32 = 0.012;
/// Step of the central differences that give gradients.
const GRADIENT_STEP: f32 = 5e-4;

/// The body's solids.
pub(super) struct Flesh {
    solids: Vec<Solid>,
    sole: f32,
}

struct Solid {
    shape: Shape,
    joint: usize,
    blend: f32,
    carve: bool,
    /// Middle and radius of a sphere around it.
    bounds: (Vec3, f32),
}

enum Shape {
    Limb { from: Vec3, to: Vec3, radii: [f32; 2] },
    Mass { centre: Vec3, radii: Vec3 },
}

impl Flesh {
    pub(super) fn of(recipe: &Recipe) -> Result<Self> {
        let mut solids = Vec::new();
        for mass in &recipe.flesh.masses {
            let shape = Shape::Mass { centre: mass.centre.into(), radii: mass.radii.into() };
            push_with_twin(&mut solids, Solid::new(shape, joint_index(&mass.joint)?, mass.blend, mass.carve));
        }
        for limb in &recipe.flesh.limbs {
            let shape = Shape::Limb { from: limb.from.into(), to: limb.to.into(), radii: limb.radii };
            push_with_twin(&mut solids, Solid::new(shape, joint_index(&limb.joint)?, limb.blend, false));
        }
        Ok(Self { solids, sole: recipe.mesh.sole })
    }

    /// The signed distance, negative inside.
    pub(super) fn distance(&self, point: Vec3) -> f32 {
        let mut distance = f32::MAX;
        for solid in &self.solids {
            let (middle, radius) = solid.bounds;
            if !solid.carve && point.distance(middle) - radius > distance + solid.blend {
                continue;
            }
            let own = solid.distance(point);
            distance = if solid.carve {
                -smooth_minimum(-distance, own, solid.blend)
            } else {
                smooth_minimum(distance, own, solid.blend)
            };
        }
        -smooth_minimum(-distance, point.y - self.sole, SOLE_BLEND)
    }

    /// The joint that moves the solid nearest to a point.
    pub(super) fn joint_at(&self, point: Vec3) -> usize {
        let solids = self.solids.iter().filter(|solid| !solid.carve);
        let nearest = solids.min_by(|a, b| a.distance(point).total_cmp(&b.distance(point)));
        nearest.map_or(0, |solid| solid.joint)
    }

    /// The nearest surface point along the gradient, by two Newton steps.
    pub(super) fn onto_surface(&self, mut point: Vec3) -> Vec3 {
        for _ in 0..2 {
            let gradient = self.gradient(point);
            point -= gradient * (self.distance(point) / gradient.length_squared().max(0.25));
        }
        point
    }

    fn gradient(&self, point: Vec3) -> Vec3 {
        let along =
            |axis: Vec3| self.distance(point + axis * GRADIENT_STEP) - self.distance(point - axis * GRADIENT_STEP);
        Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z)) / (2.0 * GRADIENT_STEP)
    }

    /// The surface as one closed mesh, its triangles evened out.
    pub(super) fn mesh(&self, detail: &MeshDetail) -> Result<TriangleMesh> {
        let space = MagnifiedSpace { arms: detail.arms, head: detail.head, feet: detail.feet };
        let field = |points: &[Vec3], distances: &mut [f32]| {
            for (point, distance) in points.iter().zip(distances) {
                let (place, magnification) = space.to_body(*point);
                // Kept comparable between regions, or the search for the surface would think hands far away.
                *distance = self.distance(place) * magnification;
            }
        };
        let (minimum, maximum) = (Vec3::new(-2.2, -1.55, -0.75), Vec3::new(2.2, 1.15, 0.75));
        let resolution = ((maximum - minimum).max_element() / detail.cell).round() as usize;
        let grid = ExtractionGrid { minimum, maximum, resolution, level: 0.0, inside_is: Sign::Negative };
        let mut mesh = extract(&field, grid).map_err(|error| malformed("flesh", error.to_string(), "a solid"))?.mesh;
        mesh.vertices.par_iter_mut().for_each(|vertex| *vertex = self.onto_surface(space.to_body(*vertex).0));
        self.even_out(&mut mesh);
        Ok(mesh)
    }

    /// Moves vertices to the mean of their neighbours and back onto the surface, a few times.
    fn even_out(&self, mesh: &mut TriangleMesh) {
        const ROUNDS: usize = 4;
        let neighbours = super::surface::neighbours(mesh.vertices.len(), &mesh.faces);
        for _ in 0..ROUNDS {
            let moved = mesh.vertices.par_iter().enumerate().map(|(vertex, position)| {
                let around = &neighbours[vertex];
                let mean =
                    around.iter().map(|other| mesh.vertices[*other as usize]).sum::<Vec3>() / around.len() as f32;
                self.onto_surface(position.lerp(mean, 0.5))
            });
            mesh.vertices = moved.collect();
        }
    }
}

impl Solid {
    fn new(shape: Shape, joint: usize, blend: f32, carve: bool) -> Self {
        let bounds = match &shape {
            Shape::Limb { from, to, radii } => ((*from + *to) / 2.0, from.distance(*to) / 2.0 + radii[0].max(radii[1])),
            Shape::Mass { centre, radii } => (*centre, radii.max_element()),
        };
        Self { shape, joint, blend, carve, bounds }
    }

    fn distance(&self, point: Vec3) -> f32 {
        match &self.shape {
            Shape::Limb { from, to, radii } => round_cone(point, *from, *to, *radii),
            Shape::Mass { centre, radii } => {
                let scaled = (point - *centre) / *radii;
                let steepness = (scaled / *radii).length();
                if steepness < 1e-6 {
                    -radii.min_element()
                } else {
                    scaled.length() * (scaled.length() - 1.0) / steepness
                }
            }
        }
    }

    fn mirrored(&self) -> Option<Self> {
        let flip = |point: Vec3| Vec3::new(-point.x, point.y, point.z);
        let (off_middle, shape) = match &self.shape {
            Shape::Limb { from, to, radii } => {
                (to.x != 0.0, Shape::Limb { from: flip(*from), to: flip(*to), radii: *radii })
            }
            Shape::Mass { centre, radii } => (centre.x != 0.0, Shape::Mass { centre: flip(*centre), radii: *radii }),
        };
        off_middle.then(|| Self::new(shape, twin(self.joint), self.blend, self.carve))
    }
}

fn push_with_twin(solids: &mut Vec<Solid>, solid: Solid) {
    let twin = solid.mirrored();
    solids.push(solid);
    solids.extend(twin);
}

fn smooth_minimum(a: f32, b: f32, width: f32) -> f32 {
    let overlap = (width - (a - b).abs()).max(0.0);
    let bulge = if overlap > 0.0 { overlap * overlap / (4.0 * width) } else { 0.0 };
    a.min(b) - bulge
}

/// The distance to the hull of two spheres (Quilez, `sdRoundCone`).
fn round_cone(point: Vec3, from: Vec3, to: Vec3, [start, end]: [f32; 2]) -> f32 {
    let axis = to - from;
    let length_squared = axis.length_squared();
    let taper = start - end;
    let slant_squared = length_squared - taper * taper;
    let offset = point - from;
    let along = offset.dot(axis);
    let beyond = along - length_squared;
    let across_squared = (offset * length_squared - axis * along).length_squared();
    let along_squared = along * along * length_squared;
    let beyond_squared = beyond * beyond * length_squared;
    let cone = taper.signum() * taper * taper * across_squared;
    if beyond.signum() * slant_squared * beyond_squared > cone {
        (across_squared + beyond_squared).sqrt() / length_squared - end
    } else if along.signum() * slant_squared * along_squared < cone {
        (across_squared + along_squared).sqrt() / length_squared - start
    } else {
        ((across_squared * slant_squared / length_squared).sqrt() + along * taper) / length_squared - start
    }
}

/// A space in which hands and head are larger, so that equal cells there are small cells of the body.
struct MagnifiedSpace {
    arms: Magnifier,
    head: Magnifier,
    feet: Magnifier,
}

impl MagnifiedSpace {
    /// The point of the body that a point of this space shows, and the magnification there.
    fn to_body(&self, point: Vec3) -> (Vec3, f32) {
        let beyond_elbow = point.x.abs() - self.arms.start;
        if beyond_elbow > 0.0 {
            let (length, magnification) = self.arms.shrink(beyond_elbow);
            let [y, z] = self.arms.centre;
            let place = Vec3::new(
                (self.arms.start + length).copysign(point.x),
                y + (point.y - y) / magnification,
                z + (point.z - z) / magnification,
            );
            return (place, magnification);
        }
        // The head grows upwards from its start, the feet downwards.
        for (region, sign) in [(&self.head, 1.0), (&self.feet, -1.0)] {
            let beyond = (point.y - region.start) * sign;
            if beyond > 0.0 {
                let (length, magnification) = region.shrink(beyond);
                let [x, z] = region.centre;
                let place = Vec3::new(
                    x + (point.x - x) / magnification,
                    region.start + sign * length,
                    z + (point.z - z) / magnification,
                );
                return (place, magnification);
            }
        }
        (point, 1.0)
    }
}

impl Magnifier {
    /// The body's length for a length of magnified space, and the magnification at its end:
    /// m(t) = 1 + (m - 1) t / ramp up to the ramp's end; the length is the integral of 1 / m.
    fn shrink(&self, length: f32) -> (f32, f32) {
        let rise = self.magnification - 1.0;
        let in_ramp = length.min(self.ramp);
        let magnification = 1.0 + rise * in_ramp / self.ramp;
        (self.ramp / rise * magnification.ln() + (length - in_ramp) / self.magnification, magnification)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The hull of two spheres is the union of all spheres between them.
    #[test]
    fn a_round_cone_is_the_union_of_the_spheres_along_it() {
        let (from, to, radii) = (Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.5, 0.1, 0.2), [0.15, 0.06]);
        for sample in 0..500 {
            let angle = sample as f32;
            let point = Vec3::new(angle.sin(), (1.7 * angle).cos() * 0.6, (0.3 * angle).sin()) * 0.7;
            let sphere = |step: i32| {
                let along = step as f32 / 2000.0;
                point.distance(from.lerp(to, along)) - (radii[0] + (radii[1] - radii[0]) * along)
            };
            let union = (0..=2000).map(sphere).fold(f32::MAX, f32::min);
            assert!((round_cone(point, from, to, radii) - union).abs() < 1e-4, "{point}");
        }
    }

    #[test]
    fn a_blend_only_adds_flesh_and_only_near_both() {
        for (a, b) in [(0.0, 0.0), (0.3, 0.31), (-0.2, 0.1), (1.0, 0.2)] {
            let blended = smooth_minimum(a, b, 0.05);
            assert!(blended <= f32::min(a, b) && blended >= f32::min(a, b) - 0.05 / 4.0 - 1e-6);
            assert_eq!(blended < f32::min(a, b), f32::abs(a - b) < 0.05);
            assert_eq!(smooth_minimum(a, b, 0.0), f32::min(a, b));
        }
    }

    #[test]
    fn the_flesh_is_the_same_on_both_sides_and_points_come_onto_it() {
        let flesh = Flesh::of(&Recipe::embedded().unwrap()).unwrap();
        for start in [Vec3::new(0.83, 0.12, 0.04), Vec3::new(0.1, -0.6, 0.1), Vec3::new(0.03, 0.25, 0.12)] {
            let mirrored = Vec3::new(-start.x, start.y, start.z);
            assert!((flesh.distance(start) - flesh.distance(mirrored)).abs() < 1e-4);
            assert_eq!(twin(flesh.joint_at(start)), flesh.joint_at(mirrored));
            assert!(flesh.distance(flesh.onto_surface(start)).abs() < 0.1 * flesh.distance(start).abs());
        }
    }

    // d length / d t = 1 / m(t), and both ends of the ramp are smooth.
    #[test]
    fn magnified_lengths_are_the_integral_of_one_over_the_magnification() {
        let magnifier = Magnifier { start: 0.5, ramp: 0.1, magnification: 4.0, centre: [0.0, 0.0] };
        assert_eq!(magnifier.shrink(0.0), (0.0, 1.0));
        for length in [0.02, 0.06, 0.0995, 0.1005, 0.3] {
            let ((before, m0), (after, m1)) = (magnifier.shrink(length - 1e-3), magnifier.shrink(length + 1e-3));
            let slope = (after - before) / 2e-3;
            assert!((slope * (m0 + m1) / 2.0 - 1.0).abs() < 1e-2, "{length}");
        }
    }
}

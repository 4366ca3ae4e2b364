//! A bounding volume hierarchy over the triangles of a mesh: flat, binary, split by the surface area heuristic.
//!
//! Children stand after their parent, so a backward sweep over the nodes sees children first. Leaves hold runs of
//! triangles, which are stored in that order. Depth is bounded: see [`DEEPEST`].

use glam::Vec3;

use super::TriangleMesh;
use crate::{Error, Result};

/// Depth from which nodes are split at the median, which leaves at most 31 levels for 2^31 faces.
const DEEPEST_BY_HEURISTIC: usize = 32;
/// No path through a hierarchy is longer, so a stack of this size holds every traversal.
pub(super) const DEEPEST: usize = 64;
const FACES_A_LEAF: usize = 4;
const BINS: usize = 12;

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) minimum: Vec3,
    /// First triangle of a leaf, or the second child; the first child follows its parent.
    start: u32,
    pub(super) maximum: Vec3,
    /// Triangles of a leaf; zero for an inner node.
    count: u32,
}

pub(super) enum Contents {
    Leaf(std::ops::Range<usize>),
    Children([usize; 2]),
}

impl Node {
    /// What node number `index` holds.
    #[inline(always)]
    pub(super) fn contents(&self, index: usize) -> Contents {
        let start = self.start as usize;
        if self.count == 0 {
            Contents::Children([index + 1, start])
        } else {
            Contents::Leaf(start..start + self.count as usize)
        }
    }

    /// Squared distance from a point to the box, square metres.
    #[inline(always)]
    pub(super) fn distance_squared(&self, point: Vec3) -> f32 {
        (self.minimum - point).max(point - self.maximum).max(Vec3::ZERO).length_squared()
    }
}

/// A face as traversals need it: a corner, the two sides from it, and its number in the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corner: Vec3,
    pub(super) sides: [Vec3; 2],
    pub(super) face: u32,
    /// Whether it is all but an edge or a point, where the sign of an area says nothing.
    pub(super) is_sliver: bool,
}

impl Triangle {
    fn new(mesh: &TriangleMesh, face: u32) -> Self {
        /// Height over longest side.
        const SLIMMEST: f32 = 1e-3;
        let [a, b, c] = mesh.corners(face);
        let sides = [b - a, c - a];
        let longest_squared = sides[0].length_squared().max(sides[1].length_squared()).max(b.distance_squared(c));
        let is_sliver = sides[0].cross(sides[1]).length() <= SLIMMEST * longest_squared;
        Self { corner: a, sides, face, is_sliver }
    }
}

pub(super) struct Hierarchy {
    pub(super) nodes: Vec<Node>,
    /// The faces in the order of the leaves.
    pub(super) triangles: Vec<Triangle>,
}

impl Hierarchy {
    pub(super) fn new(mesh: &TriangleMesh) -> Result<Self> {
        mesh.check()?;
        if mesh.faces.is_empty() {
            return Err(Error::Value {
                name: "mesh".into(),
                found: "without faces".into(),
                expected: "at least one face".into(),
            });
        }
        let mut items: Vec<Item> = (0..mesh.faces.len() as u32).map(|face| Item::new(mesh, face)).collect();
        let mut nodes = Vec::with_capacity(items.len());
        build(&mut nodes, &mut items, 0, 0);
        let triangles = items.iter().map(|item| Triangle::new(mesh, item.face)).collect();
        Ok(Self { nodes, triangles })
    }
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    centre: Vec3,
    face: u32,
}

impl Item {
    fn new(mesh: &TriangleMesh, face: u32) -> Self {
        let bounds = mesh.corners(face).into_iter().fold(Bounds::EMPTY, Bounds::with);
        // Halved first: the sum of two finite numbers may not be finite.
        Self { bounds, centre: bounds.minimum * 0.5 + bounds.maximum * 0.5, face }
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    minimum: Vec3,
    maximum: Vec3,
}

impl Bounds {
    const EMPTY: Self = Self { minimum: Vec3::INFINITY, maximum: Vec3::NEG_INFINITY };

    fn with(self, point: Vec3) -> Self {
        Self { minimum: self.minimum.min(point), maximum: self.maximum.max(point) }
    }

    fn and(self, other: Self) -> Self {
        Self { minimum: self.minimum.min(other.minimum), maximum: self.maximum.max(other.maximum) }
    }

    fn area(self) -> f32 {
        let size = (self.maximum - self.minimum).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// Appends the node of `items`, whose first is triangle `start`, and all nodes below it.
fn build(nodes: &mut Vec<Node>, items: &mut [Item], start: usize, depth: usize) {
    let bounds = items.iter().fold(Bounds::EMPTY, |all, item| all.and(item.bounds));
    let index = nodes.len();
    nodes.push(Node {
        minimum: bounds.minimum,
        maximum: bounds.maximum,
        start: start as u32,
        count: items.len() as u32,
    });
    if items.len() <= FACES_A_LEAF {
        return;
    }
    let by_heuristic = if depth < DEEPEST_BY_HEURISTIC { split_by_area(items) } else { None };
    let middle = by_heuristic.unwrap_or_else(|| split_at_median(items));
    let (low, high) = items.split_at_mut(middle);
    build(nodes, low, start, depth + 1);
    nodes[index].start = nodes.len() as u32;
    nodes[index].count = 0;
    build(nodes, high, start + middle, depth + 1);
}

fn centre_bounds(items: &[Item]) -> Bounds {
    items.iter().fold(Bounds::EMPTY, |all, item| all.with(item.centre))
}

/// Sorts `items` around the plane with the least (area x faces) on both sides; none if all centres are in one bin.
fn split_by_area(items: &mut [Item]) -> Option<usize> {
    let centres = centre_bounds(items);
    let extent = centres.maximum - centres.minimum;
    let axis = extent.max_position();
    let scale = BINS as f32 / extent[axis];
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    let bin_of = |item: &Item| (((item.centre[axis] - centres.minimum[axis]) * scale) as usize).min(BINS - 1);
    let mut bins = [(Bounds::EMPTY, 0usize); BINS];
    for item in items.iter() {
        let (bounds, count) = &mut bins[bin_of(item)];
        *bounds = bounds.and(item.bounds);
        *count += 1;
    }
    let costs = |bins: &mut dyn Iterator<Item = &(Bounds, usize)>| {
        let mut all = (Bounds::EMPTY, 0);
        let mut costs = [0.0; BINS];
        for (cost, (bounds, count)) in costs.iter_mut().zip(bins) {
            all = (all.0.and(*bounds), all.1 + count);
            *cost = all.0.area() * all.1 as f32;
        }
        costs
    };
    let (below, above) = (costs(&mut bins.iter()), costs(&mut bins.iter().rev()));
    // Bins 0..=last go below the plane.
    let cost = |&last: &usize| below[last] + above[BINS - 2 - last];
    let last = (0..BINS - 1).min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    let middle = partition(items, |item| bin_of(item) <= last);
    (0 < middle && middle < items.len()).then_some(middle)
}

fn split_at_median(items: &mut [Item]) -> usize {
    let centres = centre_bounds(items);
    let axis = (centres.maximum - centres.minimum).max_position();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    middle
}

/// Brings the items for which `goes_first` holds to the front; their number.
fn partition(items: &mut [Item], goes_first: impl Fn(&Item) -> bool) -> usize {
    let mut first = 0;
    for index in 0..items.len() {
        if goes_first(&items[index]) {
            items.swap(first, index);
            first += 1;
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth_and_faces(hierarchy: &Hierarchy, index: usize) -> (usize, usize) {
        let node = &hierarchy.nodes[index];
        match node.contents(index) {
            Contents::Leaf(range) => {
                for triangle in &hierarchy.triangles[range.clone()] {
                    for corner in [Vec3::ZERO, triangle.sides[0], triangle.sides[1]] {
                        assert!(node.distance_squared(triangle.corner + corner) < 1e-10);
                    }
                }
                (1, range.len())
            }
            Contents::Children(children) => {
                let [a, b] = children.map(|child| depth_and_faces(hierarchy, child));
                (1 + a.0.max(b.0), a.1 + b.1)
            }
        }
    }

    #[test]
    fn every_face_is_in_one_leaf_and_no_input_makes_it_deep() {
        let triangle = |at: Vec3, size: f32| [at, at + Vec3::X * size, at + Vec3::Y * size];
        // All at one place; and each half as far out as the one before, which the area heuristic would peel off one by one.
        let identical: Vec<Vec3> = (0..3000).flat_map(|_| triangle(Vec3::ONE, 0.1)).collect();
        let halving: Vec<Vec3> =
            (0..3000).flat_map(|i| triangle(Vec3::X * 0.5f32.powi(i % 120), 1e-3 * 0.5f32.powi(i % 120))).collect();
        for vertices in [identical, halving] {
            let faces: Vec<[u32; 3]> = (0..vertices.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
            let mesh = TriangleMesh { vertices, faces, ..TriangleMesh::default() };
            let hierarchy = Hierarchy::new(&mesh).unwrap();
            let (depth, count) = depth_and_faces(&hierarchy, 0);
            assert_eq!(count, mesh.faces.len());
            assert!(depth <= DEEPEST);
        }
    }

    #[test]
    fn a_mesh_without_faces_is_an_error() {
        assert!(Hierarchy::new(&TriangleMesh::default()).is_err());
    }
}

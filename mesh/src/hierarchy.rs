//! A bounding volume hierarchy over the triangles of a mesh: eight children a node, eight triangles a leaf, side by side.
//!
//! One pass of vector arithmetic looks at all eight. Nodes are split by the surface area heuristic. Children stand after their
//! parent, so a backward sweep over the nodes sees children first. Depth is bounded: see [`LEVELS_BY_HEURISTIC`].

use glam::Vec3;

use super::TriangleMesh;
use xavatar_formats::{Error, Result};

/// Level from which nodes are split at the median, which leaves at most 11 levels for 2^31 faces.
const LEVELS_BY_HEURISTIC: usize = 16;
/// Children of a node, and triangles of a packet.
pub(super) const LANES: usize = 8;
const BINS: usize = 12;

/// One number of each lane.
pub(super) type Lanes = [f32; LANES];

/// The vector of one lane.
#[inline(always)]
pub(super) fn of_lane(lanes: &[Lanes; 3], lane: usize) -> Vec3 {
    Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane])
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Child {
    Nothing,
    /// A node's index.
    Node(u32),
    /// A packet's index.
    Packet(u32),
}

/// Eight boxes and what is in them; a box of nothing is infinitely far from everything.
#[derive(Clone, Debug)]
pub(super) struct Node {
    minimum: [Lanes; 3],
    maximum: [Lanes; 3],
    pub(super) children: [Child; LANES],
}

impl Node {
    fn new() -> Self {
        Self {
            minimum: [[f32::INFINITY; LANES]; 3],
            maximum: [[f32::NEG_INFINITY; LANES]; 3],
            children: [Child::Nothing; LANES],
        }
    }

    fn set(&mut self, lane: usize, bounds: Bounds, child: Child) {
        for axis in 0..3 {
            self.minimum[axis][lane] = bounds.minimum[axis];
            self.maximum[axis][lane] = bounds.maximum[axis];
        }
        self.children[lane] = child;
    }

    /// Lowest and highest corner of a child's box, metres.
    pub(super) fn bounds(&self, lane: usize) -> [Vec3; 2] {
        [of_lane(&self.minimum, lane), of_lane(&self.maximum, lane)]
    }

    /// Squared distances from a finite point to the boxes, square metres.
    #[inline(always)]
    pub(super) fn distances_squared(&self, point: Vec3) -> Lanes {
        let mut sum = [0.0; LANES];
        for axis in 0..3 {
            let sides = self.minimum[axis].iter().zip(&self.maximum[axis]);
            for (sum, (minimum, maximum)) in sum.iter_mut().zip(sides) {
                let (below, above) = (minimum - point[axis], point[axis] - maximum);
                // Comparisons: `max` would look for NaN.
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                *sum += outside * outside;
            }
        }
        sum
    }
}

/// Eight triangles; what is missing of eight is filled with points in the corner of one that is there.
#[derive(Clone, Debug)]
pub(super) struct Packet {
    pub(super) faces: [u32; LANES],
    /// The first vertex.
    pub(super) corner: [Lanes; 3],
    /// From it to the second and the third vertex.
    pub(super) sides: [[Lanes; 3]; 2],
}

impl Packet {
    /// At least one face, at most eight.
    fn new(mesh: &TriangleMesh, faces: impl Iterator<Item = u32>) -> Self {
        let mut packet = Self { faces: [0; LANES], corner: [[0.0; LANES]; 3], sides: [[[0.0; LANES]; 3]; 2] };
        let mut count = 0;
        for face in faces {
            packet.faces[count] = face;
            let [a, b, c] = mesh.corners(face);
            for axis in 0..3 {
                packet.corner[axis][count] = a[axis];
                packet.sides[0][axis][count] = b[axis] - a[axis];
                packet.sides[1][axis][count] = c[axis] - a[axis];
            }
            count += 1;
        }
        for lane in count..LANES {
            packet.faces[lane] = packet.faces[0];
            packet.corner.iter_mut().for_each(|lanes| lanes[lane] = lanes[0]);
        }
        packet
    }
}

pub(super) struct Hierarchy {
    /// The first is the root.
    pub(super) nodes: Vec<Node>,
    pub(super) packets: Vec<Packet>,
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
        let mut hierarchy = Self { nodes: Vec::new(), packets: Vec::new() };
        hierarchy.build(mesh, &mut items, 0);
        Ok(hierarchy)
    }

    /// Appends the node of `items` and all nodes and packets below it; returns its index.
    fn build(&mut self, mesh: &TriangleMesh, items: &mut [Item], level: usize) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::new());
        for (lane, group) in split(items, level).into_iter().enumerate() {
            let bounds = group.iter().fold(Bounds::EMPTY, |all, item| all.and(item.bounds));
            let child = if group.len() <= LANES {
                self.packets.push(Packet::new(mesh, group.iter().map(|item| item.face)));
                Child::Packet(self.packets.len() as u32 - 1)
            } else {
                Child::Node(self.build(mesh, group, level + 1))
            };
            self.nodes[index].set(lane, bounds, child);
        }
        index as u32
    }
}

/// Divides items into at most eight groups: again and again the largest that is more than a packet.
fn split(items: &mut [Item], level: usize) -> Vec<&mut [Item]> {
    let mut groups = vec![items];
    while groups.len() < LANES {
        let largest = (0..groups.len()).max_by_key(|&group| groups[group].len()).unwrap_or(0);
        if groups[largest].len() <= LANES {
            break;
        }
        let group = groups.swap_remove(largest);
        let by_heuristic = if level < LEVELS_BY_HEURISTIC { split_by_area(group) } else { None };
        let middle = by_heuristic.unwrap_or_else(|| split_at_median(group));
        groups.extend(<[_; 2]>::from(group.split_at_mut(middle)));
    }
    groups
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

    fn depth_and_faces(hierarchy: &Hierarchy, index: u32) -> (usize, Vec<u32>) {
        let node = &hierarchy.nodes[index as usize];
        let (mut depth, mut faces) = (1, Vec::new());
        for (lane, child) in node.children.iter().enumerate() {
            match child {
                Child::Nothing => {}
                Child::Node(child) => {
                    assert!(*child > index);
                    let (below, of_child) = depth_and_faces(hierarchy, *child);
                    depth = depth.max(1 + below);
                    faces.extend(of_child);
                }
                Child::Packet(packet) => {
                    let packet = &hierarchy.packets[*packet as usize];
                    let mut of_packet = packet.faces.to_vec();
                    of_packet.sort_unstable();
                    of_packet.dedup();
                    faces.extend(of_packet);
                    for triangle in 0..LANES {
                        let corner = of_lane(&packet.corner, triangle);
                        for side in
                            [Vec3::ZERO, of_lane(&packet.sides[0], triangle), of_lane(&packet.sides[1], triangle)]
                        {
                            assert!(node.distances_squared(corner + side)[lane] < 1e-10);
                        }
                    }
                }
            }
        }
        (depth, faces)
    }

    #[test]
    fn every_face_is_in_one_packet_and_no_input_makes_it_deep() {
        let triangle = |at: Vec3, size: f32| [at, at + Vec3::X * size, at + Vec3::Y * size];
        // All at one place; and each half as far out as the one before, which the area heuristic would peel off one by one.
        let identical: Vec<Vec3> = (0..3000).flat_map(|_| triangle(Vec3::ONE, 0.1)).collect();
        let halving: Vec<Vec3> =
            (0..3000).flat_map(|i| triangle(Vec3::X * 0.5f32.powi(i % 120), 1e-3 * 0.5f32.powi(i % 120))).collect();
        for vertices in [identical, halving] {
            let faces: Vec<[u32; 3]> = (0..vertices.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
            let mesh = TriangleMesh { vertices, faces, ..TriangleMesh::default() };
            let hierarchy = Hierarchy::new(&mesh).unwrap();
            let (depth, mut found) = depth_and_faces(&hierarchy, 0);
            found.sort_unstable();
            assert_eq!(found, (0..mesh.faces.len() as u32).collect::<Vec<_>>());
            assert!(depth <= LEVELS_BY_HEURISTIC + 11);
        }
    }

    #[test]
    fn a_mesh_without_faces_is_an_error() {
        assert!(Hierarchy::new(&TriangleMesh::default()).is_err());
    }
}

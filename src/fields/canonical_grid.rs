//! The grid over canonical space on which skinning is learned, and what the body model says at its nodes.
//!
//! A node is bound to the nearest place on the canonical body: there it takes its first skinning weights and, in each frame,
//! the offset that expression and pose correctives give that place. R nodes, V vertices; metres.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{Axis, Grid, StartGroups, VoxelSkinning};

use crate::Result;
use crate::body::{BodyModel, Part, PartLabels, Role, Skeleton};
use crate::config::VoxelShape;
use crate::mesh::SolidIndex;

/// Room around the canonical body for clothes and hair, metres.
const MARGIN: f32 = 0.2;
/// The longest side of a person, metres: a hand or a head alone has the grid's lengths in proportion.
const PERSON: f32 = 1.7;
/// Distance from the unclothed body from which a point is outside, metres.
pub(crate) const CERTAINLY_OUTSIDE: f32 = 0.08;
/// Room around hands and face that the fine cells fill, metres.
const FINE_MARGIN: f32 = 0.03;
/// Least weight of a bone at a bound place that is kept at the node.
const LEAST_WEIGHT: f32 = 1e-3;

/// Places on the body's surface.
#[derive(Debug)]
pub struct BodyPlaces {
    /// Of each: the three vertices of its face, and their shares.
    places: Vec<([u32; 3], [f32; 3])>,
}

impl BodyPlaces {
    /// The nearest place to each of `points` (N) on the canonical body of `betas`, and the signed distance to it (N).
    ///
    /// # Errors
    /// If the body cannot be made.
    pub fn nearest(body: &BodyModel, betas: &[f32], points: &[Vec3]) -> Result<(Self, Vec<f32>)> {
        let mesh = body.mesh(body.canonical_vertices(betas, &[])?);
        let nearest = SolidIndex::new(&mesh)?.signed_distances(points);
        let places = nearest.iter().map(|(_, place)| (mesh.faces[place.face as usize], place.barycentric)).collect();
        Ok((Self { places }, nearest.into_iter().map(|(distance, _)| distance).collect()))
    }

    /// The offset of each place (N) of a body whose vertices move by `offsets` (V).
    #[must_use]
    pub fn offsets(&self, offsets: &[Vec3]) -> Vec<[f32; 3]> {
        let at = |(corners, shares): &([u32; 3], [f32; 3])| {
            let corner = |(vertex, share): (&u32, &f32)| offsets[*vertex as usize] * *share;
            corners.iter().zip(shares).map(corner).sum::<Vec3>().to_array()
        };
        self.places.par_iter().with_min_len(4096).map(at).collect()
    }
}

/// What the nodes of a grid hang on (R each).
#[derive(Clone, Debug, Default)]
pub struct NodeRows {
    /// Bones with their weights, which sum to one.
    pub weights: Vec<Vec<(usize, f32)>>,
    /// Whether something worn is there, however far from the body; empty if that is not known.
    pub worn: Vec<bool>,
}

/// The grid and its nodes' places on the canonical body.
#[derive(Debug)]
pub struct CanonicalGrid {
    grid: Grid<f32>,
    /// The place nearest to each node.
    places: BodyPlaces,
    /// Signed distance of each node to the body.
    distances: Vec<f32>,
}

impl CanonicalGrid {
    /// The grid around the canonical body of `betas`.
    ///
    /// # Errors
    /// If a spacing is out of range or would make too many nodes.
    pub fn new(body: &BodyModel, labels: &PartLabels, betas: &[f32], shape: VoxelShape) -> Result<Self> {
        let mesh = body.mesh(body.canonical_vertices(betas, &[])?);
        let (low, high) = canonical_box(body.skeleton(), &mesh.vertices);
        let size = relative_size(body.skeleton(), &mesh.vertices);
        let detailed: Vec<(Vec3, Vec3)> = Role::FINE
            .into_iter()
            .flat_map(|role| body.skeleton().parts_of(role))
            .map(|part| {
                let vertices = labels.vertices_of(part);
                box_around(vertices.iter().map(|vertex| mesh.vertices[*vertex]), size * FINE_MARGIN)
            })
            .filter(|(low, high)| low.cmple(*high).all())
            .collect();
        let axis = |axis: usize| {
            let finer: Vec<_> =
                detailed.iter().map(|(low, high)| (low[axis], high[axis], size * shape.fine_spacing)).collect();
            Axis::refined(low[axis], high[axis], size * shape.spacing, &finer)
        };
        let grid = Grid::new([axis(0)?, axis(1)?, axis(2)?])?;
        let nodes: Vec<Vec3> = (0..grid.len()).map(|node| Vec3::from_array(grid.position(node))).collect();
        let (places, distances) = BodyPlaces::nearest(body, betas, &nodes)?;
        Ok(Self { grid, places, distances })
    }

    /// A skinning field on the grid that starts from these rows.
    ///
    /// # Errors
    /// If there is not a row a node, or one has no weights.
    pub fn skinning(&self, body: &BodyModel, rows: &NodeRows) -> Result<VoxelSkinning<f32>> {
        Ok(VoxelSkinning::new(self.grid.clone(), body.skeleton().joints.len(), &rows.weights)?)
    }

    /// The body model's weights at the nodes' places.
    #[must_use]
    pub fn body_rows(&self, body: &BodyModel) -> NodeRows {
        let (weights, joints) = (body.skinning_weights(), body.skeleton().joints.len());
        let row = |(corners, shares): &([u32; 3], [f32; 3])| {
            let at = |joint: usize| {
                let corner = |(vertex, share): (&u32, &f32)| share * weights[*vertex as usize * joints + joint];
                corners.iter().zip(shares).map(corner).sum::<f32>()
            };
            (0..joints).map(|joint| (joint, at(joint))).filter(|(_, weight)| *weight > LEAST_WEIGHT).collect()
        };
        NodeRows { weights: self.places.places.par_iter().map(row).collect(), worn: Vec::new() }
    }

    /// The body model's weights changed as those of `coarse`, another grid around the same body, were changed from `before`.
    #[must_use]
    pub fn changed_rows(
        &self,
        body: &BodyModel,
        coarse: &Self,
        before: &[Vec<(usize, f32)>],
        after: &NodeRows,
    ) -> NodeRows {
        let mut rows = self.body_rows(body);
        let is_changed: Vec<bool> = before.iter().zip(&after.weights).map(|(before, after)| before != after).collect();
        rows.weights.par_iter_mut().enumerate().with_min_len(256).for_each(|(node, row)| {
            let corners = coarse.grid.corner_shares(self.grid.position(node));
            if corners.iter().all(|(corner, _)| !is_changed[*corner]) {
                return;
            }
            let mut add = |bone: usize, weight: f32| match row.iter_mut().find(|(own, _)| *own == bone) {
                Some((_, sum)) => *sum += weight,
                None => row.push((bone, weight)),
            };
            for (corner, share) in corners {
                after.weights[corner].iter().for_each(|(bone, weight)| add(*bone, share * weight));
                before[corner].iter().for_each(|(bone, weight)| add(*bone, -share * weight));
            }
            row.iter_mut().for_each(|(_, weight)| *weight = weight.max(0.0));
            let sum: f32 = row.iter().map(|(_, weight)| weight).sum();
            row.iter_mut().for_each(|(_, weight)| *weight /= sum);
            row.retain(|(_, weight)| *weight > LEAST_WEIGHT);
        });
        let worn = |node: usize| coarse.is_worn_at(&after.worn, Vec3::from_array(self.grid.position(node)));
        rows.worn = (0..self.grid.len()).into_par_iter().with_min_len(256).map(worn).collect();
        rows
    }

    /// Where the nodes are (R).
    #[must_use]
    pub fn positions(&self) -> Vec<Vec3> {
        (0..self.grid.len()).map(|node| Vec3::from_array(self.grid.position(node))).collect()
    }

    /// The values of the nodes (R), interpolated at a point.
    #[must_use]
    pub fn interpolated(&self, values: &[f32], point: Vec3) -> f32 {
        self.grid.corner_shares(point.to_array()).iter().map(|(corner, share)| values[*corner] * share).sum()
    }

    /// The node nearest to a point; none outside the grid.
    #[must_use]
    pub fn nearest_node(&self, point: Vec3) -> Option<usize> {
        self.grid.cell_number(point.to_array())?;
        let corners = self.grid.corner_shares(point.to_array());
        corners.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(corner, _)| corner)
    }

    /// The nodes' signed distances to the body (R), metres.
    #[must_use]
    pub fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// Whether each node's place (R) is on a part that is wanted.
    #[must_use]
    pub fn nodes_of(&self, labels: &PartLabels, wanted: impl Fn(Part) -> bool) -> Vec<bool> {
        self.places.places.iter().map(|(corners, _)| wanted(labels.parts[corners[0] as usize])).collect()
    }

    /// The six nodes around each (R); at the border, the node itself.
    #[must_use]
    pub fn neighbours(&self) -> Vec<[u32; 6]> {
        let [x, y, z] = self.grid.counts();
        let around = |node: usize| {
            let along = |place: usize, count: usize, stride: usize| {
                let below = if place > 0 { node - stride } else { node };
                let above = if place + 1 < count { node + stride } else { node };
                [below as u32, above as u32]
            };
            let [a, b] = along(node % x, x, 1);
            let [c, d] = along(node / x % y, y, x);
            let [e, f] = along(node / (x * y), z, x * y);
            [a, b, c, d, e, f]
        };
        (0..self.grid.len()).map(around).collect()
    }

    /// Whether a point is in a cell of which a node (R) is `worn`.
    #[must_use]
    fn is_worn_at(&self, worn: &[bool], point: Vec3) -> bool {
        let cell = self.grid.cell_number(point.to_array());
        cell.is_some_and(|cell| self.grid.cell_nodes(cell).iter().any(|node| worn.get(*node) == Some(&true)))
    }

    /// Lets searches in `skinning` skip starts that can reach no cell near the body, inside it or with a `worn` node (R, or none known).
    ///
    /// # Errors
    /// If `skinning` is on another grid.
    pub fn prune_starts(&self, skinning: &mut VoxelSkinning<f32>, groups: &StartGroups, worn: &[bool]) -> Result<()> {
        let may_be = |node: &usize| self.distances[*node] < CERTAINLY_OUTSIDE || worn.get(*node) == Some(&true);
        let is_near = |cell: usize| self.grid.cell_nodes(cell).iter().any(may_be);
        let matters: Vec<bool> = (0..self.grid.cells()).map(is_near).collect();
        Ok(skinning.prune_starts(groups, &matters)?)
    }

    /// The offset at each node (R) of a body whose vertices move by `offsets` (V).
    #[must_use]
    pub fn node_offsets(&self, offsets: &[Vec3]) -> Vec<[f32; 3]> {
        self.places.offsets(offsets)
    }
}

/// The canonical box of a body: its vertices and room around them.
pub(crate) fn canonical_box(skeleton: &Skeleton, vertices: &[Vec3]) -> (Vec3, Vec3) {
    box_around(vertices.iter().copied(), MARGIN * relative_size(skeleton, vertices))
}

/// How large a part of a body is beside a person; 1 for whole bodies, whatever their height.
fn relative_size(skeleton: &Skeleton, vertices: &[Vec3]) -> f32 {
    let (low, high) = box_around(vertices.iter().copied(), 0.0);
    if skeleton.is_whole_body() { 1.0 } else { ((high - low).max_element() / PERSON).min(1.0) }
}

fn box_around(points: impl Iterator<Item = Vec3> + Clone, margin: f32) -> (Vec3, Vec3) {
    let low = points.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = points.fold(Vec3::NEG_INFINITY, Vec3::max);
    (low - margin, high + margin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{mano, smplx};

    #[test]
    fn the_room_around_a_hand_is_in_proportion_and_around_a_child_as_around_anyone() {
        let room = |skeleton: &Skeleton, size: f32| {
            let (low, high) = canonical_box(skeleton, &[Vec3::ZERO, Vec3::splat(size)]);
            assert!((high - size + low).abs().max_element() < 1e-6);
            -low.x
        };
        assert!((room(smplx::skeleton(), 0.7) - MARGIN).abs() < 1e-6);
        assert!((room(&mano::skeleton("left"), 0.17) - 0.1 * MARGIN).abs() < 1e-6);
    }
}

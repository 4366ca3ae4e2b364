//! The grid over canonical space on which skinning is learned, and what the body model says at its nodes.
//!
//! A node is bound to the nearest place on the canonical body: there it takes its first skinning weights and, in each frame,
//! the offset that expression and pose correctives give that place. R nodes, V vertices; metres.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{Axis, Grid, StartGroups, VoxelSkinning};

use crate::Result;
use crate::body::{BodyModel, PartLabels, Role};
use crate::config::VoxelShape;
use crate::mesh::SolidIndex;

/// Room around the canonical body for clothes and hair, metres.
pub(crate) const MARGIN: f32 = 0.2;
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
        let (low, high) = canonical_box(&mesh.vertices);
        let detailed: Vec<(Vec3, Vec3)> = Role::FINE
            .into_iter()
            .flat_map(|role| body.skeleton().parts_of(role))
            .map(|part| box_around(labels.vertices_of(part).iter().map(|vertex| mesh.vertices[*vertex]), FINE_MARGIN))
            .filter(|(low, high)| low.cmple(*high).all())
            .collect();
        let axis = |axis: usize| {
            let finer: Vec<_> =
                detailed.iter().map(|(low, high)| (low[axis], high[axis], shape.fine_spacing)).collect();
            Axis::refined(low[axis], high[axis], shape.spacing, &finer)
        };
        let grid = Grid::new([axis(0)?, axis(1)?, axis(2)?])?;
        let nodes: Vec<Vec3> = (0..grid.len()).map(|node| Vec3::from_array(grid.position(node))).collect();
        let (places, distances) = BodyPlaces::nearest(body, betas, &nodes)?;
        Ok(Self { grid, places, distances })
    }

    /// A skinning field on the grid that starts from the body model's weights.
    ///
    /// # Errors
    /// If a place has no weights.
    pub fn skinning(&self, body: &BodyModel) -> Result<VoxelSkinning<f32>> {
        let (weights, joints) = (body.skinning_weights(), body.skeleton().joints.len());
        let row = |(corners, shares): &([u32; 3], [f32; 3])| {
            let at = |joint: usize| {
                let corner = |(vertex, share): (&u32, &f32)| share * weights[*vertex as usize * joints + joint];
                corners.iter().zip(shares).map(corner).sum::<f32>()
            };
            (0..joints).map(|joint| (joint, at(joint))).filter(|(_, weight)| *weight > LEAST_WEIGHT).collect()
        };
        let rows: Vec<Vec<(usize, f32)>> = self.places.places.par_iter().map(row).collect();
        Ok(VoxelSkinning::new(self.grid.clone(), joints, &rows)?)
    }

    /// Lets searches in `skinning` skip starts that can reach no cell near or inside the body.
    ///
    /// # Errors
    /// If `skinning` is on another grid.
    pub fn prune_starts(&self, skinning: &mut VoxelSkinning<f32>, groups: &StartGroups) -> Result<()> {
        let is_near =
            |cell: usize| self.grid.cell_nodes(cell).iter().any(|node| self.distances[*node] < CERTAINLY_OUTSIDE);
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
pub(crate) fn canonical_box(vertices: &[Vec3]) -> (Vec3, Vec3) {
    box_around(vertices.iter().copied(), MARGIN)
}

fn box_around(points: impl Iterator<Item = Vec3> + Clone, margin: f32) -> (Vec3, Vec3) {
    let low = points.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = points.fold(Vec3::NEG_INFINITY, Vec3::max);
    (low - margin, high + margin)
}

//! Multi-resolution marching cubes (Lorensen & Cline 1987; METHOD §6): scalar field -> closed, indexed, outward mesh.
//!
//! A coarse lattice finds where the surface is; cells it crosses, and their neighbours, are halved until there are 64 to 127
//! along the longest side (as in X-Avatar's extraction, so that thin parts are not lost); from there the surface is followed
//! from cell to cell at full resolution. Only corners of cells it crosses are evaluated there, each once, in batches.
//! Parts that no lattice point of the search sees and that touch no other part are not found.
//!
//! Every edge has exactly two faces: ambiguous cube faces are decided from the face alone. A surface that leaves the box is
//! capped at the box. Why not a crate: `marching-cubes` 0.1.2 indexes out of bounds on a cell with one inside corner, its
//! `glam` feature does not compile, and like `mcubes` it returns a soup of unconnected triangles of one cell at a time.

mod ball;
mod cases;
mod error;
mod follow;
mod lattice;
mod samples;

use glam::{UVec3, Vec3};

pub use self::error::ExtractionError;

use self::follow::follow_surface;
use self::lattice::{Box3, SparseLattice, corner};
use self::samples::Samples;
use crate::{Colouring, Component, TriangleMesh, largest_component};

/// Most cells along the longest side of a grid.
pub const FINEST_RESOLUTION: usize = 512;

/// On which side of the level the inside is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Inside is above the level: occupancy logits.
    Positive,
    /// Inside is below the level: signed distances.
    Negative,
}

/// Where and how finely a surface is searched for.
#[derive(Clone, Copy, Debug)]
pub struct ExtractionGrid {
    /// Lowest corner of the box, metres.
    pub minimum: Vec3,
    /// Highest corner of the box, metres; shorter sides are lengthened to whole cells.
    pub maximum: Vec3,
    /// Cells along the longest side, 2 to [`FINEST_RESOLUTION`]; any number.
    pub resolution: usize,
    /// The value at the surface.
    pub level: f32,
    /// Which values are inside.
    pub inside_is: Sign,
}

/// A closed mesh, and between which points of the lattice its vertices are.
#[derive(Clone, Debug, Default)]
pub struct ExtractedSurface {
    /// The surface; no two vertices are at the same place.
    pub mesh: TriangleMesh,
    /// The neighbouring lattice points that each vertex lies between (V), the one inside first: where the field was evaluated.
    pub edges: Vec<[Vec3; 2]>,
}

/// The surface `field = level` as a closed mesh whose faces look outward; it does not depend on threads.
///
/// `field` writes the values at a batch of points (up to 8,192; metres), several batches at a time on rayon's threads.
///
/// # Errors
/// [`ExtractionError::NoSurface`] with the range seen; [`ExtractionError::Input`] for a grid out of range or a value that is not finite.
pub fn extract(
    field: &(dyn Fn(&[Vec3], &mut [f32]) + Sync),
    grid: ExtractionGrid,
) -> Result<ExtractedSurface, ExtractionError> {
    let lattice = Box3::new(&grid)?;
    let mut samples = Samples::new(field, &grid, lattice);
    let crossed = follow_surface(&mut samples)?;
    if crossed.is_empty() {
        return Err(samples.no_surface());
    }
    Ok(polygonise(&crossed, &samples, lattice))
}

/// The largest part of the surface `field = level`, without handles: a ball, topologically. Where the field has bridges or tunnels the lattice
/// points that change sides are as few as are found; elsewhere it is the surface of [`extract`].
///
/// # Errors
/// As [`extract`].
pub fn extract_ball(
    field: &(dyn Fn(&[Vec3], &mut [f32]) + Sync),
    grid: ExtractionGrid,
) -> Result<Component, ExtractionError> {
    let lattice = Box3::new(&grid)?;
    let mut samples = Samples::new(field, &grid, lattice);
    let crossed = follow_surface(&mut samples)?;
    if crossed.is_empty() {
        return Err(samples.no_surface());
    }
    let largest = largest_component(&polygonise(&crossed, &samples, lattice).mesh);
    if is_ball(&largest.mesh) {
        return Ok(largest);
    }
    let crossed = ball::mend(&mut samples, &crossed)?;
    Ok(Component { others: largest.others, ..largest_component(&polygonise(&crossed, &samples, lattice).mesh) })
}

/// Whether V - E + F = 2, for a closed surface in one part.
fn is_ball(mesh: &TriangleMesh) -> bool {
    2 * mesh.vertices.len() == mesh.faces.len() + 4
}

/// The triangles of all crossed cells; a lattice edge has one vertex, shared by the cells around it.
fn polygonise(crossed: &[UVec3], samples: &Samples, lattice: Box3) -> ExtractedSurface {
    const NO_VERTEX: [u32; 3] = [u32::MAX; 3];
    let mut vertices = Vec::with_capacity(crossed.len());
    let mut edges = Vec::with_capacity(crossed.len());
    let mut faces = Vec::with_capacity(2 * crossed.len());
    let mut on_edges = SparseLattice::new(lattice.points(), NO_VERTEX);
    for &cell in crossed {
        for triangle in cases::triangles(samples.case(cell)) {
            faces.push(triangle.map(|edge| {
                let start = corner(cell, edge.lower_corner());
                let on_edge = on_edges.entry(start);
                if on_edge[edge.axis()] == u32::MAX {
                    on_edge[edge.axis()] = vertices.len() as u32;
                    let (vertex, between) = crossing(samples, lattice, start, edge.axis());
                    vertices.push(vertex);
                    edges.push(between);
                }
                on_edge[edge.axis()]
            }));
        }
    }
    let mesh = TriangleMesh { vertices, faces, normals: None, colouring: Colouring::None };
    ExtractedSurface { mesh, edges }
}

/// Where the surface crosses the lattice edge from `start` along `axis`, linearly interpolated; and the edge, its inside end first.
fn crossing(samples: &Samples, lattice: Box3, start: UVec3, axis: usize) -> (Vec3, [Vec3; 2]) {
    // Vertices that fell on a lattice point would coincide, and their faces have no area.
    const KEPT_OFF: f32 = 1e-3;
    let end = start + UVec3::AXES[axis];
    let (a, b) = (samples.depth(start), samples.depth(end));
    let along = (a / (a - b)).clamp(KEPT_OFF, 1.0 - KEPT_OFF);
    let ends = [start, end].map(|point| lattice.position(point));
    (ends[0].lerp(ends[1], along), if a > 0.0 { ends } else { [ends[1], ends[0]] })
}

#[cfg(test)]
mod tests;

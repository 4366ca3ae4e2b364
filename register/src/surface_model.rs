//! The vertices of a body that are fitted to scans: spread evenly, more densely on hands and face, with normals and shares.
//!
//! N vertices; one of each cell of a grid over the template, in cells of a size of the part's role. Eyes and the inside of the mouth
//! are left out: scans do not show them.

use std::collections::BTreeMap;

use glam::DVec3;
use xavatar_body::{BodyModel, Part, PartLabels, Role};

use crate::linear::{BodyPoints, FramePose, Linkage, PosedChain, PosedPoints};

/// How densely each role's vertices are chosen.
#[derive(Clone, Copy, Debug)]
pub struct Density {
    body: f64,
    hands: f64,
    face: f64,
}

impl Density {
    /// For a fit: about 1,600 vertices of a body with hands.
    pub const FINE: Self = Self { body: 0.045, hands: 0.0135, face: 0.02 };
    /// For a first guess: about 450.
    pub const COARSE: Self = Self { body: 0.075, hands: 0.04, face: 0.05 };

    /// The size of the widest cells, metres.
    pub fn largest(self) -> f64 {
        self.body.max(self.hands).max(self.face)
    }

    fn of(self, role: Role) -> f64 {
        match role {
            Role::Body => self.body,
            Role::Hands => self.hands,
            Role::Face => self.face,
        }
    }
}

/// Share of the whole that the vertices of one part of a role have.
fn share(role: Role) -> f64 {
    match role {
        Role::Body => 0.6,
        Role::Hands => 0.15,
        Role::Face => 0.1,
    }
}

/// The sum of all vertices' weights.
pub const TOTAL_WEIGHT: f64 = 600.0;

/// N vertices of a body, as a surface.
#[derive(Clone, Debug)]
pub struct SurfaceModel {
    /// Their numbers in the model (N).
    pub vertices: Vec<usize>,
    /// The part of each (N).
    pub parts: Vec<Part>,
    /// The role of each (N).
    pub roles: Vec<Role>,
    /// How much each counts, of [`TOTAL_WEIGHT`] in all (N).
    pub weights: Vec<f64>,
    /// At rest, metres (N).
    pub rest: Vec<DVec3>,
    normals: Vec<DVec3>,
    points: BodyPoints,
}

/// The vertices in a pose.
pub struct PosedSurface {
    /// Their places and derivatives.
    pub points: PosedPoints,
    /// Unit normals (N).
    pub normals: Vec<DVec3>,
    /// The chain that they hang on.
    pub chain: PosedChain,
}

impl SurfaceModel {
    /// Chooses vertices of a body.
    pub fn of(model: &BodyModel, linkage: &Linkage, labels: &PartLabels, density: Density) -> Self {
        let skeleton = model.skeleton();
        let mut cells: BTreeMap<(Part, [i64; 3]), usize> = BTreeMap::new();
        for (vertex, place) in model.template().iter().enumerate().filter(|(vertex, _)| !labels.detail[*vertex]) {
            let part = labels.parts[vertex];
            let cell = place.as_dvec3() / density.of(skeleton.role(part));
            cells.entry((part, cell.to_array().map(|along| along.floor() as i64))).or_insert(vertex);
        }
        let (parts, vertices): (Vec<Part>, Vec<usize>) =
            cells.iter().map(|((part, _), vertex)| (*part, *vertex)).unzip();
        let mut counts: BTreeMap<Part, f64> = BTreeMap::new();
        parts.iter().for_each(|part| *counts.entry(*part).or_default() += 1.0);
        let whole: f64 = counts.keys().map(|part| share(skeleton.role(*part))).sum();
        let weight = |part: &Part| TOTAL_WEIGHT * share(skeleton.role(*part)) / whole / counts[part];
        let normals = model.mesh(model.template().to_vec()).vertex_normals();
        Self {
            weights: parts.iter().map(weight).collect(),
            roles: parts.iter().map(|part| skeleton.role(*part)).collect(),
            rest: vertices.iter().map(|vertex| model.template()[*vertex].as_dvec3()).collect(),
            normals: vertices.iter().map(|vertex| normals[*vertex].as_dvec3()).collect(),
            points: BodyPoints::of(model, linkage, &vertices),
            parts,
            vertices,
        }
    }

    /// The vertices of some places among these, in their order.
    #[must_use]
    pub fn chosen(&self, kept: &[usize]) -> Self {
        fn chosen<T: Clone>(all: &[T], kept: &[usize]) -> Vec<T> {
            kept.iter().map(|index| all[*index].clone()).collect()
        }
        Self {
            vertices: chosen(&self.vertices, kept),
            parts: chosen(&self.parts, kept),
            roles: chosen(&self.roles, kept),
            weights: chosen(&self.weights, kept),
            rest: chosen(&self.rest, kept),
            normals: chosen(&self.normals, kept),
            points: self.points.chosen(kept),
        }
    }

    /// N.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether no vertex was chosen.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Their derivatives.
    pub fn points(&self) -> &BodyPoints {
        &self.points
    }

    /// The vertices in a pose and shape.
    pub fn posed(&self, linkage: &Linkage, pose: &FramePose, shape: &[f64]) -> PosedSurface {
        let chain = linkage.posed(pose, shape);
        let points = self.points.posed(linkage, &chain);
        let normals =
            points.turns.iter().zip(&self.normals).map(|(turn, normal)| (*turn * *normal).normalize_or_zero());
        PosedSurface { normals: normals.collect(), points, chain }
    }
}

//! The distance between landmarks and the joints or vertices of the body that they are: (c w / s^2) |x - y|^2, robust. Metres.

use glam::DVec3;

use super::robust;
use crate::landmarks::{Seen, Site, Sites};
use crate::linear::{Basis, NormalEquations, Row};

/// How a stage weighs landmarks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkTerm {
    /// Deviation that costs 1, metres.
    pub deviation: f64,
    /// Distance at which one counts a quarter, metres.
    pub reach: f64,
    /// Whether those of the surface count, or joints alone.
    pub with_vertices: bool,
}

impl LandmarkTerm {
    /// Adds the term to a frame's equations.
    pub fn add(&self, basis: Basis<'_>, sites: &Sites, seen: &[Seen], equations: &mut NormalEquations) {
        let vertices = sites.vertices().posed(basis.linkage, basis.chain);
        let mut row = Row::default();
        for Seen { site, place, confidence } in seen {
            let site = sites.site(*site);
            let found = match site.at {
                Site::Joint(joint) => basis.chain.joint(joint),
                Site::Vertex(vertex) if self.with_vertices => vertices.positions[vertex],
                Site::Vertex(_) => continue,
            };
            let way = *place - found;
            let weight = confidence * site.weight * robust::weight(way.length(), self.reach) / self.deviation.powi(2);
            for axis in DVec3::AXES {
                match site.at {
                    Site::Joint(joint) => basis.joint_row(joint, axis, &mut row),
                    Site::Vertex(vertex) => sites.vertices().row(basis, &vertices, vertex, axis, &mut row),
                }
                equations.add(&row, -axis.dot(way), weight);
            }
        }
    }
}

//! Where on a body a landmark of a name is: a joint, or the tip of a finger.
//!
//! Names are those of the body's joints, and `left_index`, `left_middle`, .. for the tips of fingers. The tip is the vertex that is
//! farthest along the finger's last bone. Detectors mean another point by hips and shoulders than bodies do: these count half.

use glam::DVec3;
use xavatar_body::BodyModel;

use crate::linear::{BodyPoints, Linkage};

/// How much a finger's landmark counts, of one of the body.
const OF_HANDS: f64 = 0.3;

/// A place of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// A joint.
    Joint(usize),
    /// One of the sites' vertices.
    Vertex(usize),
}

/// A place that landmarks may be of.
#[derive(Clone, Debug)]
pub struct NamedSite {
    /// As landmarks call it.
    pub name: String,
    /// Where it is.
    pub at: Site,
    /// How much it counts.
    pub weight: f64,
}

/// All places of a body that landmarks may be of.
#[derive(Clone, Debug)]
pub struct Sites {
    sites: Vec<NamedSite>,
    tips: Vec<usize>,
    vertices: BodyPoints,
}

impl Sites {
    /// Of a body.
    pub fn of(model: &BodyModel, linkage: &Linkage) -> Self {
        let joints = &model.skeleton().joints;
        let weight = |name: &str| {
            if tip_of(name).is_some() || name.ends_with(['1', '2']) && !name.starts_with("spine") {
                OF_HANDS
            } else {
                1.0
            }
        };
        let mut sites: Vec<NamedSite> = (joints.iter().enumerate())
            .map(|(joint, name)| NamedSite { name: name.clone(), at: Site::Joint(joint), weight: weight(name) })
            .collect();
        let mut tips = Vec::new();
        for (joint, name) in joints.iter().enumerate() {
            let (Some(finger), Some(parent)) = (tip_of(name), linkage.parents()[joint]) else { continue };
            if let Some(tip) = farthest_along(model, joint, linkage.rest()[joint] - linkage.rest()[parent]) {
                sites.push(NamedSite { name: finger.into(), at: Site::Vertex(tips.len()), weight: OF_HANDS });
                tips.push(tip);
            }
        }
        Self { sites, vertices: BodyPoints::of(model, linkage, &tips), tips }
    }

    /// The place of a number.
    pub fn site(&self, index: usize) -> &NamedSite {
        &self.sites[index]
    }

    /// The number of a name's place.
    pub fn named(&self, name: &str) -> Option<usize> {
        self.sites.iter().position(|site| site.name == name)
    }

    /// All places, in the order of their numbers.
    pub fn all(&self) -> &[NamedSite] {
        &self.sites
    }

    /// Of each [`Site::Vertex`], in their order, which of the body's vertices it is.
    pub fn tips(&self) -> &[usize] {
        &self.tips
    }

    /// The vertices among them.
    pub fn vertices(&self) -> &BodyPoints {
        &self.vertices
    }
}

/// The finger of which a joint is the last: `left_index` of `left_index3`.
fn tip_of(joint: &str) -> Option<&str> {
    let finger = joint.strip_suffix('3')?;
    ["index", "middle", "pinky", "ring", "thumb"].iter().any(|name| finger.ends_with(name)).then_some(finger)
}

/// Of the vertices that follow a joint more than all others together, the one farthest along a direction.
fn farthest_along(model: &BodyModel, joint: usize, direction: DVec3) -> Option<usize> {
    let joints = model.skeleton().joints.len();
    let along = |vertex: &usize| model.template()[*vertex].as_dvec3().dot(direction);
    let following = (0..model.vertex_count()).filter(|vertex| model.skinning_weights()[vertex * joints + joint] > 0.5);
    following.max_by(|a, b| along(a).total_cmp(&along(b)))
}

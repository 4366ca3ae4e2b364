//! How far a rig is from the exact motion, as numbers and as a table.

use std::fmt::{self, Display, Formatter};

use glam::Vec3;
use serde::Serialize;

/// Distances between the rig's vertices and the exact ones, over all vertices of all frames, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Deviation {
    /// The mean.
    pub mean: f64,
    /// The largest.
    pub max: f32,
}

/// What a rig loses against the exact motion of the same surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RigReport {
    /// Most joints that hold a vertex of the avatar.
    pub most_influences: usize,
    /// Share of the skinning weights that was cut, mean over the vertices.
    pub cut_weight_mean: f64,
    /// The same, of the vertex that lost most.
    pub cut_weight_max: f32,
    /// What the cut weights alone do.
    pub pruning: Deviation,
    /// The rig without correctives.
    pub uncorrected: Deviation,
    /// The rig with them.
    pub corrected: Deviation,
    /// How many corrective morph targets there are.
    pub correctives: usize,
    /// Smaller components of the canonical surface that were left out.
    pub dropped_components: usize,
}

impl Display for RigReport {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "against the exact motion of the same surface, all vertices and frames:      mean        max"
        )?;
        let mut row = |name: &str, deviation: &Deviation| {
            let [mean, max] = [deviation.mean, f64::from(deviation.max)].map(|metres| 1000.0 * metres);
            writeln!(formatter, "  {name:<68} {mean:7.4} mm {max:7.4} mm")
        };
        row(&format!("skinning weights cut, of up to {} a vertex", self.most_influences), &self.pruning)?;
        row("all but the correctives", &self.uncorrected)?;
        row(&format!("the rig, with {} corrective morphs", self.correctives), &self.corrected)?;
        let [mean, max] = [self.cut_weight_mean, f64::from(self.cut_weight_max)].map(|share| 100.0 * share);
        write!(formatter, "  {:<68} {mean:7.3} %  {max:7.3} %", "share of a vertex's weights that is cut")
    }
}

/// A deviation while it is summed.
#[derive(Default)]
pub(super) struct Sum {
    sum: f64,
    count: usize,
    max: f32,
}

impl Sum {
    pub(super) fn add(&mut self, vertices: &[Vec3], exact: &[Vec3]) {
        for (vertex, exact) in vertices.iter().zip(exact) {
            let distance = vertex.distance(*exact);
            self.sum += f64::from(distance);
            self.max = self.max.max(distance);
        }
        self.count += vertices.len();
    }

    pub(super) fn deviation(&self) -> Deviation {
        Deviation { mean: self.sum / self.count.max(1) as f64, max: self.max }
    }
}

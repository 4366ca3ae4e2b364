//! What a body loses where its sparse correctives are pruned (METHOD-BODY 3): blocks, of a vertex and a joint, none of whose directions is as long as a
//! level, in metres for a feature of one. A joint that turns by 60 degrees about an axis has a feature of one half.

use serde::Serialize;
use xavatar_register::linear::FramePose;

use crate::core::features;
use crate::sparse::SparseCorrectives;

/// Levels, metres for a feature of one.
const LEVELS: [f64; 6] = [1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2];

/// At one level.
#[derive(Clone, Debug, Serialize)]
pub struct AtLevel {
    /// Shorter blocks are left out, millimetres for a feature of one.
    pub level_mm: f64,
    /// The share of blocks that are left.
    pub blocks: f64,
    /// How far vertices of the poses that were fitted move by that, on average, millimetres.
    pub mean_mm: f64,
    /// The one that moves farthest.
    pub largest_mm: f64,
}

/// What is left out at each level, and the sums over poses.
pub(super) struct Pruning {
    blocks: usize,
    levels: Vec<(f64, SparseCorrectives, Sum)>,
}

#[derive(Clone, Copy, Default)]
struct Sum {
    distance: f64,
    count: usize,
    largest: f64,
}

impl Pruning {
    pub fn of(correctives: &SparseCorrectives) -> Self {
        let left_out = |level: f64| (level, correctives.shorter_than(level), Sum::default());
        Self { blocks: correctives.blocks(), levels: LEVELS.into_iter().map(left_out).collect() }
    }

    /// Adds a pose.
    pub fn add(&mut self, pose: &FramePose) {
        let features = features(pose);
        for (_, left_out, sum) in &mut self.levels {
            for offset in left_out.offsets(&features) {
                sum.distance += offset.length();
                sum.count += 1;
                sum.largest = sum.largest.max(offset.length());
            }
        }
    }

    pub fn levels(&self) -> Vec<AtLevel> {
        let at = |(level, left_out, sum): &(f64, SparseCorrectives, Sum)| AtLevel {
            level_mm: 1e3 * level,
            blocks: 1.0 - left_out.blocks() as f64 / self.blocks.max(1) as f64,
            mean_mm: 1e3 * sum.distance / sum.count.max(1) as f64,
            largest_mm: 1e3 * sum.largest,
        };
        self.levels.iter().map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    // Half a turn about x: features (1, 0, 0, -1). A block of 15 mm that only x drives moves its vertex by that.
    #[test]
    fn a_level_costs_what_the_blocks_below_it_did() {
        let block = |length: f64| [DVec3::Y * length, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO];
        let correctives = SparseCorrectives { vertices: vec![vec![(0, block(0.015))], vec![(0, block(0.1))]] };
        let mut pruning = Pruning::of(&correctives);
        let turned = DMat3::from_rotation_x(std::f64::consts::PI);
        pruning.add(&FramePose {
            rotations: vec![DMat3::IDENTITY, turned],
            translation: DVec3::ZERO,
            expression: Vec::new(),
        });
        let levels = pruning.levels();
        assert_eq!((levels[3].blocks, levels[3].mean_mm, levels[3].largest_mm), (1.0, 0.0, 0.0));
        assert!((levels[4].largest_mm - 15.0).abs() < 1e-9 && (levels[4].mean_mm - 7.5).abs() < 1e-9);
        assert_eq!(levels[4].blocks, 0.5);
    }
}

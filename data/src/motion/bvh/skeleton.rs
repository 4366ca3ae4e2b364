//! A BVH skeleton and its rows: a tree of joints with offsets and channels, and where the joints are in a frame.
//!
//! Offsets and positions are in the file's unit, rotation channels in degrees, turned in their order. Double precision.

use std::ops::Range;

use glam::{DQuat, DVec3};

/// One degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    /// Along x, y or z.
    Position(usize),
    /// About x, y or z.
    Rotation(usize),
}

/// A joint of the skeleton.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joint {
    pub(super) name: String,
    /// The joint that it hangs on, which comes before it; `None` for a root.
    pub(super) parent: Option<usize>,
    /// From the parent, at rest.
    pub(super) offset: DVec3,
    pub(super) channels: Vec<Channel>,
    /// Where its channels are in a frame's row.
    pub(super) first_channel: usize,
}

/// How a joint lies in the file's world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) turn: DQuat,
    pub(super) position: DVec3,
}

/// A whole file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bvh {
    pub(super) joints: Vec<Joint>,
    /// Between frames, seconds; `None` where the file says 0.
    pub(super) frame_time: Option<f64>,
    /// Values of all channels, a row a frame.
    pub(super) values: Vec<f64>,
    /// Values of a row.
    pub(super) width: usize,
    /// What is odd about the file, a line each.
    pub(super) oddities: Vec<String>,
}

impl Bvh {
    /// The rows of channel values, one a frame; at least one.
    pub(super) fn frames(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.width)
    }

    /// The trees of joints, one a root, as ranges: depth first, each is in one piece.
    pub(super) fn trees(&self) -> Vec<Range<usize>> {
        let roots: Vec<usize> = (0..self.joints.len()).filter(|joint| self.joints[*joint].parent.is_none()).collect();
        let ends = roots.iter().skip(1).copied().chain([self.joints.len()]);
        roots.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
    }

    /// Leaves out every joint but those of one tree; rows stay as they are.
    pub(super) fn keep(&mut self, tree: Range<usize>) {
        let first = tree.start;
        self.joints.truncate(tree.end);
        self.joints.drain(..first);
        for joint in &mut self.joints {
            joint.parent = joint.parent.map(|parent| parent - first);
        }
    }

    /// The mirror image along an axis: a rotation about it stays, about the others it changes its sense.
    pub(super) fn mirror(&mut self, axis: usize) {
        for joint in &mut self.joints {
            joint.offset[axis] = -joint.offset[axis];
            for (index, channel) in joint.channels.iter().enumerate() {
                let changes = match *channel {
                    Channel::Position(along) => along == axis,
                    Channel::Rotation(about) => about != axis,
                };
                if changes {
                    let column = self.values.iter_mut().skip(joint.first_channel + index).step_by(self.width);
                    column.for_each(|value| *value = -*value);
                }
            }
        }
    }

    /// The rotation of a joint relative to its parent in a frame's row: its channels' turns, in their order.
    pub(super) fn rotation(&self, joint: usize, row: &[f64]) -> DQuat {
        let mut rotation = DQuat::IDENTITY;
        for (channel, value) in self.channels(joint, row) {
            if let Channel::Rotation(axis) = channel {
                rotation *= DQuat::from_axis_angle(DVec3::AXES[axis], value.to_radians());
            }
        }
        rotation
    }

    /// Where a joint is in its parent's frame: its position channels, or its offset where it has none.
    pub(super) fn position(&self, joint: usize, row: &[f64]) -> DVec3 {
        let mut position = self.joints[joint].offset;
        for (channel, value) in self.channels(joint, row) {
            if let Channel::Position(axis) = channel {
                position[axis] = value;
            }
        }
        position
    }

    /// How every joint lies in a frame: the turns of all joints above it, composed.
    pub(super) fn posed(&self, row: &[f64]) -> Vec<Place> {
        self.composed(|joint| Place { turn: self.rotation(joint, row), position: self.position(joint, row) })
    }

    /// How every joint lies when nothing is turned.
    pub(super) fn at_rest(&self) -> Vec<Place> {
        self.composed(|joint| Place { turn: DQuat::IDENTITY, position: self.joints[joint].offset })
    }

    fn composed(&self, local: impl Fn(usize) -> Place) -> Vec<Place> {
        let mut world: Vec<Place> = Vec::with_capacity(self.joints.len());
        let origin = Place { turn: DQuat::IDENTITY, position: DVec3::ZERO };
        for (index, joint) in self.joints.iter().enumerate() {
            let (parent, own) = (joint.parent.map_or(origin, |parent| world[parent]), local(index));
            let position = parent.position + parent.turn * own.position;
            world.push(Place { turn: (parent.turn * own.turn).normalize(), position });
        }
        world
    }

    fn channels<'a>(&'a self, joint: usize, row: &'a [f64]) -> impl Iterator<Item = (Channel, f64)> {
        let joint = &self.joints[joint];
        joint.channels.iter().copied().zip(row[joint.first_channel..].iter().copied())
    }
}

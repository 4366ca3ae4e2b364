//! Skinning weights that are not zero, vertex by vertex: a handful of the J of each row.

/// The joints that move each vertex (V), and how much.
#[derive(Clone, Debug)]
pub(super) struct Influences {
    /// Where each vertex's begin (V + 1).
    starts: Vec<u32>,
    joints: Vec<u8>,
    weights: Vec<f32>,
}

impl Influences {
    /// Of `weights` (V, `joints`), row-major; a skeleton has at most 255 joints.
    pub fn of(weights: &[f32], joints: usize) -> Self {
        let mut influences = Self { starts: vec![0], joints: Vec::new(), weights: Vec::new() };
        for row in weights.chunks_exact(joints) {
            for (joint, weight) in row.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
                influences.joints.push(joint as u8);
                influences.weights.push(*weight);
            }
            influences.starts.push(influences.joints.len() as u32);
        }
        influences
    }

    /// The joints of a vertex with their weights, in the joints' order.
    pub fn at(&self, vertex: usize) -> impl Iterator<Item = (usize, f32)> {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        self.joints[range.clone()].iter().map(|joint| usize::from(*joint)).zip(self.weights[range].iter().copied())
    }
}

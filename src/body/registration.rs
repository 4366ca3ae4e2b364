//! Which part of the body a point belongs to: that of the nearest registered vertex (METHOD: thesis 5.1.4).
//!
//! V vertices; world coordinates, metres. Of equally near vertices any may answer, the same one every time.

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::{Part, PartLabels};
use crate::{Error, Result};

/// A frame's registered body as a k-d tree over its labelled vertices.
pub struct Registration<'a> {
    tree: ImmutableKdTree<f32, 3>,
    parts: &'a [Part],
}

impl<'a> Registration<'a> {
    /// Indexes the vertices (V) of a registered body, labelled by `labels` (V).
    ///
    /// # Errors
    /// [`Error::Value`] if there is no vertex, if one is not finite, or if labels and vertices differ in number.
    pub fn new(vertices: &[Vec3], labels: &'a PartLabels) -> Result<Self> {
        let wrong = |found: String, expected: String| Error::Value { name: "registered body".into(), found, expected };
        if vertices.is_empty() || vertices.len() != labels.parts.len() {
            let expected = format!("{} labelled vertices, at least one", labels.parts.len());
            return Err(wrong(format!("{} vertices", vertices.len()), expected));
        }
        if let Some(index) = vertices.iter().position(|vertex| !vertex.is_finite()) {
            return Err(wrong(format!("{} at vertex {index}", vertices[index]), "finite vertices".into()));
        }
        let points: Vec<[f32; 3]> = vertices.iter().map(Vec3::to_array).collect();
        let tree = ImmutableKdTree::new_from_slice(&points)
            .map_err(|failure| wrong(format!("{} vertices ({failure})", vertices.len()), "at most 2^32".into()))?;
        Ok(Self { tree, parts: &labels.parts })
    }

    /// The vertex nearest to a point. `point` has to be finite.
    pub fn nearest_vertex(&self, point: Vec3) -> usize {
        self.tree.query(&point.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute().item as usize
    }

    /// The part of the nearest vertex, and how far that vertex is, metres. `point` has to be finite.
    pub fn nearest(&self, point: Vec3) -> (Part, f32) {
        let found = self.tree.query(&point.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
        (self.parts[found.item as usize], found.distance.sqrt())
    }
}

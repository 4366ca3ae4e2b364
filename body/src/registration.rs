//! Which part of the body a point belongs to: that of the nearest registered vertex (thesis 5.1.4).
//!
//! V vertices; world coordinates, metres. Of equally near vertices any may answer, the same one every time.

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::{Part, PartLabels};
use xavatar_formats::{Error, Result};

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

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::PartLabelSource;

    fn labels(count: usize) -> PartLabels {
        let parts = (0..count).map(|vertex| Part(vertex as u8 % 4)).collect();
        PartLabels { parts, detail: vec![false; count], source: PartLabelSource::SkinningWeights }
    }

    #[test]
    fn the_nearest_vertex_of_all_answers() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let vertices: Vec<Vec3> = (0..500).map(|_| random.random::<[f32; 3]>().into()).collect();
        let labels = labels(vertices.len());
        let registration = Registration::new(&vertices, &labels).unwrap();
        for _ in 0..500 {
            let point = Vec3::from(random.random::<[f32; 3]>()) * 2.0 - 0.5;
            let distance = |vertex: usize| vertices[vertex].distance(point);
            let nearest = (0..vertices.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap();
            let (part, found) = registration.nearest(point);
            assert_eq!(part, labels.parts[nearest]);
            assert!((found - distance(nearest)).abs() < 1e-6);
        }
    }

    #[test]
    fn coinciding_vertices_do_no_harm() {
        let mut vertices = vec![Vec3::ONE; 3000];
        vertices.extend(vec![Vec3::new(1.0, 2.0, 1.0); 3000]);
        let labels = labels(vertices.len());
        let (_, distance) = Registration::new(&vertices, &labels).unwrap().nearest(Vec3::new(1.0, 1.9, 1.0));
        assert!((distance - 0.1).abs() < 1e-6);
    }
}

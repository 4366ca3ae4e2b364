//! The terms of a free surface, each with its gradient added to one that is given. Sums over pulls, V vertices x or E edges e = x_i - x_j.
//!
//! | term | is |
//! |---|---|
//! | pulls | sum |w . x_(i, j, k) - y|^2, of places in faces (or at vertices) to places y of the scan |
//! | laplacian | sum |x_i - mean of its neighbours|^2 |
//! | edge vectors | sum |e - e_0|^2, e_0 of the start |
//! | edge lengths | sum (|e|^2 - |e_0|^2)^2 |

use std::collections::BTreeSet;

use glam::DVec3;

/// A place of a surface that belongs where a scan's is.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    /// The vertices that the place hangs on.
    pub vertices: [usize; 3],
    /// How much on each; of sum 1.
    pub weights: [f64; 3],
    /// Where it belongs.
    pub place: DVec3,
}

/// How vertices hang together, and where they started.
pub struct Mesh {
    edges: Vec<(usize, usize)>,
    starts: Vec<DVec3>,
    neighbours: Vec<Vec<usize>>,
}

impl Pull {
    /// Of a vertex.
    pub fn of_vertex(vertex: usize, place: DVec3) -> Self {
        Self { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0], place }
    }
}

/// sum |w . x_(i, j, k) - y|^2
pub fn pulls(x: &[DVec3], pulls: &[Pull], gradient: &mut [DVec3]) -> f64 {
    let one = |Pull { vertices, weights, place }: &Pull| {
        let found: DVec3 = vertices.iter().zip(weights).map(|(vertex, weight)| x[*vertex] * *weight).sum();
        let way = found - *place;
        vertices.iter().zip(weights).for_each(|(vertex, weight)| gradient[*vertex] += way * (2.0 * weight));
        way.length_squared()
    };
    pulls.iter().map(one).sum()
}

impl Mesh {
    /// Of faces over vertices at their start.
    pub fn new(faces: &[[u32; 3]], start: &[DVec3]) -> Self {
        let sides = |[a, b, c]: &[u32; 3]| [(*a, *b), (*b, *c), (*c, *a)];
        let edges: BTreeSet<(usize, usize)> =
            faces.iter().flat_map(sides).map(|(a, b)| (a.min(b) as usize, a.max(b) as usize)).collect();
        let mut neighbours = vec![Vec::new(); start.len()];
        for (a, b) in &edges {
            neighbours[*a].push(*b);
            neighbours[*b].push(*a);
        }
        Self {
            starts: edges.iter().map(|(a, b)| start[*a] - start[*b]).collect(),
            edges: edges.into_iter().collect(),
            neighbours,
        }
    }

    /// The vertices that share an edge with one.
    pub fn neighbours(&self, vertex: usize) -> &[usize] {
        &self.neighbours[vertex]
    }

    /// weight sum |x_i - mean of its neighbours|^2
    pub fn laplacian(&self, x: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
        let mut energy = 0.0;
        for (vertex, neighbours) in self.neighbours.iter().enumerate().filter(|(_, neighbours)| !neighbours.is_empty())
        {
            let share = 1.0 / neighbours.len() as f64;
            let rough = x[vertex] - neighbours.iter().map(|other| x[*other]).sum::<DVec3>() * share;
            energy += weight * rough.length_squared();
            gradient[vertex] += rough * (2.0 * weight);
            neighbours.iter().for_each(|other| gradient[*other] -= rough * (2.0 * weight * share));
        }
        energy
    }

    /// weight sum |e - e_0|^2
    pub fn edge_vectors(&self, x: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
        self.over_edges(x, gradient, |edge, start| {
            let change = edge - start;
            (weight * change.length_squared(), change * (2.0 * weight))
        })
    }

    /// weight sum (|e|^2 - |e_0|^2)^2
    pub fn edge_lengths(&self, x: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
        self.over_edges(x, gradient, |edge, start| {
            let change = edge.length_squared() - start.length_squared();
            (weight * change * change, edge * (4.0 * weight * change))
        })
    }

    /// The sum of a term of each edge and its start, which gives its energy and its slope by the edge.
    fn over_edges(&self, x: &[DVec3], gradient: &mut [DVec3], term: impl Fn(DVec3, DVec3) -> (f64, DVec3)) -> f64 {
        let mut energy = 0.0;
        for ((a, b), start) in self.edges.iter().zip(&self.starts) {
            let (of_edge, slope) = term(x[*a] - x[*b], *start);
            energy += of_edge;
            gradient[*a] += slope;
            gradient[*b] -= slope;
        }
        energy
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use safetensors::SafeTensors;

    use super::*;

    // Values and gradients as numpy has them, in double precision.
    #[test]
    fn terms_and_gradients_are_the_golden_ones() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/body/registration_terms.safetensors");
        let bytes = std::fs::read(path).unwrap();
        let golden = SafeTensors::deserialize(&bytes).unwrap();
        let words = |name: &str| golden.tensor(name).unwrap().data().as_chunks::<8>().0.to_vec();
        let numbers = |name: &str| words(name).into_iter().map(f64::from_le_bytes).collect::<Vec<f64>>();
        let indices = |name: &str| words(name).into_iter().map(|word| i64::from_le_bytes(word) as usize);
        let places = |name: &str| -> Vec<DVec3> {
            numbers(name).as_chunks::<3>().0.iter().map(|place| DVec3::from_array(*place)).collect()
        };
        let faces: Vec<u32> = indices("faces").map(|vertex| vertex as u32).collect();
        let mesh = Mesh::new(faces.as_chunks::<3>().0, &places("source"));
        let (x, scan, values) = (places("x"), places("scan"), numbers("terms"));
        let pairs: Vec<usize> = indices("mutual").collect();
        let mutual: Vec<Pull> = pairs.as_chunks::<2>().0.iter().map(|[i, j]| Pull::of_vertex(*i, scan[*j])).collect();
        let near = |of: &dyn Fn(&mut [DVec3]) -> f64, value: f64, gradient: &str| {
            let mut found = vec![DVec3::ZERO; x.len()];
            let energy = of(&mut found);
            assert!((energy - value).abs() < 1e-10, "{gradient}: {energy} instead of {value}");
            let far = found.iter().zip(places(gradient)).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
            assert!(far < 1e-10, "{gradient}: {far}");
        };
        near(&|gradient| pulls(&x, &mutual, gradient), values[0], "d_mutual");
        near(&|gradient| mesh.laplacian(&x, 1.0, gradient), values[1], "d_laplacian");
        near(&|gradient| mesh.edge_vectors(&x, 1.0, gradient), values[2], "d_edge_vectors");
        near(&|gradient| mesh.edge_lengths(&x, 1.0, gradient), values[3], "d_edge_lengths");
    }

    // d/dx of a pull on the middle of a face, by finite differences.
    #[test]
    fn pulls_on_faces_slope_as_finite_differences_say() {
        const STEP: f64 = 1e-6;
        let x = [DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.7, -0.1, 0.2), DVec3::new(-0.4, 0.5, 0.6)];
        let pull = [Pull { vertices: [2, 0, 1], weights: [0.5, 0.3, 0.2], place: DVec3::new(0.3, 0.9, 0.1) }];
        let mut gradient = [DVec3::ZERO; 3];
        pulls(&x, &pull, &mut gradient);
        for (vertex, slope) in gradient.iter().enumerate() {
            for axis in 0..3 {
                let at = |step: f64| {
                    let mut x = x;
                    x[vertex][axis] += step;
                    pulls(&x, &pull, &mut [DVec3::ZERO; 3])
                };
                let numeric = (at(STEP) - at(-STEP)) / (2.0 * STEP);
                assert!((numeric - slope[axis]).abs() < 1e-8, "{vertex} {axis}: {numeric} {}", slope[axis]);
            }
        }
    }
}

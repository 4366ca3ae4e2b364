//! What coefficients of shape and of expression do to an imported body. V vertices; metres.

use glam::DVec3;

/// A direction of the body.
pub(crate) struct Direction {
    pub name: String,
    /// What a unit moves the vertices by (V).
    pub offsets: Vec<DVec3>,
    /// What it moves the joints by (55).
    pub joints: Vec<DVec3>,
}

/// Shapes, then expressions.
pub(crate) struct Directions {
    pub shapes: Vec<Direction>,
    pub expressions: Vec<Direction>,
}

impl Directions {
    /// All, shapes first.
    pub fn all(&self) -> impl Iterator<Item = &Direction> + Clone {
        self.shapes.iter().chain(&self.expressions)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.shapes.len() + self.expressions.len()
    }

    /// As in a model's file: (V, 3, directions), row-major.
    pub fn interleaved(&self) -> Vec<f32> {
        let vertices = self.shapes.first().map_or(0, |shape| shape.offsets.len());
        let all = || self.all();
        (0..3 * vertices).flat_map(|at| all().map(move |direction| direction.offsets[at / 3][at % 3] as f32)).collect()
    }

    pub fn shape_names(&self) -> Vec<String> {
        self.shapes.iter().map(|shape| shape.name.clone()).collect()
    }

    pub fn expression_names(&self) -> Vec<String> {
        self.expressions.iter().map(|expression| expression.name.clone()).collect()
    }
}

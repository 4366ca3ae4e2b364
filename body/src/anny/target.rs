//! A target: offsets of some vertices of the base mesh, in text lines `index dx dy dz`, decimetres.

use glam::DVec3;

/// Newborns are babies drawn together by these, the body along y more than across (Anny's values).
const NEWBORN_SCALE: DVec3 = DVec3::new(0.922, 0.75, 0.922);
/// The weights of the targets that are of a newborn add up to this: universal, height, and one for all origins.
const NEWBORN_WEIGHT: f64 = 3.0;

/// Offsets of vertices.
#[derive(Clone, Debug, Default)]
pub(super) struct Target {
    offsets: Vec<(usize, DVec3)>,
}

impl Target {
    /// Reads a target of a mesh of so many vertices; the error is the number of the line that is none.
    pub fn parse(text: &str, vertices: usize) -> Result<Self, usize> {
        let mut offsets = Vec::new();
        for (number, line) in (1_usize..).zip(text.lines()) {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            offsets.push(offset(line).filter(|(vertex, _)| *vertex < vertices).ok_or(number)?);
        }
        Ok(Self { offsets })
    }

    /// Moves vertices by so many times the offsets.
    pub fn add_to(&self, vertices: &mut [DVec3], weight: f64) {
        self.offsets.iter().for_each(|(vertex, offset)| vertices[*vertex] += *offset * weight);
    }

    /// Takes back, of offsets that were added, what a newborn is smaller than a baby, and as much of the mesh itself.
    pub fn shrink_to_newborn(&self, vertices: &mut [DVec3], base: &[DVec3], weight: f64) {
        let less = NEWBORN_SCALE - DVec3::ONE;
        self.offsets.iter().for_each(|(vertex, offset)| vertices[*vertex] += less * *offset * weight);
        for (vertex, base) in vertices.iter_mut().zip(base) {
            *vertex += less / NEWBORN_WEIGHT * *base * weight;
        }
    }
}

fn offset(line: &str) -> Option<(usize, DVec3)> {
    let mut words = line.split_ascii_whitespace();
    let vertex = words.next()?.parse().ok()?;
    let mut number = || words.next()?.parse().ok().filter(|number: &f64| number.is_finite());
    let offset = DVec3::new(number()?, number()?, number()?);
    words.next().is_none().then_some((vertex, offset))
}

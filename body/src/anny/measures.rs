//! How tall and how heavy a body is, and the phenotype of a body that is so tall and so heavy.

use glam::DVec3;

use super::base_mesh::BaseMesh;
use super::phenotype::Phenotype;
use super::t_pose::TPose;
use super::{Body, Wanted, wrong_value};
use xavatar_formats::Result;
use xavatar_mesh::TriangleMesh;

/// Of a living body, kilograms a cubic metre.
const DENSITY: f64 = 985.0;
/// Rounds in which height and weight are found in turn: each changes the other a little.
const ROUNDS: usize = 12;
/// Halvings of the range of an entry, from 1 to a ten-thousandth.
const HALVINGS: usize = 14;
/// Metres and kilograms that are near enough.
const NEAR: [f64; 2] = [5e-4, 0.05];

/// What is measured of a body.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Measures {
    /// From sole to crown, metres.
    pub height: f64,
    /// Litres.
    pub volume: f64,
    /// Kilograms, at the density of a body.
    pub weight: f64,
}

impl Measures {
    /// Of the body's vertices (V) in the T-pose, metres.
    pub(super) fn of(base: &BaseMesh, used: &[usize], template: &[DVec3]) -> Self {
        // Which quads are cut how does not matter to a volume.
        let mut vertices = base.vertices.clone();
        used.iter().zip(template).for_each(|(vertex, place)| vertices[*vertex] = *place);
        let (faces, _) = base.triangles(&vertices);
        let corner = |vertex: u32| template[vertex as usize];
        let volume: f64 = faces.iter().map(|[a, b, c]| corner(*a).dot(corner(*b).cross(corner(*c)))).sum::<f64>() / 6.0;
        Self::new(template.iter().map(|vertex| vertex.y), volume)
    }

    /// Of a closed mesh at rest, metres.
    pub fn of_mesh(mesh: &TriangleMesh) -> Self {
        Self::new(mesh.vertices.iter().map(|vertex| f64::from(vertex.y)), mesh.volume())
    }

    /// Of vertices' heights, metres, and a volume, cubic metres.
    fn new(heights: impl Iterator<Item = f64>, volume: f64) -> Self {
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), height| (low.min(height), high.max(height)));
        Self { height: high - low, volume: volume * 1e3, weight: volume * DENSITY }
    }
}

/// The wanted phenotype, its height and weight found for those that are wanted in metres and kilograms.
pub(super) fn settled(body: &mut Body, wanted: &Wanted) -> Result<Phenotype> {
    let mut phenotype = wanted.phenotype;
    let wishes = [("height", wanted.height), ("weight", wanted.weight)];
    let measured = |measures: &Measures, entry: &str| if entry == "height" { measures.height } else { measures.weight };
    for _ in 0..ROUNDS {
        for (entry, wish) in wishes {
            if let Some(wish) = wish {
                phenotype = found(body, &phenotype, entry, wish, |measures| measured(measures, entry))?;
            }
        }
        let measures = of_phenotype(body, &phenotype)?;
        let is_near = |((entry, wish), near): (&(&str, Option<f64>), f64)| {
            wish.is_none_or(|wish| (measured(&measures, entry) - wish).abs() <= near)
        };
        if wishes.iter().zip(NEAR).all(is_near) {
            return Ok(phenotype);
        }
    }
    let measures = of_phenotype(body, &phenotype)?;
    let found = format!("nearest at {:.2} m and {:.1} kg", measures.height, measures.weight);
    Err(wrong_value("a body of that height and weight", found, "another of either, or another phenotype"))
}

/// The phenotype whose `entry` gives the measure that is wanted.
fn found(
    body: &mut Body,
    phenotype: &Phenotype,
    entry: &str,
    wanted: f64,
    measure: impl Fn(&Measures) -> f64,
) -> Result<Phenotype> {
    let mut at = |value: f64| Ok(measure(&of_phenotype(body, &phenotype.with(entry, value))?));
    let (mut low, mut high) = (0.0, 1.0);
    let (least, most) = (at(low)?, at(high)?);
    if !(least.min(most)..=least.max(most)).contains(&wanted) {
        let name = format!("the {entry}");
        return Err(wrong_value(
            &name,
            wanted,
            format!("{least:.2} to {most:.2}, what bodies of this phenotype ({phenotype}) have"),
        ));
    }
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        if (at(middle)? < wanted) == (least < most) { low = middle } else { high = middle }
    }
    Ok(phenotype.with(entry, (low + high) / 2.0))
}

fn of_phenotype(body: &mut Body, phenotype: &Phenotype) -> Result<Measures> {
    let shaped = body.shaped(phenotype)?;
    let used = body.base.used_vertices();
    let skinned = TPose::of(&body.rig, &shaped).skinned(&body.rig, &shaped);
    let template: Vec<DVec3> = used.iter().map(|vertex| skinned[*vertex]).collect();
    Ok(Measures::of(&body.base, &used, &template))
}

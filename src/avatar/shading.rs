//! Normals and colours of an extracted surface, from the fields at each vertex's canonical point.
//!
//! n_d = normalise(+-J^-T grad f), c = texture(x_c, n_d). In the canonical pose J is the identity. A posed vertex comes with a
//! guess of its canonical point; Newton's method on the exact warp, x_c <- x_c - J^-1 (d(x_c) - x_d), makes it good.
//! V vertices, J joints; metres.

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use xavatar_deformer::{BoneTransform, ExactWorkspace, Jacobian, deformed_normals};
use xavatar_network::{SkinningTrace, TextureField, Trace};

use super::BLOCK_ROWS;
use crate::Result;
use crate::correspondence::PosedWarp;
use crate::fields::Fields;
use crate::mesh::{Colouring, TriangleMesh};

/// Newton steps; the first leaves less than a tenth of a millimetre of a guess that is a cell off.
const NEWTON_STEPS: usize = 3;
/// Residual from which one more step is enough for colours and normals, metres.
const NEAR: f32 = 1e-3;
/// Longest Newton step, metres; a longer one leads to another part of the body.
const LONGEST_STEP: f32 = 0.03;
const IDENTITY: Jacobian<f32> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The pose of a mesh that is shaded.
pub(super) enum Posing<'a> {
    /// Vertices are canonical points.
    Canonical,
    /// Vertices are deformed by this warp.
    Deformed(&'a PosedWarp<'a>),
}

/// Sets the normals and colours of `mesh` (V), whose vertices' canonical points are `canonical` (V) or near them.
pub(super) fn shade(
    fields: &Fields<f32>,
    embedded: &[f32],
    posing: &Posing,
    canonical: &[[f32; 3]],
    mesh: &mut TriangleMesh,
) -> Result<()> {
    let shades = shades(fields, embedded, posing, canonical, &mesh.vertices)?;
    mesh.normals = Some(shades.iter().map(|(normal, _)| *normal).collect());
    mesh.colouring = Colouring::Vertex(shades.into_iter().map(|(_, colour)| colour).collect());
    Ok(())
}

/// Normals and colours at points (V), whose canonical points are `canonical` (V) or near them.
pub(super) fn shades(
    fields: &Fields<f32>,
    embedded: &[f32],
    posing: &Posing,
    canonical: &[[f32; 3]],
    points: &[Vec3],
) -> Result<Vec<(Vec3, [u8; 3])>> {
    let warp = match posing {
        Posing::Canonical => None,
        Posing::Deformed(warp) => Some(*warp),
    };
    let mut shades = vec![(Vec3::ZERO, [0u8; 3]); canonical.len()];
    let blocks = canonical.par_chunks(BLOCK_ROWS).zip(points.par_chunks(BLOCK_ROWS));
    shades.par_chunks_mut(BLOCK_ROWS).zip(blocks).try_for_each_init(
        Shader::default,
        |shader, (shades, (guesses, targets))| {
            shader.place(warp, guesses, targets);
            shader.shade(fields, embedded, shades)
        },
    )?;
    Ok(shades)
}

/// One thread's memory while it shades vertices.
#[derive(Default)]
struct Shader {
    canonical: Vec<[f32; 3]>,
    jacobians: Vec<Jacobian<f32>>,
    transforms: Vec<BoneTransform<f32>>,
    skinning: ExactWorkspace<f32, SkinningTrace<f32>>,
    geometry: Trace<f32>,
    texture: Trace<f32>,
}

impl Shader {
    /// Finds canonical points and the warp's Jacobians there.
    fn place(&mut self, warp: Option<&PosedWarp>, guesses: &[[f32; 3]], targets: &[Vec3]) {
        self.canonical.clear();
        self.canonical.extend_from_slice(guesses);
        self.jacobians.clear();
        self.jacobians.resize(guesses.len(), IDENTITY);
        let Some(warp) = warp else { return };
        self.transforms.resize(guesses.len(), [0.0; 12]);
        for _ in 0..NEWTON_STEPS {
            let Self { canonical, jacobians, transforms, skinning, .. } = self;
            warp.transforms_and_jacobians(skinning, canonical, transforms, jacobians);
            let mut farthest = 0.0_f32;
            for (((point, transform), jacobian), target) in
                canonical.iter_mut().zip(transforms).zip(jacobians).zip(targets)
            {
                let residual = image(transform, *point) - *target;
                let step = Mat3::from_cols_array_2d(jacobian).transpose().inverse() * residual;
                if step.length() < LONGEST_STEP {
                    *point = (Vec3::from_array(*point) - step).to_array();
                    farthest = farthest.max(residual.length());
                }
            }
            // Newton's method converges quadratically: what is left is below a hundredth of a millimetre.
            if farthest < NEAR {
                break;
            }
        }
    }

    fn shade(&mut self, fields: &Fields<f32>, embedded: &[f32], shades: &mut [(Vec3, [u8; 3])]) -> Result<()> {
        let Self { canonical, jacobians, geometry, texture, .. } = self;
        let count = canonical.len();
        let network = &fields.geometry.mlp;
        network.forward(geometry, canonical.as_flattened(), embedded, &[]);
        network.input_gradient(geometry, &vec![1.0; count]);
        let mut normals = vec![[0.0; 3]; count];
        deformed_normals(geometry.gradient().as_chunks().0, jacobians, fields.gradient_side(), &mut normals)?;
        let inputs: Vec<f32> = match fields.texture.sees_normals() {
            true => canonical.iter().zip(&normals).flat_map(|(point, normal)| [*point, *normal]).flatten().collect(),
            false => canonical.as_flattened().to_vec(),
        };
        fields.texture.mlp.forward(texture, &inputs, embedded, geometry.features(network));
        let mut colours = vec![0.0; 3 * count];
        TextureField::colours(texture.output(), &mut colours);
        for ((shade, normal), colour) in shades.iter_mut().zip(normals).zip(colours.as_chunks::<3>().0) {
            *shade = (Vec3::from_array(normal), colour.map(|channel| (channel * 255.0).round() as u8));
        }
        Ok(())
    }
}

/// A x~.
fn image(transform: &BoneTransform<f32>, point: [f32; 3]) -> Vec3 {
    let row = |r: usize| Vec3::from_slice(&transform[4 * r..]).dot(Vec3::from_array(point)) + transform[4 * r + 3];
    Vec3::new(row(0), row(1), row(2))
}

//! Builds a body model from arrays, as a file of one has them, and poses it.
//!
//!     cargo run --release --example body -- tall.ply
//!
//! The arrays are those of SMPL-X's .npz, with any number of vertices: `v_template` (V, 3), `shapedirs` (V, 3, 20), `posedirs` (V, 3, 486),
//! `J_regressor` (55, V), `weights` (V, 55), `f` (F, 3) and the hands' means. Here they are the built-in subject's, made ten percent taller.

use std::path::{Path, PathBuf};

use xavatar::body::{BodyModel, PartLabels};
use xavatar::formats::{Array, write_npz};
use xavatar::mesh::write_ply;
use xavatar::synthetic::BuiltInSubject;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = PathBuf::from(std::env::args().nth(1).ok_or("give a .ply to write")?);
    let mut arrays = BuiltInSubject::new()?.model_arrays().clone();
    let template = &arrays["v_template"];
    let taller: Vec<f32> = template.to_f32().ok_or("no numbers")?.into_iter().map(|metres| 1.1 * metres).collect();
    let template = Array::from_f32(&template.shape, taller);
    arrays.insert("v_template".into(), template);

    // The path is what messages name; `BodyModel::load` reads a file instead.
    let body = BodyModel::from_arrays(Path::new("taller"), &arrays)?;
    // Without label files, a vertex belongs to the part whose bones move it most.
    let labels = PartLabels::from_skinning_weights(&body);
    println!("{} vertices, {} part labels", body.vertex_count(), labels.parts.len());

    let posed = body.pose(&body.skeleton().rest_pose())?;
    let head = body.skeleton().joint("head").ok_or("no such joint")?;
    println!("the head turns about {:.2}", posed.joints[head]);
    write_ply(&out, &body.mesh(posed.vertices))?;
    // Other verbs take such a file as --body.
    write_npz(out.with_file_name("SMPLX_NEUTRAL.npz"), &arrays)?;
    println!("{}", out.display());
    Ok(())
}

//! `xavatar info`: what a file holds.

use std::path::{Path, PathBuf};

use anyhow::bail;
use xavatar::avatar::Avatar;
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::data::{ArrayMap, Value, read_motion, read_npy, read_npz, read_pickle, read_pickle_arrays};
use xavatar::fields::FIELD_NAMES;
use xavatar::mesh::{Colouring, Topology, read_mesh};

use super::Outcome;

/// Say what a file holds: avatars, runs, body models, motions, arrays, meshes
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  xavatar info runs/00016\n  xavatar info models/smplx/SMPLX_NEUTRAL.npz")]
pub struct Info {
    /// A run's folder, .safetensors, .npz, .npy, .pkl, .ply or .obj
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

impl Info {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let path = &self.file;
        if !path.exists() {
            bail!("{}: no such file or folder", path.display());
        }
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension {
            _ if path.is_dir() || extension == "safetensors" => print_avatar(path)?,
            "npz" => print_arrays(path, &read_npz(path)?),
            "npy" => println!("{}", read_npy(path)?.description()),
            "pkl" => match read_pickle(path)? {
                Value::Dict(_) => print_arrays(path, &read_pickle_arrays(path)?),
                Value::Array(array) => println!("pickled {}", array.description()),
                value => println!("pickled {}", value.kind()),
            },
            "ply" | "obj" => print_mesh(path)?,
            _ => bail!("{}: expected a run's folder, .safetensors, .npz, .npy, .pkl, .ply or .obj", path.display()),
        }
        Ok(Outcome::Done)
    }
}

fn print_avatar(path: &Path) -> anyhow::Result<()> {
    let Avatar { fields, config, subject, steps } = Avatar::load(path)?;
    println!(
        "avatar of a {} subject: preset {}, {steps} steps on {} frames",
        subject.gender, config.preset, subject.frames
    );
    println!("surface: {:?}", fields.geometry.representation);
    for (name, network) in FIELD_NAMES.into_iter().zip(fields.networks()) {
        println!("{name}: {} parameters", network.parameters().len());
    }
    if let Some(voxels) = fields.skinning.voxels() {
        println!("skinning: {} logits at {} nodes", voxels.parameters().len(), voxels.baked().grid().len());
    }
    println!("betas: {:?}", subject.betas);
    let (low, high) = subject.bounds;
    println!("canonical box: {low} to {high} m");
    println!("configuration:\n{}", config.to_toml().trim_end());
    Ok(())
}

fn print_arrays(path: &Path, arrays: &ArrayMap) {
    if arrays.contains_key("v_template") {
        print_body(path, arrays);
    } else if let Ok(motion) = read_motion(path) {
        let rate = motion.frames_per_second.map_or_else(String::new, |rate| format!(" at {rate} frames/s"));
        println!("motion: {} frames{rate}; {}", motion.frames.len(), motion.source);
    }
    for (name, array) in arrays {
        println!("  {name:<24} {}", array.description());
    }
}

fn print_body(path: &Path, arrays: &ArrayMap) {
    match BodyModel::from_arrays(path, arrays) {
        Ok(body) => {
            let gender = Gender::of_file_name(path).map_or("of no stated gender".into(), |gender| gender.to_string());
            println!("SMPL-X body model, {gender}: {} vertices, {} faces", body.vertex_count(), body.faces().len());
            match PartLabels::find(&body) {
                Ok(labels) => println!("part labels: {}", labels.source),
                Err(error) => println!("part labels: {error}"),
            }
        }
        Err(error) => println!("not a usable body model: {error}"),
    }
}

fn print_mesh(path: &Path) -> anyhow::Result<()> {
    let mesh = read_mesh(path)?;
    let topology = Topology::of(&mesh.merged_by_position());
    let colours = match &mesh.colouring {
        Colouring::None => "no colours".into(),
        Colouring::Vertex(_) => "vertex colours".into(),
        Colouring::Texture { image, .. } => format!("a texture of {} x {}", image.width(), image.height()),
    };
    println!("mesh: {} vertices, {} faces, {colours}", mesh.vertices.len(), mesh.faces.len());
    println!(
        "{}; {} open edges, {} parts",
        if topology.is_watertight() { "watertight" } else { "not watertight" },
        topology.open_edges,
        topology.components
    );
    Ok(())
}

//! `xavatar info`: what a file holds.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde::Serialize;
use xavatar::avatar::{Avatar, Subject};
use xavatar::body::{BodyModel, Gender, PartLabels};
use xavatar::config::Config;
use xavatar::data::{Clip, Motion, MotionOptions, read_motion};
use xavatar::fields::FIELD_NAMES;
use xavatar::formats::Shown;
use xavatar::formats::{Array, ArrayFile, ArrayMap, Container, Error as InputError, read_pickle};
use xavatar::mesh::{Colouring, Topology, read_mesh};

use super::Outcome;
use super::json::JsonArgument;

/// Say what a file holds: avatars, runs, body models, motions, arrays, meshes
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar info runs/00016\n  xavatar info models/smplx/SMPLX_NEUTRAL.npz\n  xavatar info runs/00016 --json -")]
pub struct Info {
    /// A run's folder, .safetensors, .npz, .npy, .pkl, .pt, .json, .bvh, .ply or .obj
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

impl Info {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let path = &self.file;
        self.json.check()?;
        if !path.exists() {
            bail!("{}: no such file or folder", path.display());
        }
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let content = match extension {
            _ if path.is_dir() || extension == "safetensors" => of_avatar(path)?,
            "bvh" => of_motion(read_motion(path)?, Arrays::new()),
            "ply" | "obj" => of_mesh(path)?,
            _ => of_array_file(path)?,
        };
        self.json.print(&content, &content)?;
        Ok(Outcome::Done)
    }
}

/// What a file holds. `Display` is for people, serde for scripts.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Content {
    Avatar(Box<AvatarDescription>),
    BodyModel { gender: Option<Gender>, vertices: usize, faces: usize, part_labels: String, arrays: Arrays },
    UnusableBodyModel { problem: String, arrays: Arrays },
    Motion { frames: usize, frames_per_second: Option<f32>, source: String, report: Vec<String>, arrays: Arrays },
    Arrays { arrays: Arrays, problem: Option<String> },
    Array(ArrayDescription),
    Pickle { holds: &'static str },
    Mesh { vertices: usize, faces: usize, colours: String, watertight: bool, open_edges: usize, parts: usize },
}

type Arrays = BTreeMap<String, ArrayDescription>;

#[derive(Serialize)]
struct AvatarDescription {
    steps: u64,
    surface: String,
    /// Number of parameters by network.
    parameters: BTreeMap<&'static str, usize>,
    /// Number of logits and of grid nodes, where skinning is on a grid.
    skinning_grid: Option<(usize, usize)>,
    subject: Subject,
    config: Config,
}

#[derive(Serialize)]
struct ArrayDescription {
    #[serde(rename = "type")]
    element: &'static str,
    shape: Vec<usize>,
    #[serde(skip)]
    description: String,
}

impl ArrayDescription {
    fn of(array: &Array) -> Self {
        Self { element: array.kind(), shape: array.shape.clone(), description: array.description() }
    }
}

fn of_avatar(path: &Path) -> anyhow::Result<Content> {
    let Avatar { fields, config, subject, steps } = Avatar::load(path)?;
    let parameters = FIELD_NAMES.into_iter().zip(fields.networks());
    let voxels = fields.skinning.voxels();
    Ok(Content::Avatar(Box::new(AvatarDescription {
        steps,
        surface: format!("{:?}", fields.geometry.representation),
        parameters: parameters.map(|(name, network)| (name, network.parameters().len())).collect(),
        skinning_grid: voxels.map(|voxels| (voxels.parameters().len(), voxels.baked().grid().len())),
        subject,
        config,
    })))
}

/// A file of arrays, in whatever container, or of a motion without any.
fn of_array_file(path: &Path) -> anyhow::Result<Content> {
    let Some(file) = ArrayFile::read(path)? else {
        return match read_motion(path) {
            Ok(motion) => Ok(of_motion(motion, Arrays::new())),
            Err(_) => bail!(
                "{}: expected a run's folder, .safetensors, .npz, .npy, .pkl, .pt, .json, .bvh, .ply or .obj",
                path.display()
            ),
        };
    };
    Ok(match file.single() {
        Some(array) => match read_motion(path) {
            Ok(motion) => of_motion(motion, Arrays::from([(String::new(), ArrayDescription::of(array))])),
            Err(_) => Content::Array(ArrayDescription::of(array)),
        },
        None if file.arrays.is_empty() && file.container == Container::Pickle => {
            Content::Pickle { holds: read_pickle(path)?.kind() }
        }
        None => of_arrays(path, &file.arrays),
    })
}

fn of_arrays(path: &Path, arrays: &ArrayMap) -> Content {
    let described = arrays.iter().map(|(name, array)| (name.clone(), ArrayDescription::of(array))).collect();
    if arrays.contains_key("v_template") {
        return of_body(path, arrays, described);
    }
    match read_motion(path) {
        Ok(motion) => of_motion(motion, described),
        Err(InputError::Unrecognised { .. }) => Content::Arrays { arrays: described, problem: None },
        // It is meant to be a motion.
        Err(error) => Content::Arrays { arrays: described, problem: Some(error.to_string()) },
    }
}

fn of_motion(motion: Motion, arrays: Arrays) -> Content {
    let (frames, frames_per_second, source) = (motion.frames.len(), motion.frames_per_second, motion.source.clone());
    let report = Clip::of(motion, &MotionOptions::default()).map_or_else(
        |error| vec![error.to_string()],
        |clip| {
            let warnings = clip.warnings.into_iter().map(|line| format!("warning: {line}"));
            clip.report.into_iter().chain(warnings).collect()
        },
    );
    Content::Motion { frames, frames_per_second, source, report, arrays }
}

fn of_body(path: &Path, arrays: &ArrayMap, described: Arrays) -> Content {
    match BodyModel::from_arrays(path, arrays) {
        Ok(body) => Content::BodyModel {
            gender: Gender::of_file_name(path),
            vertices: body.vertex_count(),
            faces: body.faces().len(),
            part_labels: PartLabels::find(&body)
                .map_or_else(|error| error.to_string(), |labels| labels.source.to_string()),
            arrays: described,
        },
        Err(error) => Content::UnusableBodyModel { problem: error.to_string(), arrays: described },
    }
}

fn of_mesh(path: &Path) -> anyhow::Result<Content> {
    let mesh = read_mesh(path)?;
    let topology = Topology::of(&mesh.merged_by_position());
    Ok(Content::Mesh {
        vertices: mesh.vertices.len(),
        faces: mesh.faces.len(),
        colours: match &mesh.colouring {
            Colouring::None => "no colours".into(),
            Colouring::Vertex(_) => "vertex colours".into(),
            Colouring::Texture { image, .. } => format!("a texture of {} x {}", image.width(), image.height()),
        },
        watertight: topology.is_watertight(),
        open_edges: topology.open_edges,
        parts: topology.components,
    })
}

impl fmt::Display for Content {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Avatar(avatar) => write!(formatter, "{avatar}"),
            Self::BodyModel { gender, vertices, faces, part_labels, arrays } => {
                let gender = gender.map_or("of no stated gender".into(), |gender| gender.to_string());
                writeln!(formatter, "SMPL-X body model, {gender}: {vertices} vertices, {faces} faces")?;
                writeln!(formatter, "part labels: {part_labels}")?;
                write_arrays(formatter, arrays)
            }
            Self::UnusableBodyModel { problem, arrays } => {
                writeln!(formatter, "not a usable body model: {problem}")?;
                write_arrays(formatter, arrays)
            }
            Self::Motion { report, arrays, .. } => {
                report.iter().try_for_each(|line| writeln!(formatter, "{line}"))?;
                write_arrays(formatter, arrays)
            }
            Self::Arrays { arrays, problem } => {
                if let Some(problem) = problem {
                    writeln!(formatter, "not a usable motion: {problem}")?;
                }
                write_arrays(formatter, arrays)
            }
            Self::Array(array) => writeln!(formatter, "{}", array.description),
            Self::Pickle { holds } => writeln!(formatter, "pickled {holds}"),
            Self::Mesh { vertices, faces, colours, watertight, open_edges, parts } => {
                let watertight = if *watertight { "watertight" } else { "not watertight" };
                writeln!(formatter, "mesh: {vertices} vertices, {faces} faces, {colours}")?;
                writeln!(formatter, "{watertight}; {open_edges} open edges, {parts} parts")
            }
        }
    }
}

impl fmt::Display for AvatarDescription {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, surface, parameters, skinning_grid, subject, config } = self;
        let Subject { gender, frames, betas, bounds: (low, high), .. } = subject;
        writeln!(
            formatter,
            "avatar of a {gender} subject: preset {}, {steps} steps on {frames} frames",
            config.preset
        )?;
        writeln!(formatter, "surface: {surface}")?;
        for (name, parameters) in parameters {
            writeln!(formatter, "{name}: {parameters} parameters")?;
        }
        if let Some((logits, nodes)) = skinning_grid {
            writeln!(formatter, "skinning: {logits} logits at {nodes} nodes")?;
        }
        writeln!(formatter, "betas: {betas:?}\ncanonical box: {low} to {high} m")?;
        writeln!(formatter, "configuration:\n{}", config.to_toml().map_err(|_| fmt::Error)?.trim_end())
    }
}

fn write_arrays(formatter: &mut fmt::Formatter<'_>, arrays: &Arrays) -> fmt::Result {
    arrays
        .iter()
        .try_for_each(|(name, array)| writeln!(formatter, "  {:<24} {}", Shown(name).to_string(), array.description))
}

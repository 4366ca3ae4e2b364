//! `xavatar info`: what a file holds.

mod described_subject;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use glam::DVec3;
use serde::Serialize;
use xavatar::InputError;
use xavatar::avatar::{Avatar, Subject};
use xavatar::config::Config;
use xavatar::data::{Clip, Motion, MotionOptions, read_motion};
use xavatar::formats::Shown;
use xavatar::formats::{Array, ArrayFile, ArrayMap, Container, read_pickle};
use xavatar::mesh::{Colouring, MESH_EXTENSIONS, Note, ReadMesh, SurfacePoint, Topology, TriangleMesh, read_mesh};

use self::described_subject::SubjectDescription;
use crate::cli::Outcome;
use crate::cli::options::motion::described;
use crate::cli::output::json::JsonArgument;
use crate::cli::verbs::body::BodyDescription;

/// Say what a file or folder holds: avatars, runs, subjects, body models, motions, arrays, meshes
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar info runs/00016\n  xavatar info data/00016\n  xavatar info models/smplx/SMPLX_NEUTRAL.npz\n  xavatar info runs/00016 --json -")]
pub struct Info {
    /// The folder of a run or a subject, .safetensors, .npz, .npy, .pkl, .pt, .json, .bvh, .ply, .obj or .glb
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
        let extension =
            path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase();
        let content = match extension.as_str() {
            _ if path.is_dir() => of_folder(path)?,
            "safetensors" => of_avatar(path)?,
            "bvh" => of_motion(read_motion(path)?, Arrays::new()),
            extension if MESH_EXTENSIONS.contains(&extension) => of_mesh(path)?,
            _ => of_array_file(path)?,
        };
        self.json.print(&content, &content)?;
        Ok(Outcome::Done)
    }
}

/// A run, or a subject: whichever the folder has files of.
fn of_folder(path: &Path) -> anyhow::Result<Content> {
    if [Avatar::FILE, RUN_CONFIGURATION].iter().any(|file| path.join(file).is_file()) {
        return of_avatar(path);
    }
    let subject = SubjectDescription::of(path)
        .with_context(|| format!("{}: neither a run's folder nor a subject's", path.display()))?;
    Ok(Content::Subject(subject))
}

/// The file that a run's folder has before its avatar.
const RUN_CONFIGURATION: &str = "config.toml";

/// What a file holds. `Display` is for people, serde for scripts.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Content {
    Avatar(Box<AvatarDescription>),
    Subject(SubjectDescription),
    BodyModel {
        #[serde(flatten)]
        body: BodyDescription,
        arrays: Arrays,
    },
    UnusableBodyModel {
        problem: String,
        arrays: Arrays,
    },
    Motion {
        frames: usize,
        frames_per_second: Option<f32>,
        source: String,
        report: Vec<String>,
        arrays: Arrays,
    },
    Arrays {
        arrays: Arrays,
        problem: Option<String>,
    },
    Array(ArrayDescription),
    Pickle {
        holds: &'static str,
    },
    Mesh {
        vertices: usize,
        faces: usize,
        colours: String,
        mean_colour: Option<[u8; 3]>,
        watertight: bool,
        open_edges: usize,
        parts: usize,
        /// None if it is not watertight.
        handles: Option<usize>,
        notes: Vec<Note>,
    },
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
    let counts = fields.parameters().map(<[f32]>::len);
    let skinning_grid = fields.skinning.nodes().map(|nodes| (counts.skinning, nodes));
    let mut parameters = BTreeMap::from(counts.named());
    if skinning_grid.is_some() {
        parameters.remove("skinning");
    }
    Ok(Content::Avatar(Box::new(AvatarDescription {
        steps,
        surface: format!("{:?}", fields.geometry.representation),
        parameters,
        skinning_grid,
        subject,
        config,
    })))
}

/// A file of arrays, in whatever container, or of a motion without any.
fn of_array_file(path: &Path) -> anyhow::Result<Content> {
    let Some(file) = ArrayFile::read(path)? else {
        return match read_motion(path) {
            Ok(motion) => Ok(of_motion(motion, Arrays::new())),
            Err(_) => of_mesh(path).map_err(|error| match error {
                // That of a file of another kind, which may be none of a mesh.
                InputError::Mismatch { .. } => {
                    anyhow!("{error}; or give a run's folder, .safetensors, .npz, .npy, .pkl, .pt, .json or .bvh")
                }
                other => other.into(),
            }),
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
            let warnings = clip.warnings.iter().map(|warning| format!("warning: {}", described(warning)));
            clip.report.into_iter().chain(warnings).collect()
        },
    );
    Content::Motion { frames, frames_per_second, source, report, arrays }
}

fn of_body(path: &Path, arrays: &ArrayMap, described: Arrays) -> Content {
    match BodyDescription::of(path, arrays) {
        Ok(body) => Content::BodyModel { body, arrays: described },
        Err(error) => Content::UnusableBodyModel { problem: error.to_string(), arrays: described },
    }
}

fn of_mesh(path: &Path) -> Result<Content, InputError> {
    let ReadMesh { mesh, notes } = read_mesh(path)?;
    let topology = Topology::of(&mesh.merged_by_position());
    Ok(Content::Mesh {
        vertices: mesh.vertices.len(),
        faces: mesh.faces.len(),
        colours: match &mesh.colouring {
            Colouring::None => "no colours".into(),
            Colouring::Vertex(_) => "vertex colours".into(),
            Colouring::Texture { image, .. } => format!("a texture of {} x {}", image.width(), image.height()),
        },
        mean_colour: mean_colour(&mesh),
        watertight: topology.is_watertight(),
        open_edges: topology.open_edges,
        parts: topology.components,
        handles: topology.handles(),
        notes,
    })
}

/// The mean sRGB colour at the faces' centres; of vertices where there are no faces.
fn mean_colour(mesh: &TriangleMesh) -> Option<[u8; 3]> {
    let centre = |face| SurfacePoint { face, barycentric: [1.0 / 3.0; 3] };
    let colours: Vec<DVec3> = match &mesh.colouring {
        Colouring::Vertex(colours) if mesh.faces.is_empty() => {
            colours.iter().map(|colour| DVec3::from(colour.map(f64::from)) / 255.0).collect()
        }
        _ => (0..mesh.faces.len() as u32).filter_map(|face| Some(mesh.colour_at(&centre(face))?.as_dvec3())).collect(),
    };
    let mean = colours.iter().sum::<DVec3>() / colours.len() as f64;
    (!colours.is_empty()).then(|| mean.to_array().map(|channel| (channel * 255.0).round() as u8))
}

impl fmt::Display for Content {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Avatar(avatar) => write!(formatter, "{avatar}"),
            Self::Subject(subject) => write!(formatter, "{subject}"),
            Self::BodyModel { body, arrays } => {
                write!(formatter, "{body}")?;
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
            Self::Mesh { vertices, faces, colours, mean_colour, watertight, open_edges, parts, handles, notes } => {
                let watertight = if *watertight { "watertight" } else { "not watertight" };
                let mean = mean_colour.map_or_else(String::new, |[r, g, b]| format!(", ({r}, {g}, {b}) on average"));
                writeln!(formatter, "mesh: {vertices} vertices, {faces} faces, {colours}{mean}")?;
                let handles = handles.map_or_else(String::new, |handles| format!(", {handles} handles"));
                writeln!(formatter, "{watertight}; {open_edges} open edges, {parts} parts{handles}")?;
                notes.iter().try_for_each(|note| writeln!(formatter, "warning: {note}"))
            }
        }
    }
}

impl fmt::Display for AvatarDescription {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, surface, parameters, skinning_grid, subject, config } = self;
        let Subject { gender, frames, betas, skeleton, bounds: (low, high), .. } = subject;
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
        writeln!(formatter, "{}: {}", skeleton.description(), skeleton.joints.join(", "))?;
        writeln!(formatter, "betas: {betas:?}\ncanonical box: {low} to {high} m")?;
        writeln!(formatter, "configuration:\n{}", config.to_toml().map_err(|_| fmt::Error)?.trim_end())
    }
}

fn write_arrays(formatter: &mut fmt::Formatter<'_>, arrays: &Arrays) -> fmt::Result {
    arrays
        .iter()
        .try_for_each(|(name, array)| writeln!(formatter, "  {:<24} {}", Shown(name).to_string(), array.description))
}

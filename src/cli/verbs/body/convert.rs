//! `xavatar body convert`: a model with its shapes mirrored, or on another mesh.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use xavatar::body::{BodyModel, PartLabels, mano, moved};
use xavatar::formats::{write_npz, write_pickle};
use xavatar::mesh::read_mesh;

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Write a body model anew: on another mesh, or mended
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar body convert models/SMPLX_NEUTRAL.npz --to lowpoly.obj --out lowpoly.npz\n  \
    xavatar body convert models/MANO_LEFT.pkl --mirror-shapes --out MANO_LEFT.npz\n\n\
    The mesh has to lie on the model's template: `xavatar body pose FILE rest` writes that, to align it to.")]
pub struct Convert {
    /// A model's file: .npz, .pkl, or SUPR's .npy
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The mesh that the model gets, on the surface of its template: .ply, .obj or .glb
    #[arg(long, value_name = "MESH", required_unless_present = "mirror_shapes", conflicts_with = "mirror_shapes")]
    to: Option<PathBuf>,
    /// Change the sign of x in all shapes: for left hands that `body info` finds it wrong in
    #[arg(long)]
    mirror_shapes: bool,
    /// The model to write, .npz; on another mesh, beside it its part labels
    #[arg(long, value_name = "BODY.npz")]
    out: PathBuf,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was written.
#[derive(Serialize)]
struct Converted<'a> {
    file: &'a Path,
    family: String,
    vertices: usize,
    on_mesh: Option<OnMesh>,
}

/// How well a model sits on its new mesh.
#[derive(Serialize)]
struct OnMesh {
    mean_gap_mm: f64,
    largest_gap_mm: f64,
    joint_error_mm: f64,
    /// Vertices whose closest face looked the other way.
    turned_away: usize,
}

impl Convert {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.json.check()?;
        let arrays = BodyModel::read_arrays(&self.file)?;
        let (arrays, on_mesh) = match &self.to {
            None => (mano::with_mirrored_shapes(arrays)?, None),
            Some(mesh) => {
                let stem = self.out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let labels_file = self.out.with_file_name(format!("{stem}_vertex_labels.pkl"));
                files::new_file(&labels_file)?;
                let body = BodyModel::from_arrays(&self.file, &arrays)?;
                let moved = moved(&self.file, &arrays, &read_mesh(mesh)?.mesh)?;
                let labels = moved.map.labels(&PartLabels::find(&body)?);
                write_pickle(&labels_file, &labels.to_vertex_labels(body.skeleton()))?;
                let [mean, largest] = moved.gap.map(|gap| gap * 1e3);
                let on_mesh = OnMesh {
                    mean_gap_mm: mean,
                    largest_gap_mm: largest,
                    joint_error_mm: moved.joint_error * 1e3,
                    turned_away: moved.turned_away,
                };
                (moved.arrays, Some(on_mesh))
            }
        };
        let body = BodyModel::from_arrays(&self.out, &arrays)?;
        write_npz(&self.out, &arrays)?;
        let (family, vertices) = (body.skeleton().family.clone(), body.vertex_count());
        let converted = Converted { file: &self.out, family, vertices, on_mesh };
        self.json.print(&converted, &converted)?;
        Ok(Outcome::Done)
    }
}

impl fmt::Display for Converted<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}: {}, {} vertices", self.file.display(), self.family, self.vertices)?;
        let Some(OnMesh { mean_gap_mm, largest_gap_mm, joint_error_mm, turned_away }) = &self.on_mesh else {
            return Ok(());
        };
        writeln!(formatter, "from the template: {mean_gap_mm:.2} mm on average, {largest_gap_mm:.2} mm at most")?;
        writeln!(formatter, "joints: within {joint_error_mm:.2} mm of the model's")?;
        writeln!(formatter, "vertices whose closest face looked the other way: {turned_away}")
    }
}

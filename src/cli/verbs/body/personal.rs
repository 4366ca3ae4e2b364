//! `xavatar body personal`: a body of one person from one registration or a few.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use xavatar::body::BodyModel;
use xavatar::formats::write_npz;
use xavatar::learned::personal::personal;
use xavatar::learned::registrations::Registrations;
use xavatar::mesh::{Colouring, write_ply};

use crate::cli::Outcome;
use crate::cli::output::files;
use crate::cli::output::json::JsonArgument;

/// Deviations that are drawn in the last colour, metres.
const UNSURE: f64 = 5e-3;

/// Make a body one person's: template, joints and correctives of a registration or a few
#[derive(clap::Args)]
#[command(after_help = "Example:\n  \
    xavatar body personal 00901/train/Take1/SMPLX/mesh-f00001_smplx.ply --body models/SMPLX_NEUTRAL.npz --out anna.npz\n\n\
    A registration is a mesh in the body's topology, not a scan: `xavatar register` makes one. One tells one direction of the pose \
    correctives: poses that are unlike it stay the body's. A pose that is not symmetric leaks into the template.")]
pub struct Personal {
    /// Registrations of one person, or folders of them
    #[arg(value_name = "REGISTRATION", required = true)]
    registrations: Vec<PathBuf>,
    /// The body that it starts from
    #[arg(long, value_name = "BODY")]
    body: PathBuf,
    /// The model to write, .npz; zero coefficients are the person
    #[arg(long, value_name = "PERSON.npz")]
    out: PathBuf,
    /// Write how sure the correctives are, in the first registration's pose, as colours: blue sure, red 5 mm, .ply
    #[arg(long, value_name = "FILE.ply")]
    deviations: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

/// What was made.
#[derive(Serialize)]
struct Made<'a> {
    file: &'a PathBuf,
    registrations: usize,
    /// Of these registrations: with the body's shapes, a personal template, personal correctives.
    shapes_mm: f64,
    template_mm: f64,
    correctives_mm: f64,
    spread_mm: f64,
    noise_mm: f64,
}

impl Personal {
    pub fn run(self) -> anyhow::Result<Outcome> {
        files::new_file(&self.out)?;
        self.deviations.as_deref().map_or(Ok(()), files::new_file)?;
        self.json.check()?;
        let file = BodyModel::read_arrays(&self.body)?;
        let model = BodyModel::from_arrays(&self.body, &file)?;
        let registrations = Registrations::find(&self.registrations, model.vertex_count())?;
        let made = personal(&model, &registrations)?;
        write_npz(&self.out, &made.arrays(&file))?;
        if let (Some(path), Some(pose)) = (&self.deviations, made.poses.first()) {
            let mut mesh = made.model.mesh(made.model.pose(&pose.pose(&[]))?.vertices);
            mesh.colouring = Colouring::Vertex(made.deviations(pose).into_iter().map(colour).collect());
            write_ply(path, &mesh)?;
        }
        let [shapes, template, correctives] = made.distances.map(|distance| distance * 1e3);
        let written = Made {
            file: &self.out,
            registrations: made.poses.len(),
            shapes_mm: shapes,
            template_mm: template,
            correctives_mm: correctives,
            spread_mm: made.scales.spread * 1e3,
            noise_mm: made.scales.noise * 1e3,
        };
        self.json.print(&written, &written)?;
        Ok(Outcome::Done)
    }
}

/// From blue to red.
fn colour(deviation: f64) -> [u8; 3] {
    let share = (deviation / UNSURE).clamp(0.0, 1.0);
    [(255.0 * share) as u8, 64, (255.0 * (1.0 - share)) as u8]
}

impl fmt::Display for Made<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{}: a body of {} registrations", self.file.display(), self.registrations)?;
        writeln!(
            formatter,
            "from them: {:.2} mm with the body's shapes, {:.2} with a template of its own, {:.2} with correctives of its own",
            self.shapes_mm, self.template_mm, self.correctives_mm
        )?;
        writeln!(
            formatter,
            "most probable: correctives differ by {:.1} mm a radian, registrations by {:.1} mm",
            self.spread_mm, self.noise_mm
        )
    }
}

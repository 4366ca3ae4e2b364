//! Bodies registered to scans, in the scans' colours: people whose every pixel is known to the body model.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::{People, Person};
use crate::body::BodyModel;
use crate::data::{ScanFrames, Source};
use crate::export::Charts;
use crate::mesh::{SurfaceIndex, TriangleMesh, read_mesh};
use crate::{InputError, Result};

/// Columns and rows of a texture.
const TEXTURE: u32 = 1024;
/// The colour of scans that have none.
const GREY: Vec3 = Vec3::splat(0.5);

/// The registered bodies of a subject's frames; those moved onto the scans where the data have them in `offsets/`.
#[derive(Debug)]
pub struct RegisteredPeople<'a> {
    frames: ScanFrames,
    body: &'a BodyModel,
    charts: Charts,
    /// Where bodies that were moved onto scans are, if they are anywhere.
    offsets: PathBuf,
}

impl<'a> RegisteredPeople<'a> {
    /// The frames of the data in a folder, with the body that they are registered with.
    ///
    /// # Errors
    /// As [`Charts::new`].
    pub fn new(data: &Path, frames: ScanFrames, body: &'a BodyModel) -> Result<Self> {
        let charts = Charts::new(&body.mesh(body.template().to_vec()), TEXTURE)?;
        Ok(Self { frames, body, charts, offsets: data.join("offsets") })
    }

    /// The body moved onto a frame's scan, if there is one.
    fn moved(&self, frame: &str) -> Result<Option<Vec<Vec3>>> {
        let path = self.offsets.join(format!("{frame}.ply"));
        if !path.is_file() {
            return Ok(None);
        }
        let vertices = read_mesh(&path)?.mesh.vertices;
        match self.body.vertex_count() {
            count if count == vertices.len() => Ok(Some(vertices)),
            count => Err(InputError::Mismatch {
                path,
                found: format!("{} vertices", vertices.len()),
                expected: format!("{count}, as the body model has"),
                remedy: "give the body model that the scans are registered with".into(),
            }
            .into()),
        }
    }
}

impl People for RegisteredPeople<'_> {
    fn count(&self) -> usize {
        self.frames.ids().len()
    }

    fn person(&self, index: usize) -> Result<Person> {
        let frame = self.frames.scan(index)?;
        let name = frame.id.to_string();
        let pose = self.body.resolve(&frame.parameters)?;
        let vertices = match self.moved(&name)? {
            Some(vertices) => vertices,
            None => self.body.pose(&pose)?.vertices,
        };
        let mut mesh = self.body.mesh(vertices);
        mesh.normals = Some(mesh.vertex_normals());
        let mesh = self.charts.painted(&mesh, colours_of(&frame.scan)?, |_, _| {})?;
        Ok(Person { name, mesh, pose })
    }
}

/// The colours of the scan's places nearest to points.
fn colours_of(scan: &TriangleMesh) -> Result<impl Fn(&[Vec3]) -> Result<Vec<[u8; 3]>>> {
    let index = SurfaceIndex::new(scan)?;
    Ok(move |points: &[Vec3]| {
        let colour =
            |place| scan.colour_at(&place).unwrap_or(GREY).to_array().map(|channel| (255.0 * channel).round() as u8);
        Ok(index.closest_to_each(points).iter().map(|closest| colour(closest.surface_point())).collect())
    })
}

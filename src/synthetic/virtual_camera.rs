//! Filming scans with a virtual RGB-D camera, as the thesis makes its RGB-D data (A.2.2).
//!
//! The camera circles at 6 m around the subject and sees every frame once, from the next place on the circle. As in
//! X-Humans, the circle is centred over the mean of the vertices of the sequence's first scan, higher by 0.6 of its height; the
//! camera looks at that mean, begins in front (+Z) and turns towards the subject's right (-X). Metres, radians, Y up.
//!
//! Depth is that of the ray through a pixel's centre, without noise; colour is unlit, on white.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::f32::consts::TAU;

use glam::Vec3;
use image::Rgb;

use crate::body::Gender;
use crate::data::{
    BACKGROUND, Capture, CaptureKind, FARTHEST_DEPTH, FrameId, RgbdCapture, RgbdFrame, ScanFrame, Source,
};
use crate::formats::{Error, Result};
use crate::mesh::camera::PinholeCamera;
use crate::render::render_rgbd;

/// The circle's radius, metres.
const RADIUS: f32 = 6.0;
/// How far the circle is above the mean of the vertices, as a share of the scan's height.
const RAISED: f32 = 0.6;
/// The angle between the rays through the upper and lower edge, radians (30 degrees).
const FIELD_OF_VIEW: f32 = TAU / 12.0;

/// A virtual camera's picture size and pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Turntable {
    /// Columns and rows of the pictures, pixels.
    pub size: [u32; 2],
    /// Frames in which the camera goes around once.
    pub steps_per_turn: u32,
}

/// The thesis's: 800 x 1200 pixels, a turn in 100 frames.
impl Default for Turntable {
    fn default() -> Self {
        Self { size: [800, 1200], steps_per_turn: 100 }
    }
}

impl Turntable {
    /// The camera for frame `step`, from 0, of a sequence that begins with this scan.
    ///
    /// # Errors
    /// [`Error::Value`] if the scan has no vertices, or the size or pace is impossible.
    pub fn camera(&self, first: &ScanFrame, step: usize) -> Result<PinholeCamera> {
        Circle::around(first)?.camera(self, step)
    }
}

/// Where a sequence's camera goes.
#[derive(Clone, Copy, Debug)]
struct Circle {
    target: Vec3,
    /// Of the circle above `target`.
    rise: f32,
}

impl Circle {
    fn around(first: &ScanFrame) -> Result<Self> {
        let vertices = &first.scan.vertices;
        if vertices.is_empty() {
            let (found, expected) = ("no vertices".into(), "a surface to film".into());
            return Err(Error::Value { name: "scan".into(), found, expected }.in_frame(first.id.to_string()));
        }
        let target = (vertices.iter().map(|v| v.as_dvec3()).sum::<glam::DVec3>() / vertices.len() as f64).as_vec3();
        let (low, high) = vertices.iter().fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v.y), high.max(v.y)));
        Ok(Self { target, rise: RAISED * (high - low) })
    }

    fn camera(self, table: &Turntable, step: usize) -> Result<PinholeCamera> {
        if table.steps_per_turn == 0 {
            let (found, expected) = ("0".into(), "at least one".into());
            return Err(Error::Value { name: "steps per turn".into(), found, expected });
        }
        let share = (step % table.steps_per_turn as usize) as f32 / table.steps_per_turn as f32;
        let (sine, cosine) = (TAU * share).sin_cos();
        let position = self.target + Vec3::new(-RADIUS * sine, self.rise, RADIUS * cosine);
        PinholeCamera::looking_at(position, self.target, FIELD_OF_VIEW, table.size)
    }
}

/// RGB-D frames of scans, filmed when they are asked for: the same frames under the same names.
pub struct FilmedScans<'a> {
    scans: &'a dyn Source,
    table: Turntable,
    /// The circle and step of each frame.
    places: Vec<(Circle, usize)>,
}

impl<'a> FilmedScans<'a> {
    /// Films `scans`; reads the first scan of each sequence.
    ///
    /// # Errors
    /// Those of reading these scans; [`Error::Value`] if the pace or size is impossible.
    pub fn new(scans: &'a dyn Source, table: Turntable) -> Result<Self> {
        let mut sequences: BTreeMap<(&str, &str), (Circle, usize)> = BTreeMap::new();
        let mut places = Vec::new();
        for (index, id) in scans.ids().iter().enumerate() {
            let key = (id.split.as_str(), id.sequence.as_str());
            let (circle, step) = match sequences.entry(key) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => {
                    let circle = Circle::around(&scans.scan(index)?)?;
                    circle.camera(&table, 0)?;
                    entry.insert((circle, 0))
                }
            };
            places.push((*circle, *step));
            *step += 1;
        }
        Ok(Self { scans, table, places })
    }
}

impl FilmedScans<'_> {
    /// The whole picture of a frame.
    ///
    /// # Errors
    /// Those of reading the scan, or of filming it, with the frame named.
    pub fn picture(&self, index: usize) -> Result<RgbdFrame> {
        let scan = self.scans.scan(index)?;
        let (circle, step) = self.places[index];
        let film = || {
            let camera = circle.camera(&self.table, step)?;
            film(&scan, camera)
        };
        let frame = film().map_err(|error| error.in_frame(scan.id.to_string()))?;
        frame.check()?;
        Ok(frame)
    }
}

impl Source for FilmedScans<'_> {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Rgbd
    }

    fn ids(&self) -> &[FrameId] {
        self.scans.ids()
    }

    fn read(&self, index: usize) -> Result<Capture> {
        Ok(Capture::Rgbd(Box::new(RgbdCapture::of(self.picture(index)?)?)))
    }

    fn betas(&self) -> &[f32] {
        self.scans.betas()
    }

    fn gender(&self) -> Gender {
        self.scans.gender()
    }
}

/// What `camera` sees of a scan.
///
/// # Errors
/// [`Error::Value`] if the camera is impossible or the mesh broken.
pub fn film(scan: &ScanFrame, camera: PinholeCamera) -> Result<RgbdFrame> {
    let pictures = render_rgbd(&scan.scan, &camera)?;
    let depth: Vec<f32> =
        pictures.depth.iter().map(|&depth| if depth <= FARTHEST_DEPTH { depth } else { BACKGROUND }).collect();
    let mut colour = pictures.colour;
    for (pixel, depth) in colour.pixels_mut().zip(&depth) {
        if *depth == BACKGROUND {
            *pixel = Rgb([255; 3]);
        }
    }
    let (id, parameters) = (scan.id.clone(), scan.parameters.clone());
    Ok(RgbdFrame { id, camera, colour, depth, mask: None, parameters })
}

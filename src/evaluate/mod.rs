//! How good an avatar is: meshes predicted for held-out frames against their scans, beside the SMPLX+D baseline (thesis ch. 5).
//!
//! Frames are streamed: one scan is in memory at a time. Random numbers depend on the seed and the frame's place alone.

mod metrics;
mod overlap;
mod pictures;
mod regions;
mod report;
mod smplx_d;

pub use metrics::{FrameMetrics, PartMetrics, Parts, compare};
pub use pictures::{Likeness, Pictures, compare_pictures};
pub use regions::{RegionMetrics, Regions, RegisteredRegions, compare_regions};
pub use report::{FrameReport, Report};
pub(crate) use report::{region_name, row_name};
pub use smplx_d::{SMPLX_D, SmplxD};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::body::{BodyModel, PartLabels, Pose, Region, Registration};
use crate::data::ScanFrame;
use crate::mesh::TriangleMesh;
use crate::{Error, InputError, Result};

/// What the predictions of a sequence are measured with.
pub struct Evaluation<'a> {
    /// The body model that the frames are registered with.
    pub body: &'a BodyModel,
    /// Its vertices' parts.
    pub labels: &'a PartLabels,
    /// A baseline to measure beside the prediction.
    pub baseline: Option<&'a SmplxD<'a>>,
    /// Whether each region of the body is measured too.
    pub regions: bool,
    /// Whether looks are measured too.
    pub pictures: bool,
    /// Points drawn on each surface and in each box; [`Evaluation::SAMPLES`] is enough for 1 % of the chamfer distance.
    pub samples: usize,
    /// Of the points.
    pub seed: u64,
}

impl Evaluation<'_> {
    /// Points per surface that the published evaluation is matched with.
    pub const SAMPLES: usize = 20_000;

    /// Measures what `predict` makes of each frame and its pose, in world coordinates, and shows every frame's metrics to `progress`.
    ///
    /// # Errors
    /// The first error of `frames`, of `predict`, or of the comparison, with the frame named; [`InputError::Value`] if there is no frame.
    pub fn run(
        &self,
        frames: impl IntoIterator<Item = crate::formats::Result<ScanFrame>>,
        predict: impl Fn(&ScanFrame, &Pose) -> Result<TriangleMesh>,
        mut progress: impl FnMut(&FrameReport),
    ) -> Result<Report> {
        let mut report = Report::default();
        let regions = self.regions.then(|| Region::of_vertices(self.body, self.labels));
        for frame in frames {
            let frame = frame?;
            let place = report.per_frame.len() as u64;
            let measured = self
                .measure(&frame, place, regions.as_deref(), &predict)
                .map_err(|error| error.in_frame(frame.id.to_string()))?;
            progress(&measured);
            report.per_frame.push(measured);
        }
        if report.per_frame.is_empty() {
            return Err(Error::from(InputError::Value {
                name: "frames to evaluate".into(),
                found: "none".into(),
                expected: "at least one".into(),
            }));
        }
        Ok(report)
    }

    fn measure(
        &self,
        frame: &ScanFrame,
        place: u64,
        regions: Option<&[Region]>,
        predict: impl Fn(&ScanFrame, &Pose) -> Result<TriangleMesh>,
    ) -> Result<FrameReport> {
        let pose = self.body.resolve(&frame.parameters)?;
        let posed = self.body.pose(&pose)?.vertices;
        let registration = Registration::new(&posed, self.labels)?;
        // All comparisons meet the same random numbers.
        let random = || {
            let mut random = ChaCha8Rng::seed_from_u64(self.seed);
            random.set_stream(place);
            random
        };
        let compare = |mesh: &TriangleMesh| {
            compare(mesh, &frame.scan, &registration, self.body.skeleton(), self.samples, &mut random())
        };
        let baseline = self.baseline.map(|baseline| compare(&baseline.pose(&pose)?)).transpose()?;
        let predicted = predict(frame, &pose)?;
        let by_region = |of_vertices: &[Region]| {
            let registered = RegisteredRegions::new(&registration, &self.body.mesh(posed.clone()), of_vertices)?;
            compare_regions(&predicted, &frame.scan, &registered, self.samples, &mut random())
        };
        let regions = regions.map(by_region).transpose()?;
        let about = (self.body.skeleton(), self.labels);
        let pictures = match self.pictures {
            true => compare_pictures(&predicted, &frame.scan, &registration, about, &posed)?,
            false => None,
        };
        Ok(FrameReport { frame: frame.id.to_string(), metrics: compare(&predicted)?, baseline, regions, pictures })
    }
}

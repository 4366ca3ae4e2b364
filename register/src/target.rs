//! A scan as what a body is fitted to: points of its surface with normals, found by place and normal together.
//!
//! The nearest of (point, lambda normal) in six dimensions: lambda metres are what turning a normal by a radian counts as, so that the
//! front of a finger is not matched with its back. Of what one camera saw there is only a part, and the view says what is known of the rest.
//! Metres.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use xavatar_data::RgbdCapture;
use xavatar_formats::{Error, Result};
use xavatar_mesh::{SurfaceSampler, TriangleMesh};

use crate::view::{Sight, View};

/// Points that stand for a scan's surface.
const POINTS: usize = 40_000;
/// Of these, those that look for their place on the body.
const SEEKERS: usize = 1800;

/// Points of a surface with unit normals.
#[derive(Clone, Debug)]
pub struct ScanTarget {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// What else is known, if the points are what one camera saw.
    view: Option<Arc<View>>,
}

/// Points that can be asked for the nearest by place and normal.
pub struct OrientedIndex {
    tree: ImmutableKdTree<f32, 6>,
    normal_weight: f64,
}

impl ScanTarget {
    /// Draws points from a scan's surface; the same ones every time.
    ///
    /// # Errors
    /// [`Error::Value`] for a scan without an area, or one that [`TriangleMesh::check`] refuses.
    pub fn of(scan: &TriangleMesh) -> Result<Self> {
        let mut smooth =
            TriangleMesh { vertices: scan.vertices.clone(), faces: scan.faces.clone(), ..TriangleMesh::default() };
        smooth.normals = Some(smooth.vertex_normals());
        let sampler = SurfaceSampler::new(&smooth, None)?;
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let mut target = Self { points: Vec::with_capacity(POINTS), normals: Vec::with_capacity(POINTS), view: None };
        for _ in 0..POINTS {
            let place = sampler.sample(&mut random);
            target.points.push(smooth.position_at(&place).as_dvec3());
            target.normals.push(smooth.normal_at(&place).as_dvec3());
        }
        Ok(target)
    }

    /// Some of the points that one camera saw, in the world of its frame; the same ones every time.
    ///
    /// # Errors
    /// As [`View::of`].
    pub fn seen(capture: &RgbdCapture) -> Result<Self> {
        let mut chosen: Vec<usize> = (0..capture.cloud.points.len()).collect();
        chosen.shuffle(&mut ChaCha8Rng::seed_from_u64(0));
        chosen.truncate(POINTS);
        let some = |all: &[Vec3]| chosen.iter().map(|index| all[*index].as_dvec3()).collect();
        Ok(Self {
            points: some(&capture.cloud.points),
            normals: some(&capture.cloud.normals),
            view: Some(Arc::new(View::of(&capture.frame)?)),
        })
    }

    /// What is known of a place with this unit normal besides the points; of scans, everything is seen.
    pub fn sight(&self, place: DVec3, normal: DVec3) -> Sight {
        self.view.as_ref().map_or(Sight::Seen(0.0), |view| view.sight(place, normal))
    }

    /// Whether the points are what one camera saw, and not all of a surface.
    pub fn is_partial(&self) -> bool {
        self.view.is_some()
    }

    /// The points within a distance of a place, if there are any.
    pub fn around(&self, middle: DVec3, distance: f64) -> Option<Self> {
        let near = self.points.iter().zip(&self.normals).filter(|(point, _)| point.distance(middle) <= distance);
        let (points, normals): (Vec<DVec3>, Vec<DVec3>) = near.map(|(point, normal)| (*point, *normal)).unzip();
        (!points.is_empty()).then(|| Self { points, normals, view: self.view.clone() })
    }

    /// The points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// The unit normals of the points.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// Those that look for their place on the body, with their normals.
    pub fn seekers(&self, count: Seekers) -> impl ExactSizeIterator<Item = (DVec3, DVec3)> + '_ {
        let count = match count {
            Seekers::All => SEEKERS,
            Seekers::Few => SEEKERS / 3,
            Seekers::None => 0,
        };
        self.points.iter().copied().zip(self.normals.iter().copied()).take(count)
    }

    /// An index of the points.
    ///
    /// # Errors
    /// [`Error::Value`] if a point is not finite.
    pub fn index(&self, normal_weight: f64) -> Result<OrientedIndex> {
        OrientedIndex::new(&self.points, &self.normals, normal_weight)
    }

    /// The middle of the box around the points.
    pub fn middle(&self) -> DVec3 {
        let [low, high] = self.bounds();
        (low + high) / 2.0
    }

    /// The lowest and the highest corner of the box around the points.
    pub fn bounds(&self) -> [DVec3; 2] {
        let fold = |start: DVec3, of: fn(DVec3, DVec3) -> DVec3| self.points.iter().copied().fold(start, of);
        [fold(DVec3::INFINITY, DVec3::min), fold(DVec3::NEG_INFINITY, DVec3::max)]
    }
}

/// How many of a scan's points look for their place on the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seekers {
    /// For a fit.
    All,
    /// For a first guess.
    Few,
    /// For a limb alone.
    None,
}

impl OrientedIndex {
    /// Of points with unit normals.
    ///
    /// # Errors
    /// [`Error::Value`] if there is none, or one is not finite.
    pub fn new(points: &[DVec3], normals: &[DVec3], normal_weight: f64) -> Result<Self> {
        let wrong =
            |found: String| Error::Value { name: "points to search".into(), found, expected: "finite points".into() };
        let rows: Vec<[f32; 6]> = points.iter().zip(normals).map(|(p, n)| row(*p, *n, normal_weight)).collect();
        if rows.is_empty() || rows.as_flattened().iter().any(|value| !value.is_finite()) {
            return Err(wrong(format!("{} points, not all finite", rows.len())));
        }
        let tree = ImmutableKdTree::new_from_slice(&rows).map_err(|failure| wrong(failure.to_string()))?;
        Ok(Self { tree, normal_weight })
    }

    /// The number of the nearest, and how far it is in six dimensions. Both arguments have to be finite.
    pub fn nearest(&self, point: DVec3, normal: DVec3) -> (usize, f64) {
        let found =
            self.tree.query(&row(point, normal, self.normal_weight)).nearest_one::<SquaredEuclidean<f32>>().execute();
        (found.item as usize, f64::from(found.distance).sqrt())
    }
}

fn row(point: DVec3, normal: DVec3, normal_weight: f64) -> [f32; 6] {
    let [x, y, z] = point.as_vec3().to_array();
    let Vec3 { x: a, y: b, z: c } = (normal * normal_weight).as_vec3();
    [x, y, z, a, b, c]
}

/// A scan with the index of a stage.
pub struct IndexedTarget {
    /// The scan's points.
    pub target: Arc<ScanTarget>,
    /// They, indexed.
    pub index: OrientedIndex,
}

impl IndexedTarget {
    /// Indexes a scan.
    ///
    /// # Errors
    /// As [`ScanTarget::index`].
    pub fn new(target: &Arc<ScanTarget>, normal_weight: f64) -> Result<Self> {
        Ok(Self { index: target.index(normal_weight)?, target: target.clone() })
    }

    /// How far a place with this unit normal is from the scan in place and normal, metres; none if it was not seen.
    pub fn distance(&self, place: DVec3, normal: DVec3) -> Option<f64> {
        match self.target.sight(place, normal) {
            Sight::Seen(_) => Some(self.index.nearest(place, normal).1),
            Sight::Open(way) => Some(way.length()),
            Sight::Hidden => None,
        }
    }
}

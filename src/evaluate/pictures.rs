//! How like an avatar looks: pictures of it against pictures of the scan, by PSNR and SSIM (thesis ch. 5).
//!
//! Both meshes in their own colours, unlit, on white, from four sides of the registered body; hands and face in pictures of their own. What
//! counts are the pixels in which either mesh is to be seen and, of a part, those whose surface is nearest to its vertices.

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use xavatar_render::{RgbdImage, render_rgbd};

use super::metrics::Parts;
use crate::Result;
use crate::body::{Part, PartLabels, Registration, Role, Skeleton};
use crate::mesh::camera::{PinholeCamera, pixel_centre};
use crate::mesh::{Colouring, TriangleMesh};

/// Sides of the pictures of the whole body and of a part, pixels.
const SIDE: u32 = 512;
const SIDE_OF_PART: u32 = 192;
/// Vertical field of view, radians: the pictures are nearly parallel projections.
const FIELD_OF_VIEW: f32 = 0.3;
/// Where the cameras stand.
const DIRECTIONS: [Vec3; 4] = [Vec3::Z, Vec3::X, Vec3::NEG_Z, Vec3::NEG_X];
/// Farther from the registered body a surface is no part's, metres.
const PART_REACH: f32 = 0.03;
/// Most decibels that are told: equal pictures have infinitely many.
const HIGHEST: f64 = 100.0;
/// Radius and spread of the window of SSIM, pixels, and its constants for values in [0, 1] (Wang et al. 2004).
const WINDOW_RADIUS: usize = 5;
const WINDOW_SPREAD: f64 = 1.5;
const STABILISERS: [f64; 2] = [1e-4, 9e-4];

/// How like the pictures of one frame are; a part is absent where neither mesh shows it.
pub type Pictures = Parts<Option<Likeness>>;

/// How like two sets of pictures are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Likeness {
    /// Peak signal-to-noise ratio of the colours, decibels, at most 100.
    pub psnr_db: f64,
    /// Structural similarity of the brightness, at most 1.
    pub ssim: f64,
}

/// Compares the looks of a prediction and a scan; both and the registration, of a body with this skeleton, share one coordinate system, in
/// which the body's vertices are `posed` (V). None if either mesh has no colours.
///
/// # Errors
/// [`InputError::Value`](crate::InputError::Value) if a mesh fails [`TriangleMesh::check`] or cannot be drawn.
pub fn compare_pictures(
    prediction: &TriangleMesh,
    scan: &TriangleMesh,
    registration: &Registration,
    (skeleton, labels): (&Skeleton, &PartLabels),
    posed: &[Vec3],
) -> Result<Option<Pictures>> {
    let meshes = [prediction, scan];
    if meshes.iter().any(|mesh| matches!(mesh.colouring, Colouring::None)) {
        return Ok(None);
    }
    let of_whole = cameras(posed.iter().copied(), SIDE)?;
    let all = likeness(&pairs(meshes, &of_whole, |_| true)?);
    let mut by_role = std::collections::BTreeMap::new();
    for role in Role::FINE {
        let parts: Vec<Part> = skeleton.parts_of(role).collect();
        if parts.is_empty() {
            continue;
        }
        let mut pictures = Vec::new();
        for part in parts {
            let vertices = labels.vertices_of(part).into_iter().map(|vertex| posed[vertex]);
            let is_of_part = |point: Vec3| {
                let (nearest, distance) = registration.nearest(point);
                nearest == part && distance < PART_REACH
            };
            pictures.extend(pairs(meshes, &cameras(vertices, SIDE_OF_PART)?, is_of_part)?);
        }
        by_role.insert(role, likeness(&pictures));
    }
    Ok(Some(Parts { all, by_role }))
}

/// Cameras around points, each of which sees them all.
fn cameras(points: impl Iterator<Item = Vec3> + Clone, side: u32) -> Result<Vec<PinholeCamera>> {
    let low = points.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = points.fold(Vec3::NEG_INFINITY, Vec3::max);
    let (centre, radius) = (0.5 * (low + high), 0.6 * (high - low).length());
    let distance = radius / (0.5 * FIELD_OF_VIEW).sin();
    let camera = |direction: Vec3| {
        Ok(PinholeCamera::looking_at(centre + distance * direction, centre, FIELD_OF_VIEW, [side, side])?)
    };
    DIRECTIONS.into_iter().map(camera).collect()
}

/// Two pictures of one view.
struct Pair {
    width: usize,
    /// Their colours, row by row, in [0, 1].
    colours: [Vec<Vec3>; 2],
    /// Whether a pixel counts.
    counts: Vec<bool>,
}

/// The pictures of two meshes; a pixel counts where a mesh is at a point that does.
fn pairs(
    meshes: [&TriangleMesh; 2],
    cameras: &[PinholeCamera],
    counts: impl Fn(Vec3) -> bool + Sync,
) -> Result<Vec<Pair>> {
    let pair = |camera: &PinholeCamera| {
        let [first, second] = meshes.map(|mesh| render_rgbd(mesh, camera));
        let images = [first?, second?];
        let is_counted = |pixel: usize| {
            let (column, row) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let shows = |image: &RgbdImage| {
                let depth = image.depth[pixel];
                depth.is_finite() && counts(camera.back_project(pixel_centre(column, row), depth))
            };
            images.iter().any(shows)
        };
        let pixels = (camera.width * camera.height) as usize;
        let counts = (0..pixels).into_par_iter().with_min_len(1024).map(is_counted).collect();
        Ok(Pair { width: camera.width as usize, colours: images.map(|image| on_white(&image)), counts })
    };
    cameras.iter().map(pair).collect()
}

fn on_white(image: &RgbdImage) -> Vec<Vec3> {
    let colour = |(depth, pixel): (&f32, &image::Rgb<u8>)| {
        if depth.is_finite() { Vec3::from_array(pixel.0.map(f32::from)) / 255.0 } else { Vec3::ONE }
    };
    image.depth.iter().zip(image.colour.pixels()).map(colour).collect()
}

/// How like pictures are over the pixels that count; none if none does.
fn likeness(pairs: &[Pair]) -> Option<Likeness> {
    let counted = pairs.iter().flat_map(|pair| &pair.counts).filter(|counts| **counts).count() as f64;
    if counted == 0.0 {
        return None;
    }
    let squared = |pair: &Pair| {
        let [first, second] = &pair.colours;
        let own = first.iter().zip(second).zip(&pair.counts).filter(|(_, counts)| **counts);
        own.map(|((first, second), _)| f64::from(first.distance_squared(*second))).sum::<f64>()
    };
    let error = pairs.iter().map(squared).sum::<f64>() / (3.0 * counted);
    let similar = |pair: &Pair| {
        let similarity = similarity(pair);
        similarity.iter().zip(&pair.counts).filter(|(_, counts)| **counts).map(|(value, _)| value).sum::<f64>()
    };
    Some(Likeness {
        psnr_db: (-10.0 * error.log10()).min(HIGHEST),
        ssim: pairs.iter().map(similar).sum::<f64>() / counted,
    })
}

/// The structural similarity of brightness around each pixel.
fn similarity(pair: &Pair) -> Vec<f64> {
    let brightness = |colour: &Vec3| f64::from(colour.dot(Vec3::new(0.299, 0.587, 0.114)));
    let [a, b] = pair.colours.each_ref().map(|colours| colours.iter().map(brightness).collect::<Vec<_>>());
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>();
    let maps = [product(&a, &a), product(&b, &b), product(&a, &b), a, b];
    let [aa, bb, ab, a, b] = maps.map(|map| smoothed(&map, pair.width));
    let [c1, c2] = STABILISERS;
    let at = |pixel: usize| {
        let (a, b) = (a[pixel], b[pixel]);
        let (variances, covariance) = (aa[pixel] - a * a + bb[pixel] - b * b, ab[pixel] - a * b);
        (2.0 * a * b + c1) * (2.0 * covariance + c2) / ((a * a + b * b + c1) * (variances + c2))
    };
    (0..aa.len()).map(at).collect()
}

/// A map's Gaussian means, along rows and then along columns; at the edges over what there is.
fn smoothed(map: &[f64], width: usize) -> Vec<f64> {
    let height = map.len() / width;
    let along = |map: &[f64], place: usize, count: usize, of: &dyn Fn(usize) -> usize| {
        let (first, last) = (place.saturating_sub(WINDOW_RADIUS), (place + WINDOW_RADIUS).min(count - 1));
        let weight = |other: usize| (-0.5 * (other.abs_diff(place) as f64 / WINDOW_SPREAD).powi(2)).exp();
        let (sum, total) = (first..=last)
            .fold((0.0, 0.0), |(sum, total), other| (sum + weight(other) * map[of(other)], total + weight(other)));
        sum / total
    };
    let row = |pixel: usize| along(map, pixel % width, width, &|column| pixel - pixel % width + column);
    let rows: Vec<f64> = (0..map.len()).into_par_iter().with_min_len(1024).map(row).collect();
    let column = |pixel: usize| along(&rows, pixel / width, height, &|row| row * width + pixel % width);
    (0..map.len()).into_par_iter().with_min_len(1024).map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(colours: [Vec<Vec3>; 2], width: usize) -> Pair {
        let counts = vec![true; colours[0].len()];
        Pair { width, colours, counts }
    }

    fn noise(pixel: usize) -> f32 {
        (pixel as f32 * 12.9898).sin().abs()
    }

    #[test]
    fn a_constant_difference_has_the_ratio_it_should_and_equal_pictures_the_highest() {
        let grey = vec![Vec3::splat(0.5); 400];
        let brighter = vec![Vec3::splat(0.6); 400];
        let told = likeness(&[pair([grey.clone(), brighter], 20)]).unwrap();
        assert!((told.psnr_db - 20.0).abs() < 1e-4, "{told:?}");
        let equal = likeness(&[pair([grey.clone(), grey], 20)]).unwrap();
        assert_eq!(equal.psnr_db, HIGHEST);
        assert!((equal.ssim - 1.0).abs() < 1e-12);
    }

    // Of flat pictures only the means differ: (2 a b + c1) / (a^2 + b^2 + c1).
    #[test]
    fn flat_pictures_have_the_similarity_of_their_means() {
        let told = likeness(&[pair([vec![Vec3::splat(0.25); 900], vec![Vec3::splat(0.75); 900]], 30)]).unwrap();
        let expected = (2.0 * 0.25 * 0.75 + 1e-4) / (0.25_f64.powi(2) + 0.75_f64.powi(2) + 1e-4);
        assert!((told.ssim - expected).abs() < 1e-6, "{} {expected}", told.ssim);
    }

    #[test]
    fn similarity_falls_with_structure_and_pixels_that_do_not_count_are_left_out() {
        let textured: Vec<Vec3> = (0..900).map(|pixel| Vec3::splat(noise(pixel))).collect();
        let inverted: Vec<Vec3> = textured.iter().map(|colour| Vec3::ONE - *colour).collect();
        let opposite = likeness(&[pair([textured.clone(), inverted.clone()], 30)]).unwrap();
        assert!(opposite.ssim < -0.5, "{opposite:?}");
        let mut uncounted = pair([textured, inverted], 30);
        uncounted.counts.fill(false);
        assert_eq!(likeness(&[uncounted]), None);
    }
}

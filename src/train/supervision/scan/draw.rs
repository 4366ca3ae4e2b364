//! Part-aware sampling of one scan (thesis ch. 4.2.4, METHOD section 4).
//!
//! P_on: points of each region's surface, with normal and colour. P_off: the same points moved by normal noise, plus points
//! uniform in a cube; with occupancy, or signed distance, from the region's own solid.

use glam::Vec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use xavatar_network::Representation;

use super::{ScanSupervision, Source};
use crate::config::{Config, SamplingStrategy};
use crate::mesh::SurfacePoint;
use crate::train::drawn::{Origin, PosedSamples};
use crate::train::supervision::{Curve, uniform_points};

struct OnSurface {
    source: Source,
    label: u8,
    place: SurfacePoint,
    off: Vec3,
}

/// Widens the bound on a distance past its rounding.
const REACH_SLACK: f32 = 1.001;

/// Draws a scan's points; signed distances are true up to the losses' truncation.
pub(super) fn draw(frame: &ScanSupervision, config: &Config, random: &mut ChaCha8Rng) -> PosedSamples {
    let (settings, truncation) = (&config.sampling, config.losses.truncation as f32);
    let mut drawn = Vec::new();
    for region in &frame.regions {
        let mesh = &frame.surface(region.source).mesh;
        for _ in 0..(region.share * settings.points as f64).round() as usize {
            let place = region.sampler.sample(random);
            let position = mesh.position_at(&place);
            let label = match settings.strategy {
                SamplingStrategy::PartAware => region.part,
                SamplingStrategy::Uniform => frame.registration.nearest(position).0,
            };
            let wide = random.random::<f32>() < settings.wide_share;
            let deviation = if wide { settings.wide_deviation } else { settings.deviation };
            let noise = Vec3::from_array(std::array::from_fn(|_| random.sample(StandardNormal)));
            let off = position + deviation * noise;
            drawn.push(OnSurface { source: region.source, label: label.0, place, off });
        }
    }
    // Neighbours in space are then neighbours in every search that follows.
    let bounds = |fold: fn(Vec3, Vec3) -> Vec3| drawn.iter().map(|sample| sample.off).reduce(fold).unwrap_or_default();
    let curve = Curve::over((bounds(Vec3::min), bounds(Vec3::max)));
    drawn.sort_by_cached_key(|sample| curve.place(sample.off));
    let uniform: Vec<Vec3> = uniform_points(random).collect();

    // A distance beyond the truncation is as good as the truncation; `reach` is how far the surface is at most.
    let target = |source: Source, point: Vec3, reach: f32| {
        let solid = &frame.surface(source).solid;
        let is_inside = || solid.is_inside(point);
        match config.fields.representation {
            Representation::Occupancy => f32::from(is_inside()),
            Representation::SignedDistance => solid
                .signed_distance_within(point, REACH_SLACK * reach.min(truncation))
                .unwrap_or_else(|| if is_inside() { -truncation } else { truncation }),
        }
    };
    let looked_up: Vec<_> = drawn
        .par_iter()
        .map(|sample| {
            let mesh = &frame.surface(sample.source).mesh;
            let position = mesh.position_at(&sample.place);
            let on_scan = match sample.source {
                Source::Scan => sample.place,
                Source::Registration => frame.scan.solid.surface().closest(position).surface_point(),
            };
            let colour = frame.scan.mesh.colour_at(&on_scan).unwrap_or(Vec3::splat(0.5));
            let reach = position.distance(sample.off);
            (position, mesh.normal_at(&sample.place), colour, target(sample.source, sample.off, reach))
        })
        .collect();
    let far: Vec<_> = uniform
        .par_iter()
        .map(|point| (target(Source::Scan, *point, truncation), frame.registration.nearest(*point).0.0))
        .collect();

    let mut samples = PosedSamples::default();
    for (sample, (position, normal, colour, target)) in drawn.iter().zip(looked_up) {
        samples.on_points.push(position.to_array());
        samples.on_normals.push(normal.to_array());
        samples.on_colours.push(colour.to_array());
        samples.on_labels.push(sample.label);
        let origin = |moved: f32| frame.origin(sample.source, &sample.place, moved);
        samples.on_origins.push(origin(0.0));
        samples.off_origins.push(origin(sample.off.distance(position)));
        samples.off_points.push(sample.off.to_array());
        samples.off_targets.push(target);
        samples.off_labels.push(sample.label);
    }
    for (point, (target, label)) in uniform.iter().zip(far) {
        samples.off_points.push(point.to_array());
        samples.off_targets.push(target);
        samples.off_labels.push(label);
        samples.off_origins.push(Origin::Depth(0.0));
    }
    samples
}

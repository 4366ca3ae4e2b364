use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{Vec2, Vec3};
use proptest::prelude::*;

use super::*;
use crate::{Topology, largest_component};
use xavatar_formats::Error;

fn grid(half: f32, resolution: usize) -> ExtractionGrid {
    ExtractionGrid {
        minimum: Vec3::splat(-half),
        maximum: Vec3::splat(half),
        resolution,
        level: 0.0,
        inside_is: Sign::Negative,
    }
}

fn extract_distance(
    distance: impl Fn(Vec3) -> f32 + Sync,
    grid: ExtractionGrid,
) -> Result<TriangleMesh, ExtractionError> {
    extract(&|points, values| points.iter().zip(values).for_each(|(&p, v)| *v = distance(p)), grid)
        .map(|found| found.mesh)
}

fn torus(p: Vec3) -> f32 {
    Vec2::new(Vec2::new(p.x, p.z).length() - 0.6, p.y).length() - 0.2
}

/// A palm with five fingers of 7 mm radius, 80 mm long, 4 mm apart.
fn hand(p: Vec3) -> f32 {
    let palm = p.length() - 0.1;
    (0..5).fold(palm, |distance, finger| {
        let axis = Vec3::new((finger as f32 - 2.0) * 0.018, 0.0, 0.0);
        let along = (p - axis).y.clamp(0.0, 0.18);
        distance.min((p - axis - Vec3::Y * along).length() - 0.007)
    })
}

#[test]
fn a_sphere_converges_quadratically_at_any_resolution() {
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.7f64.powi(3);
    for resolution in [7, 33, 64, 100, 181, 256] {
        let mesh = extract_distance(|p| p.length() - 0.7, grid(1.0, resolution)).unwrap();
        let topology = Topology::of(&mesh);
        assert!(topology.is_watertight(), "{resolution}: {topology:?}");
        assert_eq!((topology.euler_characteristic(), topology.components), (2, 1));
        let cell = 2.0 / resolution as f32;
        let radius_error = mesh.vertices.iter().map(|v| (v.length() - 0.7).abs()).fold(0.0, f32::max);
        assert!(radius_error < 0.2 * cell * cell / 0.7 + 1e-3 * cell, "{resolution}: {radius_error}");
        // Chords lie below the sphere by about cell^2 / (8 r).
        let relative = (mesh.volume() - exact) / exact;
        assert!((-1.5 * f64::from(cell * cell)..0.0).contains(&relative), "{resolution}: {relative}");
    }
}

#[test]
fn a_torus_has_genus_one_and_both_signs_give_the_same_surface() {
    let mesh = extract_distance(torus, grid(1.0, 90)).unwrap();
    let topology = Topology::of(&mesh);
    assert!(topology.is_watertight());
    assert_eq!((topology.euler_characteristic(), topology.handles()), (0, Some(1)));
    assert!(mesh.volume() > 0.0);
    let logits = ExtractionGrid { inside_is: Sign::Positive, ..grid(1.0, 90) };
    let occupancy = extract_distance(|p| -torus(p), logits).unwrap();
    assert_eq!((&occupancy.faces, &occupancy.vertices), (&mesh.faces, &mesh.vertices));
}

#[test]
fn the_level_moves_the_surface() {
    let mesh = extract_distance(|p| p.length() - 0.5, ExtractionGrid { level: 0.25, ..grid(1.0, 50) }).unwrap();
    assert!(mesh.vertices.iter().all(|v| (v.length() - 0.75).abs() < 1e-3));
}

#[test]
fn vertices_lie_between_the_lattice_points_of_their_edges() {
    let field = |points: &[Vec3], values: &mut [f32]| points.iter().zip(values).for_each(|(&p, v)| *v = torus(p));
    let found = extract(&field, grid(1.0, 40)).unwrap();
    assert_eq!(found.edges.len(), found.mesh.vertices.len());
    for (vertex, [inside, outside]) in found.mesh.vertices.iter().zip(&found.edges) {
        assert!(torus(*inside) < 0.0 && torus(*outside) >= 0.0);
        assert!((vertex.distance(*inside) + vertex.distance(*outside) - inside.distance(*outside)).abs() < 1e-6);
    }
}

#[test]
fn thin_fingers_and_separate_parts_are_found() {
    let mesh = extract_distance(hand, grid(1.0, 256)).unwrap();
    let topology = Topology::of(&mesh);
    assert!(topology.is_watertight());
    assert_eq!(topology.euler_characteristic(), 2);
    let tips = |x: f32| mesh.vertices.iter().filter(|v| (v.x - x).abs() < 0.008 && v.y > 0.17).count();
    assert!((-2..=2).all(|finger| tips(finger as f32 * 0.018) > 3));

    let spheres = |p: Vec3| (p.distance(Vec3::X * 0.5) - 0.3).min(p.distance(Vec3::X * -0.5) - 0.2);
    let mesh = extract_distance(spheres, grid(1.0, 128)).unwrap();
    assert_eq!(Topology::of(&mesh).components, 2);
    let largest = largest_component(&mesh);
    assert_eq!(largest.others, 1);
    assert!(largest.mesh.vertices.iter().all(|v| v.x > 0.0));
}

#[test]
fn few_more_points_are_evaluated_than_the_crossed_cells_have_corners() {
    let evaluated = AtomicUsize::new(0);
    let body = |p: Vec3| Vec3::new(p.x * 3.0, p.y, p.z * 5.0).length() - 0.8;
    let mesh = extract(
        &|points, values| {
            evaluated.fetch_add(points.len(), Ordering::Relaxed);
            points.iter().zip(values).for_each(|(&p, v)| *v = body(p));
        },
        grid(1.0, 256),
    )
    .unwrap()
    .mesh;
    // A crossed cell has about one lattice point of its own on either side; a closed mesh has about a vertex a crossed cell.
    let necessary = 2 * mesh.vertices.len();
    let coarse = 33 * 33 * 33;
    let evaluated = evaluated.into_inner();
    assert!(evaluated < necessary + 2 * coarse, "{evaluated} for {} vertices", mesh.vertices.len());
}

#[test]
fn a_surface_that_leaves_the_box_is_capped_at_the_box() {
    let cylinder = |p: Vec3| Vec2::new(p.x, p.z).length() - 0.5;
    let mesh = extract_distance(cylinder, grid(1.0, 64)).unwrap();
    let topology = Topology::of(&mesh);
    assert!(topology.is_watertight());
    assert_eq!(topology.euler_characteristic(), 2);
    let volume = std::f64::consts::PI * 0.25 * 2.0;
    assert!((mesh.volume() - volume).abs() < 0.01 * volume);
    assert!(mesh.vertices.iter().all(|v| v.abs().max_element() <= 1.0));
}

#[test]
fn fields_without_a_surface_name_the_range_seen() {
    for (value, resolution) in [(0.25, 64), (-0.25, 64), (0.25, 300)] {
        let error = extract_distance(|p| value * (2.0 + p.x), grid(1.0, resolution)).unwrap_err();
        let ExtractionError::NoSurface { minimum, maximum, level } = error else { panic!("{error}") };
        assert_eq!(
            (minimum, maximum, level),
            (value.abs().copysign(value).min(3.0 * value), value.max(3.0 * value), 0.0)
        );
    }
}

#[test]
fn bad_grids_and_values_are_errors() {
    let sphere = |p: Vec3| p.length() - 0.7;
    for resolution in [0, 1, 513, usize::MAX] {
        assert!(matches!(
            extract_distance(sphere, grid(1.0, resolution)),
            Err(ExtractionError::Input(Error::Value { .. }))
        ));
    }
    for half in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(extract_distance(sphere, grid(half, 32)), Err(ExtractionError::Input(Error::Value { .. }))));
    }
    let nan = |p: Vec3| if p.x > 0.5 { f32::NAN } else { p.length() - 0.7 };
    assert!(matches!(extract_distance(nan, grid(1.0, 32)), Err(ExtractionError::Input(Error::Value { .. }))));
}

/// Reproducible noise in [-1, 1) that has nothing to do with its neighbours: every one of the 256 cases occurs.
fn white_noise(p: Vec3, seed: u32) -> f32 {
    let mut hash = seed;
    for bits in p.to_array().map(f32::to_bits) {
        hash = (hash ^ bits).wrapping_mul(0x9E37_79B1);
        hash ^= hash >> 15;
    }
    hash.wrapping_mul(0x85EB_CA6B) as i32 as f32 / (1u32 << 31) as f32
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    #[test]
    fn any_field_gives_closed_outward_surfaces(seed: u32, resolution in 2usize..30, sides in (0.2f32..1.0, 0.2f32..1.0)) {
        let grid = ExtractionGrid { maximum: Vec3::new(sides.0, 1.0, sides.1), ..grid(1.0, resolution) };
        let noise = extract_distance(|p| white_noise(p, seed), grid);
        let directions = [1.0, 2.0, 3.0].map(|k| Vec3::from([Vec3::X, Vec3::Y, Vec3::Z].map(|e| white_noise(e * k, seed))));
        let waves = |p: Vec3| directions.iter().map(|d| (8.0 * p.dot(*d) + d.x).sin()).sum::<f32>();
        let smooth = extract_distance(waves, ExtractionGrid { resolution: resolution + 50, ..grid });
        for mesh in [noise, smooth].into_iter().flatten() {
            let topology = Topology::of(&mesh);
            prop_assert!(topology.is_watertight(), "{topology:?}");
            prop_assert!(mesh.volume() > 0.0);
            prop_assert!((0..mesh.faces.len() as u32).all(|face| mesh.face_area(face) > 0.0));
        }
    }
}

fn ball_of(distance: impl Fn(Vec3) -> f32 + Sync, grid: ExtractionGrid) -> Component {
    extract_ball(&|points, values| points.iter().zip(values).for_each(|(&p, v)| *v = distance(p)), grid).unwrap()
}

fn assert_ball(mesh: &TriangleMesh) {
    let topology = Topology::of(mesh);
    assert!(topology.is_watertight(), "{topology:?}");
    assert_eq!((topology.euler_characteristic(), topology.components), (2, 1));
}

// A torso and an arm beside it, joined at the shoulder; in the armpit a thread joins them once more, and a needle has pierced the torso.
#[test]
fn handles_are_cut_or_filled_and_the_rest_stays() {
    let capsule = |p: Vec3, a: Vec3, b: Vec3, radius: f32| {
        let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (p - a - (b - a) * along).length() - radius
    };
    let sound = |p: Vec3| {
        let torso = capsule(p, Vec3::NEG_Y * 0.5, Vec3::Y * 0.5, 0.2);
        torso.min(capsule(p, Vec3::Y * 0.5, Vec3::new(0.7, -0.3, 0.0), 0.1))
    };
    let thread = |p: Vec3| capsule(p, Vec3::ZERO, Vec3::X * 0.45, 0.03);
    let needle = |p: Vec3| capsule(p, Vec3::new(0.0, -0.4, -0.5), Vec3::new(0.0, -0.4, 0.5), 0.02);
    let faulty = |p: Vec3| sound(p).min(thread(p)).max(-needle(p));
    for resolution in [60, 97, 128] {
        let cell = 2.0 / resolution as f32;
        let found = extract_distance(faulty, grid(1.0, resolution)).unwrap();
        assert_eq!(Topology::of(&found).euler_characteristic(), -2, "{resolution}: two handles");
        let mesh = ball_of(faulty, grid(1.0, resolution)).mesh;
        assert_ball(&mesh);
        for vertex in mesh.vertices.iter().filter(|vertex| thread(**vertex).min(needle(**vertex)) > 2.0 * cell) {
            assert!(found.vertices.contains(vertex), "{resolution}: {vertex} was no handle's");
        }
        // The torso is whole where the needle was, and the thread is severed, not the shoulder or a way around the needle.
        let volume = |mesh: &TriangleMesh| mesh.volume() as f32;
        let sound = volume(&extract_distance(sound, grid(1.0, resolution)).unwrap());
        assert!((volume(&mesh) - sound).abs() < 0.02 * sound, "{resolution}: {} of {sound}", volume(&mesh));
    }
}

#[test]
fn a_surface_without_handles_is_the_extracted_one() {
    let hand = ball_of(hand, grid(0.3, 128));
    assert_ball(&hand.mesh);
    let extracted = extract_distance(self::hand, grid(0.3, 128)).unwrap();
    assert_eq!((hand.mesh.vertices, hand.mesh.faces, hand.others), (extracted.vertices, extracted.faces, 0));
}

#[test]
fn a_ring_is_opened_and_other_parts_and_cavities_are_left_out() {
    assert_ball(&ball_of(torus, grid(1.0, 50)).mesh);
    let parts = |p: Vec3| torus(p).max(-(torus(p) + 0.12)).min((p - Vec3::splat(0.8)).length() - 0.1);
    let ball = ball_of(parts, grid(1.0, 64));
    assert_ball(&ball.mesh);
    assert_eq!(ball.others, 2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    // Sums of waves have any number of handles, parts and cavities.
    #[test]
    fn of_any_field_one_ball_is_left(seed in 0_u32..1000, roughness in 3.0_f32..14.0, resolution in 9_usize..40) {
        let phase = |k: u32| (seed * 7 + k * 131) as f32 * 0.61;
        let field = move |p: Vec3| {
            let wave = |k: u32| (roughness * p.dot(Vec3::new(phase(k).sin(), phase(k + 3).cos(), phase(k + 5).sin())) + phase(k)).sin();
            p.length() - 0.6 + 0.3 * (wave(1) + wave(2) * wave(3))
        };
        assert_ball(&ball_of(field, grid(1.0, resolution)).mesh);
    }
}

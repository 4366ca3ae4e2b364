//! Pictures: milliseconds a frame of 1024 x 1024 pixels that a body-like mesh of 100,000 faces fills from top to bottom.
//!
//! `cargo bench --bench render [-- THREADS]`. Least and median of 15.

use std::time::Instant;

use glam::Vec3;
use xavatar::mesh::camera::{FRONT, PinholeCamera};
use xavatar::mesh::{Colouring, TriangleMesh};
use xavatar::render::{Scene, View, render_depth, render_rgbd};

const REPETITIONS: usize = 15;
const SIDE: u32 = 1024;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(2);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let mesh = body();
    let low = mesh.vertices.iter().copied().fold(Vec3::MAX, Vec3::min);
    let high = mesh.vertices.iter().copied().fold(Vec3::MIN, Vec3::max);
    let camera = PinholeCamera::framing(low, high, FRONT, SIDE, SIDE)?;
    println!("{} faces, {SIDE} x {SIDE} pixels, {threads} threads", mesh.faces.len());
    println!("{:>26} {:>9} {:>9}", "", "least ms", "median ms");
    let scene = Scene::new(&mesh)?;
    let views = [
        ("shaded, anti-aliased", View::Shaded),
        ("colour, anti-aliased", View::Colour),
        ("normals, anti-aliased", View::Normals),
    ];
    for (name, view) in views {
        measure(name, || scene.render(&camera, view).map(drop))?;
    }
    measure("depth", || render_depth(&mesh, &camera).map(drop))?;
    measure("depth and colour", || render_rgbd(&mesh, &camera).map(drop))?;
    measure("occlusion and floor, a mesh", || Scene::new(&mesh)?.with_ambient_occlusion(Some(-0.95)).map(drop))?;
    Ok(())
}

fn measure(name: &str, mut work: impl FnMut() -> xavatar::formats::Result<()>) -> xavatar::formats::Result<()> {
    work()?;
    let mut times = Vec::new();
    for _ in 0..REPETITIONS {
        let began = Instant::now();
        work()?;
        times.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!("{name:>26} {:>9.1} {:>9.1}", times[0], times[REPETITIONS / 2]);
    Ok(())
}

/// An upright, wavy ellipsoid with 100,000 faces, 1.8 m high and 0.9 m wide, wound outward.
fn body() -> TriangleMesh {
    let (rings, columns) = (250_u32, 200_u32);
    let mut mesh = TriangleMesh::default();
    for ring in 0..=rings {
        for column in 0..columns {
            let latitude = std::f32::consts::PI * ring as f32 / rings as f32;
            let longitude = std::f32::consts::TAU * column as f32 / columns as f32;
            let wave = 1.0 + 0.05 * (9.0 * latitude).sin() * (7.0 * longitude).cos();
            let (sin, cos) = latitude.sin_cos();
            let place = Vec3::new(0.45 * sin * longitude.sin(), 0.9 * cos, 0.3 * sin * longitude.cos());
            mesh.vertices.push(place * wave);
        }
    }
    for ring in 0..rings {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let [a, b] = [ring * columns + column, ring * columns + next];
            mesh.faces.extend([[a, a + columns, b], [b, a + columns, b + columns]]);
        }
    }
    let colour = |place: &Vec3| (*place * 120.0 + 128.0).to_array().map(|channel| channel as u8);
    mesh.colouring = Colouring::Vertex(mesh.vertices.iter().map(colour).collect());
    mesh
}

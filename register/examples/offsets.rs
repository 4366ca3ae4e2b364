//! How near bodies come to their scans when they are moved vertex by vertex:
//! `cargo run --release -p xavatar-register --example offsets -- DATA BODY [FRAMES]`.
//!
//! Of registered data, a row a frame and their median: distances from the scan's samples to the mesh, and to the scan from those vertices that
//! are drawn to it, median and 95 % each in millimetres, of the body and of the mesh that was moved; faces that were turned over; seconds.

use std::time::Instant;

use glam::Vec3;
use xavatar_body::{BodyModel, PartLabels};
use xavatar_data::{Split, Subject, read_frame};
use xavatar_formats::Result;
use xavatar_mesh::{SurfaceIndex, TriangleMesh};
use xavatar_register::free_form::{Freedom, free_form, freedoms, turned_faces};
use xavatar_register::target::ScanTarget;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [data, body, rest @ ..] = arguments.as_slice() else { return Err("give DATA and BODY".into()) };
    let count: usize = rest.first().map_or(Ok(usize::MAX), |count| count.parse())?;
    let subject = Subject::open(data)?;
    let model = BodyModel::load(body.as_ref(), subject.gender)?;
    let freedoms = freedoms(&model, &PartLabels::find(&model)?);
    let subject = subject.settled(&model)?;
    println!("{:<20} {:>27} {:>27}", "mm", "body", "moved");
    println!("{:<20}{}  turned  seconds", "", "  scan median, 95 %    mesh".repeat(2));
    let mut rows: Vec<[f64; 10]> = Vec::new();
    let files = [Split::Train, Split::Test].into_iter().flat_map(|split| subject.files(split));
    for files in files.filter(|files| files.parameters.path().is_some()).take(count) {
        let pose = model.resolve(&files.read_parameters(&subject.betas)?)?;
        let start = model.mesh(model.pose(&pose)?.vertices);
        let scan = read_frame(files, &subject.betas)?.scan;
        let began = Instant::now();
        let moved = free_form(&start, &freedoms, &scan)?;
        let seconds = began.elapsed().as_secs_f64();
        let [before, after] = [distances(&start, &freedoms, &scan)?, distances(&moved, &freedoms, &scan)?];
        let turned = turned_faces(&start, &moved).len() as f64;
        let row = [before[0], before[1], before[2], before[3], after[0], after[1], after[2], after[3], turned, seconds];
        print(&files.id.to_string(), &row);
        rows.push(row);
    }
    let mut medians = [0.0; 10];
    for (column, median) in medians.iter_mut().enumerate() {
        *median = quantile(rows.iter().map(|row| row[column]).collect(), 0.5);
    }
    print("median", &medians);
    Ok(())
}

fn print(name: &str, row: &[f64; 10]) {
    println!("{name:<20} {}", row.map(|value| format!("{value:6.2}")).join(" "));
}

/// Median and 95 % from the scan to the mesh, then from the mesh to the scan, millimetres.
fn distances(mesh: &TriangleMesh, freedoms: &[Freedom], scan: &TriangleMesh) -> Result<[f64; 4]> {
    let to = |surface: &TriangleMesh, points: &[Vec3]| -> Result<[f64; 2]> {
        let found = SurfaceIndex::new(surface)?.closest_to_each(points);
        let distances: Vec<f64> = found.iter().map(|closest| 1e3 * f64::from(closest.distance)).collect();
        Ok([quantile(distances.clone(), 0.5), quantile(distances, 0.95)])
    };
    let samples: Vec<Vec3> = ScanTarget::of(scan)?.points().iter().map(|point| point.as_vec3()).collect();
    let free =
        mesh.vertices.iter().zip(freedoms).filter(|(_, freedom)| **freedom == Freedom::Drawn).map(|(place, _)| *place);
    let [[a, b], [c, d]] = [to(mesh, &samples)?, to(scan, &free.collect::<Vec<_>>())?];
    Ok([a, b, c, d])
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((share * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
}

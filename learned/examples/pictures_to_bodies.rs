//! Bodies of pictures: a small network with an auto-decoder as what it knows of bodies, on pictures that are drawn, as a table.
//!
//! `cargo run --release -p xavatar-learned --example pictures_to_bodies -- BODY.npz [PEOPLE] [EPOCHS] [VERTICES]` makes PEOPLE people up, on BODY's mesh with about
//! VERTICES vertices left, whose limbs are turned, and trains an auto-decoder on their shapes. It draws four pictures of each, outline and normals, by
//! cameras of their own, and trains a network that finds code and camera in them, without and with a judge of meshes. Measured on an eighth as many others, a
//! picture each: the mean distance of a vertex, before any camera turns it. The mean of all people's shapes and the codes nearest to the shapes themselves say between what that lies.

mod people;

use std::f64::consts::FRAC_PI_3;
use std::path::PathBuf;
use std::time::Instant;

use candle_core::{DType, Device, Tensor};
use glam::{DQuat, DVec3, EulerRot, Mat3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar_formats::{Error, Result};
use xavatar_learned::blsm::BlsmBody;
use xavatar_learned::descent::Descent;
use xavatar_learned::pictures::{Drawn, Judge, PictureNetwork, projected};
use xavatar_learned::spiral::{Autodecoder, AutodecoderTraining, FACTORS, levels};
use xavatar_mesh::TriangleMesh;
use xavatar_mesh::camera::PinholeCamera;
use xavatar_render::render_points;

use people::mean_distance;

/// Numbers of a code.
const CODES: usize = 32;
/// Pictures of a person who is trained on.
const VIEWS: usize = 4;
/// Pixels of a side.
const SIDE: usize = 64;
/// An outline and a normal.
const CHANNELS: usize = 4;
/// How far a camera turns a body about y, x and z, radians.
const TURNS: DVec3 = DVec3::new(FRAC_PI_3, 0.2, 0.1);
/// Half pictures that a metre is, and how much more at most; how far the body's middle is away from the picture's, half pictures.
const SIZE: [f64; 2] = [0.9, 0.1];
const AWAY: f64 = 0.1;
/// So far away that perspective is weak, metres.
const FAR: f64 = 100.0;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = PathBuf::from(arguments.next().unwrap_or_else(|| "SMPLX_NEUTRAL.npz".into()));
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (count, epochs, vertices) = (number(400), number(40), number(400));
    let body = people::body(&file, vertices)?;
    let shape = |person: usize| people::shape(&body, person, true);
    let known: Vec<Vec<DVec3>> = (0..count).map(shape).collect();
    let others: Vec<Vec<DVec3>> = (count..count + count.div_ceil(8)).map(shape).collect();
    let levels = levels(&body.bent(), &FACTORS)?;
    let decoder = decoder(AutodecoderTraining::new(levels.clone(), &known, CODES, 0)?, epochs)?;
    let (drawn, unseen) = (drawn(&body, &known, VIEWS)?, drawn(&body, &others, 1)?);
    println!("{count} people, {} others, {VIEWS} pictures each, {SIDE} x {SIDE} pixels, {epochs} epochs", others.len());
    println!("| | vertex, mm | seconds |\n|---|---|---|");
    let row = |name: &str, found: &[Vec<DVec3>], began: Instant| {
        println!("| {name} | {:.1} | {:.0} |", 1e3 * mean_distance(&others, found), began.elapsed().as_secs_f64());
    };
    let began = Instant::now();
    let mean = decoder.decoded(&vec![0.0; decoder.code_count()])?.shape;
    row("the mean code", &vec![mean; others.len()], began);
    for (name, has_judge) in [("network", false), ("network and judge", true)] {
        let began = Instant::now();
        let judge = if has_judge { Some(Judge::new(&levels, &drawn.shapes, CODES, 1)?) } else { None };
        let network = PictureNetwork::new(&drawn, &decoder, judge.as_ref(), 2)?;
        let mut descent = Descent::new(&network, 3)?;
        let mut judging = judge.as_ref().map(|judge| Descent::new(judge, 4)).transpose()?;
        // A judge that knows nothing of real meshes would call the mean the best.
        if let (Some(judge), Some(judging)) = (&judge, &mut judging) {
            (0..epochs).try_for_each(|_| judging.epoch(judge).map(|_| ()))?;
        }
        for _ in 0..epochs {
            descent.epoch(&network)?;
            if let (Some(judge), Some(judging)) = (&judge, &mut judging) {
                network.show(judge)?;
                judging.epoch(judge)?;
            }
        }
        row(name, &network.shapes_of(&unseen.pictures)?, began);
    }
    let began = Instant::now();
    let nearest = |shape: &Vec<DVec3>| Ok(decoder.decoded(&decoder.code_of(shape, 1e-9)?)?.shape);
    row("the nearest code", &others.iter().map(nearest).collect::<Result<Vec<_>>>()?, began);
    Ok(())
}

fn decoder(training: AutodecoderTraining, epochs: usize) -> Result<Autodecoder> {
    let mut descent = Descent::new(&training, 0)?;
    for _ in 0..epochs {
        descent.epoch(&training)?;
    }
    Ok(training.finished()?.0)
}

/// So many pictures of each of these shapes, one shape after the other.
fn drawn(body: &BlsmBody, shapes: &[Vec<DVec3>], views: usize) -> Result<Drawn> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut uniform = |most: f64| random.random_range(-most..=most);
    let (mut pixels, mut cameras, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for shape in shapes.iter().flat_map(|shape| std::iter::repeat_n(shape, views)) {
        let turn = DQuat::from_euler(EulerRot::YXZ, uniform(TURNS.x), uniform(TURNS.y), uniform(TURNS.z));
        let turned: Vec<DVec3> = shape.iter().map(|place| turn * *place).collect();
        let low = turned.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = turned.iter().copied().fold(DVec3::MIN, DVec3::max);
        let (middle, size) = ((low + high) / 2.0, SIZE[0] + uniform(SIZE[1]));
        let away = [uniform(AWAY) - size * middle.x, uniform(AWAY) - size * middle.y];
        pixels.extend(picture(body, &turned, away, size)?);
        cameras.extend(turn.to_array().into_iter().chain(away).chain([size]));
        all.push(shape.clone());
    }
    let of_vertices = landmarks(body);
    let count = all.len();
    let tensors = || -> candle_core::Result<Drawn> {
        let places: Vec<f64> = all.iter().flatten().flat_map(|place| place.to_array()).collect();
        let places = Tensor::from_vec(places, (count, body.template.len(), 3), &Device::Cpu)?;
        let of_vertices = Tensor::from_vec(of_vertices, (body.names.len(), body.template.len()), &Device::Cpu)?;
        let cameras = Tensor::from_vec(cameras, (count, 7), &Device::Cpu)?;
        let landmarks = projected(&of_vertices.unsqueeze(0)?.broadcast_matmul(&places)?, &cameras)?;
        Ok(Drawn {
            pictures: Tensor::from_vec(pixels, (count, CHANNELS, SIDE, SIDE), &Device::Cpu)?,
            landmarks: landmarks.to_dtype(DType::F32)?,
            of_vertices: of_vertices.to_dtype(DType::F32)?,
            shapes: all,
        })
    };
    tensors().map_err(|error| Error::Value {
        name: "pictures".into(),
        found: error.to_string(),
        expected: "tensors that fit each other".into(),
    })
}

/// Landmarks as rows of vertices (J, V): the middle of what each joint moves.
fn landmarks(body: &BlsmBody) -> Vec<f64> {
    let count = body.template.len();
    let mut rows = vec![0.0; body.names.len() * count];
    for (vertex, row) in body.weights.iter().enumerate() {
        row.iter().for_each(|(joint, weight)| rows[joint * count + vertex] = *weight);
    }
    for row in rows.chunks_exact_mut(count) {
        let sum = row.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        row.iter_mut().for_each(|weight| *weight /= sum);
    }
    rows
}

/// Outline and normals, by channel, row by row, of a turned body's shape that a camera moves and sizes.
fn picture(body: &BlsmBody, turned: &[DVec3], away: [f64; 2], size: f64) -> Result<Vec<f32>> {
    let vertices = turned.iter().map(|place| place.as_vec3()).collect();
    let mesh = TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() };
    let half = SIDE as f64 / 2.0;
    let focal = (half * size * FAR) as f32;
    let camera = PinholeCamera {
        width: SIDE as u32,
        height: SIDE as u32,
        fx: focal,
        fy: focal,
        cx: (half * (1.0 + away[0])) as f32,
        cy: (half * (1.0 - away[1])) as f32,
        rotation: Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)),
        translation: Vec3::Z * FAR as f32,
    };
    let normals = mesh.vertex_normals();
    let seen = render_points(&mesh, &camera)?;
    let mut channels = vec![0.0; CHANNELS * seen.len()];
    for (pixel, point) in seen.iter().enumerate() {
        let Some(point) = point else { continue };
        let corners = mesh.faces[point.place.face as usize].iter().zip(point.place.barycentric);
        let normal: Vec3 = corners.map(|(corner, share)| normals[*corner as usize] * share).sum();
        for (channel, value) in [1.0].into_iter().chain(normal.normalize_or_zero().to_array()).enumerate() {
            channels[channel * seen.len() + pixel] = value;
        }
    }
    Ok(channels)
}

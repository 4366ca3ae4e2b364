//! How far registration is from registrations that are known:
//! `cargo run --release -p xavatar-register --example score -- SUBJECT BODY OUT [--geometry-only | --models PACKAGE] [--rgbd PICTURES]`.
//!
//! The subject's own registrations make landmarks, with 20 mm of noise and every fifth missing, unless a package's networks find them, and
//! are hidden from the fit, which is
//! written to OUT, a new folder. PICTURES are the subject's as a depth camera sees it, with the same names of frames (SUBJECT itself, if it
//! has some). Mean distances of vertices in millimetres, a frame a row. Hands that the scan lacks, or of which the
//! picture shows less than 30 %, are left out, which the truth decides. Jitter: the true surface taken back to rest by the fitted bones, its mean distance over frames from its median.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{DMat3, DVec3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use xavatar_body::{BodyModel, PartLabels, Pose, PosedBody, Registration, Role};
use xavatar_data::{FrameFiles, RgbdCapture, RgbdFiles, RgbdPictures, RgbdSubject, Scans, Split, Subject, read_frame};
use xavatar_formats::Result;
use xavatar_landmarks::Models;
use xavatar_register::fit::{Fitter, Known};
use xavatar_register::job::{Job, Recordings, Up, Verdict, find_landmarks};
use xavatar_register::landmarks::{LandmarkFiles, Site};
use xavatar_register::linear::FramePose;
use xavatar_register::surface_model::Density;
use xavatar_register::target::ScanTarget;

const NOISE: f64 = 0.02;
const MISSING: f64 = 0.2;
/// Joints that no detector finds.
const UNSEEN: [&str; 6] = ["spine1", "spine2", "spine3", "left_collar", "right_collar", "jaw"];
/// Joints of the body that are compared.
const JOINTS: usize = 22;

/// A frame as it really is, and as it was found.
struct Compared {
    name: String,
    truth: PosedBody,
    found: PosedBody,
    /// Added to every vertex that was found.
    translation: Vec3,
    /// By vertex, whether its hand is in the scan; true of all else.
    visible: Vec<bool>,
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [subject, body, out, ..] = arguments.as_slice() else { return Err("give SUBJECT, BODY and OUT".into()) };
    let truth = Subject::open(subject)?;
    let model = BodyModel::load(body.as_ref(), truth.gender)?;
    let labels = PartLabels::find(&model)?;
    let truth = truth.settled(&model)?;
    let is_blind = arguments.iter().any(|argument| argument == "--geometry-only");
    let package = arguments.iter().skip_while(|argument| *argument != "--models").nth(1);
    let pictures = arguments.iter().skip_while(|argument| *argument != "--rgbd").nth(1);
    let pictures = pictures.map(RgbdPictures::open).transpose()?;
    let recordings = match pictures {
        Some(pictures) => Recordings::Rgbd(pictures),
        None => Recordings::Scans(Scans::open(subject, &[])?),
    };
    let began = Instant::now();
    let mut phase = "";
    let mut observe = |name: &'static str, _: f64, _: &str| {
        if name != phase {
            phase = name;
            eprintln!("{:6.1} s {name}", began.elapsed().as_secs_f64());
        }
    };
    let run_on = AtomicBool::new(false);
    let landmarks = match package {
        Some(package) => {
            find_landmarks(&recordings, &Models::open(package.as_ref())?, Up::Y, out.as_ref(), &mut observe, &run_on)?
        }
        None if is_blind => None,
        None => Some(noisy_landmarks(&truth, &model, &labels, Path::new(out))?),
    };
    let job = Job {
        recordings: &recordings,
        gender: truth.gender,
        body: &model,
        labels: &labels,
        landmarks: landmarks.as_ref(),
        starts: None,
        up: Up::Y,
        known: Known::default(),
        shape_from: None,
        frames_per_second: None,
        offsets: false,
        out: out.into(),
    };
    let Some(report) = job.run(&mut observe, &run_on)? else { return Err("stopped".into()) };
    println!("{report}{:.2} s a frame", began.elapsed().as_secs_f64() / report.frames.len() as f64);
    let found = match recordings {
        Recordings::Scans(_) => poses(&Subject::open(out)?.settled(&model)?, &model)?,
        Recordings::Rgbd(_) => poses_in_pictures(&RgbdSubject::open(out)?, &model)?,
    };
    for split in [Split::Train, Split::Test] {
        let frames = compared(&truth, &found, split, &recordings, &model, &labels)?;
        if !frames.is_empty() {
            print_errors(&frames, &model, &labels);
            println!("jitter {:.2} mm", jitter(&frames, &model));
        }
    }
    for frame in
        report.frames.iter().filter(|frame| frame.verdict == Verdict::Registered && !frame.missing_hands.is_empty())
    {
        println!("{} without {}", frame.frame, frame.missing_hands.join(", "));
    }
    Ok(())
}

/// Landmarks of a subject's registrations, as a file beside the output.
fn noisy_landmarks(truth: &Subject, model: &BodyModel, labels: &PartLabels, out: &Path) -> Result<LandmarkFiles> {
    let fitter = Fitter::new(model, labels, Density::COARSE);
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut frames = serde_json::Map::new();
    for files in [Split::Train, Split::Test].into_iter().flat_map(|split| truth.files(split)) {
        let pose = model.resolve(&files.read_parameters(&truth.betas)?)?;
        let shape: Vec<f64> = pose.shape.iter().map(|value| f64::from(*value)).collect();
        let chain = fitter.linkage.posed(&FramePose::of(&pose, fitter.linkage.extents()), &shape);
        let tips = fitter.sites.vertices().posed(&fitter.linkage, &chain);
        let rows = fitter.sites.all().iter().map(|site| {
            let place = match site.at {
                Site::Joint(joint) => chain.joint(joint),
                Site::Vertex(vertex) => tips.positions[vertex],
            };
            let noise = DVec3::from_array([0, 1, 2].map(|_| random.sample::<f64, _>(StandardNormal)));
            let is_missing = random.random::<f64>() < MISSING || UNSEEN.contains(&site.name.as_str());
            let place = place + noise * NOISE / 3.0_f64.sqrt();
            if is_missing { serde_json::Value::Null } else { serde_json::json!([place.x, place.y, place.z, 1.0]) }
        });
        frames.insert(files.id.to_string(), rows.collect());
    }
    let names: Vec<&str> = fitter.sites.all().iter().map(|site| site.name.as_str()).collect();
    let path = out.with_extension("landmarks.json");
    let text = serde_json::json!({ "names": names, "frames": frames }).to_string();
    std::fs::write(&path, text).map_err(xavatar_formats::Error::io(&path))?;
    LandmarkFiles::read(&path)
}

fn compared(
    truth: &Subject,
    found: &BTreeMap<String, Pose>,
    split: Split,
    recordings: &Recordings,
    model: &BodyModel,
    labels: &PartLabels,
) -> Result<Vec<Compared>> {
    let mut frames = Vec::new();
    for files in truth.files(split) {
        let Some(own) = found.get(&files.id.to_string()) else { continue };
        let truth_posed = model.pose(&model.resolve(&files.read_parameters(&truth.betas)?)?)?;
        let (points, share) = match recordings {
            Recordings::Scans(_) => (ScanTarget::of(&read_frame(files, &truth.betas)?.scan)?, 0.5),
            Recordings::Rgbd(pictures) => {
                let Some(seen) = pictures.files(split).iter().find(|seen| seen.id == files.id) else { continue };
                (ScanTarget::seen(&RgbdCapture::of(seen.read(&[])?)?)?, 0.3)
            }
        };
        frames.push(Compared {
            name: files.id.to_string(),
            visible: visible(&truth_posed, points.points(), share, model, labels)?,
            truth: truth_posed,
            translation: own.translation,
            found: model.pose(own)?,
        });
    }
    Ok(frames)
}

/// The poses of a subject's frames by name.
fn poses(subject: &Subject, model: &BodyModel) -> Result<BTreeMap<String, Pose>> {
    let files = [Split::Train, Split::Test].into_iter().flat_map(|split| subject.files(split));
    let is_registered = |files: &&FrameFiles| files.parameters.path().is_some();
    let pose = |files: &FrameFiles| Ok((files.id.to_string(), model.resolve(&files.read_parameters(&subject.betas)?)?));
    files.filter(is_registered).map(pose).collect()
}

/// The same of what a depth camera saw.
fn poses_in_pictures(subject: &RgbdSubject, model: &BodyModel) -> Result<BTreeMap<String, Pose>> {
    let pose = |files: &RgbdFiles| Ok((files.id.to_string(), model.resolve(&files.read(&subject.betas)?.parameters)?));
    subject.train.iter().chain(&subject.test).map(pose).collect()
}

/// By vertex, whether it is of no hand, or of one of which this share is near points that were seen.
fn visible(
    truth: &PosedBody,
    points: &[DVec3],
    share: f64,
    model: &BodyModel,
    labels: &PartLabels,
) -> Result<Vec<bool>> {
    const NEAR: f32 = 0.008;
    let points: Vec<Vec3> = points.iter().map(|point| point.as_vec3()).collect();
    let (parts, detail) = (vec![Default::default(); points.len()], vec![false; points.len()]);
    let everywhere = PartLabels { parts, detail, source: labels.source.clone() };
    let nearest = Registration::new(&points, &everywhere)?;
    let mut visible = vec![true; truth.vertices.len()];
    for part in model.skeleton().parts_of(Role::Hands) {
        let hand = labels.vertices_of(part);
        let mut distances: Vec<f32> = hand.iter().map(|vertex| nearest.nearest(truth.vertices[*vertex]).1).collect();
        distances.sort_by(f32::total_cmp);
        let is_seen = distances.get((share * distances.len() as f64) as usize).is_some_and(|near| *near < NEAR);
        hand.into_iter().for_each(|vertex| visible[vertex] = is_seen);
    }
    Ok(visible)
}

fn print_errors(frames: &[Compared], model: &BodyModel, labels: &PartLabels) {
    let skeleton = model.skeleton();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let median = |values: &[f64]| values[values.len() / 2];
    println!("{:<20} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}", "mm", "all", "body", "joints", "left", "right", "face");
    let mut rows = Vec::new();
    for frame in frames {
        let distances = |found: &[Vec3], truth: &[Vec3]| -> Vec<f64> {
            found.iter().zip(truth).map(|(found, truth)| 1e3 * f64::from(found.distance(*truth))).collect()
        };
        let errors = distances(&frame.found.vertices, &frame.truth.vertices);
        let joints = distances(&frame.found.joints[..JOINTS], &frame.truth.joints[..JOINTS]);
        let of = |wanted: &dyn Fn(usize) -> bool| {
            let chosen =
                (0..errors.len()).filter(|vertex| frame.visible[*vertex] && !labels.detail[*vertex] && wanted(*vertex));
            mean(&chosen.map(|vertex| errors[vertex]).collect::<Vec<_>>())
        };
        let role = |role: Role| of(&|vertex| skeleton.role(labels.parts[vertex]) == role);
        let hands: Vec<_> = skeleton.parts_of(Role::Hands).collect();
        let hand = |side: usize| of(&|vertex| hands.get(side) == Some(&labels.parts[vertex]));
        let row = [of(&|_| true), role(Role::Body), mean(&joints), hand(0), hand(1), role(Role::Face)];
        println!("{:<20} {}", frame.name, row.map(|value| format!("{value:6.1}")).join(" "));
        rows.push(row);
    }
    let column = |index: usize| {
        let mut values: Vec<f64> = rows.iter().map(|row| row[index]).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    for (name, of) in [("median", &median as &dyn Fn(&[f64]) -> f64), ("mean", &mean)] {
        let value = |index: usize| {
            Some(column(index)).filter(|values| !values.is_empty()).map_or(f64::NAN, |values| of(&values))
        };
        println!("{name:<20} {}", [0, 1, 2, 3, 4, 5].map(|index| format!("{:6.1}", value(index))).join(" "));
    }
}

/// Mean distance of the true surface, taken back to rest by the fitted bones, from its median over frames; millimetres.
fn jitter(frames: &[Compared], model: &BodyModel) -> f64 {
    let joints = model.skeleton().joints.len();
    let weights = model.skinning_weights();
    let back = |frame: &Compared, vertex: usize| {
        let mut matrix = DMat3::ZERO;
        let mut shift = frame.translation.as_dvec3();
        for (joint, bone) in frame.found.bone_transforms.iter().enumerate() {
            let weight = f64::from(weights[vertex * joints + joint]);
            matrix += DMat3::from_cols_slice(&bone.matrix3.to_cols_array().map(f64::from)) * weight;
            shift += Vec3::from(bone.translation).as_dvec3() * weight;
        }
        matrix.inverse() * (frame.truth.vertices[vertex].as_dvec3() - shift)
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for vertex in 0..model.vertex_count() {
        let seen: Vec<DVec3> =
            frames.iter().filter(|frame| frame.visible[vertex]).map(|frame| back(frame, vertex)).collect();
        if seen.is_empty() {
            continue;
        }
        let middle = DVec3::from_array([0, 1, 2].map(|axis| {
            let mut values: Vec<f64> = seen.iter().map(|place| place[axis]).collect();
            values.sort_by(f64::total_cmp);
            (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
        }));
        sum += seen.iter().map(|place| 1e3 * place.distance(middle)).sum::<f64>() / seen.len() as f64;
        count += 1.0;
    }
    sum / count
}

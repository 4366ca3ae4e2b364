//! How far registration is from registrations that are known: `cargo run --release -p xavatar-register --example score -- SUBJECT BODY`.
//!
//! The subject's own registrations make landmarks, with 20 mm of noise and every fifth missing, and are hidden from the fit. Mean distances
//! of vertices in millimetres, a frame a row. Hands that the scan lacks are left out, which the truth decides. Jitter: the true surface
//! taken back to rest by the fitted bones, its mean distance over frames from its median.

use std::sync::Arc;
use std::time::Instant;

use glam::{DMat3, DVec3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use xavatar_body::{BodyModel, PartLabels, Registration, Role};
use xavatar_data::{ScanFrame, Split, Subject, read_frame};
use xavatar_formats::Result;
use xavatar_register::fit::{Fitter, Frame, Known, Start, from_landmarks};
use xavatar_register::landmarks::{Seen, Site, believed};
use xavatar_register::linear::FramePose;
use xavatar_register::surface_model::Density;
use xavatar_register::target::ScanTarget;

const NOISE: f64 = 0.02;
const MISSING: f64 = 0.2;

struct Truth {
    name: String,
    pose: xavatar_body::Pose,
    vertices: Vec<Vec3>,
    joints: Vec<Vec3>,
    /// By vertex, whether its hand is in the scan; true of all else.
    visible: Vec<bool>,
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, subject, body, ..] = arguments.as_slice() else { return Err("give SUBJECT and BODY".into()) };
    let subject = Subject::open(subject)?;
    let model = BodyModel::load(body.as_ref(), subject.gender)?;
    let labels = PartLabels::find(&model)?;
    let subject = subject.settled(&model)?;
    let fitter = Fitter::new(&model, &labels, Density::FINE);
    println!("{} vertices are fitted", fitter.surface.len());
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut read = |split: Split| -> Result<Vec<(Truth, Frame)>> {
        let files = subject.files(split).iter();
        files.map(|files| prepared(&fitter, &labels, read_frame(files, &subject.betas)?, &mut random)).collect()
    };
    let (train, test) = (read(Split::Train)?, read(Split::Test)?);
    let start = |frame: &Frame| {
        from_landmarks(&fitter.linkage, &fitter.sites, &fitter.prior, &frame.landmarks).ok_or("no torso")
    };
    let frames: Vec<Frame> = train.iter().map(|(_, frame)| frame.clone()).collect();
    if arguments.iter().any(|argument| argument == "--geometry-only") {
        return geometry_only(&model, &labels, &train, &frames);
    }
    let starts = frames.iter().map(start).collect::<std::result::Result<Vec<_>, _>>()?;
    let began = Instant::now();
    let (shaped, mut poses) = fitter.fit(starts, &frames, &Known::default(), |stage, share| {
        eprintln!("{:5.1} s {:3.0} % {stage}", began.elapsed().as_secs_f64(), share * 100.0);
    })?;
    let qualities = fitter.refit(&mut poses, &frames, &shaped)?;
    println!("{} frames together: {:.2} s a frame", frames.len(), began.elapsed().as_secs_f64() / frames.len() as f64);
    println!("shape {:.2?} of {:.2?}", shaped.shape, subject.betas);
    report(
        &fitter,
        &labels,
        &shaped.shape,
        train.iter().map(|(truth, _)| truth).zip(&poses).collect::<Vec<_>>().as_slice(),
    )?;
    for (quality, (truth, _)) in qualities.iter().zip(&train) {
        let parts =
            quality.parts.iter().map(|(name, part)| format!("{name} {:.1} mm, far {:.2}", part.median_mm, part.far));
        println!(
            "{} uncovered {:.3} limits {} {}",
            truth.name,
            quality.uncovered,
            quality.beyond_limits,
            parts.collect::<Vec<_>>().join("; ")
        );
    }
    let began = Instant::now();
    let mut others = Vec::new();
    for (_, frame) in &test {
        others.push(fitter.fit_pose(Start::FromLandmarks(start(frame)?), frame, &shaped)?);
    }
    let frames: Vec<Frame> = test.iter().map(|(_, frame)| frame.clone()).collect();
    fitter.refit(&mut others, &frames, &shaped)?;
    println!("{} frames alone: {:.2} s a frame", test.len(), began.elapsed().as_secs_f64() / test.len().max(1) as f64);
    report(
        &fitter,
        &labels,
        &shaped.shape,
        test.iter().map(|(truth, _)| truth).zip(&others).collect::<Vec<_>>().as_slice(),
    )?;
    Ok(())
}

/// How far guesses from the scans' shape alone are from the truth, with their scores.
fn geometry_only(
    model: &BodyModel,
    labels: &PartLabels,
    train: &[(Truth, Frame)],
    frames: &[Frame],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let coarse = Fitter::new(model, labels, Density::COARSE);
    for (frame, (truth, _)) in frames.iter().zip(train) {
        let began = Instant::now();
        let Some(guess) = coarse.guess(&Frame { scan: frame.scan.clone(), landmarks: Vec::new() })? else { continue };
        let joints = model.pose(&guess.pose.pose(&guess.shape))?.joints;
        let error =
            (0..22).map(|joint| 1e3 * f64::from(joints[joint].distance(truth.joints[joint]))).sum::<f64>() / 22.0;
        println!(
            "{} score {:.1} joints {error:.0} mm, {:.1} s",
            truth.name,
            1e3 * guess.score,
            began.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

fn prepared(
    fitter: &Fitter<'_>,
    labels: &PartLabels,
    frame: ScanFrame,
    random: &mut ChaCha8Rng,
) -> Result<(Truth, Frame)> {
    let pose = fitter.model.resolve(&frame.parameters)?;
    let posed = fitter.model.pose(&pose)?;
    let scan = ScanTarget::of(&frame.scan)?;
    let mut landmarks = Vec::new();
    let mut noise = |scale: f64| DVec3::from_array([0, 1, 2].map(|_| random.sample::<f64, _>(StandardNormal))) * scale;
    let chain = fitter.linkage.posed(&FramePose::of(&pose, fitter.linkage.extents()), &wide(&pose.shape));
    let tips = fitter.sites.vertices().posed(&fitter.linkage, &chain);
    for (site, named) in fitter.sites.all().iter().enumerate() {
        // Joints that no detector finds.
        if ["spine1", "spine2", "spine3", "left_collar", "right_collar", "jaw"].contains(&named.name.as_str()) {
            continue;
        }
        let place = match named.at {
            Site::Joint(joint) => chain.joint(joint),
            Site::Vertex(vertex) => tips.positions[vertex],
        };
        landmarks.push(Seen { site, place: place + noise(NOISE / 3.0_f64.sqrt()), confidence: 1.0 });
    }
    landmarks.retain(|_| random.random::<f64>() > MISSING);
    let (landmarks, dropped) = believed(&fitter.linkage, &fitter.sites, &landmarks);
    if !dropped.is_empty() {
        println!("{}: dropped {}", frame.id, dropped.join(", "));
    }
    let of_scan: Vec<Vec3> = scan.points().iter().map(|point| point.as_vec3()).collect();
    let everywhere = PartLabels {
        parts: vec![Default::default(); of_scan.len()],
        detail: vec![false; of_scan.len()],
        source: labels.source.clone(),
    };
    let nearest = Registration::new(&of_scan, &everywhere)?;
    let mut visible = vec![true; posed.vertices.len()];
    for part in fitter.model.skeleton().parts_of(Role::Hands) {
        let hand = labels.vertices_of(part);
        let mut distances: Vec<f32> = hand.iter().map(|vertex| nearest.nearest(posed.vertices[*vertex]).1).collect();
        distances.sort_by(f32::total_cmp);
        if distances[distances.len() / 2] >= 0.008 {
            hand.into_iter().for_each(|vertex| visible[vertex] = false);
        }
    }
    let truth = Truth { name: frame.id.to_string(), pose, vertices: posed.vertices, joints: posed.joints, visible };
    Ok((truth, Frame { scan: Arc::new(scan), landmarks }))
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}

fn report(fitter: &Fitter<'_>, labels: &PartLabels, shape: &[f64], frames: &[(&Truth, &FramePose)]) -> Result<()> {
    let skeleton = fitter.model.skeleton();
    let roles: Vec<Role> = labels.parts.iter().map(|part| skeleton.role(*part)).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut rows = Vec::new();
    println!("{:<20} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}", "mm", "all", "body", "joints", "left", "right", "face");
    for (truth, pose) in frames {
        let posed = fitter.model.pose(&pose.pose(shape))?;
        let errors: Vec<f64> =
            posed.vertices.iter().zip(&truth.vertices).map(|(a, b)| 1e3 * f64::from(a.distance(*b))).collect();
        let of = |wanted: &dyn Fn(usize) -> bool| {
            let chosen =
                (0..errors.len()).filter(|vertex| truth.visible[*vertex] && !labels.detail[*vertex] && wanted(*vertex));
            mean(&chosen.map(|vertex| errors[vertex]).collect::<Vec<_>>())
        };
        let joints: Vec<f64> =
            (0..22).map(|joint| 1e3 * f64::from(posed.joints[joint].distance(truth.joints[joint]))).collect();
        let role = |role: Role| of(&|vertex| roles[vertex] == role);
        let hands: Vec<_> = skeleton.parts_of(Role::Hands).collect();
        let hand = |side: usize| of(&|vertex| hands.get(side) == Some(&labels.parts[vertex]));
        let row = [of(&|_| true), role(Role::Body), mean(&joints), hand(0), hand(1), role(Role::Face)];
        println!("{:<20} {}", truth.name, row.map(|value| format!("{value:6.1}")).join(" "));
        if std::env::var("JOINTS").is_ok_and(|name| truth.name.ends_with(&name)) {
            for (joint, name) in skeleton.joints.iter().enumerate() {
                println!(
                    "   {name} {:.0}   {:.2} true {:.2}",
                    1e3 * posed.joints[joint].distance(truth.joints[joint]),
                    pose.pose(shape).rotations[joint].0,
                    truth.pose.rotations[joint].0
                );
            }
        }
        rows.push(row);
    }
    let column = |index: usize| {
        let mut values: Vec<f64> = rows.iter().map(|row| row[index]).filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    for (name, of) in [("median", &(|v: &[f64]| v[v.len() / 2]) as &dyn Fn(&[f64]) -> f64), ("mean", &mean)] {
        println!(
            "{name:<20} {}",
            [0, 1, 2, 3, 4, 5]
                .map(|index| format!(
                    "{:6.1}",
                    match column(index) {
                        values if values.is_empty() => f64::NAN,
                        values => of(&values),
                    }
                ))
                .join(" ")
        );
    }
    println!("jitter {:.2} mm", jitter(fitter, shape, frames));
    Ok(())
}

fn jitter(fitter: &Fitter<'_>, shape: &[f64], frames: &[(&Truth, &FramePose)]) -> f64 {
    let joints = fitter.linkage.extents().joints;
    let weights = fitter.model.skinning_weights();
    let at_rest: Vec<Vec<DVec3>> = frames
        .iter()
        .map(|(truth, pose)| {
            let posed = fitter.model.pose(&pose.pose(shape)).map(|posed| posed.bone_transforms).unwrap_or_default();
            let back = |(vertex, place): (usize, &Vec3)| {
                let mut matrix = DMat3::ZERO;
                let mut shift = DVec3::ZERO;
                for (joint, bone) in posed.iter().enumerate() {
                    let weight = f64::from(weights[vertex * joints + joint]);
                    matrix += DMat3::from_cols_slice(&bone.matrix3.to_cols_array().map(f64::from)) * weight;
                    shift += Vec3::from(bone.translation).as_dvec3() * weight;
                }
                matrix.inverse() * (place.as_dvec3() - pose.translation - shift)
            };
            truth.vertices.iter().enumerate().map(back).collect()
        })
        .collect();
    let mut sum = (0.0, 0.0);
    for vertex in 0..weights.len() / joints {
        let seen: Vec<DVec3> = (frames.iter().zip(&at_rest))
            .filter(|((truth, _), _)| truth.visible[vertex])
            .map(|(_, rest)| rest[vertex])
            .collect();
        if seen.is_empty() {
            continue;
        }
        let middle = DVec3::from_array([0, 1, 2].map(|axis| {
            let mut values: Vec<f64> = seen.iter().map(|place| place[axis]).collect();
            values.sort_by(f64::total_cmp);
            (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
        }));
        sum.0 += seen.iter().map(|place| 1e3 * place.distance(middle)).sum::<f64>() / seen.len() as f64;
        sum.1 += 1.0;
    }
    sum.0 / sum.1
}

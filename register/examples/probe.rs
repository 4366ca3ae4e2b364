//! Probe.
use std::time::Instant;
use xavatar_body::{BodyModel, PartLabels};
use xavatar_data::{Split, Subject, read_frame};
use xavatar_landmarks::{Models, find};
use xavatar_register::fit::Fitter;
use xavatar_register::landmarks::Site;
use xavatar_register::linear::FramePose;
use xavatar_register::surface_model::Density;
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let subject = Subject::open(&a[0])?;
    let model = BodyModel::load(a[1].as_ref(), subject.gender)?;
    let labels = PartLabels::find(&model)?;
    let subject = subject.settled(&model)?;
    let models = Models::open(a[2].as_ref())?;
    let split = if a[3] == "test" { Split::Test } else { Split::Train };
    let step: usize = a[4].parse()?;
    let fitter = Fitter::new(&model, &labels, Density::COARSE);
    let mut all: std::collections::BTreeMap<String, Vec<f64>> = Default::default();
    for files in subject.files(split).iter().step_by(step) {
        let frame = read_frame(files, &subject.betas)?;
        let t = Instant::now();
        let found = find(&models, &frame.scan)?;
        let s = t.elapsed().as_secs_f64();
        let pose = model.resolve(&frame.parameters)?;
        let shape: Vec<f64> = pose.shape.iter().map(|v| f64::from(*v)).collect();
        let chain = fitter.linkage.posed(&FramePose::of(&pose, fitter.linkage.extents()), &shape);
        let tips = fitter.sites.vertices().posed(&fitter.linkage, &chain);
        let mut line = String::new();
        let (mut b, mut h) = (vec![], [vec![], vec![]]);
        for l in &found.landmarks {
            let Some(i) = fitter.sites.named(&l.name) else { println!("no site {}", l.name); continue };
            let site = fitter.sites.site(i);
            let p = match site.at { Site::Joint(j) => chain.joint(j), Site::Vertex(v) => tips.positions[v] };
            let e = 1e3 * p.distance(l.place);
            all.entry(l.name.clone()).or_default().push(e);
            if site.weight < 1.0 || l.name.ends_with("wrist") { h[usize::from(l.name.starts_with("right"))].push(e) } else { b.push(e); line += &format!(" {}:{:.0}({:.2})", l.name.replace("left_", "L").replace("right_", "R"), e, l.confidence); }
        }
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let scan = xavatar_register::target::ScanTarget::of(&frame.scan)?;
        let posed = model.pose(&pose)?;
        let points: Vec<glam::Vec3> = scan.points().iter().map(|p| p.as_vec3()).collect();
        let present: Vec<bool> = model.skeleton().parts_of(xavatar_body::Role::Hands).map(|part| {
            let hand = labels.vertices_of(part);
            let mut d: Vec<f32> = hand.iter().step_by(7).map(|v| points.iter().map(|p| p.distance(posed.vertices[*v])).fold(9.0, f32::min)).collect();
            d.sort_by(f32::total_cmp);
            d[d.len() / 2] < 0.008
        }).collect();
        println!("{} {s:.2}s {present:?} body {:.0} n {} hands {:.1}/{} {:.1}/{} votes {:?} |{line}", files.id, mean(&b), b.len(), mean(&h[0]), h[0].len(), mean(&h[1]), h[1].len(), found.hand_votes.map(|v| v.map(|v| (v * 100.0) as i32)));
    }
    for (name, mut v) in all { v.sort_by(f64::total_cmp); println!("{name:16} n {} median {:.1} max {:.1}", v.len(), v[v.len() / 2], v[v.len() - 1]); }
    Ok(())
}

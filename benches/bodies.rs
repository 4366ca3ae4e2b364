//! Bodies a second: a batch of poses to vertices and joints, and the exact gradient back. Beside PyPI smplx: `scripts/bodies_per_second.py`.
//!
//! `cargo bench --bench bodies -- BODY.npz [FRAMES]`; without a model, the built-in one.

use std::hint::black_box;
use std::time::Instant;

use xavatar::body::{BodyModel, Gender, Pose, PoseAxisAngle, PoseBatch};
use xavatar::synthetic::BuiltInSubject;

/// Batches that are timed; the fastest counts.
const ROUNDS: usize = 5;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    let model = match arguments.next() {
        Some(path) => BodyModel::load(path.as_ref(), Gender::Neutral)?,
        None => BuiltInSubject::new()?.model().clone(),
    };
    let frames = arguments.next().map_or(Ok(64), |count| count.parse())?;
    let joints = model.skeleton().joints.len();
    let turn = |frame: usize, joint: usize| {
        let angle = ((frame * 31 + joint * 17) % 19) as f32 / 19.0 - 0.5;
        PoseAxisAngle(glam::Vec3::new(angle, -0.5 * angle, 0.3 * angle))
    };
    let pose = |frame: usize| Pose {
        rotations: (0..joints).map(|joint| turn(frame, joint)).collect(),
        shape: vec![0.5; model.shape_coefficients()],
        expression: vec![0.2; model.expression_coefficients()],
        ..Pose::default()
    };
    let poses: Vec<Pose> = (0..frames).map(pose).collect();
    let batch = PoseBatch::<f32>::of(&model, &poses)?;
    let (mut forward, mut both) = (f64::MAX, f64::MAX);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let posed = model.pose_batch(&batch)?;
        forward = forward.min(start.elapsed().as_secs_f64());
        let gradient = posed.pullback(&model, &batch, &posed.vertices, &posed.joints)?;
        both = both.min(start.elapsed().as_secs_f64());
        black_box(gradient);
    }
    let rate = |seconds: f64| frames as f64 / seconds;
    println!("{}, {} vertices, batches of {frames}", model.skeleton().description(), model.vertex_count());
    println!("forward {:.1} bodies/s, with gradients {:.1} bodies/s", rate(forward), rate(both));
    Ok(())
}

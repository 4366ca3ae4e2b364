//! Meshes from an avatar: seconds a canonical mesh, a posed one, and a frame of fixed topology, skinned alone and written.
//!
//! `cargo bench --bench extraction -- RUN BODY MOTION [RESOLUTION]...`: a trained run or avatar, its body model's folder, a motion.

use std::path::Path;
use std::time::Instant;

use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::{BodyModel, PartLabels};
use xavatar::data::{Clip, MotionOptions};
use xavatar::mesh::{write_obj, write_ply};

/// Frames of a motion that are measured.
const FRAMES: usize = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [run, body, motion, resolutions @ ..] = arguments.as_slice() else {
        println!("usage: cargo bench --bench extraction -- RUN BODY MOTION [RESOLUTION]...");
        return Ok(());
    };
    let avatar = Avatar::load(Path::new(run))?;
    let body = BodyModel::load(Path::new(body), avatar.subject.gender)?;
    let labels = PartLabels::find(&body)?;
    let clip = Clip::load(Path::new(motion), &MotionOptions::default())?;
    let mut frames = clip.poses(Some(&body))?;
    frames.truncate(FRAMES);
    let folder = tempfile::tempdir()?;
    let resolutions: Vec<usize> = resolutions.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let resolutions = if resolutions.is_empty() { vec![256] } else { resolutions };
    println!("{:>10} {:>34} {:>10} {:>10}", "resolution", "what", "seconds", "vertices");
    for resolution in resolutions {
        let show = |what: &str, began: Instant, count: usize, vertices: usize| {
            let seconds = began.elapsed().as_secs_f64() / count as f64;
            println!("{resolution:>10} {what:>34} {seconds:>10.4} {vertices:>10}");
        };
        let began = Instant::now();
        let canonical =
            avatar.extract_canonical(&avatar.subject.skeleton.canonical_pose(&avatar.subject.betas), resolution)?;
        show("canonical", began, 1, canonical.mesh.vertices.len());

        let began = Instant::now();
        let animator = Animator::new(&avatar, &body, &labels)?;
        show("made ready for poses", began, 1, 0);
        let began = Instant::now();
        let mut vertices = 0;
        for frame in &frames {
            vertices = animator.extract(frame, resolution)?.mesh.vertices.len();
        }
        show("posed, without hidden surfaces", began, frames.len(), vertices);

        let began = Instant::now();
        let fixed = FixedTopology::new(&avatar, &body, resolution)?;
        show("fixed topology, made ready", began, 1, fixed.canonical().vertices.len());
        let began = Instant::now();
        for frame in &frames {
            vertices = fixed.pose(frame)?.vertices.len();
        }
        show("fixed topology, skinned", began, frames.len(), vertices);
        let mesh = fixed.pose(&frames[0])?;
        let began = Instant::now();
        (0..FRAMES).try_for_each(|frame| write_ply(folder.path().join(format!("{frame}.ply")), &mesh))?;
        show("written as PLY", began, FRAMES, vertices);
        let began = Instant::now();
        (0..FRAMES).try_for_each(|frame| write_obj(folder.path().join(format!("{frame}.obj")), &mesh))?;
        show("written as OBJ", began, FRAMES, vertices);
    }
    Ok(())
}

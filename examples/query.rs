//! Asks an avatar's fields about single points: inside or outside, normal, colour, and whose bone's motion they follow.
//!
//!     cargo run --release --example train -- runs/example
//!     cargo run --release --example query -- runs/example

use std::path::PathBuf;

use xavatar::avatar::Avatar;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let avatar = Avatar::load(&PathBuf::from(std::env::args().nth(1).ok_or("give an avatar")?))?;
    let skeleton = &avatar.subject.skeleton;
    let canonical = skeleton.canonical_pose(&avatar.subject.betas);

    // Canonical space is the body in its canonical pose, metres; its joints are in the avatar.
    let joints: Vec<usize> =
        ["pelvis", "head", "left_knee", "right_wrist"].iter().filter_map(|name| skeleton.joint(name)).collect();
    let points: Vec<_> = joints.iter().map(|joint| avatar.subject.joints[*joint]).collect();

    println!("{:?}", avatar.fields.geometry.representation);
    for (joint, sample) in joints.iter().zip(avatar.query(&points, &canonical)?) {
        let (bone, weight) = sample
            .weights
            .iter()
            .copied()
            .enumerate()
            .fold((0, 0.0), |best, (bone, weight)| if weight > best.1 { (bone, weight) } else { best });
        println!(
            "at the {:<12} value {:6.3}  normal {:5.2}  colour {:?}  follows the {} by {:.0} %",
            skeleton.joints[*joint],
            sample.value,
            sample.normal,
            sample.colour,
            skeleton.joints[bone],
            100.0 * weight
        );
    }
    Ok(())
}

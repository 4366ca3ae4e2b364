//! The BVH format: a tree of joints with offsets and channels, then a row of channel values a frame.
//!
//! Read token by token; nesting is a loop, bounded by [`MAX_DEPTH`]. A file may have several roots, such as a prop beside a person,
//! and names on its end sites.

use glam::DVec3;
use xavatar_formats::excerpt;

use super::rows;
use super::skeleton::{Bvh, Channel, Joint};
use super::text::{Parsed, Words};

/// Joints inside joints; people have about 10.
const MAX_DEPTH: usize = 200;
/// Joints of one file.
const MAX_JOINTS: usize = 2000;

/// Parses the text of a file.
pub(super) fn parse(text: &str) -> Parsed<Bvh> {
    let mut words = Words::new(text);
    words.keyword("HIERARCHY")?;
    let (joints, width) = hierarchy(&mut words)?;
    words.label("Frames")?;
    let frames: usize = words.number("a count of frames")?;
    words.label("Frame")?;
    words.label("Time")?;
    let frame_time: f64 = words.number("seconds")?;
    if !(frame_time.is_finite() && frame_time >= 0.0) {
        return Err(words.fault(frame_time, "a positive time between frames"));
    }
    if frames == 0 || width == 0 {
        return Err(words.fault(format_args!("{frames} frames of {width} channels"), "at least one of each"));
    }
    let (rest, line) = words.rest();
    let (values, miscounted) = rows::read(rest, line, frames, width)?;
    let frame_time = (frame_time > 0.0).then_some(frame_time);
    Ok(Bvh { joints, frame_time, values, width, oddities: miscounted.into_iter().collect() })
}

/// The joints, parents before children, and how many channels they have together; up to and with the word `MOTION`.
fn hierarchy(words: &mut Words) -> Parsed<(Vec<Joint>, usize)> {
    const EXPECTED: &str = "ROOT, JOINT, End Site, OFFSET, CHANNELS, } or MOTION";
    let mut joints: Vec<Joint> = Vec::new();
    let mut width = 0;
    // The joints whose braces are open; `None` for an end site.
    let mut open: Vec<Option<usize>> = Vec::new();
    loop {
        let word = words.expect(EXPECTED)?;
        match (word.to_ascii_uppercase().as_str(), open.last().copied()) {
            ("MOTION", None) if !joints.is_empty() => return Ok((joints, width)),
            ("ROOT", None) => open.push(Some(add_joint(words, &mut joints, None)?)),
            ("JOINT", Some(Some(parent))) => open.push(Some(add_joint(words, &mut joints, Some(parent))?)),
            (end @ ("END" | "ENDSITE"), Some(Some(_))) => {
                if end == "END" {
                    words.keyword("Site")?;
                }
                // Some tools name them.
                words.rest_of_line();
                words.keyword("{")?;
                open.push(None);
            }
            ("OFFSET", Some(joint)) => {
                let mut offset = DVec3::ZERO;
                for axis in 0..3 {
                    offset[axis] = words.finite()?;
                }
                // Where the last bone ends is not needed: no joint turns there.
                if let Some(joint) = joint {
                    joints[joint].offset = offset;
                }
            }
            ("CHANNELS", Some(Some(joint))) => {
                if !joints[joint].channels.is_empty() {
                    return Err(words.fault("CHANNELS a second time", "them once a joint"));
                }
                joints[joint].first_channel = width;
                joints[joint].channels = channels(words)?;
                width += joints[joint].channels.len();
            }
            ("}", Some(_)) => drop(open.pop()),
            _ => return Err(words.fault(excerpt(word), EXPECTED)),
        }
        if open.len() > MAX_DEPTH {
            return Err(words.fault(format_args!("more than {MAX_DEPTH} joints inside each other"), "a skeleton"));
        }
    }
}

fn add_joint(words: &mut Words, joints: &mut Vec<Joint>, parent: Option<usize>) -> Parsed<usize> {
    if joints.len() == MAX_JOINTS {
        return Err(words.fault(format_args!("more than {MAX_JOINTS} joints"), "a skeleton"));
    }
    let name = words.rest_of_line().trim_end_matches('{').trim().to_owned();
    if name.is_empty() {
        return Err(words.fault("a joint without a name", "a name"));
    }
    words.keyword("{")?;
    joints.push(Joint { name, parent, offset: DVec3::ZERO, channels: Vec::new(), first_channel: 0 });
    Ok(joints.len() - 1)
}

fn channels(words: &mut Words) -> Parsed<Vec<Channel>> {
    let count: usize = words.number("a count of channels")?;
    if count > 6 {
        return Err(words.fault(format_args!("{count} channels"), "at most 6"));
    }
    let mut channels = Vec::with_capacity(count);
    for _ in 0..count {
        let word = words.expect("a channel")?;
        let channel = match word.to_ascii_lowercase().as_str() {
            "xposition" => Channel::Position(0),
            "yposition" => Channel::Position(1),
            "zposition" => Channel::Position(2),
            "xrotation" => Channel::Rotation(0),
            "yrotation" => Channel::Rotation(1),
            "zrotation" => Channel::Rotation(2),
            _ => return Err(words.fault(excerpt(word), "Xposition to Zposition or Xrotation to Zrotation")),
        };
        channels.push(channel);
    }
    Ok(channels)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use xavatar_formats::Fault;

    use super::*;

    const TEXT: &str = "HIERARCHY\nROOT Hips\n{\n  OFFSET 0 1 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n  \
        JOINT Left Leg {\n    OFFSET 0.5 -1 0\n    CHANNELS 3 Zrotation Xrotation Yrotation\n    End Site\n    {\n OFFSET 0 -1 0 }\n  }\n}\n\
        MOTION\nFrames: 2\nFrame Time: 0.04\n1 2 3 90 0 0 0 30 0\n4 5 6 0 0 90 10 20 30\n";

    #[test]
    fn joints_and_frames_are_read() {
        let bvh = parse(TEXT).unwrap();
        assert_eq!(bvh.joints.len(), 2);
        assert_eq!((bvh.joints[1].name.as_str(), bvh.joints[1].parent), ("Left Leg", Some(0)));
        assert_eq!((bvh.joints[1].offset, bvh.joints[1].first_channel), (DVec3::new(0.5, -1.0, 0.0), 6));
        assert_eq!((bvh.frame_time, bvh.oddities.len()), (Some(0.04), 0));
        let rows: Vec<&[f64]> = bvh.frames().collect();
        assert_eq!(bvh.position(0, rows[1]), DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(bvh.position(1, rows[1]), DVec3::new(0.5, -1.0, 0.0));
        assert!((bvh.rotation(0, rows[0]) * DVec3::X).distance(DVec3::Y) < 1e-12);
        // Z, then X in the frame that Z turned, then Y.
        let [z, x, y] = [10.0f64, 20.0, 30.0].map(f64::to_radians);
        let expected = DQuat::from_rotation_z(z) * DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y);
        assert!((bvh.rotation(1, rows[1]) - expected).length() < 1e-12);
    }

    // What tools write beside the letter of the format.
    #[test]
    fn other_spellings_are_the_same_file() {
        let expected = parse(TEXT).unwrap();
        for (from, to) in [
            ("HIERARCHY", "# made by a tool\n\n// on Monday\nHierarchy"),
            ("ROOT", "# the person\nroot"),
            ("End Site", "End Site Toe_End # the toes"),
            ("End Site", "EndSite"),
            ("Left Leg {", "Left Leg // not Left Leg#2\n{"),
            ("OFFSET 0.5 -1 0", "OFFSET 0.5 -1 0 # metres"),
            ("4 5 6 0 0 90 10 20 30", "4 5 6 0 0 90 10 20 30 // frame 2"),
            ("Frames: 2", "Frames:2"),
            ("Frames: 2", "FRAMES : 2"),
            ("Frame Time: 0.04", "Frame Time:\t0.04"),
            ("1 2 3 90", "# take 1\n1 2 3 90"),
            ("4 5 6 0 0 90", "4 5 6\n0 0 90"),
            ("\n", "\r\n"),
        ] {
            assert!(TEXT.contains(from));
            assert_eq!(parse(&TEXT.replace(from, to)).unwrap(), expected, "{to:?}");
        }
    }

    #[test]
    fn a_second_root_is_a_tree_of_its_own() {
        let prop = "ROOT Prop\n{\nOFFSET 7 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\nMOTION";
        let text = TEXT.replace("MOTION", prop).replace("30 0\n", "30 0 1 1 1\n").replace("20 30\n", "20 30 1 1 1\n");
        let mut bvh = parse(&text).unwrap();
        assert_eq!(bvh.trees(), [0..2, 2..3]);
        bvh.keep(2..3);
        assert_eq!((bvh.joints.len(), bvh.joints[0].parent), (1, None));
        assert_eq!(bvh.posed(bvh.frames().next().unwrap())[0].position, DVec3::ONE);
    }

    // Of a person whose every point x is at M x, the turn R is M R M.
    #[test]
    fn a_mirror_image_has_every_joint_at_the_mirrored_place() {
        let bvh = parse(TEXT).unwrap();
        for axis in 0..3 {
            let mut mirrored = bvh.clone();
            mirrored.mirror(axis);
            for (row, image) in bvh.frames().zip(mirrored.frames()) {
                for (place, image) in bvh.posed(row).into_iter().zip(mirrored.posed(image)) {
                    let mut expected = place.position + place.turn * DVec3::new(1.0, 2.0, 3.0);
                    expected[axis] = -expected[axis];
                    let mut point = DVec3::new(1.0, 2.0, 3.0);
                    point[axis] = -point[axis];
                    assert!((image.position + image.turn * point).distance(expected) < 1e-12, "axis {axis}");
                }
            }
        }
    }

    #[test]
    fn what_breaks_the_format_is_named_with_its_line() {
        let message = |text: &str| match parse(text).unwrap_err() {
            Fault::Malformed { place, found, expected } => format!("{place}: {found}, expected {expected}"),
            other => format!("{other:?}"),
        };
        for (from, to, words) in [
            ("HIERARCHY", "HIERARCHIES", "line 1: \"HIERARCHIES\""),
            ("ROOT Hips", "ROOT", "line 2: a joint without a name"),
            ("CHANNELS 6", "CHANNELS 60", "line 5: 60 channels"),
            ("CHANNELS 6", "CHANNELS 4294967296000000000000", "line 5"),
            ("Yrotation\n  JOINT", "Wrotation\n  JOINT", "\"Wrotation\""),
            ("OFFSET 0 1 0", "OFFSET 0 inf 0", "line 4: inf"),
            ("Frames: 2", "Frames: 0", "0 frames"),
            ("Frames: 2", "Frames: -2", "\"-2\""),
            ("Frames: 2", "Rows: 2", "line 15: \"Rows:\", expected Frames"),
            ("Time: 0.04", "Time: -1", "positive time"),
            ("Time: 0.04", "Time: nan", "positive time"),
            ("4 5 6", "4 NaN 6", "\"NaN\""),
            ("4 5 6", "4 5 6 7", "line 18: 10 numbers, expected 9"),
            ("1 2 3", "1 2", "line 17: 8 numbers, expected 9"),
            ("MOTION", "}\nMOTION", "line 14: \"}\""),
        ] {
            assert!(TEXT.contains(from));
            let found = message(&TEXT.replacen(from, to, 1));
            assert!(found.contains(words), "{to}: {found}");
        }
    }

    #[test]
    fn rows_are_those_that_are_there() {
        for (from, to, rows, words) in [
            ("Frames: 2", "Frames: 3", 2, "says 3 frames and has 2"),
            ("Frames: 2", "Frames: 1", 2, "says 1 frames and has 2"),
            ("Frames: 2", "Frames: 18446744073709551615", 2, "has 2"),
            ("20 30\n", "20\n", 1, "cut off after 8 of 9 numbers"),
            ("20 30\n", "20 -", 1, "cut off after 8 of 9 numbers"),
        ] {
            let bvh = parse(&TEXT.replacen(from, to, 1)).unwrap();
            assert_eq!(bvh.frames().len(), rows, "{to}");
            assert!(bvh.oddities[0].contains(words), "{:?}", bvh.oddities);
        }
        let bvh = parse(&TEXT.replace("0.04", "0")).unwrap();
        assert_eq!((bvh.frame_time, bvh.oddities.len()), (None, 0));
    }

    // Cut within the hierarchy or the first row there is nothing to read; later the whole rows are.
    #[test]
    fn cut_files_have_their_whole_rows_or_are_refused() {
        let first_row_ends = TEXT.find("4 5 6").unwrap() - 1;
        for length in 0..TEXT.len() {
            let read = parse(&TEXT[..length]).map(|bvh| bvh.frames().len());
            // The last number may have lost digits, which nothing shows.
            match length {
                length if length < first_row_ends => assert!(read.is_err(), "{length}"),
                _ => assert!(read.is_ok_and(|rows| rows >= 1), "{length}"),
            }
        }
    }

    #[test]
    fn endless_nesting_is_refused() {
        let text = format!("HIERARCHY ROOT a {{{}", "JOINT a {\n".repeat(100_000));
        assert!(matches!(parse(&text), Err(Fault::Malformed { found, .. }) if found.contains("inside each other")));
        let text = format!("HIERARCHY ROOT a {{{}", "JOINT a {\n}\n".repeat(100_000));
        assert!(matches!(parse(&text), Err(Fault::Malformed { found, .. }) if found.contains("more than 2000")));
    }
}

//! The BVH format: a tree of joints with offsets and channels, then a row of channel values a frame.
//!
//! Read token by token, so that memory grows only with what the file really holds, whatever counts it claims; nesting is a
//! loop, bounded by [`MAX_DEPTH`]. Offsets and positions are in the file's unit, rotations in degrees.

use glam::{DQuat, DVec3};

use xavatar_formats::{Fault, excerpt};

type Parsed<T> = std::result::Result<T, Fault>;

/// Joints inside joints; people have about 10.
const MAX_DEPTH: usize = 200;
/// Joints of one skeleton.
const MAX_JOINTS: usize = 2000;

/// One degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    /// Along x, y or z.
    Position(usize),
    /// About x, y or z.
    Rotation(usize),
}

/// A joint of the skeleton.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joint {
    pub(super) name: String,
    /// The joint that it hangs on, which comes before it; `None` for the root.
    pub(super) parent: Option<usize>,
    /// From the parent, at rest.
    pub(super) offset: DVec3,
    pub(super) channels: Vec<Channel>,
    /// Where its channels are in a frame's row.
    pub(super) first_channel: usize,
}

/// A whole file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bvh {
    pub(super) joints: Vec<Joint>,
    /// Between frames, seconds.
    pub(super) frame_time: f64,
    /// Values of all channels, a row a frame.
    values: Vec<f64>,
    /// Values of a row.
    width: usize,
}

impl Bvh {
    /// The rows of channel values, one a frame; at least one.
    pub(super) fn frames(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.width)
    }

    /// The rotation of a joint relative to its parent in a frame's row: its channels' turns, in their order.
    pub(super) fn rotation(&self, joint: usize, row: &[f64]) -> DQuat {
        let mut rotation = DQuat::IDENTITY;
        for (channel, value) in self.channels(joint, row) {
            if let Channel::Rotation(axis) = channel {
                rotation *= DQuat::from_axis_angle(DVec3::AXES[axis], value.to_radians());
            }
        }
        rotation
    }

    /// Where a joint is in its parent's frame: its position channels, or its offset where it has none.
    pub(super) fn place(&self, joint: usize, row: &[f64]) -> DVec3 {
        let mut place = self.joints[joint].offset;
        for (channel, value) in self.channels(joint, row) {
            if let Channel::Position(axis) = channel {
                place[axis] = value;
            }
        }
        place
    }

    fn channels<'a>(&'a self, joint: usize, row: &'a [f64]) -> impl Iterator<Item = (Channel, f64)> {
        let joint = &self.joints[joint];
        joint.channels.iter().copied().zip(row[joint.first_channel..].iter().copied())
    }
}

/// Parses the text of a file.
pub(super) fn parse(text: &str) -> Parsed<Bvh> {
    let mut words = Words::new(text);
    words.keyword("HIERARCHY")?;
    let (joints, width) = hierarchy(&mut words)?;
    words.keyword("Frames:")?;
    let frames: usize = words.number("a count of frames")?;
    words.keyword("Frame")?;
    words.keyword("Time:")?;
    let frame_time: f64 = words.number("seconds")?;
    if !(frame_time.is_finite() && frame_time > 0.0) {
        return Err(words.fault(frame_time, "a positive time between frames"));
    }
    if frames == 0 || width == 0 {
        return Err(words.fault(format_args!("{frames} frames of {width} channels"), "at least one of each"));
    }
    // Saturated, it is still more than any file has.
    let expected = frames.saturating_mul(width);
    let mut values = Vec::new();
    while let Some(word) = words.next() {
        let value = word.parse().ok().filter(|value: &f64| value.is_finite());
        values.push(value.ok_or_else(|| words.fault(excerpt(word), "a finite number"))?);
        if values.len() > expected {
            return Err(words.fault("more numbers", format_args!("{frames} frames of {width} channels")));
        }
    }
    if values.len() != expected {
        let found = format!("{} numbers", values.len());
        return Err(Fault::malformed("the end", found, format_args!("{frames} frames of {width} channels")));
    }
    Ok(Bvh { joints, frame_time, values, width })
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
        match (word, open.last().copied()) {
            ("MOTION", None) if !joints.is_empty() => return Ok((joints, width)),
            ("ROOT", None) if joints.is_empty() => open.push(Some(add_joint(words, &mut joints, None)?)),
            ("ROOT", None) => return Err(words.fault("a second ROOT", "one skeleton")),
            ("JOINT", Some(Some(parent))) => open.push(Some(add_joint(words, &mut joints, Some(parent))?)),
            ("End", Some(Some(_))) => {
                words.keyword("Site")?;
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
            (word, _) => return Err(words.fault(excerpt(word), EXPECTED)),
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

/// The words of a text, and the line that the last one is on.
struct Words<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        Self { rest: text.trim_start_matches('\u{feff}'), line: 1 }
    }

    fn next(&mut self) -> Option<&'a str> {
        let start = self.rest.find(|c: char| !c.is_whitespace())?;
        self.line += self.rest[..start].matches('\n').count();
        let word = &self.rest[start..];
        let end = word.find(char::is_whitespace).unwrap_or(word.len());
        // Braces may touch what stands before or after them.
        let end = match word[..end].find(['{', '}']) {
            Some(0) => 1,
            Some(brace) => brace,
            None => end,
        };
        self.rest = &word[end..];
        Some(&word[..end])
    }

    /// What is left of the line, up to an opening brace, which is left.
    fn rest_of_line(&mut self) -> &'a str {
        let end = self.rest.find(['\n', '{']).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest;
        line
    }

    fn expect(&mut self, expected: &str) -> Parsed<&'a str> {
        let end = || Fault::malformed("the end", "nothing", expected);
        self.next().ok_or_else(end)
    }

    fn keyword(&mut self, keyword: &str) -> Parsed<()> {
        let word = self.expect(keyword)?;
        if word.eq_ignore_ascii_case(keyword) { Ok(()) } else { Err(self.fault(excerpt(word), keyword)) }
    }

    fn number<T: std::str::FromStr>(&mut self, expected: &str) -> Parsed<T> {
        let word = self.expect(expected)?;
        word.parse().map_err(|_| self.fault(excerpt(word), expected))
    }

    fn finite(&mut self) -> Parsed<f64> {
        let value: f64 = self.number("a number")?;
        if value.is_finite() { Ok(value) } else { Err(self.fault(value, "a finite number")) }
    }

    fn fault(&self, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Fault {
        Fault::malformed(format_args!("line {}", self.line), found, expected)
    }
}

#[cfg(test)]
mod tests {
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
        let rows: Vec<&[f64]> = bvh.frames().collect();
        assert_eq!(bvh.place(0, rows[1]), DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(bvh.place(1, rows[1]), DVec3::new(0.5, -1.0, 0.0));
        assert!((bvh.rotation(0, rows[0]) * DVec3::X).distance(DVec3::Y) < 1e-12);
        // Z, then X in the frame that Z turned, then Y.
        let [z, x, y] = [10.0f64, 20.0, 30.0].map(f64::to_radians);
        let expected = DQuat::from_rotation_z(z) * DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y);
        assert!((bvh.rotation(1, rows[1]) - expected).length() < 1e-12);
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
            ("Frames: 2", "Frames: 3", "the end: 18 numbers, expected 3 frames of 9 channels"),
            ("Frames: 2", "Frames: 1", "more numbers"),
            ("Frames: 2", "Frames: 0", "0 frames"),
            ("Frames: 2", "Frames: -2", "\"-2\""),
            ("Frames: 2", "Frames: 18446744073709551615", "18 numbers"),
            ("Time: 0.04", "Time: 0", "positive time"),
            ("Time: 0.04", "Time: nan", "positive time"),
            ("4 5 6", "4 NaN 6", "\"NaN\""),
            ("MOTION", "ROOT Other { }\nMOTION", "second ROOT"),
            ("MOTION", "}\nMOTION", "line 14: \"}\""),
        ] {
            assert!(TEXT.contains(from));
            let found = message(&TEXT.replacen(from, to, 1));
            assert!(found.contains(words), "{to}: {found}");
        }
        for length in 0..TEXT.trim_end().len() - 2 {
            assert!(parse(&TEXT[..length]).is_err(), "{length}");
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

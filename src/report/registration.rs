//! The page of a registration: every frame, the worst first, with pictures of the worst and a table of all parts.

use std::io::Write;
use std::path::Path;

use super::page::{Fact, KeyFigure, Picture, ReportPage};
use super::picture::data_uri;
use super::{PICTURE_WIDTH, closeup, overlay};
use crate::Result;
use crate::body::BodyModel;
use crate::data::{Capture, CaptureKind, CapturedSubject, RgbdSubject};
use crate::formats::write_atomically;
use crate::register::job::{FrameReport, RegistrationReport, Verdict};

/// The page in the data's folder.
pub const REGISTRATION_PAGE: &str = "register.html";
/// Frames that are pictured.
const PICTURED: usize = 8;

/// Writes the page of data that a registration left in `folder`, in the place of an earlier one.
///
/// # Errors
/// Those of reading the data; [`InputError::Io`](crate::InputError::Io) if the page cannot be written.
pub fn write_registration_page(
    folder: &Path,
    report: &RegistrationReport,
    body: &BodyModel,
    command: String,
) -> Result<()> {
    let kind = if RgbdSubject::is_in(folder) { CaptureKind::Rgbd } else { CaptureKind::Scans };
    let sources = match report.registered() {
        0 => Vec::new(),
        _ => CapturedSubject::open(folder, kind)?.both(body)?.into(),
    };
    let mut pictures = Vec::new();
    for frame in report.frames.iter().filter(|frame| frame.verdict == Verdict::Registered).take(PICTURED) {
        let found = sources.iter().find_map(|source| Some((source, source.place(&frame.frame)?)));
        let Some((source, place)) = found else { continue };
        let capture = source.read(place)?;
        let mesh = body.mesh(body.pose(&body.resolve(capture.parameters())?)?.vertices);
        let picture = match &capture {
            Capture::Scan(frame) => closeup(&frame.scan, &mesh)?,
            Capture::Rgbd(capture) => overlay(capture, &mesh)?,
        };
        let picture = data_uri(&picture, PICTURE_WIDTH)?;
        let caption = caption(frame);
        pictures.push(Picture {
            name: frame.frame.clone(),
            alternative: format!("{}: {caption}", frame.frame),
            caption,
            picture,
        });
    }
    let left_out = report.frames.iter().filter(|frame| frame.verdict == Verdict::LeftOut);
    let left_out = left_out.map(|frame| Fact::new(format!("Left out: {}", frame.frame), frame.reason.clone()));
    let all = report.frames.iter().filter(|frame| frame.verdict == Verdict::Registered);
    let all = all.map(|frame| Fact::new(frame.frame.clone(), caption(frame)));
    let page = ReportPage {
        title: folder.display().to_string(),
        kicker: match kind {
            CaptureKind::Scans => "Scans, registered",
            CaptureKind::Rgbd => "Pictures, registered",
        },
        lead: "The body, without its clothing, in every frame; the worst frames first. Errors include the clothes."
            .into(),
        figures: vec![
            KeyFigure {
                label: "Frames registered",
                value: format!("{} / {}", report.registered(), report.frames.len()),
                unit: "",
            },
            KeyFigure { label: "Clothing, mean", value: format!("{:.1}", report.clothing_mm), unit: "mm" },
        ],
        frames_heading: "Worst first",
        frames: pictures,
        command,
        facts: left_out.chain(all).collect(),
        ..ReportPage::default()
    };
    let html = page.html()?;
    Ok(write_atomically(&folder.join(REGISTRATION_PAGE), |file| file.write_all(html.as_bytes()))?)
}

/// How far each part is from the scan.
fn caption(frame: &FrameReport) -> String {
    let parts = frame.quality.iter().flat_map(|quality| &quality.parts);
    let parts = parts.map(|(name, part)| format!("{} {:.1} mm", name.replace('_', " "), part.median_mm));
    let hands = |hands: &'static str| move |hand: &String| format!("{} {hands}", hand.replace('_', " "));
    let missing = frame.missing_hands.iter().map(hands("not in the scan"));
    let turned = frame.turned_hands.iter().map(hands("away from its landmarks"));
    parts.chain(missing).chain(turned).collect::<Vec<_>>().join(", ")
}

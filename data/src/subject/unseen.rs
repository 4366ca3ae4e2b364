//! What scans do not show of a person, by the report of their registration: hands that a scan lacks were guessed, and those that lie
//! away from their landmarks were fitted wrongly. Neither teaches anything.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use xavatar_formats::{Error, Result, read_bytes};

/// The report, in a subject's folder.
const FILE: &str = "register.json";

/// The names of parts by frame (`train/Take1/f00001`).
pub(super) type UnseenParts = BTreeMap<String, Vec<String>>;

#[derive(Deserialize)]
struct Report {
    frames: Vec<FrameReport>,
}

#[derive(Deserialize)]
struct FrameReport {
    frame: String,
    #[serde(default)]
    missing_hands: Vec<String>,
    #[serde(default)]
    turned_hands: Vec<String>,
}

/// Reads the report of a subject's registration, if there is one.
///
/// # Errors
/// [`Error::Malformed`] for a file that is none; [`Error::Io`].
pub(super) fn read(folder: &Path) -> Result<UnseenParts> {
    let path = folder.join(FILE);
    if !path.is_file() {
        return Ok(UnseenParts::new());
    }
    let report: Report = serde_json::from_slice(&read_bytes(&path)?).map_err(|error| Error::Malformed {
        path: path.clone(),
        format: "report of a registration",
        place: "the text".into(),
        found: error.to_string(),
        expected: "what registration writes; remove the file to take all frames as they are".into(),
    })?;
    let unseen =
        report.frames.into_iter().map(|frame| (frame.frame, [frame.missing_hands, frame.turned_hands].concat()));
    Ok(unseen.filter(|(_, hands)| !hands.is_empty()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_that_a_registration_flags_are_unseen_and_a_broken_report_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(read(folder.path()).unwrap().is_empty());
        let report = r#"{"betas": [0.5], "frames": [
            {"frame": "train/A/f00001", "verdict": "registered", "missing_hands": ["left_hand"]},
            {"frame": "train/A/f00002", "missing_hands": []},
            {"frame": "train/A/f00003", "missing_hands": [], "turned_hands": ["right_hand"]}]}"#;
        std::fs::write(folder.path().join(FILE), report).unwrap();
        let expected = [("train/A/f00001", "left_hand"), ("train/A/f00003", "right_hand")];
        let expected = expected.map(|(frame, hand)| (frame.to_owned(), vec![hand.to_owned()])).into();
        assert_eq!(read(folder.path()).unwrap(), expected);
        std::fs::write(folder.path().join(FILE), "{").unwrap();
        assert!(read(folder.path()).unwrap_err().to_string().contains(FILE));
    }
}

//! Which scan and which registration belong together: those whose files share a name, or a number.
//!
//! `mesh-f00001.obj` and `mesh-f00001_smplx.pkl`, `0001/0001.obj` and `0001/smplx_param.pkl`, `scan_07.ply` and `fit_07.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Endings that tell a registration from its scan.
const ENDINGS: [&str; 13] = [
    "_smplx_param",
    "_smplx_params",
    "_smplx",
    "_smplh",
    "_smpl",
    "_smpld",
    "_param",
    "_params",
    "_fit",
    "_fitted",
    "_registration",
    "-smplx",
    "-fit",
];
/// Names that say nothing of the frame, which is then the folder's.
const ANYTHING: [&str; 10] =
    ["smplx", "smpl", "param", "params", "fit", "scan", "mesh", "model", "smplx_param", "registration"];

/// A frame's files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Paired {
    /// What the files share.
    pub name: String,
    pub scan: Option<PathBuf>,
    pub fit: Option<PathBuf>,
}

/// The frames of scans and registrations, in the order of their names. Of several scans of one name the first counts.
pub(super) fn paired(scans: &[PathBuf], fits: &[PathBuf]) -> Vec<Paired> {
    let mut frames: BTreeMap<String, Paired> = BTreeMap::new();
    let frame = |frames: &mut BTreeMap<String, Paired>, name: String| -> Paired {
        frames.remove(&name).unwrap_or(Paired { name, ..Paired::default() })
    };
    for scan in scans {
        let found = frame(&mut frames, shared_name(scan));
        let found = Paired { scan: found.scan.or(Some(scan.clone())), ..found };
        frames.insert(found.name.clone(), found);
    }
    for fit in fits {
        let found = frame(&mut frames, shared_name(fit));
        let found = Paired { fit: found.fit.or(Some(fit.clone())), ..found };
        frames.insert(found.name.clone(), found);
    }
    let frames: Vec<Paired> = frames.into_values().collect();
    if frames.iter().any(|frame| frame.scan.is_some() && frame.fit.is_some()) {
        return frames;
    }
    by_number(&frames).unwrap_or(frames)
}

/// What a scan and its registration are both called.
pub(super) fn shared_name(path: &Path) -> String {
    let text =
        |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = text(path.file_stem());
    let mut name = stem.as_str();
    // Endings are ASCII, so lower case keeps every byte's place.
    while let Some(ending) = ENDINGS.iter().find(|ending| name.to_ascii_lowercase().ends_with(*ending)) {
        name = &name[..name.len() - ending.len()];
    }
    if name.is_empty() || ANYTHING.contains(&name.to_ascii_lowercase().as_str()) {
        return text(path.parent().and_then(Path::file_name));
    }
    name.to_owned()
}

/// Whether a mesh is a registration's own, and not a scan: `..._smplx.ply`.
pub(super) fn is_registered_mesh(path: &Path) -> bool {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    ENDINGS.iter().any(|ending| stem.ends_with(ending)) || matches!(stem.as_str(), "smplx" | "smpl" | "smplx_mesh")
}

/// The last number in a name.
pub(super) fn last_number(name: &str) -> Option<u32> {
    name.rsplit(|character: char| !character.is_ascii_digit()).find(|digits| !digits.is_empty())?.parse().ok()
}

/// Frames paired by the last numbers in their names, if every scan and every registration has one of its own.
fn by_number(frames: &[Paired]) -> Option<Vec<Paired>> {
    let numbered = |has: fn(&Paired) -> bool| -> Option<BTreeMap<u32, &Paired>> {
        let of_kind: Vec<&Paired> = frames.iter().filter(|frame| has(frame)).collect();
        let numbers: BTreeMap<u32, &Paired> =
            of_kind.iter().map(|frame| Some((last_number(&frame.name)?, *frame))).collect::<Option<_>>()?;
        (numbers.len() == of_kind.len()).then_some(numbers)
    };
    let (scans, fits) = (numbered(|frame| frame.scan.is_some())?, numbered(|frame| frame.fit.is_some())?);
    let numbers: BTreeSet<u32> = scans.keys().chain(fits.keys()).copied().collect();
    let frame = |number: u32| Paired {
        name: scans.get(&number).or(fits.get(&number)).map(|frame| frame.name.clone()).unwrap_or_default(),
        scan: scans.get(&number).and_then(|frame| frame.scan.clone()),
        fit: fits.get(&number).and_then(|frame| frame.fit.clone()),
    };
    let paired: Vec<Paired> = numbers.into_iter().map(frame).collect();
    paired.iter().any(|frame| frame.scan.is_some() && frame.fit.is_some()).then_some(paired)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(scans: &[&str], fits: &[&str]) -> Vec<(Option<String>, Option<String>)> {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let text = |path: Option<PathBuf>| path.map(|path| path.display().to_string());
        let frames = paired(&paths(scans), &paths(fits));
        frames.into_iter().map(|frame| (text(frame.scan), text(frame.fit))).collect()
    }

    fn both(scan: &str, fit: &str) -> (Option<String>, Option<String>) {
        (Some(scan.into()), Some(fit.into()))
    }

    #[test]
    fn files_are_paired_by_what_their_names_share() {
        assert_eq!(
            names(&["m/mesh-f00002.obj", "m/mesh-f00001.obj"], &["s/mesh-f00001_smplx.pkl", "s/mesh-f00002_smplx.pkl"]),
            [
                both("m/mesh-f00001.obj", "s/mesh-f00001_smplx.pkl"),
                both("m/mesh-f00002.obj", "s/mesh-f00002_smplx.pkl")
            ]
        );
        assert_eq!(
            names(&["0001/0001.obj"], &["x/0001/smplx_param.pkl"]),
            [both("0001/0001.obj", "x/0001/smplx_param.pkl")]
        );
        assert_eq!(names(&["a/Anna.ply"], &["a/Anna_SMPLX.npz"]), [both("a/Anna.ply", "a/Anna_SMPLX.npz")]);
    }

    #[test]
    fn files_of_other_names_are_paired_by_number() {
        assert_eq!(
            names(&["scan_07.ply", "scan_08.ply"], &["take7_fit008.json", "take7_fit007.json"]),
            [both("scan_07.ply", "take7_fit007.json"), both("scan_08.ply", "take7_fit008.json")]
        );
        // A number twice pairs nothing.
        assert_eq!(names(&["a1.ply", "b1.ply"], &["c1.npz"]).len(), 3);
    }

    #[test]
    fn a_file_alone_is_a_frame_that_lacks_the_other() {
        assert_eq!(names(&["a1.ply"], &["a1_fit.npz", "a2_fit.npz"])[1], (None, Some("a2_fit.npz".into())));
        assert!(
            is_registered_mesh(Path::new("mesh-f00101_smpl.obj")) && !is_registered_mesh(Path::new("mesh-f00101.obj"))
        );
        assert_eq!((last_number("take7_f012"), last_number("anna")), (Some(12), None));
    }
}

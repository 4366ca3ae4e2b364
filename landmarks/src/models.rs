//! Where the networks come from: a package that the user has. None is part of this program, and none is downloaded.
//!
//! | package | holds |
//! |---|---|
//! | MediaPipe's wheel of PyPI, 0.10.0 to 0.10.14 | body, hand and face |
//! | `@mediapipe/pose` of npm | the body, also the larger network |
//!
//! Both are Apache-2.0. A package may also be unpacked, in a folder.

use std::path::Path;

use xavatar_formats::{Error, FileTree, Result};

use crate::network::Network;

/// Folders of packages that networks are in.
const FOLDERS: [&str; 6] = [
    "",
    "mediapipe/modules/pose_landmark/",
    "mediapipe/modules/hand_landmark/",
    "modules/pose_landmark/",
    "modules/hand_landmark/",
    "package/",
];

/// The networks.
pub struct Models {
    /// Points of the body, and whether there is a person.
    pub body: Network,
    /// Points of a hand, whether there is one, and whether it is a right one.
    pub hand: Network,
}

impl Models {
    /// Reads them from a wheel or another zip, a tarball of npm, or a folder.
    ///
    /// # Errors
    /// [`Error::Missing`] if networks are not in it; [`Error::Malformed`] for one that is damaged, or of another kind.
    pub fn open(path: &Path) -> Result<Self> {
        let mut package = FileTree::open(path)?;
        Ok(Self {
            body: network(
                &mut package,
                &["pose_landmark_heavy.tflite", "pose_landmark_full.tflite"],
                &[0, 1],
                &[[1, 1, 195], [1, 1, 1]],
            )?,
            hand: network(
                &mut package,
                &["hand_landmark_full.tflite", "hand_landmark_lite.tflite"],
                &[0, 1, 2],
                &[[1, 1, 63], [1, 1, 1], [1, 1, 1]],
            )?,
        })
    }
}

/// The first of some files that a package has, with the outputs that are wanted of it.
fn network(package: &mut FileTree, names: &[&str], wanted: &[usize], shapes: &[[usize; 3]]) -> Result<Network> {
    let places = names.iter().flat_map(|name| FOLDERS.iter().map(move |folder| format!("{folder}{name}")));
    let Some(place) = places.into_iter().find(|place| package.has(place)) else {
        return Err(Error::Missing {
            path: package.path().into(),
            what: names.join(" or "),
            remedy: "give MediaPipe's wheel of version 0.10.14, whose later ones hold no networks: \
                pip download mediapipe==0.10.14 --no-deps --python-version 3.11 --only-binary :all:"
                .into(),
        });
    };
    let bytes = package.bytes(&place)?;
    let file = package.path().join(&place);
    let network = Network::parse(&bytes, wanted).map_err(|fault| fault.in_file(&file, "network"))?;
    if network.output_shapes() != shapes {
        return Err(Error::Mismatch {
            path: file,
            found: format!("outputs of {:?}", network.output_shapes()),
            expected: format!("{shapes:?}"),
            remedy: "give the package as it was downloaded".into(),
        });
    }
    Ok(network)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OTHER: &[u8] = include_bytes!("../tests/fixtures/small.tflite");

    #[test]
    fn a_package_without_networks_is_told_which_version_has_them() {
        let folder = tempfile::tempdir().unwrap();
        let message = Models::open(folder.path()).err().unwrap().to_string();
        assert!(message.contains("pose_landmark_full.tflite") && message.contains("mediapipe==0.10.14"), "{message}");
    }

    #[test]
    fn another_network_or_none_under_the_name_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("pose_landmark_full.tflite");
        std::fs::write(&file, OTHER).unwrap();
        let error = Models::open(folder.path()).err().unwrap();
        assert!(matches!(&error, Error::Mismatch { found, .. } if found.contains("[1, 1, 48]")), "{error}");
        std::fs::write(&file, b"version https://git-lfs.github.com/spec/v1").unwrap();
        let error = Models::open(folder.path()).err().unwrap();
        assert!(matches!(error, Error::Malformed { format: "network", .. }), "{error}");
    }
}

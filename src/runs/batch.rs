//! Runs in one folder that end in one table.

use std::io::Write;
use std::path::{Path, PathBuf};

use xavatar_formats::{create_folder, remove_partial, write_atomically};

use super::run::Run;
use super::table::{RowKey, RunTable};
use crate::config::Config;
use crate::{Error, InputError, Result};

/// A folder of runs and their table.
pub struct Batch {
    folder: PathBuf,
    /// What its files are called.
    name: &'static str,
}

impl Batch {
    /// The batch of this name in a folder that is new, empty, or holds these runs (each in a folder of its own, with its settings), the
    /// table and `others`.
    ///
    /// # Errors
    /// If the folder holds anything else, or a run of other settings.
    pub fn open(folder: &Path, name: &'static str, runs: &[(String, &Config)], others: &[&str]) -> Result<Self> {
        let batch = Self { folder: folder.into(), name };
        create_folder(folder)?;
        remove_partial(folder)?;
        for entry in std::fs::read_dir(folder).map_err(InputError::io(folder))? {
            let found = entry.map_err(InputError::io(folder))?.file_name().to_string_lossy().into_owned();
            let own = [batch.json(), batch.markdown()];
            let is_own = own.iter().any(|own| own.file_name().is_some_and(|own| *own == *found))
                || others.contains(&found.as_str())
                || runs.iter().any(|(run, _)| *run == found);
            if !is_own {
                return Err(Error::from(InputError::Mismatch {
                    path: folder.into(),
                    found: format!("a folder that is not empty, and not of {name}: it has `{found}`"),
                    expected: "a new or empty one, or that of the same call before".into(),
                    remedy: "name another folder".into(),
                }));
            }
        }
        for (run, config) in runs {
            let folder = batch.folder_of(run);
            if Run::is_begun(&folder)? {
                Run::require_settings(&folder, config)?;
            }
        }
        Ok(batch)
    }

    /// The folder of a run.
    pub fn folder_of(&self, run: &str) -> PathBuf {
        self.folder.join(run)
    }

    /// Where the table is written for scripts.
    pub fn json(&self) -> PathBuf {
        self.folder.join(format!("{}.json", self.name))
    }

    /// Where it is written for documents.
    pub fn markdown(&self) -> PathBuf {
        self.folder.join(format!("{}.md", self.name))
    }

    /// Writes the table.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write<K: RowKey>(&self, table: &RunTable<K>) -> Result<()> {
        let json = self.json();
        let text = serde_json::to_string_pretty(table).map_err(|error| InputError::io(&json)(error.into()))?;
        write_atomically(&json, |file| writeln!(file, "{text}"))?;
        Ok(write_atomically(&self.markdown(), |file| file.write_all(table.markdown().as_bytes()))?)
    }
}

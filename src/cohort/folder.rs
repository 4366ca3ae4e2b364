//! A subject's folder, and what its marks say.
//!
//! | file | |
//! |---|---|
//! | `inputs.json` | digests of what it was begun with |
//! | `registered/` | data that were made of bare scans |
//! | `run/` | the training (see [`runs`](crate::runs)), with `avatar.safetensors` and `report.html` |
//! | `avatar.glb`, `picture.png` | what was exported, and how it looks |
//! | `journal.jsonl` | each stage that was begun, ended, stopped or failed, when and where |
//! | `failed.json` | why the last call failed; gone once one does not |
//! | `done.json` | the mark of complete work, written last |
//! | `before-DIGEST/` | all of this, of other inputs or settings |

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::digest::{Inputs, digest_of};
use super::plan::{Stage, SubjectPlan};
use crate::runs::RunMetrics;
use crate::{InputError, Result};
use xavatar_formats::{FolderLock, create_folder, read_bytes, write_atomically};

const INPUTS: &str = "inputs.json";
const DONE: &str = "done.json";
const FAILED: &str = "failed.json";
const JOURNAL: &str = "journal.jsonl";
const REGISTERED: &str = "registered";
const RUN: &str = "run";
const GLB: &str = "avatar.glb";
const PICTURE: &str = "picture.png";

/// How far a subject is.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum State {
    /// Nothing was begun.
    Waiting,
    /// A process works on it.
    Running {
        /// Which, on which machine.
        holder: String,
    },
    /// Begun, by a process that has stopped or was killed.
    Stopped,
    /// The last call failed; the next one tries again.
    Failed {
        /// Why.
        reason: String,
    },
    /// All that is asked is done.
    Done(Mark),
}

/// What is known of complete work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// The settings of its results, as a digest.
    settings: String,
    /// The avatar's training steps; none where training was not asked for.
    pub steps: Option<u64>,
    /// Wall time of each stage over all calls, seconds.
    pub seconds: BTreeMap<Stage, f64>,
    /// How good it is, where that was asked for.
    pub metrics: Option<RunMetrics>,
}

#[derive(Serialize, Deserialize)]
struct Failure {
    reason: String,
}

/// A line of the journal.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    /// Seconds since 1970.
    time: f64,
    stage: Stage,
    /// `ended`, `stopped` or `failed`.
    event: String,
    seconds: f64,
    process: u32,
}

/// The folder of a subject.
#[derive(Clone, Debug)]
pub struct SubjectFolder {
    path: PathBuf,
}

impl SubjectFolder {
    /// The folder of a subject, which need not be there, in that of all.
    pub fn new(out: &Path, plan: &SubjectPlan) -> Self {
        Self { path: out.join(&plan.name) }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where its training is.
    pub fn run(&self) -> PathBuf {
        self.path.join(RUN)
    }

    /// Where data that are made of bare scans go.
    pub fn registered(&self) -> PathBuf {
        self.path.join(REGISTERED)
    }

    /// Where the avatar is exported.
    pub fn glb(&self) -> PathBuf {
        self.path.join(GLB)
    }

    /// Where its picture is.
    pub fn picture(&self) -> PathBuf {
        self.path.join(PICTURE)
    }

    /// How far the subject is. Inputs are not looked at: only a call that works on it finds them changed.
    ///
    /// # Errors
    /// [`InputError::Io`] if the folder cannot be read.
    pub fn state(&self, plan: &SubjectPlan) -> Result<State> {
        if let Some(mark) = self.done(plan)? {
            return Ok(State::Done(mark));
        }
        if let Some(holder) = FolderLock::holder(&self.path)? {
            return Ok(State::Running { holder });
        }
        Ok(match self.read::<Failure>(FAILED) {
            Some(Failure { reason }) => State::Failed { reason },
            None if self.path.join(INPUTS).is_file() => State::Stopped,
            None => State::Waiting,
        })
    }

    /// The mark of complete work, if it is of these settings.
    pub(super) fn done(&self, plan: &SubjectPlan) -> Result<Option<Mark>> {
        let settings = settings_of(plan)?;
        Ok(self.read::<Mark>(DONE).filter(|mark| mark.settings == settings))
    }

    /// What the work was begun with.
    pub(super) fn inputs(&self) -> Option<Inputs> {
        self.read(INPUTS)
    }

    /// Says what the work is begun with. What there is of other inputs is put aside, never removed; where that is, if there was any.
    pub(super) fn begin(&self, inputs: &Inputs) -> Result<Option<PathBuf>> {
        let before = self.inputs().filter(|before| !before.is_same(inputs));
        let aside = before.map(|before| self.path.join(format!("before-{}", before.short())));
        if let Some(aside) = &aside {
            create_folder(aside)?;
            // The inputs last: a call that is killed on the way is done again by the next.
            for name in [DONE, FAILED, JOURNAL, GLB, PICTURE, REGISTERED, RUN, INPUTS] {
                let (from, to) = (self.path.join(name), free_name(aside, name));
                if from.exists() {
                    std::fs::rename(&from, to).map_err(InputError::io(&from))?;
                }
            }
        }
        self.write(INPUTS, inputs)?;
        Ok(aside)
    }

    pub(super) fn note(&self, stage: Stage, event: &str, seconds: f64) -> Result<()> {
        let path = self.path.join(JOURNAL);
        let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64());
        let entry = Entry { time, stage, event: event.into(), seconds, process: std::process::id() };
        let line = serde_json::to_string(&entry).map_err(|error| InputError::io(&path)(error.into()))? + "\n";
        let file = std::fs::OpenOptions::new().append(true).create(true).open(&path);
        Ok(file.and_then(|mut file| file.write_all(line.as_bytes())).map_err(InputError::io(&path))?)
    }

    pub(super) fn fail(&self, reason: String) -> Result<()> {
        self.write(FAILED, &Failure { reason })
    }

    pub(super) fn forget_failure(&self) -> Result<()> {
        self.remove(FAILED)
    }

    /// Of a subject that was done with other settings of its results: the avatar stays, what was made of it is made anew.
    pub(super) fn forget_results(&self) -> Result<()> {
        match self.path.join(DONE).is_file() {
            true => [GLB, DONE].into_iter().try_for_each(|name| self.remove(name)),
            false => Ok(()),
        }
    }

    fn remove(&self, name: &str) -> Result<()> {
        let path = self.path.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(InputError::io(&path)(error).into()),
            _ => Ok(()),
        }
    }

    pub(super) fn finish(&self, plan: &SubjectPlan, steps: Option<u64>, metrics: Option<RunMetrics>) -> Result<()> {
        self.write(DONE, &Mark { settings: settings_of(plan)?, steps, seconds: self.seconds(), metrics })
    }

    /// Wall time of each stage, from the journal; lines that a killed process left in part are skipped.
    fn seconds(&self) -> BTreeMap<Stage, f64> {
        let bytes = read_bytes(&self.path.join(JOURNAL)).unwrap_or_default();
        let entries = bytes.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Entry>(line).ok());
        let mut seconds = BTreeMap::new();
        entries.for_each(|entry| *seconds.entry(entry.stage).or_default() += entry.seconds);
        seconds
    }

    /// None if there is no such file, or it is not whole.
    fn read<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        serde_json::from_slice(&read_bytes(&self.path.join(name)).ok()?).ok()
    }

    fn write(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let path = self.path.join(name);
        let text = serde_json::to_string_pretty(value).map_err(|error| InputError::io(&path)(error.into()))?;
        Ok(write_atomically(&path, |file| writeln!(file, "{text}"))?)
    }
}

fn settings_of(plan: &SubjectPlan) -> Result<String> {
    Ok(digest_of(format!("{}{}", plan.training_settings()?, plan.result_settings()).as_bytes()))
}

/// A name in a folder that nothing has yet: what was put aside twice is kept twice.
fn free_name(folder: &Path, name: &str) -> PathBuf {
    let numbered = (2..).map(|number| folder.join(format!("{name}-{number}")));
    let mut names = std::iter::once(folder.join(name)).chain(numbered);
    names.find(|path| !path.exists()).unwrap_or_else(|| folder.join(name))
}

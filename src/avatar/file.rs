//! One self-contained safetensors file: parameters under `field.parameter`, the configuration and the subject as text.
//!
//! It carries what the user's own training made, the skeleton with its joints' places, parts and canonical pose, and never a body
//! model's blend shapes. Version 2 had no skeleton: its avatars are SMPL-X's, and read as such.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{Avatar, Subject};
use crate::body::smplx;
use crate::config::Config;
use crate::fields::Fields;
use crate::{Error, InputError, Result};
use xavatar_formats::{TensorFile, read_bytes};

/// Version of the file's layout.
const VERSION: u32 = 3;
/// More coefficients of expression than any body model has.
const MOST_EXPRESSIONS: usize = 1000;
/// The version without a skeleton.
const WITHOUT_SKELETON: u32 = 2;

impl Avatar {
    /// The file's name in a run folder.
    pub const FILE: &str = "avatar.safetensors";

    /// Writes the avatar as one file, whole or not at all.
    ///
    /// # Errors
    /// [`InputError::Io`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut file = TensorFile::default();
        self.fields.insert_into(&mut file);
        let subject = serde_json::to_string(&self.subject).map_err(|error| InputError::io(path)(error.into()))?;
        file.text = HashMap::from([
            ("version".into(), VERSION.to_string()),
            ("config".into(), self.config.to_toml()?),
            ("subject".into(), subject),
            ("steps".into(), self.steps.to_string()),
        ]);
        Ok(file.write(path)?)
    }

    /// Reads an avatar file, or the one in a run folder.
    ///
    /// # Errors
    /// If the file is missing, broken, of another version, or its parameters do not fit its configuration.
    pub fn load(path: &Path) -> Result<Self> {
        let path: PathBuf = if path.is_dir() { path.join(Self::FILE) } else { path.into() };
        if !path.exists() {
            return Err(Error::from(InputError::Missing {
                path,
                what: "avatar".into(),
                remedy: "pass an avatar.safetensors or the folder of a finished run".into(),
            }));
        }
        Self::parse(&path, &read_bytes(&path)?)
    }

    /// What the bytes of an avatar file hold; errors name it as `path`.
    ///
    /// # Errors
    /// As [`Avatar::load`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let file = TensorFile::parse(bytes).map_err(|fault| fault.in_file(path, "safetensors file"))?;
        let version: u32 = file.parsed(path, "version")?;
        if ![WITHOUT_SKELETON, VERSION].contains(&version) {
            return Err(Error::from(InputError::Mismatch {
                path: path.into(),
                found: format!("an avatar file of version {version}"),
                expected: format!("version {WITHOUT_SKELETON} or {VERSION}"),
                remedy: "train it again, or use the program that wrote it".into(),
            }));
        }
        let config = Config::written(file.text(path, "config")?)
            .map_err(|error| malformed(path, "config", error.to_string()))?;
        let subject = subject(file.text(path, "subject")?, version, path)?;
        let (skeleton, condition) = (&subject.skeleton, subject.condition());
        let fields = Fields::read(&file, path, &config.fields, skeleton, &condition, subject.bounds)?;
        Ok(Self { fields, config, subject, steps: file.parsed(path, "steps")? })
    }
}

/// The subject of a file of one of the known versions, checked.
fn subject(text: &str, version: u32, path: &Path) -> Result<Subject> {
    let broken = |found: String| malformed(path, "subject", found);
    let mut value: Value = serde_json::from_str(text).map_err(|error| broken(error.to_string()))?;
    if let (WITHOUT_SKELETON, Value::Object(entries)) = (version, &mut value) {
        entries.insert("skeleton".into(), json!(smplx::skeleton()));
        entries.insert("expressions".into(), json!(smplx::EXPRESSIONS));
    }
    let subject: Subject = serde_json::from_value(value).map_err(|error| broken(error.to_string()))?;
    subject.skeleton.check().map_err(|error| broken(error.to_string()))?;
    let (low, high) = subject.bounds;
    let joints = subject.joints.len();
    let has_box = low.is_finite() && high.is_finite() && low.cmplt(high).all();
    if joints != subject.skeleton.joints.len() || !has_box {
        return Err(broken(format!("{joints} joints in {low} to {high}")));
    }
    if subject.expressions > MOST_EXPRESSIONS {
        return Err(broken(format!("{} expressions", subject.expressions)));
    }
    Ok(subject)
}

fn malformed(path: &Path, place: &str, found: String) -> Error {
    Error::from(InputError::Malformed {
        path: path.into(),
        format: "avatar",
        place: format!("metadata `{place}`"),
        found,
        expected: "what this program writes".into(),
    })
}

//! A manifest: which subjects there are, and what is to be done with each (docs/batch.md).
//!
//! TOML, with the settings of all at the top and a `[[subject]]` each, which may say any of them again; or CSV, with a column a setting.
//! Paths are relative to the manifest.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::plan::SubjectPlan;
use super::rows::tables_of_csv;
use crate::{Error, InputError, Result};
use xavatar_formats::read_text;

pub(super) const FORMAT: &str = "manifest";
const EXPECTED: &str = "what docs/batch.md describes";
/// Overrides of the preset: those of a subject are added to those of all.
const SET: &str = "set";

/// The subjects of a study, with where their results go.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifest {
    /// The file.
    pub path: PathBuf,
    /// The folder that holds a folder for each subject, the tables and the index.
    pub out: PathBuf,
    /// The subjects, in the order of the file.
    pub subjects: Vec<SubjectPlan>,
}

impl Manifest {
    /// Reads a manifest, by its extension as `.csv` or else as TOML. The data themselves are not looked at.
    ///
    /// # Errors
    /// [`InputError::Malformed`] naming the line or the subject: unknown or missing keys, two subjects of one name, none at all; those of
    /// [`Config::preset_with`](crate::config::Config::preset_with) for settings.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_text(path)?)
    }

    /// As [`read`](Self::read), of the text of the file at `path`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        let (mut shared, subjects) = match is_csv {
            true => (Table::new(), tables_of_csv(path, text)?),
            false => tables_of_toml(path, text)?,
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let out = match shared.remove("out") {
            None => PathBuf::from(path.file_stem().unwrap_or_default()),
            Some(Value::String(out)) => out.into(),
            Some(other) => return Err(malformed(path, "`out`", &other.to_string(), "a folder")),
        };
        let mut names = BTreeSet::new();
        let mut plans = Vec::with_capacity(subjects.len());
        for (index, own) in subjects.into_iter().enumerate() {
            let named = own.get("name").and_then(Value::as_str).map_or(String::new(), |name| format!(" ({name})"));
            let place = format!("subject {}{named}", index + 1);
            let merged: std::result::Result<SubjectPlan, _> = merged(&shared, own).try_into();
            let plan = merged.map_err(|error| malformed(path, &place, error.message(), EXPECTED))?.under(folder);
            if !is_plain(&plan.name) {
                let expected = "a name of letters, digits, `-`, `_` and `.` that does not begin with a dot";
                return Err(malformed(path, &place, &plan.name, expected));
            }
            plan.check()?;
            // Some file systems know no case.
            if !names.insert(plan.name.to_lowercase()) {
                return Err(malformed(path, &place, "the name of an earlier one", "another name"));
            }
            plans.push(plan);
        }
        if plans.is_empty() {
            return Err(malformed(path, "the list of subjects", "empty", "a [[subject]] with name and data, or more"));
        }
        Ok(Self { path: path.into(), out: folder.join(out), subjects: plans })
    }
}

/// What all subjects share, and each one's own.
fn tables_of_toml(path: &Path, text: &str) -> Result<(Table, Vec<Table>)> {
    let mut shared: Table = text.parse().map_err(|error: toml::de::Error| {
        let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
        malformed(path, &format!("line {line}"), error.message(), "TOML")
    })?;
    let expected = "[[subject]], once for each";
    let own = |value| match value {
        Value::Table(table) => Ok(table),
        other => Err(malformed(path, "`subject`", other.type_str(), expected)),
    };
    let subjects = match shared.remove("subject") {
        None => Vec::new(),
        Some(Value::Array(values)) => values.into_iter().map(own).collect::<Result<_>>()?,
        Some(other) => return Err(malformed(path, "`subject`", other.type_str(), expected)),
    };
    Ok((shared, subjects))
}

/// A subject's own settings over those of all.
fn merged(shared: &Table, own: Table) -> Table {
    let mut merged = shared.clone();
    for (key, value) in own {
        match (merged.get_mut(&key), value) {
            (Some(Value::Table(all)), Value::Table(own)) if key == SET => all.extend(own),
            (_, value) => drop(merged.insert(key, value)),
        }
    }
    merged
}

/// Whether a name is a folder's on every system, and needs no quotes in a shell.
fn is_plain(name: &str) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    !name.is_empty() && !name.starts_with('.') && !name.starts_with('-') && name.bytes().all(is_plain)
}

pub(super) fn malformed(path: &Path, place: &str, found: &str, expected: &str) -> Error {
    Error::from(InputError::Malformed {
        path: path.into(),
        format: FORMAT,
        place: place.into(),
        found: found.trim_end().into(),
        expected: expected.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cohort::Stage;
    use crate::data::{CaptureKind, Split};

    fn read(name: &str, text: &str) -> Result<Manifest> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let mut manifest = Manifest::read(&path)?;
        // So that manifests of different folders can be compared.
        let below = |path: &mut PathBuf| *path = path.strip_prefix(folder.path()).unwrap().into();
        below(&mut manifest.path);
        below(&mut manifest.out);
        for plan in &mut manifest.subjects {
            below(&mut plan.data);
            below(&mut plan.body);
            plan.landmarks.iter_mut().for_each(below);
        }
        Ok(manifest)
    }

    const TOML: &str = "
        body = 'models/smplx'
        preset = 'demo'
        set = { seed = 3, 'schedule.steps' = 100 }
        [[subject]]
        name = 'anna'
        data = 'data/anna'
        [[subject]]
        name = 'ben'
        data = 'data/ben'
        stages = ['train', 'eval']
        split = 'train'
        landmarks = 'ben.json'
        set = { 'schedule.steps' = 200 }
    ";

    #[test]
    fn subjects_have_the_settings_of_all_and_their_own_over_them() {
        let Manifest { out, subjects, .. } = read("study.toml", TOML).unwrap();
        assert_eq!(out, Path::new("study"));
        let [anna, ben] = &subjects[..] else { panic!("{subjects:?}") };
        let steps = |plan: &SubjectPlan| {
            let config = plan.config(CaptureKind::Scans).unwrap();
            (config.seed, config.schedule.steps)
        };
        assert_eq!((steps(anna), steps(ben)), ((3, 100), (3, 200)));
        assert_eq!((anna.stages.as_slice(), anna.split), (&Stage::ALL[..], Split::Test));
        assert_eq!((ben.stages.as_slice(), ben.split), (&[Stage::Train, Stage::Evaluate][..], Split::Train));
        assert_eq!((&*anna.body, ben.landmarks.as_deref()), (Path::new("models/smplx"), Some(Path::new("ben.json"))));
    }

    #[test]
    fn a_table_says_the_same_in_columns() {
        let csv = "name,data,body,preset,seed,schedule.steps,stages,split,landmarks\n\
                   anna,data/anna,models/smplx,demo,3,100,,,\n\
                   \"ben\",data/ben,models/smplx,demo,3,200,train eval,train,ben.json\n";
        assert_eq!(read("study.csv", csv).unwrap().subjects, read("study.toml", TOML).unwrap().subjects);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_subject() {
        let subject = |more: &str| format!("body = 'b'\n[[subject]]\nname = 'anna'\ndata = 'd'\n{more}");
        for (text, word) in [
            ("body = ".to_owned(), "line 1"),
            ("body = 'b'".into(), "list of subjects"),
            ("subject = 3".into(), "[[subject]]"),
            (subject("colour = 'red'"), "subject 1 (anna)"),
            (subject("stages = ['fly']"), "fly"),
            (subject("stages = ['eval']"), "train"),
            (subject("set = { 'schedule.stepz' = 3 }"), "schedule.steps"),
            (subject("preset = 'slow'"), "fast"),
            (subject("accept = ['ugly']"), "ugly"),
            (subject("[[subject]]\nname = 'Anna'\ndata = 'e'"), "earlier"),
            (subject("[[subject]]\nname = '../up'\ndata = 'e'"), "../up"),
            ("[[subject]]\nname = 'anna'\ndata = 'd'".into(), "body"),
        ] {
            let message = read("study.toml", &text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
        let message = read("study.csv", "name,data\nanna\n").unwrap_err().to_string();
        assert!(message.contains("line 2"), "{message}");
    }
}

//! The built-in presets, and what a user changes of one.
//!
//! A preset is a file in `configs/` that says what differs from the preset it `extends`. Sections are merged key by key; any other value,
//! tables within sections and tables that name their `kind` among them, takes the place of the one before.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Config, malformed};
use crate::{Error, InputError, Result};

/// Name and contents; a preset follows the one it extends.
const PRESETS: [(&str, &str); 6] = [
    ("fast", include_str!("../../configs/fast.toml")),
    ("demo", include_str!("../../configs/demo.toml")),
    ("paper-scan", include_str!("../../configs/paper-scan.toml")),
    ("fast-rgbd", include_str!("../../configs/fast-rgbd.toml")),
    ("demo-rgbd", include_str!("../../configs/demo-rgbd.toml")),
    ("paper-rgbd", include_str!("../../configs/paper-rgbd.toml")),
];

/// What a preset for scans is called for RGB-D frames.
const FOR_RGBD: [(&str, &str); 3] = [("fast", "fast-rgbd"), ("demo", "demo-rgbd"), ("paper-scan", "paper-rgbd")];

/// The names of the built-in presets.
pub fn preset_names() -> [&'static str; 6] {
    PRESETS.map(|(name, _)| name)
}

/// The preset of RGB-D frames that corresponds to `name`: itself if it is for those already.
pub fn preset_for_rgbd(name: &str) -> &str {
    FOR_RGBD.iter().find(|(scans, _)| *scans == name).map_or(name, |(_, rgbd)| rgbd)
}

/// The configuration of a preset after `settings`, pairs of a dotted key and a value; ranges are not checked.
pub(super) fn with_settings(name: &str, settings: &[(String, String)]) -> Result<Config> {
    let mut table = complete(name)?;
    let convert = |table: &toml::Table| table.clone().try_into::<Config>();
    for (key, value) in settings {
        set(&mut table, key, value)?;
        // One at a time, so that what is refused is this value.
        convert(&table).map_err(|error| {
            let (name, found) = (key.clone(), format!("`{value}`"));
            InputError::Value { name, found, expected: error.message().trim_end().into() }
        })?;
    }
    convert(&table).map_err(|error| malformed(Path::new(name), &error))
}

/// The preset of this name with all that it extends.
fn complete(name: &str) -> Result<toml::Table> {
    let Some((_, text)) = PRESETS.iter().find(|(preset, _)| *preset == name) else {
        let expected = format!("one of {}", preset_names().join(", "));
        return Err(InputError::Value { name: "preset".into(), found: format!("`{name}`"), expected }.into());
    };
    let mut own: toml::Table = text.parse().map_err(|error| malformed(Path::new(name), &error))?;
    let mut table = match own.remove("extends") {
        Some(toml::Value::String(base)) => complete(&base)?,
        _ => toml::Table::new(),
    };
    for (key, value) in own {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(section)), toml::Value::Table(changes)) if !changes.contains_key("kind") => {
                section.extend(changes);
            }
            (_, value) => drop(table.insert(key, value)),
        }
    }
    table.insert("preset".into(), name.into());
    Ok(table)
}

/// Replaces the value of a dotted key that the preset has, reading `value` as TOML or else as a bare string.
fn set(table: &mut toml::Table, key: &str, value: &str) -> Result<()> {
    let known = keys(table);
    let Some(old) = known.get(key) else {
        let nearest = known.into_keys().min_by_key(|known| strsim::damerau_levenshtein(known, key));
        return Err(Error::UnknownSetting { key: key.into(), nearest: nearest.unwrap_or_default() });
    };
    let parsed = format!("value = {value}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("value"));
    let new = match (parsed.unwrap_or_else(|| value.into()), old) {
        (toml::Value::Integer(integer), toml::Value::Float(_)) => toml::Value::Float(integer as f64),
        (value, _) => value,
    };
    let (sections, last) = key.rsplit_once('.').map_or((None, key), |(sections, last)| (Some(sections), last));
    let innermost = sections
        .into_iter()
        .flat_map(|sections| sections.split('.'))
        .try_fold(table, |table, section| table.get_mut(section).and_then(toml::Value::as_table_mut));
    if let Some(section) = innermost {
        section.insert(last.into(), new);
    }
    Ok(())
}

/// Every value of a table, and of the tables in it, by its dotted key.
fn keys(table: &toml::Table) -> BTreeMap<String, toml::Value> {
    let mut found = BTreeMap::new();
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => {
                found.extend(keys(inner).into_iter().map(|(inner, value)| (format!("{key}.{inner}"), value)));
            }
            _ => drop(found.insert(key.clone(), value.clone())),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::SamplingStrategy;
    use super::*;

    fn fast_with(settings: &[(&str, &str)]) -> Result<Config> {
        let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).into(), (*value).into())).collect();
        Config::preset_with("fast", &settings)
    }

    #[test]
    fn every_preset_is_valid_and_survives_its_own_text() {
        for name in preset_names() {
            let config = Config::preset(name).unwrap();
            assert_eq!(config.preset, name);
            assert_eq!(toml::from_str::<Config>(&config.to_toml().unwrap()).unwrap(), config);
            assert!(Config::preset(preset_for_rgbd(name)).unwrap().rgbd.is_some(), "{name}");
        }
    }

    #[test]
    fn a_preset_changes_what_it_says_of_the_one_it_extends() {
        let (fast, demo) = (Config::preset("fast").unwrap(), Config::preset("demo").unwrap());
        assert_eq!(demo.fields.geometry, fast.fields.geometry);
        assert!(demo.sampling.points < fast.sampling.points);
        assert_eq!(demo.sampling.hand_share, fast.sampling.hand_share);
    }

    #[test]
    fn settings_override_the_preset() {
        let config = fast_with(&[
            ("losses.normal", "0.25"),
            ("losses.bone", "3"),
            ("sampling.strategy", "uniform"),
            ("fields.geometry.width", "32"),
        ])
        .unwrap();
        assert_eq!((config.losses.normal, config.losses.bone), (0.25, 3.0));
        assert_eq!((config.sampling.strategy, config.fields.geometry.width), (SamplingStrategy::Uniform, 32));
    }

    #[test]
    fn unknown_keys_suggest_the_nearest() {
        for (key, nearest) in [("losses.normals", "losses.normal"), ("optimizer.clip", "optimiser.clip")] {
            match fast_with(&[(key, "1")]) {
                Err(Error::UnknownSetting { nearest: found, .. }) => assert_eq!(found, nearest),
                other => panic!("{other:?}"),
            }
        }
        assert!(matches!(fast_with(&[("losses", "1")]), Err(Error::UnknownSetting { .. })));
    }

    #[test]
    fn of_many_settings_the_wrong_one_is_named() {
        let error = fast_with(&[("losses.normal", "1"), ("sampling.points", "many"), ("seed", "3")]).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("sampling.points is `many`") && !message.contains("losses.normal"), "{message}");
    }
}

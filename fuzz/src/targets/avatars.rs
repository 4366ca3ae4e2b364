//! Avatar files, and the texts in them.
//!
//! The avatars are untrained, as small as they come: one with networks alone, one with hash grids and a skinning grid.

use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

use glam::Vec3;
use xavatar::avatar::{Avatar, Subject};
use xavatar::body::Gender;
use xavatar::config::Config;
use xavatar::fields::{Fields, Poser};
use xavatar::formats::TensorFile;
use xavatar::synthetic::BuiltInSubject;

pub(super) fn avatar(bytes: &[u8]) -> bool {
    Avatar::parse(Path::new("avatar.safetensors"), bytes).is_ok()
}

/// Without the name of the checksum, so that what is mutated is read.
pub(super) fn avatar_seeds() -> Vec<Vec<u8>> {
    let unchecked = |mut bytes: Vec<u8>| {
        let place = bytes.windows(5).position(|window| window == b"crc32");
        place.into_iter().for_each(|place| bytes[place] = b'x');
        bytes
    };
    files().iter().map(|file| unchecked(written(file))).collect()
}

/// The texts of an avatar file: version, configuration, subject and steps, between [`BETWEEN`], beside sound tensors.
pub(super) fn avatar_texts(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let texts: Vec<&str> = text.split(BETWEEN).collect();
    let entries = KEYS.iter().zip(&texts).map(|(key, text)| ((*key).to_owned(), (*text).to_owned()));
    let text: HashMap<String, String> = entries.collect();
    files().iter().any(|file| avatar(&written(&TensorFile { text: text.clone(), tensors: file.tensors.clone() })))
}

pub(super) fn avatar_texts_seeds() -> Vec<Vec<u8>> {
    let texts = |file: &TensorFile| KEYS.map(|key| file.text.get(key).cloned().unwrap_or_default()).join(BETWEEN);
    files().iter().map(|file| texts(file).into_bytes()).collect()
}

const KEYS: [&str; 4] = ["version", "config", "subject", "steps"];
const BETWEEN: &str = "\n----\n";

fn written(file: &TensorFile) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail.
    let _ = file.write_to(&mut bytes);
    bytes
}

/// The avatars' files; none if they cannot be made, which is missed where seeds are checked.
fn files() -> &'static [TensorFile] {
    static FILES: OnceLock<Vec<TensorFile>> = OnceLock::new();
    FILES.get_or_init(|| {
        let networks = [
            ("fields.geometry.width", "44"),
            ("fields.geometry.depth", "2"),
            ("fields.geometry.skip", "1"),
            ("fields.geometry.frequencies", "1"),
            ("fields.geometry.embedded", "2"),
            ("fields.texture.width", "20"),
            ("fields.texture.depth", "2"),
            ("fields.texture.skip", "1"),
            ("fields.texture.frequencies", "0"),
            ("fields.skinning.width", "8"),
            ("fields.skinning.depth", "1"),
        ];
        let grids = [
            ("fields.geometry.width", "8"),
            ("fields.geometry.grid.log2_entries", "5"),
            ("fields.geometry.grid.levels", "3"),
            ("fields.texture.width", "8"),
            ("fields.texture.grid.log2_entries", "5"),
            ("fields.texture.grid.levels", "3"),
            ("fields.skinning.spacing", "0.6"),
            ("fields.skinning.fine_spacing", "0.6"),
        ];
        [file("paper-scan", &networks), file("demo", &grids)].into_iter().flatten().collect()
    })
}

fn file(preset: &str, settings: &[(&str, &str)]) -> Option<TensorFile> {
    let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    let config = Config::preset_with(preset, &settings).ok()?;
    let built_in = BuiltInSubject::new().ok()?;
    let (body, betas) = (built_in.model(), built_in.betas());
    let bounds = (Vec3::splat(-1.3), Vec3::splat(1.3));
    let subject = Subject::of(body, Gender::Neutral, betas, bounds, 1).ok()?;
    let poser = Poser::for_training(&config, body, built_in.part_labels(), betas, bounds).ok()?;
    let skinning = poser.initial_skinning(body, |grid| Ok(grid.body_rows(body))).ok()?;
    let mut fields = Fields::new(&config.fields, &subject.condition(), skinning, bounds).ok()?;
    fields.initialise(1);
    let folder = std::env::temp_dir().join(format!("xavatar-fuzz-{}-{preset}.safetensors", std::process::id()));
    Avatar { fields, config, subject, steps: 3 }.save(&folder).ok()?;
    let file = TensorFile::read(&folder).ok();
    let _ = std::fs::remove_file(&folder);
    file
}

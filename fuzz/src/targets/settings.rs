//! Settings as text: manifests of many subjects, the configuration of a run.

use std::path::Path;

use xavatar::cohort::Manifest;
use xavatar::config::Config;

pub(super) fn manifest(bytes: &[u8]) -> bool {
    Manifest::parse(Path::new("study.toml"), &String::from_utf8_lossy(bytes)).is_ok()
}

pub(super) fn manifest_seeds() -> Vec<Vec<u8>> {
    let own = "out = 'runs'\nbody = 'models'\npreset = 'demo'\nset = { seed = 3, 'schedule.steps' = 100 }\n\
        accept = ['no-colours']\nresolution = 64\n[[subject]]\nname = 'anna'\ndata = 'anna'\n[[subject]]\nname = 'ben'\n\
        data = 'ben'\nstages = ['train', 'eval']\nsplit = 'train'\nlandmarks = 'ben.json'\nset = { 'schedule.minutes' = 2.5 }\n";
    vec![own.into(), b"body = 'b'\n[[subject]]\nname = 'a'\ndata = 'd'\n".to_vec()]
}

pub(super) fn manifest_table(bytes: &[u8]) -> bool {
    Manifest::parse(Path::new("study.csv"), &String::from_utf8_lossy(bytes)).is_ok()
}

pub(super) fn manifest_table_seeds() -> Vec<Vec<u8>> {
    let table = "name,data,body,preset,seed,schedule.steps,stages,split,landmarks,resolution\n\
        anna,anna,models,demo,3,100,,,,\n\"ben\",\"b\"\"en\",models,demo,3,200,train eval,train,ben.json,64\n";
    vec![table.into()]
}

pub(super) fn config(bytes: &[u8]) -> bool {
    Config::parse(Path::new("config.toml"), &String::from_utf8_lossy(bytes)).is_ok()
}

pub(super) fn config_seeds() -> Vec<Vec<u8>> {
    let written = |preset| Config::preset(preset).and_then(|config| config.to_toml()).unwrap_or_default().into_bytes();
    ["fast", "fast-rgbd", "paper-scan"].map(written).into()
}

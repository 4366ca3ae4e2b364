//! Runs as a library: begun, stopped, gone on with, measured, and nothing done twice.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use xavatar::config::Config;
use xavatar::runs::{Batch, Ending, Event, Run, RunTable, Turn, Yardstick};
use xavatar::synthetic::{BuiltInSubject, FilmedTake, Split};
use xavatar::train::TrainingSpec;

fn config(seed: u64) -> Config {
    let settings = [
        ("schedule.steps", "6"),
        ("schedule.pretraining_steps", "10"),
        ("sampling.points", "300"),
        ("fields.skinning.spacing", "0.08"),
        ("fields.skinning.fine_spacing", "0.04"),
        ("fields.geometry.grid.log2_entries", "13"),
        ("fields.texture.grid.log2_entries", "13"),
        ("seed", &seed.to_string()),
    ];
    Config::preset_with("demo", &settings.map(|(key, value)| (key.to_owned(), value.to_owned()))).unwrap()
}

struct Made {
    subject: BuiltInSubject,
    frames: FilmedTake,
    unseen: FilmedTake,
}

impl Made {
    fn new() -> Self {
        let subject = BuiltInSubject::new().unwrap();
        let (frames, unseen) = (subject.film(Split::Train, 2).unwrap(), subject.film(Split::Test, 1).unwrap());
        Self { subject, frames, unseen }
    }

    fn spec<'a>(&'a self, config: &'a Config) -> TrainingSpec<'a> {
        let (body, labels) = (self.subject.model(), self.subject.part_labels());
        TrainingSpec { config, source: &self.frames, body, labels }
    }
}

fn unwatched(_: Event<'_>) {}

fn never(event: Event<'_>) {
    panic!("{event:?}")
}

fn all_files(folder: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(all_files(&path)),
            false => files.push((path.clone(), std::fs::read(&path).unwrap())),
        }
    }
    files.sort();
    files
}

#[test]
fn a_run_does_what_is_left_to_do_and_nothing_twice() {
    let (made, folder, go) = (Made::new(), tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let (config, path) = (config(1), folder.path().join("run"));
    let yardstick = Yardstick { scans: &made.unseen, split: Split::Test, resolution: 32 };
    let open = || Run::open(&path, made.spec(&config)).unwrap();

    assert_eq!(open().train(&AtomicBool::new(true), &mut unwatched).unwrap(), Ending::Stopped);
    assert!(
        !open().is_finished() && open().avatar().is_err() && open().measure(&yardstick, &go, &mut unwatched).is_err()
    );
    assert_eq!(open().train(&go, &mut unwatched).unwrap(), Ending::Finished);
    assert_eq!(open().avatar().unwrap().steps, 6);
    assert_eq!(open().measure(&yardstick, &AtomicBool::new(true), &mut unwatched).unwrap(), None);
    let measured = open().measure(&yardstick, &go, &mut unwatched).unwrap().unwrap();
    assert_eq!((measured.steps, measured.frames), (6, 1));

    let before = all_files(&path);
    assert_eq!(open().train(&go, &mut never).unwrap(), Ending::Finished);
    assert_eq!(open().measure(&yardstick, &go, &mut never).unwrap().unwrap(), measured);
    assert!(all_files(&path) == before, "files were written anew");
}

#[test]
fn folders_of_something_else_are_refused() {
    let (made, folder) = (Made::new(), tempfile::tempdir().unwrap());
    let (own, other) = (config(1), config(2));
    let refused = |path: &Path, config: &Config| Run::open(path, made.spec(config)).err().unwrap().to_string();

    let path = folder.path().join("run");
    Run::open(&path, made.spec(&own)).unwrap();
    assert!(refused(&path, &other).contains("other settings"), "{}", refused(&path, &other));
    std::fs::write(folder.path().join("letter.txt"), "dear").unwrap();
    assert!(refused(folder.path(), &own).contains("config.toml"), "{}", refused(folder.path(), &own));

    let batch =
        |config: &Config, others: &[&str]| Batch::open(folder.path(), "trials", &[("run".to_owned(), config)], others);
    assert!(batch(&own, &[]).err().unwrap().to_string().contains("letter.txt"));
    assert!(batch(&other, &["letter.txt"]).err().unwrap().to_string().contains("other settings"));
    let opened = batch(&own, &["letter.txt"]).unwrap();
    assert_eq!(opened.folder_of("run"), path);
    opened.write(&RunTable::<Turn>::default()).unwrap();
    assert!(opened.json().is_file() && opened.markdown().is_file());
    batch(&own, &["letter.txt"]).unwrap();
}

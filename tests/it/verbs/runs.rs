//! Runs that were killed, damaged, or are wanted by two: whatever happened, the next call goes on, and ends as if it had not.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

#[cfg(unix)]
use super::cli::interrupt;
use super::tool::{assert_outcome, borrowed, data, text, training, xavatar};

fn avatar(run: &Path) -> Vec<u8> {
    std::fs::read(run.join("avatar.safetensors")).unwrap()
}

/// The files of a folder whose names begin like this, in order.
fn files(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> =
        entries.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(prefix)).collect();
    files.sort();
    files
}

#[test]
fn equal_runs_are_equal_avatars_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str| {
        let run = folder.path().join(name);
        assert_outcome(&borrowed(&training(&run, 8)), 0, &[]);
        avatar(&run)
    };
    assert!(run("first") == run("second"));
}

// What a kill leaves between making the folder and naming the configuration, and a kill later, in each folder that is written to.
#[test]
fn what_killed_calls_left_holds_no_run_up_and_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    std::fs::create_dir(&run).unwrap();
    std::fs::write(run.join(".partial-abc"), "half").unwrap();
    std::fs::write(run.join(".lock"), "process 1 on elsewhere\n").unwrap();
    let arguments = training(&run, 8);
    let start = borrowed(&arguments);
    assert_outcome(&[&start[..], &["--resume"]].concat(), 1, &["a run (config.toml)"]);
    assert_outcome(&start, 0, &[]);
    assert!(files(&run, ".partial-").is_empty());
    let whole = avatar(&run);
    for part in [run.clone(), run.join("checkpoints"), run.join("cache")] {
        std::fs::write(part.join(".partial-def"), "half").unwrap();
    }
    std::fs::remove_file(run.join("avatar.safetensors")).unwrap();
    assert_outcome(&[&start[..], &["--resume"]].concat(), 0, &[]);
    for part in [run.clone(), run.join("checkpoints"), run.join("cache")] {
        assert!(files(&part, ".partial-").is_empty(), "{}", part.display());
    }
    assert!(avatar(&run) == whole);
}

#[test]
fn a_damaged_checkpoint_gives_way_to_the_one_before() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let arguments = training(&run, 23);
    let resume = [&borrowed(&arguments)[..], &["--resume"]].concat();
    assert_outcome(&borrowed(&arguments), 0, &[]);
    let (whole, checkpoints) = (avatar(&run), files(&run.join("checkpoints"), "step-"));
    assert!(checkpoints.len() > 1, "{checkpoints:?}");
    let newest = std::fs::read(checkpoints.last().unwrap()).unwrap();
    let mut changed = newest.clone();
    *changed.last_mut().unwrap() ^= 1;
    for damaged in [&newest[..newest.len() / 2], &newest[..0], &changed] {
        std::fs::write(checkpoints.last().unwrap(), damaged).unwrap();
        std::fs::remove_file(run.join("avatar.safetensors")).unwrap();
        assert_outcome(&resume, 0, &["warning: ", "going on from the checkpoint before"]);
        assert!(avatar(&run) == whole);
        assert_eq!(files(&run.join("checkpoints"), "step-"), checkpoints, "it is made again");
    }
    // Without any that can be read it begins at the beginning.
    checkpoints.iter().for_each(|checkpoint| std::fs::write(checkpoint, "damaged").unwrap());
    std::fs::remove_file(run.join("avatar.safetensors")).unwrap();
    assert_outcome(&resume, 0, &["going on from the checkpoint before"]);
    assert!(avatar(&run) == whole);
}

#[test]
fn an_avatar_that_was_changed_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert_outcome(&borrowed(&training(&run, 1)), 0, &[]);
    let mut bytes = avatar(&run);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(run.join("avatar.safetensors"), bytes).unwrap();
    assert_outcome(&["info", text(&run)], 1, &["checksum", "damaged"]);
}

// The report shows the notes of all steps; one of them is unreadable.
#[test]
fn a_damaged_note_does_not_fail_a_run_that_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let arguments = training(&run, 8);
    assert_outcome(&borrowed(&arguments), 0, &[]);
    let notes = run.join("metrics.jsonl");
    let mut bytes = std::fs::read(&notes).unwrap();
    bytes[..3].fill(0xff);
    std::fs::write(&notes, bytes).unwrap();
    std::fs::remove_file(run.join("report.html")).unwrap();
    let resume = [&borrowed(&arguments)[..], &["--resume"]].concat();
    assert_outcome(&resume, 0, &["1 of 48 steps are damaged and left out"]);
    assert!(run.join("report.html").is_file());
}

#[test]
fn quiet_runs_leave_a_report_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let arguments = training(&run, 1);
    let printed = assert_outcome(&[&["--quiet"], &borrowed(&arguments)[..]].concat(), 0, &["avatar.safetensors"]);
    assert_eq!(printed.lines().count(), 1, "{printed}");
    assert!(run.join("report.html").is_file());
}

#[cfg(unix)]
#[test]
fn a_folder_is_one_runs_at_a_time_until_that_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let arguments = training(&run, 100_000);
    let mut child = xavatar(&borrowed(&arguments)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let has_begun = || run.join("metrics.jsonl").is_file();
    while !has_begun() {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::sleep(Duration::from_millis(5));
    }
    let resume = [&borrowed(&arguments)[..], &["--resume"]].concat();
    let holder = format!("in use by process {} on ", child.id());
    assert_outcome(&resume, 1, &[&holder]);
    assert!(Command::new("kill").args(["-KILL", &child.id().to_string()]).status().unwrap().success());
    child.wait().unwrap();
    let noted = std::fs::read_to_string(run.join("metrics.jsonl")).unwrap().lines().count();
    let (code, printed) = interrupt(&resume, &run, noted + 5, "-INT");
    assert_eq!(code, Some(3), "{printed}");
}

/// The subject with so many training frames, all alike.
#[cfg(unix)]
fn many_frames(folder: &Path, count: usize) -> PathBuf {
    let (data, _) = data();
    let many = folder.join("many");
    for entry in walk(Path::new(data)) {
        let copy = many.join(entry.strip_prefix(data).unwrap());
        std::fs::create_dir_all(copy.parent().unwrap()).unwrap();
        let name = entry.file_name().unwrap().to_str().unwrap();
        let is_training = entry.components().any(|part| part.as_os_str() == "train");
        let copies = if is_training && name.contains("f00001") { count } else { 1 };
        for number in (1..=copies).filter(|_| copies > 1 || !is_training) {
            std::fs::hard_link(&entry, copy.with_file_name(name.replace("f00001", &format!("f{number:05}")))).unwrap();
        }
    }
    many
}

/// All files under a folder.
#[cfg(unix)]
fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

// A scheduler asks once, and kills after half a minute: long before that many frames are prepared.
#[cfg(unix)]
#[test]
fn a_polite_kill_ends_the_preparation_of_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (frames, run) = (2000, folder.path().join("run"));
    let many = many_frames(folder.path(), frames);
    let mut arguments = training(&run, 5);
    arguments[1] = text(&many).to_owned();
    let mut child = xavatar(&borrowed(&arguments)).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let prepared = || std::fs::read_dir(run.join("cache")).map_or(0, Iterator::count);
    while prepared() < 3 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was asked to");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("stopped") && said.contains("--resume"), "{said}");
    assert!(prepared() < frames, "it stopped before all was done");
}

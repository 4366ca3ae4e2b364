//! Many subjects from one manifest: whatever happens to one of them, the others are complete, and nothing is done twice.

use std::fs;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::time::Duration;

#[cfg(unix)]
use std::process::{Command, Stdio};

use serde_json::Value;

use super::tool::{TINY, assert_outcome, data, outcome, run, text, xavatar};

/// A manifest of tiny subjects by their names, in a folder of its own; each has the same data.
fn manifest(folder: &Path, steps: usize, subjects: &[(&str, &str)]) -> PathBuf {
    let (data, body) = data();
    let settings =
        TINY.map(|setting| setting.split_once('=').unwrap()).map(|(key, value)| format!("{key:?} = {value}"));
    let settings = settings.join(", ");
    let rows = subjects.iter().map(|(name, more)| {
        let data = if more.contains("data =") { String::new() } else { format!("data = {data:?}\n") };
        format!("[[subject]]\nname = {name:?}\n{data}{more}\n")
    });
    let path = folder.join("study.toml");
    let head = format!(
        "body = {body:?}\npreset = 'demo'\nresolution = 48\ntexture = 0\n\
         set = {{ {settings}, 'schedule.steps' = {steps} }}\n"
    );
    fs::write(&path, head + &rows.collect::<String>()).unwrap();
    path
}

fn summary(manifest: &Path) -> Value {
    serde_json::from_slice(&run(&["batch", text(manifest), "--status", "--json", "-"]).stdout).unwrap()
}

/// The stages in a subject's journal, as `stage event`.
fn journal(folder: &Path) -> Vec<String> {
    let lines = fs::read_to_string(folder.join("journal.jsonl")).unwrap_or_default();
    let entries = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    entries.map(|entry| format!("{} {}", entry["stage"].as_str().unwrap(), entry["event"].as_str().unwrap())).collect()
}

#[test]
fn one_subjects_bad_frame_stops_no_other_and_nothing_is_done_twice() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad");
    copy(Path::new(data().0), &bad);
    let scan = first_scan(&bad);
    let whole = fs::read(&scan).unwrap();
    fs::write(&scan, &whole[..whole.len() / 2]).unwrap();
    let bad_data = format!("data = {bad:?}");
    let subjects = [("anna", ""), ("ben", bad_data.as_str()), ("cora", "stages = ['train']")];
    let manifest = manifest(folder.path(), 6, &subjects);
    let call = ["batch", text(&manifest)];
    let out = folder.path().join("study");
    assert_eq!(summary(&manifest)["totals"]["waiting"], 3);

    let printed = assert_outcome(&call, 1, &["3 subjects: 2 done, 1 failed", "index.html"]);
    assert!(printed.contains("error: ben: ") && printed.contains("f00001"), "{printed}");
    let table: Value = serde_json::from_slice(&fs::read(out.join("subjects.json")).unwrap()).unwrap();
    let row = |place: usize| &table["subjects"][place];
    assert_eq!((&row(0)["state"], &row(0)["steps"]), (&"done".into(), &6.into()));
    assert!(row(0)["metrics"]["mean"]["all"]["cd_mm"].as_f64().unwrap() > 0.0);
    assert!(row(1)["reason"].as_str().unwrap().contains("f00001"), "{table}");
    assert_eq!((&row(2)["state"], &row(2)["metrics"]), (&"done".into(), &Value::Null));
    let sheet = fs::read_to_string(out.join("subjects.csv")).unwrap();
    assert_eq!(sheet.lines().count(), 4);
    assert!(sheet.starts_with("name,state,steps,") && sheet.contains("\nanna,done,6,"), "{sheet}");
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(
        page.contains("href=\"anna&#x2f;run&#x2f;report.html\"") && page.contains("href=\"anna&#x2f;avatar.glb\""),
        "{page}"
    );
    assert!(out.join("anna/picture.png").is_file() && !out.join("cora/avatar.glb").exists());
    assert_eq!(journal(&out.join("anna")), ["train ended", "eval ended", "export ended"]);

    // The frame is mended: what had failed is begun anew, what was done is not touched.
    fs::write(&scan, &whole).unwrap();
    let before = fs::metadata(out.join("anna/run/avatar.safetensors")).unwrap().modified().unwrap();
    assert_outcome(&call, 0, &["3 subjects: 3 done", "anna: done by an earlier call", "ben: train"]);
    assert_eq!(fs::metadata(out.join("anna/run/avatar.safetensors")).unwrap().modified().unwrap(), before);
    assert_eq!(journal(&out.join("anna")).len(), 3);
    assert!(!out.join("ben/failed.json").exists());
}

#[test]
fn what_was_made_of_other_settings_is_kept_and_of_the_same_data_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let manifest_of = |steps, more| manifest(folder.path(), steps, &[("anna", more)]);
    let first = manifest_of(4, "");
    assert_outcome(&["batch", text(&first)], 0, &["1 done"]);
    let subject = folder.path().join("study/anna");
    let avatar = fs::read(subject.join("run/avatar.safetensors")).unwrap();

    // Other results of the same avatar: measured and exported again, trained no more.
    let finer = manifest_of(4, "resolution = 56");
    assert_outcome(&["batch", text(&finer)], 0, &["1 done"]);
    let stages = journal(&subject);
    assert_eq!(stages.iter().filter(|stage| *stage == "train ended").count(), 1, "{stages:?}");
    assert_eq!(stages.iter().filter(|stage| *stage == "export ended").count(), 2, "{stages:?}");

    let longer = manifest_of(7, "");
    assert_eq!(summary(&longer)["totals"]["done"], 0);
    assert_outcome(&["batch", text(&longer)], 0, &["warning: anna: its data or settings have changed", "1 done"]);
    assert_eq!(summary(&longer)["subjects"][0]["steps"], 7);
    let kept = fs::read_dir(&subject).unwrap().map(|entry| entry.unwrap().path());
    let kept =
        kept.into_iter().find(|path| path.file_name().unwrap().to_str().unwrap().starts_with("before-")).unwrap();
    assert_eq!(fs::read(kept.join("run/avatar.safetensors")).unwrap(), avatar);
}

// As array tasks do: each the share that its scheduler's variable says, at the same time.
#[test]
fn tasks_of_an_array_share_the_subjects() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a", "b", "c", "d"];
    let manifest = manifest(folder.path(), 3, &names.map(|name| (name, "stages = ['train']")));
    let call = ["batch", text(&manifest)];
    let tasks = ["0", "1", "2"].map(|task| {
        let variable = if task == "1" { "JOB_COMPLETION_INDEX" } else { "SLURM_ARRAY_TASK_ID" };
        xavatar(&call).env(variable, task).output()
    });
    for task in tasks {
        assert_eq!(task.unwrap().status.code(), Some(0));
    }
    let status = summary(&manifest);
    assert_eq!((&status["totals"]["done"], &status["totals"]["waiting"]), (&3.into(), &1.into()));
    let beyond = xavatar(&call).env("SLURM_ARRAY_TASK_ID", "4").output().unwrap();
    assert_eq!(beyond.status.code(), Some(2));
    assert_outcome(&[&call[..], &["--shard", "1/2"]].concat(), 0, &["4 subjects: 4 done"]);
    assert_outcome(&[&call[..], &["--shard", "2/2"]].concat(), 2, &["I/N"]);
}

#[cfg(unix)]
#[test]
fn a_notice_saves_the_training_and_the_next_call_ends_as_if_there_had_been_none() {
    let folder = tempfile::tempdir().unwrap();
    let subject = |name: &str, steps| {
        let folder = folder.path().join(name);
        fs::create_dir(&folder).unwrap();
        (manifest(&folder, steps, &[("anna", "stages = ['train']")]), folder.join("study/anna"))
    };
    const STEPS: usize = 400;
    let (whole, alone) = subject("whole", STEPS);
    assert_outcome(&["batch", text(&whole)], 0, &[]);
    let (stopped, anna) = subject("stopped", STEPS);
    let notes = anna.join("run/metrics.jsonl");
    // A notice, a polite kill, and one that nobody can hear.
    for (signal, code, again) in [("-USR1", Some(3), 50), ("-TERM", Some(3), 100), ("-KILL", None, 150)] {
        let mut child =
            xavatar(&["batch", text(&stopped)]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        while fs::read_to_string(&notes).map_or(0, |notes| notes.lines().count()) < again {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            std::thread::sleep(Duration::from_millis(2));
        }
        let (busy, printed) = outcome(&["batch", text(&stopped)]);
        assert!(busy == 3 && printed.contains(&format!("anna: left to process {}", child.id())), "{printed}");
        assert_eq!(summary(&stopped)["subjects"][0]["state"], "running");
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), code, "{}", String::from_utf8_lossy(&ended.stderr));
        assert_eq!(summary(&stopped)["subjects"][0]["state"], "stopped");
    }
    assert_outcome(&["batch", text(&stopped)], 0, &["1 done"]);
    let avatar = |subject: &Path| fs::read(subject.join("run/avatar.safetensors")).unwrap();
    assert!(avatar(&anna) == avatar(&alone));
    assert_eq!(journal(&anna), ["train stopped", "train stopped", "train ended"]);
}

#[test]
fn schedulers_get_one_task_a_subject() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(folder.path(), 3, &["a", "b", "c"].map(|name| (name, "")));
    let script = assert_outcome(&["batch", text(&manifest), "--emit", "slurm"], 0, &["#SBATCH --array=0-2\n"]);
    assert!(script.contains("--shard \"$SLURM_ARRAY_TASK_ID/3\"") && script.contains(text(&manifest)), "{script}");
    let job = assert_outcome(&["batch", text(&manifest), "--emit", "kubernetes"], 0, &["completions: 3\n"]);
    assert!(job.contains("\"batch\", \"/work/study.toml\""), "{job}");
    assert!(!folder.path().join("study").exists());
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (entry, target) = (entry.as_ref().unwrap().path(), to.join(entry.as_ref().unwrap().file_name()));
        if entry.is_dir() {
            copy(&entry, &target);
        } else {
            fs::copy(&entry, &target).unwrap();
        }
    }
}

/// The first training scan.
fn first_scan(data: &Path) -> PathBuf {
    let folder = data.join("train/Take1/meshes_ply");
    let mut scans: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    scans.retain(|path| path.file_name().unwrap().to_str().unwrap().starts_with("mesh-f00001"));
    scans.sort();
    scans.remove(0)
}

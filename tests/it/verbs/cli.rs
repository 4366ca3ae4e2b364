//! The command line as scripts see it: exit codes, messages, files.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use xavatar::avatar::Avatar;
use xavatar::mesh::read_mesh;

use super::tool::{TINY, assert_outcome, borrowed, data, run, text, trained, training, xavatar};

#[test]
fn wrong_usage_exits_with_2_before_anything_is_read() {
    let train = ["train", "/nowhere", "--body", "/nowhere", "--out", "/nowhere/run"];
    let with = |more: &[&'static str]| [&train[..], more].concat();
    for (arguments, word) in [
        (vec![], "Usage"),
        (vec!["fly"], "fly"),
        (vec!["train"], "--body"),
        (with(&["--minutes", "1", "--steps", "1"]), "cannot be used with"),
        (with(&["--minutes=-1"]), "--minutes"),
        (with(&["--minutes", "nan"]), "minutes"),
        (with(&["--steps", "0"]), "--steps"),
        (with(&["--threads", "0"]), "--threads"),
        (with(&["--set", "losses.normal"]), "key=value"),
        (with(&["--set", "losses.normals=1"]), "did you mean `losses.normal`?"),
        (with(&["--set", "losses.normal=-1"]), "losses.normal is -1"),
        (with(&["--preset", "slow"]), "fast"),
        (vec!["eval", "/nowhere", "/nowhere", "--body", "/nowhere", "--baseline", "smpl"], "smplx+d"),
        (vec!["extract", "/nowhere", "--resolution", "100000"], "512"),
        (vec!["extract", "/nowhere", "--pose", "/nowhere"], "--body"),
        (vec!["completions", "cmd"], "bash"),
        (vec!["info", "/nowhere", "--log-format", "xml"], "json"),
    ] {
        assert_outcome(&arguments, 2, &[word]);
    }
}

#[test]
fn help_and_version_are_not_errors() {
    assert_outcome(&["train", "--help"], 0, &["Example", "xavatar train"]);
    assert_outcome(&["--version"], 0, &[env!("CARGO_PKG_VERSION")]);
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("absent");
    let (absent, out) = (text(&absent), folder.path().join("run"));
    let (data, body) = data();
    for arguments in [
        vec!["check", absent, "--body", body],
        vec!["check", data, "--body", absent],
        vec!["train", absent, "--body", body, "--out", text(&out)],
        vec!["train", data, "--body", body, "--out", absent, "--resume"],
        vec!["eval", absent, data, "--body", body],
        vec!["extract", absent, "--out", text(&out.with_extension("ply"))],
        vec!["animate", absent, data, "--body", body, "--out", text(&out)],
        vec!["info", absent],
    ] {
        let printed = assert_outcome(&arguments, 1, &["error: ", absent]);
        assert_eq!(printed.lines().filter(|line| line.starts_with("error")).count(), 1, "{printed}");
    }
    assert!(!out.exists(), "nothing is made before the inputs are known to be there");
}

#[test]
fn the_written_subject_passes_its_check() {
    let (data, body) = data();
    let json = tempfile::NamedTempFile::new().unwrap();
    let arguments = ["check", data, "--body", body, "--json", text(json.path())];
    assert_outcome(&arguments, 0, &["ready to train", "3 frames", "watertight"]);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json.path()).unwrap()).unwrap();
    assert_eq!(report["problems"].as_array().unwrap().len(), 0);
    assert!(report["distances"]["all"]["median_mm"].as_f64().unwrap() < 30.0, "{report}");
}

#[test]
fn an_avatar_is_measured_extracted_animated_and_described() {
    let (run, (data, body)) = (trained(), data());
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);

    let json = file("metrics.json");
    let eval = ["eval", run, data, "--body", body, "--split", "test", "--baseline", "smplx+d", "--resolution", "48"];
    assert_outcome(&[&eval[..], &["--json", text(&json)]].concat(), 0, &["SMPLX+D", "CD mm", "Hands", "Face"]);
    let metrics: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(metrics["frames"], 1);
    assert_eq!(metrics["per_frame"].as_array().unwrap().len(), 1);
    for value in ["cd_mm", "cd_max_mm", "nc", "iou", "iou_box"] {
        assert!(metrics["mean"]["all"][value].as_f64().unwrap().is_finite(), "{metrics}");
        assert!(metrics["baseline"]["hands"][value].as_f64().unwrap().is_finite(), "{metrics}");
        assert!(metrics["baseline"]["face"][value].as_f64().unwrap().is_finite(), "{metrics}");
    }
    assert_outcome(&[&eval[..], &["--json", text(&json)]].concat(), 1, &["exists already"]);

    let canonical = file("canonical.obj");
    let extract = ["extract", run, "--resolution", "48", "--out", text(&canonical)];
    assert_outcome(&extract, 0, &["canonical.obj", "vertices"]);
    assert_outcome(&extract, 1, &["canonical.obj", "exists already"]);
    assert_outcome(&["info", text(&canonical)], 0, &["mesh", "watertight", "1 parts, 0 handles"]);

    let posed = file("posed.ply");
    let take = PathBuf::from(data).join("test/Take2");
    let pose = ["--pose", text(&take), "--body", body];
    assert_outcome(&[&["extract", run, "--resolution", "48", "--out", text(&posed)][..], &pose].concat(), 0, &[]);
    assert!(posed.is_file());

    assert_outcome(&["info", run], 0, &["preset demo", "10 steps", "3 frames", "neutral"]);
    assert_outcome(&["info", text(&Path::new(body).join("SMPLX_NEUTRAL.npz"))], 0, &["SMPL-X", "neutral", "shapedirs"]);
}

#[test]
fn an_interrupted_animation_goes_on_and_does_not_mix_with_another() {
    let (run, (data, body)) = (trained(), data());
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("animation");
    let take = PathBuf::from(data).join("train/Take1");
    let animate = ["animate", run, text(&take), "--body", body, "--resolution", "40", "--out", text(&out)];
    let resume = [&animate[..], &["--resume"]].concat();
    assert_outcome(&animate, 0, &["3 meshes", "by the format", "frame rate: 30 per second (assumed"]);
    let mesh = |number: u32| out.join(format!("mesh-f{number:05}.ply"));
    let first = std::fs::read(mesh(1)).unwrap();
    std::fs::remove_file(mesh(1)).unwrap();
    assert_outcome(&animate, 1, &["not empty", "--resume"]);
    assert_outcome(&resume, 0, &["2 of 3 meshes are there already"]);
    assert_eq!(std::fs::read(mesh(1)).unwrap(), first);
    assert_outcome(&[&resume[..], &["--fixed-topology"]].concat(), 1, &["fixed_topology was false, now true"]);
    assert_outcome(&[&resume[..], &["--smooth", "0.1"]].concat(), 1, &["smooth was null, now 0.1"]);
    let other = PathBuf::from(data).join("test/Take2");
    let other = ["animate", run, text(&other), "--body", body, "--resolution", "40", "--out", text(&out), "--resume"];
    assert_outcome(&other, 1, &["motion was", "Take2"]);
    std::fs::remove_file(out.join("animation.json")).unwrap();
    assert_outcome(&resume, 1, &["no animation was begun"]);
}

#[test]
fn meshes_of_fixed_topology_have_the_same_faces() {
    let (run, (data, body)) = (trained(), data());
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("animation");
    let take = PathBuf::from(data).join("train/Take1");
    let animate = ["animate", run, text(&take), "--body", body, "--resolution", "40", "--out", text(&out)];
    assert_outcome(&[&animate[..], &["--fixed-topology"]].concat(), 0, &["3 meshes"]);
    let [first, second] = [1, 2].map(|number| read_mesh(out.join(format!("mesh-f{number:05}.ply"))).unwrap().mesh);
    assert_eq!(first.faces, second.faces);
    assert_ne!(first.vertices, second.vertices);
}

/// Starts training, sends a signal once so many steps are noted, and returns the exit code, if any, and what was printed.
#[cfg(unix)]
pub(super) fn interrupt(arguments: &[&str], run: &Path, steps: usize, signal: &str) -> (Option<i32>, String) {
    let child = xavatar(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while std::fs::read_to_string(run.join("metrics.jsonl")).unwrap_or_default().lines().count() < steps {
        assert!(Instant::now() < deadline, "no steps were made");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[cfg(unix)]
#[test]
fn a_run_that_was_stopped_and_killed_ends_like_one_that_was_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    let steps = 60;
    assert_outcome(&borrowed(&training(&whole, steps)), 0, &[]);

    let arguments = training(&broken, steps);
    let start = borrowed(&arguments);
    let resume = [&start[..], &["--resume"]].concat();
    let (code, printed) = interrupt(&start, &broken, 50, "-INT");
    assert_eq!(code, Some(3), "{printed}");
    assert!(printed.contains("--resume"), "{printed}");
    assert_outcome(&start, 1, &["not empty", "--resume"]);
    assert_outcome(&[&resume[..], &["--set", "losses.normal=0.7"]].concat(), 2, &["losses.normal = ", "not 0.7"]);

    let (code, _) = interrupt(&resume, &broken, 75, "-KILL");
    assert_eq!(code, None, "killed in the middle");
    assert_outcome(&resume, 0, &["avatar.safetensors"]);
    let parameters = |run: &Path| {
        let fields = Avatar::load(run).unwrap().fields;
        fields.parameters().map(<[f32]>::to_vec)
    };
    assert!(parameters(&whole) == parameters(&broken), "the parameters differ");
    let steps = |run: &Path| std::fs::read_to_string(run.join("metrics.jsonl")).unwrap().lines().count();
    assert_eq!(steps(&whole), steps(&broken), "a step is noted once");
}

#[cfg(unix)]
#[test]
fn interrupted_ablations_go_on_and_end_in_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ablations");
    let (data, body) = data();
    let fixed = ["ablate", data, "--body", body, "--out", text(&out), "--preset", "demo", "--resolution", "48"];
    let settings = TINY.iter().flat_map(|setting| ["--set", setting]);
    let ablate: Vec<&str> = fixed.into_iter().chain(settings).chain(["--steps", "10"]).collect();
    let second = out.join("a1-body-starts");
    let (code, printed) = interrupt(&ablate, &second, 20, "-INT");
    assert_eq!(code, Some(3), "{printed}");
    let partial: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("ablations.json")).unwrap()).unwrap();
    assert_eq!(partial["rows"].as_array().unwrap().len(), 1, "the table has what is done");

    assert_outcome(&[&ablate[..], &["--set", "losses.normal=0.7"]].concat(), 1, &["other settings"]);
    let printed = assert_outcome(&ablate, 0, &["full: trained already", "A2 all starts: training", "s/step"]);
    assert!(!printed.contains("full: training"), "{printed}");
    let json = std::fs::read(out.join("ablations.json")).unwrap();
    let table: serde_json::Value = serde_json::from_slice(&json).unwrap();
    let rows = table["rows"].as_array().unwrap();
    let names = ["full", "body_starts", "all_starts", "uniform_sampling", "free_weights"];
    assert_eq!(rows.iter().map(|row| row["ablation"].as_str().unwrap()).collect::<Vec<_>>(), names);
    for row in rows {
        assert_eq!((&row["steps"], &row["frames"]), (&10.into(), &1.into()));
        assert!(row["seconds_per_step"].as_f64().unwrap() > 0.0);
        assert!(row["mean"]["all"]["cd_mm"].as_f64().unwrap().is_finite(), "{row}");
    }
    assert_eq!(std::fs::read_to_string(out.join("ablations.md")).unwrap().lines().count(), 7);
    let config = std::fs::read_to_string(out.join("a4-free-weights/config.toml")).unwrap();
    assert!(["joint = 0.0", "surface = 0.0", "volume = 0.0"].iter().all(|line| config.contains(line)), "{config}");

    let again = assert_outcome(&ablate, 0, &["A4 no weight losses: trained already"]);
    assert!(!again.contains(": training"), "{again}");
    assert!(std::fs::read(out.join("ablations.json")).unwrap() == json, "nothing is trained or measured twice");
}

/// The lines of stderr, each a JSON object with a time and a kind.
fn log_lines(stderr: &[u8]) -> Vec<serde_json::Value> {
    let lines = std::str::from_utf8(stderr).unwrap().lines();
    let lines: Vec<serde_json::Value> = lines.map(|line| serde_json::from_str(line).expect(line)).collect();
    assert!(lines.iter().all(|line| line["time"].is_f64() && line["kind"].is_string()), "{lines:?}");
    lines
}

#[test]
fn the_log_is_json_where_that_is_asked_for() {
    let (data, body) = data();
    let output = run(&["check", data, "--body", body, "--json", "-", "--log-format", "json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON alone on stdout");
    assert_eq!(report["sequences"][0]["frames"], 3);
    let lines = log_lines(&output.stderr);
    let last = lines.iter().rfind(|line| line["kind"] == "progress").expect("progress is said without a terminal");
    assert_eq!((&last["phase"], &last["share"]), (&"scans".into(), &1.0.into()));

    let output = run(&["--log-format", "json", "info", "/nowhere"]);
    let lines = log_lines(&output.stderr);
    assert_eq!((lines.len(), &lines[0]["kind"]), (1, &"error".into()));
    assert!(lines[0]["message"].as_str().unwrap().contains("/nowhere"));
}

#[test]
fn quiet_leaves_results_and_errors() {
    let (data, body) = data();
    let output = run(&["check", data, "--body", body, "--quiet"]);
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("ready to train"));
    let output = run(&["info", "/nowhere", "-q"]);
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: /nowhere"));
}

#[test]
fn info_describes_files_in_json() {
    let (_, body) = data();
    let described = |file: &str| -> serde_json::Value {
        let output = run(&["info", file, "--json", "-"]);
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let avatar = described(trained());
    assert_eq!((&avatar["kind"], &avatar["steps"]), (&"avatar".into(), &10.into()));
    assert_eq!((&avatar["subject"]["frames"], &avatar["config"]["preset"]), (&3.into(), &"demo".into()));
    let model = described(text(&Path::new(body).join("SMPLX_NEUTRAL.npz")));
    assert_eq!((&model["kind"], &model["gender"]), (&"body_model".into(), &"neutral".into()));
    assert_eq!(model["arrays"]["v_template"]["shape"], serde_json::json!([model["vertices"], 3]));
}

#[test]
fn figures_are_printed_as_json_alone() {
    let (run, (data, body)) = (trained(), data());
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let printed = |arguments: &[&str]| -> serde_json::Value {
        let output = self::run(&[arguments, &["--json", "-"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON alone on stdout")
    };
    let mesh = file("canonical.ply");
    let extracted = printed(&["extract", run, "--resolution", "32", "--out", text(&mesh)]);
    assert_eq!(extracted["vertices"], read_mesh(&mesh).unwrap().mesh.vertices.len());
    let (meshes, take) = (file("meshes"), PathBuf::from(data).join("train/Take1"));
    let animate = ["animate", run, text(&take), "--body", body, "--fixed-topology", "--resolution", "32"];
    let animated = printed(&[&animate[..], &["--out", text(&meshes)]].concat());
    assert_eq!(
        (&animated["meshes"], &animated["frames"], &animated["frames_per_second"]),
        (&3.into(), &3.into(), &30.0.into())
    );
    let picture = file("dance.png");
    let render = ["render", run, "--body", body, "--resolution", "32", "--size", "40x60", "--frames", "1..2"];
    assert_eq!(printed(&[&render[..], &["--out", text(&picture)]].concat())["pictures"], 2);
    let (pictures, points) = (file("pictures"), file("points.ply"));
    let filmed = printed(&["render-rgbd", data, "--out", text(&pictures)]);
    assert_eq!((&filmed["folder"], &filmed["frames"]), (&text(&pictures).into(), &4.into()));
    let cloud = printed(&["pointcloud", text(&pictures), "--parts", "--body", body, "--out", text(&points)]);
    let parts = cloud["parts"].as_object().unwrap();
    assert_eq!(parts.keys().collect::<Vec<_>>(), ["body", "face", "left_hand", "right_hand"]);
    let sum: u64 = parts.values().map(|count| count.as_u64().unwrap()).sum();
    assert!(sum > 0 && cloud["points"] == sum, "{cloud}");
}

#[test]
fn an_official_checkpoint_becomes_an_avatar() {
    let (_, body) = data();
    let official = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/official").join(name);
    let (checkpoint, meta) = (official("scan.ckpt"), official("meta_info.npz"));
    let folder = tempfile::tempdir().unwrap();
    let (avatar, mesh) = (folder.path().join("avatar.safetensors"), folder.path().join("canonical.ply"));
    let convert = ["convert", text(&checkpoint), "--meta", text(&meta), "--body", body, "--out", text(&avatar)];
    assert_outcome(&convert, 0, &["avatar.safetensors"]);
    assert_outcome(&convert, 1, &["exists already"]);
    assert_outcome(&["info", text(&avatar)], 0, &["neutral", "preset paper-scan", "Occupancy"]);
    assert_outcome(&["extract", text(&avatar), "--resolution", "32", "--out", text(&mesh)], 0, &["vertices"]);
    let legacy = official("legacy.pth");
    let out = folder.path().join("legacy.safetensors");
    let convert = ["convert", text(&legacy), "--meta", text(&meta), "--body", body, "--out", text(&out)];
    assert_outcome(&convert, 1, &["legacy.pth", "torch.save"]);
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let mut child = xavatar(&["completions", "zsh"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn completions_know_every_verb() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert_outcome(&["completions", shell], 0, &["xavatar", "train", "ablate", "log-format", "baseline"]);
    }
}

#[test]
fn the_built_in_subject_is_written_with_as_many_frames_as_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("mannequin");
    assert_outcome(&["demo", "--write-data", text(&data), "--frames", "3"], 0, &["xavatar check"]);
    let scans = |take: &str| std::fs::read_dir(data.join(take).join("meshes_ply")).unwrap().count();
    assert_eq!((scans("train/Take1"), scans("test/Take2")), (3, 1));
    assert_outcome(&["demo", "--frames", "3"], 2, &["--write-data"]);
}

#[test]
fn nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.txt"), "mine").unwrap();
    let occupied = text(folder.path());
    let (data, body) = data();
    assert_outcome(&["train", data, "--body", body, "--out", occupied], 1, &["not empty", "--resume"]);
    assert_outcome(&["demo", "--smoke", "--out", occupied], 1, &["not empty"]);
    assert_outcome(&["demo", "--smoke", "--write-data", occupied], 1, &["not empty"]);
    let take = PathBuf::from(data).join("test/Take2");
    assert_outcome(&["animate", trained(), text(&take), "--body", body, "--out", occupied], 1, &["not empty"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

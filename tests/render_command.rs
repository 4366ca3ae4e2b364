//! `xavatar render` on a tiny avatar: a PNG, films of every kind, a comparison with scans; and what it refuses.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The smoke demo's run, and its subject as data.
struct Made {
    _folder: tempfile::TempDir,
    run: PathBuf,
    data: PathBuf,
}

fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (run, data) = (folder.path().join("run"), folder.path().join("data"));
        for arguments in [["--out", run.to_str().unwrap()], ["--write-data", data.to_str().unwrap()]] {
            let output = xavatar(&[&["demo", "--smoke"], &arguments[..]].concat());
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        }
        Made { _folder: folder, run, data }
    })
}

fn xavatar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_xavatar")).args(arguments).output().unwrap()
}

/// `render` of the demo's avatar at a low resolution, with more arguments.
fn render(out: &Path, more: &[&str]) -> Output {
    let Made { run, data, .. } = made();
    let (run, body, out) =
        (run.display().to_string(), data.join("body").display().to_string(), out.display().to_string());
    let usual = ["render", &run, "--body", &body, "--resolution", "48", "--size", "60x90", "--out", &out];
    xavatar(&[&usual, more].concat())
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Pixels that are not white.
fn ink(path: &Path) -> usize {
    image::open(path).unwrap().to_rgb8().pixels().filter(|pixel| pixel.0.iter().any(|channel| *channel < 200)).count()
}

#[test]
fn a_png_shows_poses_side_by_side_and_views_below_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let (one, three) = (folder.path().join("one.png"), folder.path().join("three.png"));
    let output = render(&one, &["--frames", "1..1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let output = render(&three, &["--frames", "1..9", "--view", "shaded,normals,depth,parts,weights"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let size = |path: &Path| image::open(path).unwrap().to_rgb8().dimensions();
    let ((width, height), (wide, high)) = (size(&one), size(&three));
    assert!(wide > 3 * width && high > 4 * height, "{width} x {height}, {wide} x {high}");
    assert!(ink(&one) > 300 && ink(&three) > 12 * ink(&one), "{} {}", ink(&one), ink(&three));
}

#[test]
fn films_have_a_picture_a_frame_or_a_step_of_the_turn() {
    let folder = tempfile::tempdir().unwrap();
    let pngs = folder.path().join("pngs");
    let output = render(&pngs, &["--frames", "1..4", "--fixed-topology"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(std::fs::read_dir(&pngs).unwrap().count(), 4);
    assert!(ink(&pngs.join("frame-f00004.png")) > 300);
    let turntable = folder.path().join("turntable.apng");
    let output = render(&turntable, &["--turntable", "--fps", "2", "--view", "colour,weights"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let bytes = std::fs::read(&turntable).unwrap();
    let control = bytes.windows(4).position(|name| name == b"acTL").unwrap();
    assert_eq!(bytes[control + 4..control + 8], 8_u32.to_be_bytes(), "four seconds at two pictures a second");
}

#[test]
fn an_avatar_against_its_scans_shows_both_and_their_distance() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("errors.png");
    let data = made().data.display().to_string();
    let output = render(&out, &["--against", &data]);
    assert!(output.status.success(), "{}", stderr(&output));
    let sheet = image::open(&out).unwrap().to_rgb8();
    // Scan, avatar and error below each other.
    assert!(sheet.height() > 3 * 90 && ink(&out) > 1000, "{:?}", sheet.dimensions());
}

#[test]
fn nothing_is_overwritten_and_wrong_requests_say_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    let there = folder.path().join("there.png");
    std::fs::write(&there, "mine").unwrap();
    assert!(stderr(&render(&there, &[])).contains("exists already"));
    assert_eq!(std::fs::read(&there).unwrap(), b"mine");
    let message = stderr(&render(&folder.path().join("film.avi"), &[]));
    assert!(message.contains(".gif") && message.contains(".avi"), "{message}");
    let message = stderr(&render(&folder.path().join("a.png"), &["--frames", "900..901"]));
    assert!(message.contains("900"), "{message}");
    let data = made().data.display().to_string();
    let both = render(&folder.path().join("b.png"), &["--against", &data, "--motion", "dance"]);
    assert_eq!(both.status.code(), Some(2));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "and nothing is left behind");
}

#[test]
fn an_mp4_is_made_by_ffmpeg_or_its_absence_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("film.mp4");
    let has_ffmpeg = Command::new("ffmpeg").arg("-version").output().is_ok_and(|output| output.status.success());
    let output = render(&out, &["--frames", "1..3"]);
    if has_ffmpeg {
        assert!(output.status.success(), "{}", stderr(&output));
        assert_eq!(&std::fs::read(&out).unwrap()[4..8], b"ftyp");
    } else {
        println!("no ffmpeg here: only the error is tested");
        assert!(stderr(&output).contains("install ffmpeg"), "{}", stderr(&output));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

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
    command(out, more).output().unwrap()
}

fn command(out: &Path, more: &[&str]) -> Command {
    let Made { run, data, .. } = made();
    let (run, body, out) =
        (run.display().to_string(), data.join("body").display().to_string(), out.display().to_string());
    let mut command = Command::new(env!("CARGO_BIN_EXE_xavatar"));
    command.args(["render", &run, "--body", &body, "--resolution", "48", "--out", &out]);
    if !more.contains(&"--size") {
        command.args(["--size", "60x90"]);
    }
    command.args(more);
    command
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
    // Odd sides: a player's colours are halved.
    let film = ["--frames", "1..3", "--fixed-topology", "--size", "61x91"];
    let output = render(&out, &film);
    if !has_ffmpeg {
        println!("no ffmpeg here: only the error is tested");
        assert!(stderr(&output).contains("install ffmpeg"), "{}", stderr(&output));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        return;
    }
    assert!(output.status.success(), "{}", stderr(&output));
    // Back to pictures, which are those of the folder but for an even side and what the codec takes.
    let pngs = folder.path().join("pngs");
    assert!(render(&pngs, &film).status.success());
    let decoded = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&out)
        .arg(folder.path().join("decoded-f%05d.png"))
        .output()
        .unwrap();
    assert!(decoded.status.success(), "{}", stderr(&decoded));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2 + 3, "three pictures, and nothing else");
    for frame in 1..=3 {
        let picture = |path: PathBuf| image::open(path).unwrap().to_rgb8();
        let film = picture(folder.path().join(format!("decoded-f{frame:05}.png")));
        let exact = picture(pngs.join(format!("frame-f{frame:05}.png")));
        assert_eq!(film.dimensions(), (62, 92));
        let differences = exact.enumerate_pixels().flat_map(|(x, y, pixel)| {
            let found = film.get_pixel(x, y).0;
            [0, 1, 2].map(|channel| f64::from(pixel.0[channel].abs_diff(found[channel])))
        });
        let mean = differences.sum::<f64>() / (3.0 * 61.0 * 91.0);
        assert!(mean < 4.0, "frame {frame} differs by {mean} levels");
    }
}

// A program of that name that reads a little and gives up.
#[cfg(unix)]
#[test]
fn an_ffmpeg_that_fails_is_quoted_and_leaves_nothing() {
    use std::os::unix::fs::PermissionsExt;

    let (folder, tools) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let ffmpeg = tools.path().join("ffmpeg");
    let script = "#!/bin/sh\n[ \"$1\" = -version ] && exit 0\nread -r _\necho 'no encoder on this moon' >&2\nexit 3\n";
    std::fs::write(&ffmpeg, script).unwrap();
    std::fs::set_permissions(&ffmpeg, PermissionsExt::from_mode(0o755)).unwrap();
    let path = std::env::join_paths([tools.path().into(), PathBuf::from("/usr/bin"), PathBuf::from("/bin")]).unwrap();
    let out = folder.path().join("film.mp4");
    let output = command(&out, &["--frames", "1..3", "--fixed-topology"]).env("PATH", path).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = stderr(&output);
    assert!(message.contains("no encoder on this moon") && message.contains("film.mp4"), "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

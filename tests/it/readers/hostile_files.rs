//! Files made to harm, as the command meets them: they may not steer the terminal, block, fill the memory or end the program.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use xavatar::formats::{Array, ArrayData, ArrayMap, Error, MemoryLimit, read_npz, write_npz};
use zip::write::SimpleFileOptions;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// The exit code of `xavatar info` and all that it printed.
fn info(path: &Path, more: &[&str]) -> (i32, Vec<u8>) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xavatar"));
    let output = command.arg("info").arg(path).args(more).stdin(Stdio::null()).output().unwrap();
    (output.status.code().unwrap(), [output.stdout, output.stderr].concat())
}

#[test]
fn nothing_in_a_file_steers_the_terminal() {
    for (name, code, shown) in [
        ("e.npz", 1, "a\\u001b]0;x\\u0007"),
        ("g.npz", 0, "\\u001b[31mred"),
        ("e.ply", 0, "u{1b}[2J"),
        ("e.pkl", 1, "u{1b}[31mos.system"),
        ("m.obj", 0, "u{1b}]0;OWNED"),
    ] {
        for more in [&[][..], &["--json", "-"]] {
            let (found, printed) = info(&fixture("escapes").join(name), more);
            let text = String::from_utf8(printed).unwrap();
            assert_eq!(found, code, "{name}: {text}");
            assert!(text.contains(shown), "{name}: {text:?}");
            assert!(!text.chars().any(|character| character.is_control() && character != '\n'), "{name}: {text:?}");
        }
    }
}

#[test]
fn names_in_json_are_the_files_own() {
    let (_, printed) = info(&fixture("escapes/g.npz"), &["--json", "-"]);
    let json: serde_json::Value = serde_json::from_slice(&printed).unwrap();
    assert!(json["arrays"].as_object().unwrap().contains_key("\u{1b}[31mred\u{1b}[0m"), "{json}");
}

// Names of 60 kB, one of them of what is missing: no message quotes them whole.
#[test]
fn messages_are_short_whatever_the_file_holds() {
    let folder = tempfile::tempdir().unwrap();
    let long = "n".repeat(60_000);
    let npz = folder.path().join("long.npz");
    write_npz(&npz, &ArrayMap::from([(long.clone(), Array::from_f32(&[1], vec![0.0]))])).unwrap();
    let obj = folder.path().join("long.obj");
    std::fs::write(&obj, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nmtllib {long}\nusemtl m\nf 1/1 2/1 3/1\n"))
        .unwrap();
    let ply = folder.path().join("long.ply");
    std::fs::write(&ply, format!("ply\nformat ascii 1.0\nelement {long} 1\n{long}\nend_header\n")).unwrap();
    let toml = folder.path().join("run");
    std::fs::create_dir(&toml).unwrap();
    std::fs::write(toml.join("avatar.safetensors"), b"\x10\0\0\0\0\0\0\0{\"a\":{\"dtype\":1}").unwrap();
    for path in [npz, obj, ply, toml] {
        let (_, printed) = info(&path, &[]);
        assert!((1..3000).contains(&printed.len()), "{}: {} bytes", path.display(), printed.len());
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["npz", "npy", "pkl", "bvh", "ply", "obj", "glb", "safetensors"] {
        let pipe = folder.path().join(format!("pipe.{extension}"));
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let device = folder.path().join(format!("device.{extension}"));
        std::os::unix::fs::symlink("/dev/zero", &device).unwrap();
        for path in [pipe, device] {
            let mut child = Command::new(env!("CARGO_BIN_EXE_xavatar"))
                .args(["info", path.to_str().unwrap()])
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            let begin = Instant::now();
            while child.try_wait().unwrap().is_none() {
                // A reader of a pipe that nobody writes to waits for ever.
                if begin.elapsed() > Duration::from_secs(60) {
                    child.kill().unwrap();
                    panic!("{} blocks", path.display());
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            let output = child.wait_with_output().unwrap();
            let said = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(1), "{said}");
            assert!(said.contains(path.to_str().unwrap()) && said.contains("a pipe, a device"), "{said}");
        }
    }
}

/// An npz of one member that claims to be an array of this type and shape, and is zeros.
fn zeros(path: &Path, descr: &str, count: usize, bytes: usize) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    archive.start_file("zeros.npy", SimpleFileOptions::default()).unwrap();
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({count},), }}");
    archive.write_all(b"\x93NUMPY\x01\0").unwrap();
    archive.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    archive.write_all(header.as_bytes()).unwrap();
    let block = vec![0; 1 << 20];
    (0..bytes >> 20).for_each(|_| archive.write_all(&block).unwrap());
    archive.finish().unwrap();
}

// 128 MB of zeros deflate to 130 kB; as integers of one byte they would widen to 1 GB.
#[test]
fn archives_that_unpack_to_a_thousandfold_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.npz");
    for descr in ["|u1", "|i1"] {
        zeros(&path, descr, 128 << 20, 128 << 20);
        match read_npz(&path) {
            Err(Error::TooLarge { limit: MemoryLimit::OfFile { bytes, .. }, purpose, .. }) => {
                assert!(bytes < 128 << 20 && purpose.contains("zeros"), "{purpose}: {bytes}");
            }
            other => panic!("{:?}", other.map(|arrays| arrays.len())),
        }
    }
    // What unpacks to little but widens to much.
    zeros(&path, "|i1", 60 << 20, 60 << 20);
    assert!(matches!(read_npz(&path), Err(Error::TooLarge { .. })));
}

// A take that stands still, and integers of one byte: a thousandfold is honest where it is small.
#[test]
fn small_files_may_unpack_to_much() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("still.npz");
    let still = Array { shape: vec![10_000, 165], data: ArrayData::F64(vec![0.0; 1_650_000]) };
    write_npz(&path, &ArrayMap::from([("poses".into(), still.clone())])).unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < 100_000);
    assert_eq!(read_npz(&path).unwrap()["poses"], still);
}

// Where the system gives no more memory, the message says so; the program is not aborted. 300 MB stored take 2.4 GB as i64.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_the_system_does_not_give_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.npy");
    let header = format!("{{'descr': '|i1', 'fortran_order': False, 'shape': ({},), }}", 300 << 20);
    let head = [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
    std::fs::write(&path, &head).unwrap();
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len((head.len() + (300 << 20)) as u64).unwrap();
    let command = format!("ulimit -v 2000000; exec '{}' info '{}'", env!("CARGO_BIN_EXE_xavatar"), path.display());
    let output = Command::new("bash").args(["-c", &command]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("which the system does not have"), "{said}");
}

//! MP4 through the ffmpeg program: raw pictures go to its standard input.

use std::ffi::OsString;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use super::Pictures;
use xavatar_formats::{Error, Result};

const PROGRAM: &str = "ffmpeg";
/// Players want halved colours, and those want even sides; and HD's matrix, which the file names too: of small pictures players
/// would guess another.
const FILTERS: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2:0:0:white,scale=out_color_matrix=bt709:out_range=tv";
/// Most that is quoted of what ffmpeg complains about, bytes.
const LONGEST_COMPLAINT: u64 = 400;

/// Whether ffmpeg can be started.
pub(super) fn check_for_ffmpeg() -> Result<()> {
    let answer = Command::new(PROGRAM).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    match answer {
        Ok(status) if status.success() => Ok(()),
        _ => Err(Error::Missing {
            path: PROGRAM.into(),
            what: "the program that writes MP4".into(),
            remedy: "install ffmpeg so that it is on the PATH, or write a .gif, an .apng or a folder of PNGs".into(),
        }),
    }
}

pub(super) fn write(path: &Path, pictures: &mut Pictures) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    encode(path, folder, pictures).map_err(Error::io(path))
}

fn encode(path: &Path, folder: &Path, pictures: &mut Pictures) -> io::Result<()> {
    let partial = tempfile::Builder::new().prefix(".partial-").suffix(".mp4").tempfile_in(folder)?.into_temp_path();
    // Not a pipe, which nobody would empty while pictures are written.
    let mut complaints = tempfile::tempfile()?;
    let (width, height) = pictures.size;
    let mut command = Command::new(PROGRAM);
    // Ctrl-C is not for ffmpeg: the film is nearly done.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut ffmpeg = command
        .args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
        .args(["-s", &format!("{width}x{height}"), "-r", &pictures.frames_per_second.to_string(), "-i", "-"])
        .args(["-vf", FILTERS, "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
        .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"])
        .arg(input_safe(&partial))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(complaints.try_clone()?)
        .spawn()?;
    let written = match ffmpeg.stdin.take() {
        Some(mut input) => pictures.for_each(|_, picture| input.write_all(picture)),
        None => Ok(()),
    };
    let status = ffmpeg.wait()?;
    if !status.success() {
        let mut complaint = String::new();
        complaints.seek(SeekFrom::Start(0))?;
        // What is not UTF-8 leaves what was read before.
        let _ = complaints.take(LONGEST_COMPLAINT).read_to_string(&mut complaint);
        return Err(io::Error::other(format!("ffmpeg failed ({status}): {}", complaint.trim())));
    }
    written?;
    #[cfg(unix)]
    std::fs::set_permissions(&partial, std::os::unix::fs::PermissionsExt::from_mode(0o644))?;
    partial.persist(path).map_err(|failure| failure.error)
}

/// A name that ffmpeg takes for a file's, whatever it begins with.
fn input_safe(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

//! Files that are read where they lie in a subject's folder: its descriptions, and its cameras.
//!
//! What else is looked for is in a folder of each thread's own; the input becomes the file, or several with [`BETWEEN`] between them.

use std::io;
use std::path::Path;

use image::{ImageBuffer, Luma, RgbImage};
use tempfile::TempDir;
use xavatar::data::{RgbdSubject, Subject};

const BETWEEN: &str = "\n----\n";
const MOTION: &[u8] = include_bytes!("../../../tests/golden/motions/own.npz");
const REGISTRATION: &[u8] = include_bytes!("../../../tests/golden/pickles/smplx-p4.pkl");
/// Of a subject of scans: what describes it, how its scans are placed, how its registration came out.
const DESCRIPTIONS: [&str; 3] = [Subject::DESCRIPTION_FILE, "mended.toml", "register.json"];
/// Frames, as many as [`MOTION`] has.
const FRAMES: usize = 3;

thread_local! {
    static SCANS: Option<TempDir> = made(scans).ok();
    static RGBD: Option<TempDir> = made(rgbd).ok();
}

pub(super) fn subject(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let mut parts = text.split(BETWEEN);
    let files = DESCRIPTIONS.map(|name| (name, parts.next().unwrap_or_default()));
    with_files(&SCANS, &files, |folder| Subject::open(folder).is_ok())
}

pub(super) fn subject_seeds() -> Vec<Vec<u8>> {
    let described = "gender = 'female'\nbetas = [0.5, -1, 0, 0, 0, 0, 0, 0, 0, 0]\nhands = 'flat'\ntest = ['take']\n\
        [scans]\nscale = 0.001\nturn = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]\nshift = [0, 0, 0]\norigin = 'world'\n\
        [[sequence]]\nname = 'walk'\nfolder = 'take'\nsplit = 'train'\nscans = ''\nfits = ''\n";
    let placed = "scale = 2.0\nturn = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nshift = [0, 1e-3, 0]\nreverse_faces = true\n";
    let registered = r#"{"betas": [0.5], "frames": [{"frame": "train/take/f00001", "verdict": "registered",
        "missing_hands": ["left_hand"]}]}"#;
    let plain = "gender = 'neutral'\ndata = 'take'\n";
    [[described, placed, registered], [plain, placed, r#"{"frames": []}"#]]
        .map(|parts| parts.join(BETWEEN).into())
        .into()
}

/// The file of cameras, whose first line is its name: JSON, TOML or text.
pub(super) fn cameras(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let Some((name, text)) = text.split_once('\n').filter(|(name, _)| CAMERA_FILES.contains(name)) else {
        return false;
    };
    let layout = format!("{LAYOUT}cameras = '../{name}'\n");
    with_files(&RGBD, &[(RgbdSubject::LAYOUT_FILE, &layout), (name, text)], is_read)
}

pub(super) fn cameras_seeds() -> Vec<Vec<u8>> {
    let pose = "[[1, 0, 0, 0], [0, -1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]]";
    let intrinsic = "[[6, 0, 3.5], [0, 6.5, 2.5], [0, 0, 1]]";
    let columns = r#""intrinsic_matrix": [6, 0, 0, 0, 6, 0, 3, 2, 1]"#;
    let placed = "[1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 1, 3, 1]";
    let camera = format!(r#"{{"intrinsic": {{{columns}}}, "extrinsic": {placed}}}"#);
    [
        format!("c.json\n{{\"intrinsic\": {intrinsic}, \"extrinsic\": [{pose}, {pose}, {pose}]}}"),
        format!("c.toml\nintrinsic = {intrinsic}\nextrinsic = {pose}\n"),
        format!("c.json\n{{\"parameters\": [{camera}, {camera}, {camera}]}}"),
        "c.txt\n1 0 0 0 0 -1 0 1 0 0 -1 3\n# a comment\n1 0 0 0\n0 -1 0 1\n0 0 -1 3\n0 0 0 1\n1 0 0 0 0 -1 0 1 0 0 -1 3 0 0 0 1\n"
            .into(),
        "c.txt\n0.1 1 2 3 0 0 0 1\n0.2 1 2 3 0 0 1 0\n0.3, 0, 0, 0, 1, 0, 0, 0\n".into(),
    ]
    .map(String::into_bytes)
    .into()
}

/// `rgbd.toml`, and the matrix that it may name as text.
pub(super) fn rgbd_layout(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let (layout, matrix) = text.split_once(BETWEEN).unwrap_or((&text, ""));
    with_files(&RGBD, &[(RgbdSubject::LAYOUT_FILE, layout), ("matrix.txt", matrix)], is_read)
}

pub(super) fn rgbd_layout_seeds() -> Vec<Vec<u8>> {
    let matrix = "6 0 3\n0 6 2\n0 0 1\n";
    let of_file = LAYOUT.replace("{ fx = 6, fy = 6, cx = 3, cy = 2 }", "'matrix.txt'").replace("'metres'", "0.001");
    [LAYOUT, &of_file].map(|layout| [layout, "cameras = 'poses.txt'\n", BETWEEN, matrix].concat().into_bytes()).into()
}

const CAMERA_FILES: [&str; 3] = ["c.json", "c.toml", "c.txt"];

/// Ends in its sequence.
const LAYOUT: &str = "gender = 'neutral'\nbetas = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\ndepth_unit = 'metres'\n\
    pixel_origin = 'corner'\nintrinsics = { fx = 6, fy = 6, cx = 3, cy = 2 }\n[[sequence]]\nsplit = 'train'\nfolder = 'take'\n\
    colour = 'colour'\ndepth = 'depth'\nbodies = 'bodies.npz'\n";

/// Whether `read` succeeds on a thread's folder with these files in it.
fn with_files(
    folder: &'static std::thread::LocalKey<Option<TempDir>>,
    files: &[(&str, &str)],
    read: impl Fn(&Path) -> bool,
) -> bool {
    folder.with(|folder| {
        let Some(folder) = folder.as_ref().map(TempDir::path) else { return false };
        let write = |(name, text): &(&str, &str)| {
            let path = folder.join(name);
            // A file that is cut to nothing and written again waits for the disk on some file systems.
            let _ = std::fs::remove_file(&path);
            std::fs::write(path, text).is_ok()
        };
        files.iter().all(write) && read(folder)
    })
}

fn made(fill: fn(&Path) -> io::Result<()>) -> io::Result<TempDir> {
    let folder = tempfile::tempdir()?;
    fill(folder.path())?;
    Ok(folder)
}

/// A scan and its registration.
fn scans(folder: &Path) -> io::Result<()> {
    std::fs::create_dir_all(folder.join("take"))?;
    std::fs::write(folder.join("take/anna_1.ply"), "")?;
    std::fs::write(folder.join("take/anna_1_smplx.pkl"), REGISTRATION)
}

/// Pictures and bodies of one take.
fn rgbd(folder: &Path) -> io::Result<()> {
    let take = folder.join("take");
    std::fs::create_dir_all(take.join("colour"))?;
    std::fs::create_dir_all(take.join("depth"))?;
    std::fs::write(take.join("bodies.npz"), MOTION)?;
    std::fs::write(take.join("poses.txt"), "1 0 0 0 0 -1 0 1 0 0 -1 3\n".repeat(FRAMES))?;
    let depth = ImageBuffer::<Luma<u16>, _>::from_pixel(6, 4, Luma([2]));
    for number in 0..FRAMES {
        let file = format!("{number}.png");
        RgbImage::new(6, 4).save(take.join("colour").join(&file)).map_err(io::Error::other)?;
        depth.save(take.join("depth").join(&file)).map_err(io::Error::other)?;
    }
    Ok(())
}

/// Opens the subject, and reads a frame of it.
fn is_read(folder: &Path) -> bool {
    RgbdSubject::open(folder).is_ok_and(|subject| subject.training_frames().picture(0).is_ok())
}

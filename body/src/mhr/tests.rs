//! MHR's file in miniature, made here: a cube of flesh around each joint that SMPL-X has, in a pose between A and T, and a TorchScript archive.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;
use xavatar_formats::{Array, Error, write_npz};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::{BodyModel, Gender, PartLabels};

/// Coefficients of identity and of expression, and parameters of pose and scale.
const IDENTITY: usize = 12;
const EXPRESSIONS: usize = 11;
const PARAMETERS: usize = 204;
/// The first of the scales.
const SCALES: usize = 136;
/// Hidden units of the correctives.
const HIDDEN: usize = 4;
/// Half a cube of flesh, centimetres.
const FLESH: f64 = 1.5;

type Tensors = BTreeMap<String, (Vec<usize>, Vec<f64>)>;

/// Where SMPL-X's joint is in the pose that the body is made in, centimetres.
fn place(joint: &str) -> DVec3 {
    let (side, name) = joint.split_once('_').unwrap_or(("", joint));
    let sign = if side == "right" { -1.0 } else { 1.0 };
    let on_side = |x: f64, y: f64, z: f64| DVec3::new(sign * x, y, z);
    let fingers = ["thumb", "index", "middle", "ring", "pinky"];
    if let Some(finger) = fingers.iter().position(|finger| name.starts_with(finger)) {
        let along = f64::from(name.as_bytes()[name.len() - 1] - b'1');
        let across = if finger == 0 { 4.0 } else { 3.5 - 2.0 * finger as f64 };
        return on_side(58.0 + 2.0 * along, 88.0 - 2.5 * along - if finger == 0 { 0.0 } else { 4.0 }, across);
    }
    match name {
        "hip" => on_side(9.0, 92.0, 0.0),
        "knee" => on_side(12.0, 52.0, 1.0),
        "ankle" => on_side(14.0, 9.0, -2.0),
        "foot" => on_side(15.0, 2.0, 10.0),
        "collar" => on_side(3.0, 145.0, 0.0),
        "shoulder" => on_side(17.0, 143.0, -1.0),
        "elbow" => on_side(36.0, 120.0, -2.0),
        "wrist" => on_side(53.0, 97.0, 0.0),
        "eye" => on_side(3.0, 166.0, 9.0),
        "pelvis" => DVec3::new(0.0, 95.0, 0.0),
        "spine1" => DVec3::new(0.0, 105.0, 0.0),
        "spine2" => DVec3::new(0.0, 118.0, 0.0),
        "spine3" => DVec3::new(0.0, 130.0, 0.0),
        "neck" => DVec3::new(0.0, 150.0, 0.0),
        "head" => DVec3::new(0.0, 158.0, 2.0),
        "jaw" => DVec3::new(0.0, 160.0, 4.0),
        other => panic!("{other}"),
    }
}

/// The tensors of the file.
fn tensors() -> Tensors {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let skeleton = smplx::skeleton();
    let map = joints::map();
    let count = map.names.len();
    let mut number = |spread: f64| spread * random.random_range(-1.0..1.0);
    let (mut parents, mut places, mut turns) = (Vec::new(), Vec::new(), Vec::<DQuat>::new());
    let (mut offsets, mut prerotations) = (Vec::new(), Vec::new());
    let mut inverse_bind = Vec::new();
    for joint in 0..count {
        let becomes = map.becomes[joint];
        let above = |joint: usize| skeleton.parents[joint].map(|parent| map.at[parent]);
        let parent = if map.at[becomes] < joint { Some(map.at[becomes]) } else { above(becomes) };
        let parent = parent.or((joint == 1).then_some(0));
        let is_tip = map.names[joint].ends_with("_null") && map.becomes[joint] > smplx::joint::RIGHT_EYE;
        let tip = if is_tip {
            DVec3::new(skeleton.joints[becomes].starts_with("left").into(), -1.2, 0.0)
        } else {
            DVec3::ZERO
        };
        let own = place(&skeleton.joints[becomes]) + tip;
        let turn = DQuat::from_scaled_axis(DVec3::new(number(0.5), number(0.5), number(0.5)));
        let (from, parent_turn) =
            parent.map_or((DVec3::ZERO, DQuat::IDENTITY), |parent: usize| (places[parent], turns[parent]));
        offsets.extend((parent_turn.inverse() * (own - from)).to_array());
        prerotations.extend((parent_turn.inverse() * turn).to_array());
        inverse_bind.extend((turn.inverse() * -own).to_array());
        inverse_bind.extend(turn.inverse().to_array());
        inverse_bind.push(1.0);
        parents.push(parent.map_or(-1.0, |parent| parent as f64));
        places.push(own);
        turns.push(turn);
    }
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let (mut of_vertex, mut of_joint) = (Vec::new(), Vec::new());
    for at in &map.at {
        let first = vertices.len();
        for corner in 0..8 {
            let sign = |bit: usize| if corner >> bit & 1 == 1 { FLESH } else { -FLESH };
            of_vertex.push((vertices.len()) as f64);
            of_joint.push(*at as f64);
            vertices.push(places[*at] + DVec3::new(sign(0), sign(1), sign(2)));
        }
        for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            faces.extend([a, b, c, a, c, d].map(|corner: usize| (first + corner) as f64));
        }
    }
    let mut transform = vec![0.0; 7 * count * (PARAMETERS + IDENTITY)];
    let mut put = |parameter: usize, joint: usize, at: usize| {
        transform[(7 * joint + at) * (PARAMETERS + IDENTITY) + parameter] = 1.0
    };
    for (index, joint) in map.at.iter().take(43).enumerate() {
        (0..3).for_each(|axis| put(3 + 3 * index + axis, *joint, 3 + axis));
    }
    (0..3).for_each(|axis| put(axis, 1, axis));
    put(SCALES, 1, 6);
    put(SCALES + 1, map.joint("l_lowarm").unwrap(), 6);
    let count_of = vertices.len();
    let mut offsets_of =
        |directions: usize, spread: f64| (0..directions * 3 * count_of).map(|_| number(spread)).collect::<Vec<f64>>();
    let (identity, expressions, second) =
        (offsets_of(IDENTITY, 0.3), offsets_of(EXPRESSIONS, 0.1), vec![0.0; 3 * count_of * HIDDEN]);
    let flat = |values: &[DVec3]| values.iter().flat_map(DVec3::to_array).collect::<Vec<f64>>();
    let elbow = map.joint("l_lowarm").unwrap();
    // A unit hears how the left elbow turns, in two entries; the others hear other joints.
    let features: Vec<f64> =
        [6 * (elbow - 2) + 1, 6 * (elbow - 2) + 3, 0, 6, 12].map(|feature| feature as f64).to_vec();
    let units = vec![0.0, 0.0, 1.0, 2.0, 3.0];
    let (skin, poses) = ("character_torch.linear_blend_skinning", "pose_correctives_model.pose_dirs_predictor");
    [
        ("character_torch.blend_shape.base_shape".to_owned(), vec![count_of, 3], flat(&vertices)),
        ("character_torch.blend_shape.shape_vectors".to_owned(), vec![IDENTITY, count_of, 3], identity),
        ("face_expressions_model.shape_vectors".to_owned(), vec![EXPRESSIONS, count_of, 3], expressions),
        ("character_torch.mesh.faces".to_owned(), vec![faces.len() / 3, 3], faces),
        ("character_torch.skeleton.joint_parents".to_owned(), vec![count], parents),
        ("character_torch.skeleton.joint_translation_offsets".to_owned(), vec![count, 3], offsets),
        ("character_torch.skeleton.joint_prerotations".to_owned(), vec![count, 4], prerotations),
        (
            "character_torch.parameter_transform.parameter_transform".to_owned(),
            vec![7 * count, PARAMETERS + IDENTITY],
            transform,
        ),
        (format!("{skin}.inverse_bind_pose"), vec![count, 8], inverse_bind),
        (format!("{skin}.skin_weights_flattened"), vec![of_joint.len()], vec![1.0; of_joint.len()]),
        (format!("{skin}.skin_indices_flattened"), vec![of_joint.len()], of_joint),
        (format!("{skin}.vert_indices_flattened"), vec![of_vertex.len()], of_vertex),
        (format!("{poses}.0.sparse_indices"), vec![2, 5], [units, features].concat()),
        (format!("{poses}.0.sparse_weight"), vec![5], vec![1.0; 5]),
        (format!("{poses}.2.weight"), vec![3 * count_of, HIDDEN], second),
    ]
    .into_iter()
    .map(|(name, shape, values)| (name, (shape, values)))
    .collect()
}

/// The file as TorchScript writes it: modules in modules, tensors of doubles, and code that is packed.
fn archive(tensors: &Tensors) -> Vec<u8> {
    fn text(pickle: &mut Vec<u8>, text: &str) {
        pickle.push(b'X');
        pickle.extend((text.len() as u32).to_le_bytes());
        pickle.extend(text.as_bytes());
    }
    fn number(pickle: &mut Vec<u8>, number: usize) {
        pickle.push(b'J');
        pickle.extend((number as i32).to_le_bytes());
    }
    fn tensor(pickle: &mut Vec<u8>, shape: &[usize], key: usize) {
        pickle.extend(b"ctorch._utils\n_rebuild_tensor_v2\n((");
        text(pickle, "storage");
        pickle.extend(b"ctorch\nDoubleStorage\n");
        text(pickle, &key.to_string());
        text(pickle, "cpu");
        number(pickle, shape.iter().product());
        pickle.extend(b"tQ");
        number(pickle, 0);
        pickle.push(b'(');
        shape.iter().for_each(|extent| number(pickle, *extent));
        pickle.extend(b"t(");
        (1..=shape.len()).for_each(|axis| number(pickle, shape[axis..].iter().product()));
        pickle.extend(b"t\x89ccollections\nOrderedDict\n)RtR");
    }
    fn module<'a>(pickle: &mut Vec<u8>, entries: &[(&'a str, &'a [usize], usize)]) {
        pickle.extend(b"c__torch__.mhr.___torch_mangle_3\nModule\n)\x81}(");
        text(pickle, "training");
        pickle.push(0x89);
        text(pickle, "fronts");
        pickle.extend(b"ctorch.jit._pickle\nbuild_intlist\n(](K\x01K\x02etR");
        let mut rest = entries;
        while let Some((name, shape, key)) = rest.first() {
            match name.split_once('.') {
                None => {
                    text(pickle, name);
                    tensor(pickle, shape, *key);
                    rest = &rest[1..];
                }
                Some((own, _)) => {
                    let same = rest.iter().take_while(|(name, ..)| name.split('.').next() == Some(own)).count();
                    let inner: Vec<_> =
                        rest[..same].iter().map(|(name, shape, key)| (&name[own.len() + 1..], *shape, *key)).collect();
                    text(pickle, own);
                    module(pickle, &inner);
                    rest = &rest[same..];
                }
            }
        }
        pickle.extend(b"ub");
    }
    let mut pickle = b"\x80\x02".to_vec();
    let entries: Vec<(&str, &[usize], usize)> =
        tensors.iter().enumerate().map(|(key, (name, (shape, _)))| (name.as_str(), shape.as_slice(), key)).collect();
    module(&mut pickle, &entries);
    pickle.push(b'.');
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut add = |name: &str, bytes: &[u8], options: SimpleFileOptions| {
        zip.start_file(format!("mhr_model/{name}"), options).unwrap();
        zip.write_all(bytes).unwrap();
    };
    add("data.pkl", &pickle, stored);
    add(
        "code/__torch__/mhr.py",
        b"class Module(Module):\n  pass\n",
        stored.compression_method(CompressionMethod::Deflated),
    );
    for (key, (_, values)) in tensors.values().enumerate() {
        add(&format!("data/{key}"), &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>(), stored);
    }
    zip.finish().unwrap().into_inner()
}

fn written(folder: &TempDir, tensors: &Tensors) -> PathBuf {
    let path = folder.path().join("mhr_model.pt");
    File::create(&path).unwrap().write_all(&archive(tensors)).unwrap();
    path
}

/// A result of SAM 3D Body: identity, a pose, scales.
fn person(folder: &TempDir) -> (PathBuf, Person) {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let mut parameters: Vec<f64> = (0..SCALES).map(|_| random.random_range(-0.4..0.4)).collect();
    parameters.resize(PARAMETERS, 0.0);
    parameters[..3].copy_from_slice(&[20.0, -5.0, 300.0]);
    parameters[SCALES] = 0.1;
    parameters[SCALES + 1] = -0.2;
    let identity: Vec<f64> = (0..IDENTITY).map(|_| random.random_range(-1.0..1.0)).collect();
    let row = |values: &[f64]| Array::from_f32(&[1, values.len()], values.iter().map(|value| *value as f32).collect());
    let arrays = [("shape_params".to_owned(), row(&identity)), ("mhr_model_params".to_owned(), row(&parameters))];
    let path = folder.path().join("person.npz");
    write_npz(&path, &arrays.into_iter().collect()).unwrap();
    (path, Person { identity, parameters })
}

fn loaded(folder: &TempDir, imported: &Imported) -> BodyModel {
    let path = folder.path().join("mhr.npz");
    write_npz(&path, &imported.model).unwrap();
    BodyModel::load(&path, Gender::Neutral).unwrap()
}

#[test]
fn the_body_is_one_of_smplx_in_the_t_pose() {
    let folder = TempDir::new().unwrap();
    written(&folder, &tensors());
    let imported = import(folder.path(), None).unwrap();
    let model = loaded(&folder, &imported);
    assert_eq!(model.skeleton().family, "SMPL-X");
    assert!(imported.joint_error < 1e-4 && imported.pose.is_none(), "{}", imported.joint_error);
    assert!(imported.kept.iter().all(|kept| (0.8..1.0).contains(kept)), "{:?}", imported.kept);
    let joints = model.pose(&model.skeleton().rest_pose()).unwrap().joints;
    let joint = |name: &str| joints[model.skeleton().joint(name).unwrap()];
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let at = |name: &str| joint(&format!("{side}_{name}"));
        for (from, to) in [("shoulder", "elbow"), ("elbow", "wrist")] {
            assert!(((at(to) - at(from)).normalize().x * sign - 1.0).abs() < 1e-4, "{side} {from}");
        }
        let (leg, fingers) = ((at("ankle") - at("hip")).normalize(), (at("middle3") - at("middle1")).normalize());
        assert!(leg.y < -0.99 && fingers.x * sign > 0.97, "{leg} {fingers}");
        // Palms down: the thumb's side is before.
        assert!(at("index1").z > at("pinky1").z && (at("index1").y - at("pinky1").y).abs() < 0.01);
    }
    let labels = PartLabels::from_vertex_labels(
        Path::new("labels.pkl"),
        &imported.labels,
        model.skeleton(),
        model.vertex_count(),
    );
    assert!(
        labels.is_ok_and(|labels| labels.parts.iter().any(|part| model.skeleton().role(*part) == crate::Role::Hands))
    );
}

// SMPL-X's posing of the imported body is MHR's own of its parameters, where each joint between SMPL-X's is rigid.
#[test]
fn a_person_of_sam_3d_body_is_posed_as_mhr_poses_it() {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, &tensors());
    let (result, person) = person(&folder);
    let imported = import(&path, Some(&result)).unwrap();
    let model = loaded(&folder, &imported);
    let pose = imported.pose.clone().unwrap();
    let pose = Pose { shape: vec![0.0; 10], expression: vec![0.0; 10], ..pose };
    let posed = model.pose(&pose).unwrap().vertices;

    let body = Body::read(&path).unwrap();
    let mut shaped = body.vertices.clone();
    for (share, offsets) in person.identity.iter().zip(&body.identity) {
        shaped.iter_mut().zip(offsets).for_each(|(vertex, offset)| *vertex += *offset * *share);
    }
    let own = body.rig.skinned(&body.rig.posed(&person.parameters), &shaped);
    for (index, (own, posed)) in own.iter().zip(&posed).enumerate() {
        let distance = (own.0 * METRES).as_vec3().distance(*posed);
        assert!(distance < 2e-3, "{distance} at {index}: {} {posed}", own.0 * METRES);
    }
}

#[test]
fn correctives_are_those_of_the_network_as_far_as_they_are_linear() {
    let folder = TempDir::new().unwrap();
    let mut tensors = tensors();
    let second = &mut tensors.get_mut("pose_correctives_model.pose_dirs_predictor.2.weight").unwrap().1;
    // The first vertex goes up by the first unit.
    second[HIDDEN] = 1.0;
    let imported = import(&written(&folder, &tensors), None).unwrap();
    let [whole, left] = imported.correctives;
    assert!(whole > 0.0 && left > 0.0 && left < 0.8 * whole, "{whole} {left}");
    let none = import(&written(&folder, &self::tensors()), None).unwrap();
    assert_eq!(none.correctives, [0.0, 0.0]);
}

#[test]
fn the_joints_own_turns_are_what_the_parameters_say() {
    let folder = TempDir::new().unwrap();
    let rig = Body::read(&written(&folder, &tensors())).unwrap().rig;
    let made = rig.posed(&[]);
    let identity = vec![DQuat::IDENTITY; smplx::joint::COUNT];
    for turn in rig.own_turns(&made, &identity) {
        assert!(turn.angle_between(DQuat::IDENTITY) < 1e-7, "{turn}");
    }
}

#[test]
fn what_is_wrong_is_named() {
    let folder = TempDir::new().unwrap();
    assert!(matches!(import(&folder.path().join("none"), None), Err(Error::Missing { .. })));
    let message = |change: &dyn Fn(&mut Tensors)| {
        let mut tensors = tensors();
        change(&mut tensors);
        import(&written(&folder, &tensors), None).unwrap_err().to_string()
    };
    let skeleton = "character_torch.skeleton.joint_parents";
    assert!(message(&|tensors| drop(tensors.remove(skeleton))).contains("joint_parents`: nothing of this name"));
    assert!(message(&|tensors| tensors.get_mut(skeleton).unwrap().1[3] = 9.0).contains("9 as the parent of joint 3"));
    let bind = "character_torch.linear_blend_skinning.inverse_bind_pose";
    assert!(message(&|tensors| tensors.get_mut(bind).unwrap().1[3..7].fill(0.0)).contains("joint 0"));
    let weights = "character_torch.linear_blend_skinning.skin_weights_flattened";
    assert!(message(&|tensors| tensors.get_mut(weights).unwrap().1[0] = f64::NAN).contains("skin_weights"));
    assert!(message(&|tensors| tensors.get_mut(weights).unwrap().1[0] = 0.0).contains("vertex 0"));
    let sparse = "pose_correctives_model.pose_dirs_predictor.0.sparse_indices";
    assert!(message(&|tensors| tensors.get_mut(sparse).unwrap().1[0] = 700.0).contains("sparse_indices"));
    let path = written(&folder, &tensors());
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert!(import(&path, None).is_err());
    written(&folder, &tensors());
    let wrong = import(&path, Some(Path::new("nobody.npz")));
    assert!(wrong.unwrap_err().to_string().contains("nobody.npz"));
}

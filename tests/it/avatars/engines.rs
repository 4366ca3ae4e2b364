//! Rigs as engines expect them move as they did before.

use std::collections::HashMap;

use glam::Vec3;
use tempfile::TempDir;
use xavatar::export::{BoneAxis, Engine, RiggedMesh, write_glb, write_usda, write_usdz};

use super::export::{RATE, RIGGING, avatar, take};
use super::untrained::subject;

fn rig() -> RiggedMesh {
    let frames = take(3);
    RIGGING.rig(&avatar(true), Some(subject().model()), &frames, RATE, |_, _| {}).unwrap().0
}

fn farthest(a: &[Vec3], b: &[Vec3]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn turned_joints_move_nothing_and_bones_lie_along_limbs() {
    let upright = rig();
    for (engine, axis) in [
        (Engine::Blender, Some(Vec3::Y)),
        (Engine::Unity, None),
        (Engine::Unreal, Some(Vec3::X)),
        (Engine::Godot, None),
    ] {
        let turned = upright.clone().for_engine(engine);
        for frame in 0..3 {
            let distance = farthest(&turned.posed(frame), &upright.posed(frame));
            assert!(distance < 2e-5, "{engine:?}, frame {frame}: {distance} m");
        }
        assert_eq!(engine.bone_axis().is_some(), axis.is_some());
        let Some(axis) = axis else {
            assert_eq!(turned.joints, upright.joints);
            continue;
        };
        let knee = turned.joints.iter().position(|joint| joint.name == "left_knee").unwrap();
        let ankle = turned.joints.iter().find(|joint| joint.name == "left_ankle").unwrap();
        assert_eq!(ankle.parent, Some(knee));
        assert!(ankle.translation.normalize().distance(axis) < 1e-5, "{engine:?}: {}", ankle.translation);
    }
    assert_eq!([Engine::Blender, Engine::Unreal].map(Engine::bone_axis), [Some(BoneAxis::Y), Some(BoneAxis::X)]);
}

#[test]
fn a_root_is_above_the_skeleton_in_the_file() {
    let folder = TempDir::new().unwrap();
    for (engine, root) in [(Engine::Unreal, Some("root")), (Engine::Unity, Some("Armature")), (Engine::Godot, None)] {
        let path = folder.path().join(format!("{engine:?}.glb"));
        write_glb(&path, &rig().for_engine(engine)).unwrap();
        let document = gltf::Gltf::open(path).unwrap();
        let tops: Vec<_> = document.scenes().next().unwrap().nodes().collect();
        let top = tops.iter().find(|node| node.mesh().is_none()).unwrap();
        assert_eq!(top.name(), root.or(Some("pelvis")));
        if root.is_some() {
            assert_eq!(top.children().map(|child| child.name().unwrap()).collect::<Vec<_>>(), ["pelvis"]);
        }
        assert_eq!(document.skins().next().unwrap().joints().count(), 55);
    }
}

#[test]
fn fewer_faces_keep_the_weights_and_morphs_of_their_vertices() {
    let whole = rig();
    let wanted = whole.mesh.faces.len() / 4;
    let (fewer, cost) = whole.clone().with_fewer_faces(wanted).unwrap();
    assert!(fewer.mesh.faces.len() <= wanted && cost.before == whole.mesh.faces.len());
    assert!(cost.mean_mm > 0.0 && cost.mean_mm < cost.max_mm && cost.max_mm < 60.0, "{cost}");
    let key = |vertex: &Vec3| vertex.to_array().map(f32::to_bits);
    let places: HashMap<_, usize> = whole.mesh.vertices.iter().map(key).zip(0..).collect();
    let row = |rigged: &RiggedMesh, vertex: usize| {
        let range = vertex * rigged.influences..(vertex + 1) * rigged.influences;
        (rigged.skin_joints[range.clone()].to_vec(), rigged.skin_weights[range].to_vec())
    };
    for (vertex, place) in fewer.mesh.vertices.iter().enumerate() {
        let source = places[&key(place)];
        assert_eq!(row(&fewer, vertex), row(&whole, source));
        for (few, all) in fewer.morphs.iter().zip(&whole.morphs) {
            assert_eq!(few.offsets[vertex], all.offsets[source]);
        }
    }
}

// What is in it is for OpenUSD to say: scripts/usd-exports.sh.
#[test]
fn a_package_holds_its_files_as_they_are_where_they_may_be_read() {
    let folder = TempDir::new().unwrap();
    let (package, text) = (folder.path().join("avatar.usdz"), folder.path().join("avatar.usda"));
    let (rigged, _) = rig().with_texture(&avatar(true), 256, |_, _| {}).unwrap();
    write_usdz(&package, &rigged).unwrap();
    write_usda(&text, &rigged).unwrap();
    let bytes = std::fs::read(&package).unwrap();
    let scene = std::fs::read_to_string(&text).unwrap();
    assert!(scene.starts_with("#usda 1.0\n") && scene.contains("@avatar.png@"));
    // Local headers: signature, no compression at offset 8, lengths of name and extra field at 26 and 28.
    let heads: Vec<usize> = (0..bytes.len() - 4).filter(|at| bytes[*at..].starts_with(b"PK\x03\x04")).collect();
    assert_eq!(heads.len(), 2);
    let short = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    for (head, content) in
        heads.into_iter().zip([scene.into_bytes(), std::fs::read(text.with_extension("png")).unwrap()])
    {
        let begin = head + 30 + short(head + 26) + short(head + 28);
        assert_eq!((short(head + 8), begin % 64), (0, 0));
        assert!(bytes[begin..].starts_with(&content));
    }
}

//! Exported files, read back by another reader and posed by their own arrays, against the avatar's exact motion.

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use gltf::animation::util::ReadOutputs;
use tempfile::TempDir;
use xavatar::avatar::{Avatar, FixedTopology, Subject};
use xavatar::body::{BodyModel, FaceUnits, Gender, Pose, PoseAxisAngle, smplx};
use xavatar::config::{SkinningSettings, VoxelShape};
use xavatar::export::{RiggedMesh, Rigging, bake_texture, ground_mesh, ground_motion, write_glb};
use xavatar::fields::{CanonicalGrid, Fields, Skinning};
use xavatar::mesh::{Colouring, ReadMesh, read_mesh, write_obj, write_ply};
use xavatar::synthetic::Split;
use xavatar_network::Trace;

use super::untrained::{small_networks, subject};

pub(super) const RIGGING: Rigging = Rigging { resolution: 40, influences: 8, correctives: 40 };
pub(super) const RATE: f32 = 25.0;

/// Geometry and colour that nothing was trained of: a ball. `grid`: skinned as the body is, with its offsets; else by chance.
pub(super) fn avatar(grid: bool) -> Avatar {
    let mut config = small_networks();
    let (body, betas) = (subject().model(), subject().betas());
    // Larger than the ball, so that its surface is not cut off, even where a test makes it uneven.
    let bounds = (Vec3::splat(-1.6), Vec3::splat(1.6));
    let skinning = if grid {
        let shape = VoxelShape { spacing: 0.1, fine_spacing: 0.05 };
        config.fields.skinning = SkinningSettings::Voxels(shape);
        let grid = CanonicalGrid::new(body, subject().part_labels(), betas, shape).unwrap();
        Skinning::grid(grid.skinning(body, &grid.body_rows(body)).unwrap(), Vec::new())
    } else {
        let SkinningSettings::Network(shape) = &config.fields.skinning else { unreachable!("a paper preset") };
        Skinning::network(shape, smplx::skeleton()).unwrap()
    };
    let subject = Subject::of(body, Gender::Neutral, betas, bounds, 0).unwrap();
    let mut fields = Fields::new(&config.fields, &subject.condition(), skinning, bounds).unwrap();
    fields.initialise(5);
    Avatar { fields, config, subject, steps: 0 }
}

pub(super) fn take(frames: usize) -> Vec<Pose> {
    let pose = |frame| subject().model().resolve(&subject().parameters(Split::Test, frame, frames).unwrap().into());
    (0..frames).map(|frame| pose(frame).unwrap()).collect()
}

/// What is in a GLB, as another program reads it.
struct Glb {
    document: gltf::Gltf,
}

/// A frame of a GLB's animation.
struct NodePose {
    /// Translation and rotation by node.
    turns: HashMap<usize, (DVec3, DQuat)>,
    weights: Vec<f32>,
}

impl Glb {
    fn of(rigged: &RiggedMesh) -> Self {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("avatar.glb");
        write_glb(&path, rigged).unwrap();
        Self { document: gltf::Gltf::open(path).unwrap() }
    }

    fn data<'a>(&'a self) -> impl Clone + Fn(gltf::Buffer<'_>) -> Option<&'a [u8]> {
        |_| self.document.blob.as_deref()
    }

    fn primitive(&self) -> gltf::Primitive<'_> {
        self.document.meshes().next().unwrap().primitives().next().unwrap()
    }

    fn positions(&self) -> Vec<DVec3> {
        let primitive = self.primitive();
        primitive.reader(self.data()).read_positions().unwrap().map(|p| Vec3::from(p).as_dvec3()).collect()
    }

    /// (M, V).
    fn morphs(&self) -> Vec<Vec<DVec3>> {
        let primitive = self.primitive();
        let reader = primitive.reader(self.data());
        let target = |(positions, ..): (Option<gltf::accessor::Iter<[f32; 3]>>, _, _)| {
            positions.unwrap().map(|p| Vec3::from(p).as_dvec3()).collect()
        };
        reader.read_morph_targets().map(target).collect()
    }

    fn target_names(&self) -> Vec<String> {
        let mesh = self.document.meshes().next().unwrap();
        let extras: serde_json::Value = serde_json::from_str(mesh.extras().as_ref().unwrap().get()).unwrap();
        serde_json::from_value(extras["targetNames"].clone()).unwrap()
    }

    /// The joints and weights of each vertex, all sets together.
    fn influences(&self) -> Vec<Vec<(usize, f64)>> {
        let primitive = self.primitive();
        let reader = primitive.reader(self.data());
        let mut rows = vec![Vec::new(); self.positions().len()];
        for set in 0.. {
            let (Some(joints), Some(weights)) = (reader.read_joints(set), reader.read_weights(set)) else { break };
            for ((row, joints), weights) in rows.iter_mut().zip(joints.into_u16()).zip(weights.into_f32()) {
                row.extend(joints.into_iter().map(usize::from).zip(weights.map(f64::from)));
            }
        }
        rows
    }

    /// The pose of the nodes themselves, and that of each frame of the animation.
    fn poses(&self) -> (NodePose, Vec<NodePose>) {
        let turn = |node: gltf::Node| {
            let (translation, [x, y, z, w], _) = node.transform().decomposed();
            (node.index(), (Vec3::from(translation).as_dvec3(), Quat::from_xyzw(x, y, z, w).as_dquat()))
        };
        let rest = || NodePose { turns: self.document.nodes().map(turn).collect(), weights: Vec::new() };
        let mut frames: Vec<NodePose> = Vec::new();
        for channel in self.document.animations().next().unwrap().channels() {
            let node = channel.target().node().index();
            let reader = channel.reader(self.data());
            let count = reader.read_inputs().unwrap().count();
            frames.resize_with(count, rest);
            match reader.read_outputs().unwrap() {
                ReadOutputs::Translations(values) => {
                    for (frame, value) in frames.iter_mut().zip(values) {
                        frame.turns.get_mut(&node).unwrap().0 = Vec3::from(value).as_dvec3();
                    }
                }
                ReadOutputs::Rotations(values) => {
                    for (frame, value) in frames.iter_mut().zip(values.into_f32()) {
                        frame.turns.get_mut(&node).unwrap().1 = Quat::from_array(value).as_dquat();
                    }
                }
                ReadOutputs::MorphTargetWeights(values) => {
                    let values: Vec<f32> = values.into_f32().collect();
                    let weights = values.chunks(values.len() / count);
                    frames.iter_mut().zip(weights).for_each(|(frame, weights)| frame.weights = weights.to_vec());
                }
                ReadOutputs::Scales(_) => panic!("nothing is scaled"),
            }
        }
        (rest(), frames)
    }

    /// Where joints are, in the world (J).
    fn joint_transforms(&self, pose: &NodePose) -> Vec<DMat4> {
        fn visit(node: gltf::Node, above: DMat4, pose: &NodePose, placed: &mut HashMap<usize, DMat4>) {
            let (translation, rotation) = pose.turns[&node.index()];
            let here = above * DMat4::from_rotation_translation(rotation, translation);
            placed.insert(node.index(), here);
            node.children().for_each(|child| visit(child, here, pose, placed));
        }
        let mut placed = HashMap::new();
        let scene = self.document.default_scene().unwrap();
        scene.nodes().for_each(|node| visit(node, DMat4::IDENTITY, pose, &mut placed));
        let skin = self.document.skins().next().unwrap();
        skin.joints().map(|joint| placed[&joint.index()]).collect()
    }

    fn skinning_transforms(&self, pose: &NodePose) -> Vec<DMat4> {
        let skin = self.document.skins().next().unwrap();
        let inverse_bind = skin.reader(self.data()).read_inverse_bind_matrices().unwrap();
        let joints = self.joint_transforms(pose);
        joints.iter().zip(inverse_bind).map(|(j, bind)| *j * glam::Mat4::from_cols_array_2d(&bind).as_dmat4()).collect()
    }

    /// The vertices of every frame, by the specification's formula.
    fn animated(&self) -> Vec<Vec<DVec3>> {
        let (positions, morphs, influences) = (self.positions(), self.morphs(), self.influences());
        let vertices = |pose: &NodePose| {
            let transforms = self.skinning_transforms(pose);
            let vertex = |index: usize| {
                let morphed = morphs.iter().zip(&pose.weights).map(|(morph, weight)| morph[index] * f64::from(*weight));
                let point = positions[index] + morphed.sum::<DVec3>();
                let held = influences[index].iter().filter(|(_, weight)| *weight != 0.0);
                held.map(|(joint, weight)| transforms[*joint].transform_point3(point) * *weight).sum()
            };
            (0..positions.len()).map(vertex).collect()
        };
        self.poses().1.iter().map(vertices).collect()
    }
}

fn farthest<'a>(vertices: &[DVec3], exact: impl IntoIterator<Item = &'a Vec3>) -> f64 {
    vertices.iter().zip(exact).map(|(vertex, exact)| vertex.distance(exact.as_dvec3())).fold(0.0, f64::max)
}

// sum_k w_k (G_k InvBind_k)(p + morphs), all from the file, is the mesh that `animate --fixed-topology` writes
#[test]
fn the_files_own_skinning_is_the_fixed_topology() {
    let (avatar, frames) = (avatar(true), take(12));
    let fixed = FixedTopology::new(&avatar, subject().model(), RIGGING.resolution).unwrap();
    for influences in [4, 8] {
        let rigging = Rigging { influences, ..RIGGING };
        let (rigged, report) = rigging.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
        assert!(report.uncorrected.max > 1e-3, "nothing to correct: {report:?}");
        let animated = Glb::of(&rigged).animated();
        assert_eq!(animated.len(), frames.len());
        let mut worst = 0.0_f64;
        for (index, (vertices, parameters)) in animated.iter().zip(&frames).enumerate() {
            worst = worst.max(farthest(vertices, &fixed.pose(parameters).unwrap().vertices));
            assert!(farthest(vertices, &rigged.posed(index)) < 1e-5);
        }
        // On this ball vertices hang far from their bones: four influences alone are 10 cm off.
        assert!(worst < 1e-4, "{influences} influences: {worst}");
        assert!((worst - f64::from(report.corrected.max)).abs() < 1e-5, "{worst} is not {report:?}");
    }
}

// Blender clamps weights to [0, 1]; what plays must not change for it
#[test]
fn the_clip_keeps_every_weight_within_the_sliders_of_other_programs() {
    let (avatar, mut frames) = (avatar(true), take(6));
    for (frame, coefficient) in frames.iter_mut().zip([-1.5, 0.0, 0.7, 2.5, 0.2, -0.1]) {
        frame.expression = vec![coefficient, 0.3];
    }
    let (rigged, _) = RIGGING.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    assert!(rigged.animation.morph_weights.iter().any(|weight| *weight < -0.5), "nothing to keep within");
    let glb = Glb::of(&rigged);
    let poses = glb.poses().1;
    assert!(poses.iter().flat_map(|pose| &pose.weights).all(|weight| (0.0..=1.0).contains(weight)));
    for (index, vertices) in glb.animated().iter().enumerate() {
        assert!(farthest(vertices, &rigged.posed(index)) < 1e-5);
    }
    // Expressions stay units of their coefficients; the clip moves a copy of those that leave the range, and the others themselves.
    let names = glb.target_names();
    let place = |name: &str| names.iter().position(|other| other == name);
    let morphs = glb.morphs();
    for (index, moved_by) in [(0, "clip_expression_0"), (1, "expression_1")] {
        assert!(farthest(&morphs[index], &rigged.morphs[index].offsets) < 1e-6);
        assert!(poses.iter().any(|pose| pose.weights[place(moved_by).unwrap()] > 0.0), "{moved_by}");
    }
    assert!(poses.iter().all(|pose| pose.weights[0] == 0.0 && pose.weights[place("clip_constant").unwrap()] == 1.0));
    assert_eq!(place("clip_expression_1"), None);
}

#[test]
fn offsets_that_readers_want_said_are_said() {
    let (avatar, frames) = (avatar(true), take(6));
    let (mut rigged, _) = RIGGING.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    // A ball's expressions move all of it; those of a face do not.
    rigged.morphs[0].offsets[9..].fill(Vec3::ZERO);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("avatar.glb");
    write_glb(&path, &rigged).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let document: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let accessors = document["accessors"].as_array().unwrap();
    let sparse: Vec<_> = accessors.iter().filter_map(|accessor| accessor.get("sparse")).collect();
    assert!(!sparse.is_empty());
    for part in sparse.iter().flat_map(|sparse| [&sparse["indices"], &sparse["values"]]) {
        assert_eq!(part["byteOffset"], 0, "{part}");
    }
}

#[test]
fn what_is_grounded_stands_on_the_floor_and_moves_as_before() {
    let (avatar, mut frames) = (avatar(true), take(5));
    let body = subject().model();
    let before = frames.clone();
    let lift = ground_motion(&avatar, Some(body), &mut frames).unwrap();
    for (moved, pose) in frames.iter().zip(&before) {
        assert!((moved.translation - pose.translation).abs_diff_eq(Vec3::Y * lift, 1e-5), "jumps and steps stay");
    }
    let (mut rigged, _) = RIGGING.rig(&avatar, Some(body), &frames, RATE, |_, _| {}).unwrap();
    let floor = |vertices: &[Vec3]| vertices.iter().map(|vertex| vertex.y).fold(f32::INFINITY, f32::min);
    let posed: Vec<Vec<Vec3>> = (0..frames.len()).map(|frame| rigged.posed(frame)).collect();
    let lowest = posed.iter().map(|vertices| floor(vertices)).fold(f32::INFINITY, f32::min);
    // The motion is grounded by a finer surface than this one.
    assert!(lowest.abs() < 0.02, "{lowest} m");
    rigged.ground_bind_pose();
    assert!(floor(&rigged.mesh.vertices).abs() < 1e-6);
    let glb = Glb::of(&rigged);
    for transform in glb.skinning_transforms(&glb.poses().0) {
        assert!(transform.abs_diff_eq(DMat4::IDENTITY, 1e-5), "nothing moves in the bind pose");
    }
    for (vertices, before) in glb.animated().iter().zip(&posed) {
        assert!(farthest(vertices, before) < 1e-5, "the clip stays where it is");
    }
    let mut mesh = avatar.extract_unconditioned(RIGGING.resolution).unwrap().mesh;
    ground_mesh(&mut mesh);
    assert_eq!(floor(&mesh.vertices), 0.0);
}

#[test]
fn what_is_lost_without_correctives_is_reported() {
    let (avatar, frames) = (avatar(true), take(5));
    let fixed = FixedTopology::new(&avatar, subject().model(), RIGGING.resolution).unwrap();
    let rigging = Rigging { correctives: 0, influences: 4, ..RIGGING };
    let (rigged, report) = rigging.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    assert_eq!((rigged.morphs.len(), report.correctives), (10, 0));
    let animated = Glb::of(&rigged).animated();
    let plain = Rigging { influences: 4, ..RIGGING }.rig_to_look_at(&avatar, Some(subject().model()), &frames, RATE);
    assert!(Glb::of(&plain.unwrap()).animated() == animated, "what is not measured is the same");
    let exact: Vec<_> = frames.iter().map(|parameters| fixed.pose(parameters).unwrap().vertices).collect();
    let worst = animated.iter().zip(&exact).map(|(vertices, exact)| farthest(vertices, exact)).fold(0.0, f64::max);
    assert!((worst - f64::from(report.uncorrected.max)).abs() < 1e-5, "{worst} is not {report:?}");
    assert_eq!(report.uncorrected, report.corrected);
    assert!(report.most_influences > 4 && report.cut_weight_max > 0.0 && report.pruning.max > 0.0);
    // Eight influences cut less.
    let (_, eight) =
        Rigging { influences: 8, ..rigging }.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    assert!(eight.pruning.mean < report.pruning.mean && eight.cut_weight_mean < report.cut_weight_mean);
}

#[test]
fn skeleton_morphs_colours_and_clip_are_in_the_file() {
    let (avatar, frames) = (avatar(true), take(6));
    let (rigged, _) = RIGGING.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    let glb = Glb::of(&rigged);
    let joints: Vec<gltf::Node> = glb.document.skins().next().unwrap().joints().collect();
    assert_eq!(joints.iter().map(|joint| joint.name().unwrap()).collect::<Vec<_>>(), smplx::skeleton().joints);
    for (index, joint) in joints.iter().enumerate() {
        for child in joint.children() {
            let child = joints.iter().position(|joint| joint.index() == child.index()).unwrap();
            assert_eq!(smplx::skeleton().parents[child], Some(index));
        }
    }
    // In the pose of the nodes nothing moves, and joints are where the avatar's are.
    let (rest, poses) = glb.poses();
    for (joint, transform) in glb.skinning_transforms(&rest).iter().enumerate() {
        assert!(transform.abs_diff_eq(DMat4::IDENTITY, 1e-5), "joint {joint}");
    }
    for (placed, joint) in glb.joint_transforms(&rest).iter().zip(&avatar.subject.joints) {
        assert!(placed.w_axis.truncate().distance(joint.as_dvec3()) < 1e-5);
    }
    // A joint's rotation is SMPL-X's own.
    let elbow = frames[3].rotations[18].0.as_dvec3();
    let (_, turn) = poses[3].turns[&joints[18].index()];
    assert!(turn.to_scaled_axis().distance(elbow) < 1e-5);

    let names = glb.target_names();
    assert_eq!(names[9..11], ["expression_9", "corrective_0"]);
    assert_eq!(names.len(), glb.morphs().len());

    let primitive = glb.primitive();
    let reader = primitive.reader(glb.data());
    let Colouring::Vertex(colours) = &rigged.mesh.colouring else { panic!("no colours") };
    for (read, colour) in reader.read_colors(0).unwrap().into_rgba_f32().zip(colours) {
        // Back to sRGB by the inverse of the transfer function, one level of 255 exactly.
        for (linear, srgb) in read.iter().zip(colour) {
            let encoded = if *linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            assert!((encoded * 255.0 - f32::from(*srgb)).abs() < 0.51, "{linear} for {srgb}");
        }
    }
    let times: Vec<f32> = glb
        .document
        .animations()
        .next()
        .unwrap()
        .channels()
        .next()
        .unwrap()
        .reader(glb.data())
        .read_inputs()
        .unwrap()
        .collect();
    assert!(times.iter().enumerate().all(|(frame, time)| (time - frame as f32 / RATE).abs() < 1e-6));
    for (read, index) in reader.read_indices().unwrap().into_u32().zip(rigged.mesh.faces.as_flattened()) {
        assert_eq!(read, *index);
    }
}

// The morph of coefficient k keeps the field's value while the condition goes from none to c_k: f(p + d_k, c_k) = f(p, 0)
#[test]
fn expressions_of_avatars_without_offsets_are_the_fields() {
    let mut avatar = avatar(false);
    // Networks begin deaf to the condition.
    let perturb = |(index, parameter): (usize, &mut f32)| *parameter += 5e-3 * (index as f32 * 0.7).sin();
    avatar.fields.geometry.mlp.update(|parameters| parameters.iter_mut().enumerate().for_each(perturb));
    let (network, condition) = (&avatar.fields.geometry.mlp, avatar.condition());
    let (rigged, _) = Rigging { correctives: 0, ..RIGGING }.rig(&avatar, None, &take(1), RATE, |_, _| {}).unwrap();
    let values = |points: &[Vec3], expression: &[f32]| {
        let rows: Vec<f32> = points.iter().flat_map(Vec3::to_array).collect();
        let mut trace = Trace::default();
        network.forward(&mut trace, &rows, &network.embed(&condition.of_expression(expression)), &[]);
        trace.output().to_vec()
    };
    let vertices = &rigged.mesh.vertices;
    let neutral = values(vertices, &[]);
    let largest = neutral.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    assert!(largest < 0.01, "vertices lie on the surface, not where it is cut off: {largest}");
    let change = |values: Vec<f32>| values.iter().zip(&neutral).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    for (coefficient, morph) in rigged.morphs.iter().enumerate() {
        let mut expression = vec![0.0; coefficient + 1];
        expression[coefficient] = 1.0;
        let moved: Vec<Vec3> = vertices.iter().zip(&morph.offsets).map(|(p, d)| *p + *d).collect();
        let (before, after) = (change(values(vertices, &expression)), change(values(&moved, &expression)));
        assert!(after < 0.02 * before, "{}: {before} to {after}", morph.name);
    }
}

// An avatar whose warp has no offsets needs no body model: the skeleton is in the avatar
#[test]
fn without_a_body_model_the_skeleton_moves_the_avatar_alone() {
    let (avatar, mut frames) = (avatar(false), take(6));
    frames.iter_mut().for_each(|frame| frame.expression.clear());
    let fixed = FixedTopology::new(&avatar, subject().model(), RIGGING.resolution).unwrap();
    let (rigged, report) = Rigging { correctives: 80, ..RIGGING }.rig(&avatar, None, &frames, RATE, |_, _| {}).unwrap();
    assert!(report.most_influences > 8);
    for (vertices, parameters) in Glb::of(&rigged).animated().iter().zip(&frames) {
        let worst = farthest(vertices, &fixed.pose(parameters).unwrap().vertices);
        assert!(worst < 1e-4, "{worst}");
    }
}

#[test]
fn consecutive_rotations_are_on_one_side() {
    let turn = |angle: f32| {
        let mut pose = smplx::skeleton().rest_pose();
        pose.rotations[16] = PoseAxisAngle(Vec3::X * angle);
        pose
    };
    let frames: Vec<_> = (0..40).map(|frame| turn(frame as f32 * 0.3)).collect();
    let (rigged, _) =
        Rigging { correctives: 0, ..RIGGING }.rig(&avatar(false), None, &frames, RATE, |_, _| {}).unwrap();
    let rotations = &rigged.animation.rotations;
    assert!(rotations.windows(2).all(|pair| pair[0].iter().zip(&pair[1]).all(|(a, b)| a.dot(*b) > 0.9)));
}

#[test]
fn what_cannot_be_rigged_is_named() {
    let (avatar, body) = (avatar(true), subject().model());
    let refused = |rigging: Rigging, avatar: &Avatar, body: Option<&BodyModel>, frames: &[Pose], rate: f32| {
        rigging.rig(avatar, body, frames, rate, |_, _| {}).unwrap_err().to_string()
    };
    let message = refused(Rigging { influences: 5, ..RIGGING }, &avatar, Some(body), &take(1), RATE);
    assert!(message.contains("influences is 5, expected 4 or 8"), "{message}");
    let message = refused(RIGGING, &avatar, Some(body), &[], RATE);
    assert!(message.contains("0 frames"), "{message}");
    let message = refused(RIGGING, &avatar, Some(body), &take(1), f32::NAN);
    assert!(message.contains("NaN a second"), "{message}");
    let mut short = take(1);
    short[0].rotations.pop();
    let message = refused(RIGGING, &avatar, None, &short, RATE);
    assert!(message.contains("54 rotations") && message.contains("SMPL-X skeleton (55 joints)"), "{message}");
    let mut other = avatar.clone();
    other.subject.joints[20].x += 0.01;
    let message = refused(RIGGING, &other, Some(body), &take(1), RATE);
    assert!(message.contains("10.0 mm") && message.contains("trained with"), "{message}");
    let mut broken = take(1);
    broken[0].translation.y = f32::INFINITY;
    let message = refused(RIGGING, &avatar, Some(body), &broken, RATE);
    assert!(message.contains("translation is [0, inf, 0]"), "{message}");
    let message = refused(
        RIGGING,
        &avatar,
        None,
        &{
            let mut frames = take(1);
            frames[0].rotations[22].0.x = f32::NAN;
            frames
        },
        RATE,
    );
    assert!(message.contains("NaN"), "{message}");
}

#[test]
fn a_baked_texture_shows_the_fields_colours() {
    let avatar = avatar(true);
    let mesh = avatar.extract_unconditioned(RIGGING.resolution).unwrap().mesh;
    let baked = bake_texture(&avatar, &mesh, 256, |_, _| {}).unwrap();
    assert!(baked.report.psnr > 40.0, "{:?}", baked.report);
    assert_eq!(baked.mesh.faces.len(), mesh.faces.len());
    for (face, source) in baked.mesh.faces.iter().zip(&mesh.faces) {
        assert_eq!(face.map(|vertex| baked.sources[vertex as usize]), *source);
    }
    // The files say the same.
    let folder = TempDir::new().unwrap();
    let (obj, ply) = (folder.path().join("avatar.obj"), folder.path().join("avatar.ply"));
    write_obj(&obj, &baked.mesh).unwrap();
    write_ply(&ply, &baked.mesh).unwrap();
    for path in [obj, ply] {
        let read = read_mesh(&path).unwrap().mesh;
        let (Colouring::Texture { image, .. }, Colouring::Texture { image: written, .. }) =
            (&read.colouring, &baked.mesh.colouring)
        else {
            panic!("no texture")
        };
        assert_eq!((image, read.vertices.len()), (written, baked.mesh.vertices.len()));
    }
    let message = bake_texture(&avatar, &mesh, 16, |_, _| {}).unwrap_err().to_string();
    assert!(message.contains("the texture is"), "{message}");
}

#[test]
fn a_textured_rig_moves_as_the_coloured_one() {
    let (avatar, frames) = (avatar(true), take(3));
    let (coloured, _) = RIGGING.rig(&avatar, Some(subject().model()), &frames, RATE, |_, _| {}).unwrap();
    let (textured, report) = coloured.clone().with_texture(&avatar, 256, |_, _| {}).unwrap();
    let glb = Glb::of(&textured);
    let (before, after) = (Glb::of(&coloured).animated(), glb.animated());
    let faces = coloured.mesh.faces.as_flattened().iter().zip(textured.mesh.faces.as_flattened());
    for (a, b) in faces {
        assert!(before[2][*a as usize].distance(after[2][*b as usize]) < 1e-6);
    }
    let material = glb.primitive().material();
    let texture = material.pbr_metallic_roughness().base_color_texture().unwrap();
    let gltf::image::Source::View { view, mime_type } = texture.texture().source().source() else { panic!("a file") };
    let png = &glb.document.blob.as_ref().unwrap()[view.offset()..view.offset() + view.length()];
    let image = image::load_from_memory(png).unwrap();
    assert_eq!((mime_type, image.width(), image.height()), ("image/png", report.width, report.height));
    let primitive = glb.primitive();
    let reader = primitive.reader(glb.data());
    assert!(reader.read_colors(0).is_none());
    assert!(reader.read_tex_coords(0).unwrap().into_f32().flatten().all(|c| (0.0..=1.0).contains(&c)));
    // Read as meshes, both stand as they were bound, in the same colours.
    for rigged in [coloured, textured] {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("avatar.glb");
        write_glb(&path, &rigged).unwrap();
        let ReadMesh { mesh, notes } = read_mesh(&path).unwrap();
        assert_eq!((notes, &mesh.faces), (vec![], &rigged.mesh.faces));
        let vertices: Vec<DVec3> = mesh.vertices.iter().map(|vertex| vertex.as_dvec3()).collect();
        assert!(farthest(&vertices, &rigged.mesh.vertices) < 1e-5);
        match (&mesh.colouring, &rigged.mesh.colouring) {
            (Colouring::Vertex(read), Colouring::Vertex(written)) => assert_eq!(read, written),
            (Colouring::Texture { uvs, image }, Colouring::Texture { uvs: written, image: picture }) => {
                assert_eq!((uvs, image), (written, picture));
            }
            (read, _) => panic!("{read:?}"),
        }
    }
}

// An action that lifts the whole head, which no expression does: it is carried over from the body's surface.
#[test]
fn facial_actions_are_morphs_that_the_clip_leaves_alone() {
    let (avatar, body) = (avatar(true), subject().model());
    let (rigged, _) = RIGGING.rig(&avatar, Some(body), &take(3), RATE, |_, _| {}).unwrap();
    let (clip, before) = (rigged.animation.morph_weights.clone(), rigged.morphs.len());
    let head = body.skeleton().joint("head").unwrap();
    let joints = body.skeleton().joints.len();
    let lift = |vertex: usize| DVec3::Y * 0.004 * f64::from(body.skinning_weights()[vertex * joints + head]);
    let rest = body.pose(&body.skeleton().rest_pose()).unwrap();
    let units = FaceUnits {
        vertices: body.template().iter().map(|vertex| vertex.as_dvec3()).collect(),
        faces: body.faces().to_vec(),
        joints: body.skeleton().joints.iter().cloned().zip(rest.joints.iter().map(|joint| joint.as_dvec3())).collect(),
        offsets: vec![("browInnerUp".into(), (0..body.vertex_count()).map(lift).collect())],
    };
    let (rigged, report) = rigged.with_face_units(&avatar.subject, body, &units).unwrap();
    let morph = rigged.morphs.last().unwrap();
    assert_eq!((rigged.morphs.len(), morph.name.as_str()), (before + 1, "browInnerUp"));
    for (row, old) in rigged.animation.morph_weights.chunks(before + 1).zip(clip.chunks(before)) {
        assert_eq!((&row[..before], row[before]), (old, 0.0));
    }
    let highest = morph.offsets.iter().map(|offset| offset.y).fold(0.0, f32::max);
    assert!((0.0035..0.0045).contains(&highest), "{highest} m");
    let error = &report.units[0].morph;
    assert!(error.root_mean_square < 0.1 * error.size, "{report}");
}

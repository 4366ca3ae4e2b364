//! The search, its implicit gradient and the baked warp against float64 vectors: a random skinning network, three poses,
//! 24 points per part, Newton's roots from every start.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{DType, Device, Tensor};
use xavatar_deformer::{
    BakedWeights, BoneTransform, Candidates, ExactWarp, Grid, SearchSettings, StartGroups, Warp, deform,
    deform_backward, root_cotangents, search, search_and_polish,
};
use xavatar_network::{Backward, KinematicTree, Real, SkinningField};

const POSES: usize = 3;
const PARTS: [&str; 4] = ["body", "face", "left_hand", "right_hand"];

/// Parents of the SMPL-X skeleton after the root.
const PARENTS: [usize; 54] = [
    0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15, 20, 25, 26, 20, 28, 29, 20, 31,
    32, 20, 34, 35, 20, 37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53,
];

/// The golden tensors by name.
struct Golden(HashMap<String, Tensor>);

impl Golden {
    fn read() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/correspondence.safetensors");
        Self(candle_core::safetensors::load(path, &Device::Cpu).expect("the golden file reads"))
    }

    fn values(&self, name: &str) -> Vec<f64> {
        let tensor = self.0.get(name).unwrap_or_else(|| panic!("golden tensor {name}"));
        let flat = tensor.to_dtype(DType::F64).and_then(|tensor| tensor.flatten_all()).expect("a numeric tensor");
        flat.to_vec1().expect("f64")
    }

    fn points(&self, name: &str) -> Vec<[f64; 3]> {
        self.values(name).as_chunks::<3>().0.to_vec()
    }

    fn bones(&self, pose: usize) -> Vec<BoneTransform<f64>> {
        let matrices = self.values(&format!("pose{pose}.bone_transforms"));
        matrices.as_chunks::<16>().0.iter().map(|matrix| std::array::from_fn(|index| matrix[index])).collect()
    }

    fn field<T: Real>(&self) -> SkinningField<T> {
        let parents: Vec<_> = std::iter::once(None).chain(PARENTS.map(Some)).collect();
        let tree = KinematicTree::new(&parents).expect("a tree");
        let mut field = SkinningField::new(tree, 4, 64, 0, 20.0).expect("a valid shape");
        let entries = field.mlp().layout().entries().to_vec();
        field.mlp_mut().update(|parameters| {
            for entry in &entries {
                let values = self.values(&format!("skin.{}", golden_name(&entry.name)));
                let target = &mut parameters[entry.range.clone()];
                assert_eq!(values.len(), target.len(), "{}", entry.name);
                target.iter_mut().zip(values).for_each(|(target, value)| *target = T::of(value));
            }
        });
        field
    }
}

/// `lin3.weight_v` -> `3.v`.
fn golden_name(name: &str) -> String {
    let (layer, parameter) = name.trim_start_matches("lin").split_once('.').expect("lin{l}.{parameter}");
    let letter = match parameter {
        "weight_v" => "v",
        "weight_g" => "g",
        _ => "b",
    };
    format!("{layer}.{letter}")
}

fn groups() -> StartGroups {
    let body = vec![0, 1, 2, 4, 5, 16, 17, 18, 19];
    let hand = |wrist, first| std::iter::once(wrist).chain(first..first + 15).collect::<Vec<usize>>();
    let (left, right) = (hand(20, 25), hand(21, 40));
    let full = body.iter().chain(&[15]).chain(&left).chain(&right).copied().collect();
    StartGroups::new(55, vec![body, vec![12, 15, 22], left, right], full).expect("valid groups")
}

fn distance<T: Real>(a: [T; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis].wide() - b[axis]).powi(2)).sum::<f64>().sqrt()
}

fn narrow(points: &[[f64; 3]]) -> Vec<[f32; 3]> {
    points.iter().map(|point| point.map(|value| value as f32)).collect()
}

fn narrow_bones(bones: &[BoneTransform<f64>]) -> Vec<BoneTransform<f32>> {
    bones.iter().map(|bone| bone.map(|value| value as f32)).collect()
}

/// The share of `roots` (I per point, those with a small residual) that are candidates of their point.
fn share_found<T: Real>(candidates: &Candidates<T>, roots: &[[f64; 3]], residuals: &[f64], within: f64) -> f64 {
    let starts = roots.len() / candidates.len();
    let (mut found, mut known) = (0, 0);
    for (index, (&root, _)) in roots.iter().zip(residuals).enumerate().filter(|(_, (_, residual))| **residual < 1e-5) {
        known += 1;
        let mut of_point = candidates.points[candidates.range(index / starts)].iter();
        found += usize::from(of_point.any(|&candidate| distance(candidate, root) < within));
    }
    f64::from(found as u32) / f64::from(known)
}

// d_w(x_canonical, B) = x_deformed
#[test]
fn the_golden_roots_deform_to_their_points() {
    let golden = Golden::read();
    let field = golden.field::<f64>();
    for (pose, part) in (0..POSES).flat_map(|pose| PARTS.map(|part| (pose, part))) {
        let bones = golden.bones(pose);
        let canonical = golden.points(&format!("pose{pose}.{part}.x_canonical"));
        let mut transforms = vec![[0.0; 12]; canonical.len()];
        let mut deformed = vec![[0.0; 3]; canonical.len()];
        ExactWarp::new(&field, &bones).unwrap().transforms(&mut Default::default(), &canonical, &mut transforms);
        deform(&transforms, &canonical, &mut deformed).unwrap();
        for (found, expected) in deformed.iter().zip(golden.points(&format!("pose{pose}.{part}.x_deformed"))) {
            assert!(distance(*found, expected) < 1e-10, "{part} of pose {pose}: {found:?} != {expected:?}");
        }
    }
}

#[test]
fn broyden_converges_as_often_as_newton_and_finds_its_roots() {
    let golden = Golden::read();
    let field = golden.field::<f64>();
    let (groups, settings) = (groups(), SearchSettings::default());
    let (mut starts, mut converged, mut newton, mut evaluations) = (0, 0, 0, 0);
    for (pose, (label, part)) in (0..POSES).flat_map(|pose| PARTS.into_iter().enumerate().map(move |p| (pose, p))) {
        let bones = golden.bones(pose);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        let tensor = |name: &str| format!("pose{pose}.{part}.{name}");
        let points = golden.points(&tensor("x_deformed"));
        let labels = vec![label as u8; points.len()];
        let found = search(&warp, &groups, &points, Some(&labels), &settings).unwrap();
        let residuals = golden.values(&tensor("residual"));
        let of_newton = share_found(&found, &golden.points(&tensor("x_root")), &residuals, 1e-3);
        let of_truth = share_found(&found, &golden.points(&tensor("x_canonical")), &vec![0.0; points.len()], 1e-3);
        // Where several roots exist, a start may reach another one than Newton's does.
        assert!(of_newton > 0.93, "{part} of pose {pose}: {of_newton} of Newton's roots");
        assert!(of_truth > 0.95, "{part} of pose {pose}: {of_truth} of the true roots");
        let share = found.statistics.converged as f64 / residuals.len() as f64;
        let of_newton = residuals.iter().filter(|residual| **residual < 1e-5).count() as f64 / residuals.len() as f64;
        assert!(share >= of_newton - 0.02, "{part} of pose {pose}: {share} converge, with Newton {of_newton}");
        starts += found.statistics.starts;
        converged += found.statistics.converged;
        evaluations += found.statistics.evaluations;
        newton += residuals.iter().filter(|residual| **residual < 1e-5).count();
    }
    println!("{converged} of {starts} starts converge (Newton: {newton}) in {evaluations} evaluations");
    assert!(converged >= newton);
    assert!(evaluations < 6 * starts, "{evaluations} evaluations for {starts} starts");
}

// d sum(c . x_c) / d parameters = backward of w with wbar_j = lambda . (B_j x_c), lambda = -J^-T c
#[test]
fn implicit_parameter_gradients_match() {
    let golden = Golden::read();
    let field = golden.field::<f64>();
    for (pose, part) in (0..POSES).flat_map(|pose| PARTS.map(|part| (pose, part))) {
        let bones = golden.bones(pose);
        let tensor = |name: &str| format!("pose{pose}.{part}.{name}");
        let roots = golden.points(&tensor("x_canonical"));
        let cotangents = golden.points(&tensor("c"));
        let (mut transforms, mut jacobians) = (vec![[0.0; 12]; roots.len()], vec![[[0.0; 3]; 3]; roots.len()]);
        let warp = ExactWarp::new(&field, &bones).unwrap();
        warp.transforms_and_jacobians(&mut Default::default(), &roots, &mut transforms, &mut jacobians);
        let mut lambda = vec![[0.0; 3]; roots.len()];
        assert_eq!(root_cotangents(&jacobians, &cotangents, &mut lambda).unwrap(), 0);
        let (mut to_weights, mut to_points) = (vec![0.0; roots.len() * bones.len()], vec![[0.0; 3]; roots.len()]);
        deform_backward(&transforms, &bones, &roots, &lambda, &mut to_weights, &mut to_points).unwrap();

        let mut trace = Default::default();
        field.forward(&mut trace, &roots, &mut vec![0.0; to_weights.len()]);
        let mut folded = field.mlp().zero_gradient();
        field.backward(&mut trace, &to_weights, None, Backward::Parameters, &mut folded);
        let mut gradient = vec![0.0; field.mlp().layout().len()];
        field.mlp().parameter_gradient(&folded, &mut gradient);
        for entry in field.mlp().layout().entries() {
            let expected = golden.values(&tensor(&format!("d.skin.{}", golden_name(&entry.name))));
            let size = expected.iter().map(|value| value.abs()).fold(0.0, f64::max);
            for (found, expected) in gradient[entry.range.clone()].iter().zip(&expected) {
                // The golden softplus is linear beyond beta y = 20, which is worth 2e-9.
                let error = (found - expected).abs();
                assert!(error < 1e-8 * size, "{part} of pose {pose}, {}: {found} != {expected}", entry.name);
            }
        }
    }
}

#[test]
fn single_precision_and_polished_baked_searches_find_the_double_precision_roots() {
    let golden = Golden::read();
    let field = golden.field::<f64>();
    let (groups, settings) = (groups(), SearchSettings::default());
    let single_field = golden.field::<f32>();
    let grid = Grid::regular([-1.0, -1.2, -0.3], [1.0, 0.7, 0.3], [41, 39, 13]).unwrap();
    let baked = BakedWeights::sample(&single_field, grid).unwrap();
    let (mut known, mut single_found, mut polished_found) = (0.0, 0.0, 0.0);
    for (pose, (label, part)) in (0..POSES).flat_map(|pose| PARTS.into_iter().enumerate().map(move |p| (pose, p))) {
        let wide = golden.points(&format!("pose{pose}.{part}.x_deformed"));
        let labels = vec![label as u8; wide.len()];
        let wide_bones = golden.bones(pose);
        let warp = ExactWarp::new(&field, &wide_bones).unwrap();
        let expected = search(&warp, &groups, &wide, Some(&labels), &settings).unwrap();

        let (points, bones) = (narrow(&wide), narrow_bones(&wide_bones));
        let exact = ExactWarp::new(&single_field, &bones).unwrap();
        let single = search(&exact, &groups, &points, Some(&labels), &settings).unwrap();
        let fast = baked.warp(&bones, None).unwrap();
        let polished = search_and_polish(&fast, &exact, &groups, &points, Some(&labels), &settings).unwrap();
        assert!(single.residuals.iter().chain(&polished.residuals).all(|&residual| residual < 1e-5));
        let found = |found: &Candidates<f32>| {
            let roots = (0..wide.len()).flat_map(|point| expected.range(point).map(move |root| (point, root)));
            let held = roots.filter(|&(point, root)| {
                found.range(point).any(|candidate| distance(found.points[candidate], expected.points[root]) < 1e-3)
            });
            held.count() as f64
        };
        known += expected.points.len() as f64;
        single_found += found(&single);
        polished_found += found(&polished);
    }
    assert!(single_found > 0.99 * known, "{single_found} of {known} roots in single precision");
    // A random network's weights vary faster than a body's; on a coarse grid some of its roots do not exist.
    assert!(polished_found > 0.95 * known, "{polished_found} of {known} roots baked and polished");
    println!("{known} roots: {single_found} in single precision, {polished_found} baked and polished");
}

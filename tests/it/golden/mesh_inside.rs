//! Inside tests and distances against golden vectors: 3,000 random points around a torus, float64.

use std::path::Path;

use candle_core::{DType, Device, safetensors};
use glam::Vec3;
use xavatar::mesh::{SolidIndex, Topology, read_mesh};

#[test]
fn inside_test_matches_the_golden_torus() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let mesh = read_mesh(golden.join("torus.ply")).unwrap().mesh;
    let topology = Topology::of(&mesh);
    assert!(topology.is_watertight());
    assert_eq!(topology.euler_characteristic(), 0);

    let tensors = safetensors::load(golden.join("inside_torus.safetensors"), &Device::Cpu).unwrap();
    let points: Vec<[f32; 3]> = tensors["points"]
        .to_dtype(DType::F32)
        .unwrap()
        .to_vec2::<f32>()
        .unwrap()
        .into_iter()
        .map(|row| row.try_into().unwrap())
        .collect();
    let inside = tensors["inside"].to_dtype(DType::F32).unwrap().to_vec1::<f32>().unwrap();
    assert_eq!(points.len(), 3000);

    let solid = SolidIndex::new(&mesh).unwrap();
    let points: Vec<Vec3> = points.into_iter().map(Vec3::from).collect();
    for ((point, &expected), (distance, _)) in points.iter().zip(&inside).zip(solid.signed_distances(&points)) {
        assert!(distance.abs() < 1e-4 || (distance < 0.0) == (expected > 0.5), "{point}: {distance}");
    }
}

//! A network with every operator against what LiteRT makes of it (scripts/small_network.py), and files that are damaged.

use xavatar_formats::Fault;

use super::{Network, Workspace};

const FILE: &[u8] = include_bytes!("../../tests/fixtures/small.tflite");

#[rustfmt::skip]
const FEATURES: [f32; 48] = [
    1.75332, -0.510142, -1.65492, -0.431718, -0.286437, -0.734608, -0.0775146, 0.301514,
    1.99399, -1.00069, -3.63414, -0.58491, -0.38041, -1.73584, -0.0775146, 0.301514,
    1.89952, -0.288162, -1.71687, -0.291594, -0.32564, -0.68083, -0.0775146, 0.301514,
    2.27774, -1.4343, -5.59788, -1.04463, -0.298926, -1.7819, -0.0775146, 0.301514,
    1.40847, -0.63477, -0.371713, -0.119311, -0.296665, -0.23897, -0.0775146, 0.301514,
    1.57804, -1.26901, -1.75471, -0.231745, -0.173975, -1.386, -0.0775146, 0.301514,
];
const SHARES: [f32; 4] = [0.830058, 0.966672, 0.342708, 0.0451291];

fn picture() -> Vec<f32> {
    (0..9 * 8 * 3).map(|index| (index * 37 % 101) as f32 / 101.0).collect()
}

fn assert_close(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-4, "{found} instead of {expected}");
    }
}

#[test]
fn every_operator_computes_what_litert_does() {
    let network = Network::parse(FILE, &[0, 1]).unwrap();
    assert_eq!((network.input_shape(), network.output_shapes()), ([9, 8, 3], vec![[1, 1, 48], [1, 1, 4]]));
    let mut workspace = Workspace::default();
    // Twice: rooms that are used again must not show.
    for _ in 0..2 {
        let outputs = network.run(&picture(), &mut workspace);
        assert_close(&outputs[0], &FEATURES);
        assert_close(&outputs[1], &SHARES);
    }
}

#[test]
fn only_what_is_wanted_runs() {
    let (all, one) = (Network::parse(FILE, &[0, 1]).unwrap(), Network::parse(FILE, &[0]).unwrap());
    assert!(one.steps.len() < all.steps.len());
    assert_close(&one.run(&picture(), &mut Workspace::default())[0], &FEATURES);
    assert!(Network::parse(FILE, &[2]).is_err());
}

// Whatever a byte becomes, the file is refused or runs to numbers: no index leaves what it is of.
#[test]
fn damaged_files_are_refused_or_run() {
    let mut runs = 0;
    for place in 0..FILE.len() {
        for value in [0, 1, 0x7f, 0xff, FILE[place] ^ 0x10] {
            let mut bytes = FILE.to_vec();
            bytes[place] = value;
            let Ok(network) = Network::parse(&bytes, &[0, 1]) else { continue };
            // Most bytes are weights; every 64th of these runs.
            if place % 64 == 0 {
                let count = network.input_shape().iter().product();
                network.run(&vec![0.5; count], &mut Workspace::default());
                runs += 1;
            }
        }
    }
    assert!(runs > 50, "{runs}");
    for length in 0..FILE.len() {
        let _ = Network::parse(&FILE[..length], &[0, 1]);
    }
    assert!(matches!(Network::parse(b"no network at all", &[0]), Err(Fault::Malformed { .. })));
}

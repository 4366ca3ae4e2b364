//! Probe.
use std::time::Instant;
use xavatar_landmarks::network::{Network, Workspace};
fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let bytes = std::fs::read(&a[0]).unwrap();
    let wanted: Vec<usize> = a[3].split(',').map(|x| x.parse().unwrap()).collect();
    let net = Network::parse(&bytes, &wanted).unwrap();
    let input: Vec<f32> = std::fs::read(&a[1]).unwrap().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let mut w = Workspace::default();
    let out = net.run(&input, &mut w);
    let t = Instant::now();
    for _ in 0..5 { net.run(&input, &mut w); }
    eprintln!("{} ms {:?}", t.elapsed().as_secs_f64() * 200.0, net.output_shapes());
    let flat: Vec<u8> = out.concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(&a[2], flat).unwrap();
}

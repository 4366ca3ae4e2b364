#![allow(missing_docs)]
use glam::Vec3;
use xavatar::{mannequin, mesh::*, render::*};
fn shot(m: &TriangleMesh, lo: Vec3, hi: Vec3, az: f32, w: u32, h: u32, v: View) -> image::RgbImage {
    render_mesh(m, &Camera::framing(lo, hi, az, w, h).unwrap(), v).unwrap()
}
#[test]
fn view() {
    let t = std::time::Instant::now();
    let m = mannequin::skin().unwrap();
    println!("skin {:?} V {} F {} {:?}", t.elapsed(), m.vertices.len(), m.faces.len(), Topology::of(&m));
    let tile = |i| Tile::new(i, "");
    let (lo, hi) = (Vec3::new(-0.9, -1.33, -0.2), Vec3::new(0.9, 0.45, 0.2));
    let body: Vec<_> =
        [0.0, 0.8, 1.57, 3.14].into_iter().map(|a| tile(shot(&m, lo, hi, a, 500, 500, View::Shaded))).collect();
    let (lo, hi) = (Vec3::new(-0.12, 0.15, -0.1), Vec3::new(0.12, 0.45, 0.12));
    let head: Vec<_> =
        [0.0, 0.8, 1.57, 3.14].into_iter().map(|a| tile(shot(&m, lo, hi, a, 500, 500, View::Shaded))).collect();
    contact_sheet(&[body, head]).unwrap().save("/tmp/view.png").unwrap();
    let mut hand = m.clone();
    // seen from above: turn the hand up
    for v in &mut hand.vertices {
        *v = Vec3::new(v.x, -v.z, v.y);
    }
    let (lo, hi) = (Vec3::new(0.64, -0.12, 0.05), Vec3::new(0.9, 0.1, 0.15));
    let a = tile(shot(&hand, lo, hi, 0.0, 700, 600, View::Shaded));
    let (lo, hi) = (Vec3::new(0.05, -1.33, -0.12), Vec3::new(0.2, -1.15, 0.2));
    let b = tile(shot(&m, lo, hi, 0.7, 500, 500, View::Shaded));
    contact_sheet(&[vec![a, b]]).unwrap().save("/tmp/hand.png").unwrap();
}

#![allow(missing_docs)]
use glam::Vec3;
use xavatar::{body::*, mannequin, mesh::*, render::*};
fn shot(m: &TriangleMesh, az: f32, w: u32, h: u32, v: View) -> Tile {
    let lo = m.vertices.iter().copied().reduce(Vec3::min).unwrap();
    let hi = m.vertices.iter().copied().reduce(Vec3::max).unwrap();
    Tile::new(render_mesh(m, &Camera::framing(lo, hi, az, w, h).unwrap(), v).unwrap(), "")
}
fn around(m: &TriangleMesh, lo: Vec3, hi: Vec3, az: f32) -> Tile {
    Tile::new(render_mesh(m, &Camera::framing(lo, hi, az, 450, 450).unwrap(), View::Shaded).unwrap(), "")
}
#[test]
fn view() {
    let m = mannequin::model().unwrap();
    let colour = |mesh: &mut TriangleMesh| {
        let w = m.skinning_weights();
        let c = (0..m.vertex_count())
            .map(|v| {
                let mut rgb = Vec3::ZERO;
                for j in 0..55 {
                    let h = j as f32 * 2.4;
                    rgb += w[v * 55 + j] * (Vec3::new(h.sin(), (h + 2.1).sin(), (h + 4.2).sin()) * 0.5 + 0.5);
                }
                (rgb * 255.0).to_array().map(|x| x as u8)
            })
            .collect();
        mesh.colouring = Colouring::Vertex(c);
    };
    let mut p = BodyParameters::default();
    p.body_pose[16 - 1].0 = Vec3::new(0.0, 0.0, -1.1);
    p.body_pose[17 - 1].0 = Vec3::new(0.0, 0.0, -1.1);
    p.body_pose[18 - 1].0 = Vec3::new(0.0, -1.3, 0.0);
    p.body_pose[19 - 1].0 = Vec3::new(0.0, 1.3, 0.0);
    p.body_pose[1 - 1].0 = Vec3::new(-1.2, 0.0, 0.2);
    p.body_pose[4 - 1].0 = Vec3::new(1.4, 0.0, 0.0);
    p.body_pose[15 - 1].0 = Vec3::new(0.0, 0.4, 0.0);
    let rest = m.mesh(m.pose(&BodyParameters::default()).unwrap().vertices);
    let mut posed = m.mesh(m.pose(&p).unwrap().vertices);
    colour(&mut posed);
    let mut r = rest.clone();
    colour(&mut r);
    let row1 = vec![
        shot(&r, 0.0, 450, 450, View::Colour),
        shot(&posed, 0.0, 450, 450, View::Shaded),
        shot(&posed, 0.7, 450, 450, View::Colour),
        shot(&posed, 3.4, 450, 450, View::Shaded),
    ];
    let (lo, hi) = (Vec3::new(-0.12, 0.15, -0.1), Vec3::new(0.12, 0.45, 0.12));
    let mut row2 = vec![];
    for (jaw, e) in [(0.0, 99), (0.3, 0), (0.0, 1), (0.0, 2)] {
        let mut q = BodyParameters::default();
        q.jaw_pose.0.x = jaw;
        if e < 10 {
            q.expression[e] = 1.5;
        }
        let mut me = m.mesh(m.pose(&q).unwrap().vertices);
        colour(&mut me);
        row2.push(around(&me, lo, hi, 0.4));
    }
    let mut row3 = vec![];
    for b in [0usize, 1, 5, 7] {
        let mut q = BodyParameters::default();
        q.betas[b] = 2.0;
        row3.push(shot(&m.mesh(m.pose(&q).unwrap().vertices), 0.4, 450, 450, View::Shaded));
    }
    contact_sheet(&[row1, row2, row3]).unwrap().save("/tmp/view.png").unwrap();
    let mut q = BodyParameters::default();
    q.left_hand_pose = HandPose::RelativeToMean(Default::default());
    let (lo, hi) = (Vec3::new(0.64, -0.12, 0.02), Vec3::new(0.9, 0.1, 0.15));
    let mut tiles = vec![];
    for c in [0.0f32, 2.2, 4.4] {
        q.left_hand_pose = HandPose::Pca(vec![c]);
        let mut h = m.mesh(m.pose(&q).unwrap().vertices);
        colour(&mut h);
        let g = h.clone();
        tiles.push(around(&g, Vec3::new(0.64, 0.0, -0.1), Vec3::new(0.9, 0.2, 0.1), 0.5));
        for v in &mut h.vertices {
            *v = Vec3::new(v.x, v.z, -v.y);
        }
        tiles.push(around(&h, Vec3::new(0.64, -0.1, -0.15), Vec3::new(0.9, 0.12, -0.02), 0.0));
    }
    let _ = (lo, hi);
    contact_sheet(&[tiles]).unwrap().save("/tmp/hand.png").unwrap();
}

use super::*;

/// A ball of rings of vertices, without its caps.
fn ball(radius: f32, rings: u32) -> TriangleMesh {
    let around = 2 * rings;
    let place = |ring: u32, step: u32| {
        let polar = std::f32::consts::PI * (ring + 1) as f32 / (rings + 1) as f32;
        let turn = std::f32::consts::TAU * step as f32 / around as f32;
        Vec3::new(polar.sin() * turn.sin(), polar.cos(), polar.sin() * turn.cos()) * radius
    };
    let at = |ring: u32, step: u32| ring * around + step % around;
    let cells = (0..rings - 1).flat_map(|ring| (0..around).map(move |step| (ring, step)));
    TriangleMesh {
        vertices: (0..rings * around).map(|index| place(index / around, index % around)).collect(),
        faces: cells
            .flat_map(|(ring, step)| {
                let corners = [at(ring, step), at(ring + 1, step), at(ring + 1, step + 1), at(ring, step + 1)];
                [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
            })
            .collect(),
        ..TriangleMesh::default()
    }
}

/// Folds as cloth has them: 8 mm high, five around.
fn folded(mut mesh: TriangleMesh) -> TriangleMesh {
    for place in &mut mesh.vertices {
        let height = 0.008 * (5.0 * place.x.atan2(place.z)).sin() * (place.y / 0.3).acos().sin();
        *place += place.normalize() * height;
    }
    mesh
}

/// Without the faces of which a corner is in front of z.
fn with_hole(mut mesh: TriangleMesh, z: f32) -> TriangleMesh {
    let TriangleMesh { vertices, faces, .. } = &mut mesh;
    faces.retain(|face| face.iter().all(|vertex| vertices[*vertex as usize].z < z));
    mesh
}

fn free(mesh: &TriangleMesh) -> Vec<Freedom> {
    vec![Freedom::Drawn; mesh.vertices.len()]
}

// A ball in a larger one that has folds comes to lie on it: less than half a millimetre off, no face turned over.
#[test]
fn a_surface_that_is_displaced_is_recovered() {
    let (start, scan) = (ball(0.28, 32), folded(ball(0.3, 96)));
    let found = free_form(&start, &free(&start), &scan).unwrap();
    let scan = xavatar_mesh::SurfaceIndex::new(&scan).unwrap();
    let inner = found.vertices.iter().filter(|place| place.y.abs() < 0.25);
    let mut far: Vec<f32> = inner.map(|place| scan.closest(*place).distance).collect();
    far.sort_by(f32::total_cmp);
    assert!(far[far.len() / 2] < 0.000_5, "{}", far[far.len() / 2]);
    assert!(far[far.len() * 95 / 100] < 0.001_5, "{}", far[far.len() * 95 / 100]);
    assert_eq!(turned_faces(&start, &found), Vec::<usize>::new());
}

// Over a hole of 13 cm the surface keeps its form: not drawn to the hole's border, neither within the body nor outside what is around.
#[test]
fn over_a_hole_the_surface_is_the_bodys() {
    let (start, scan) = (ball(0.28, 32), with_hole(ball(0.3, 96), 0.27));
    let found = free_form(&start, &free(&start), &scan).unwrap();
    let over: Vec<(Vec3, Vec3)> =
        found.vertices.iter().zip(&start.vertices).filter(|(_, start)| start.z > 0.26).map(|(a, b)| (*a, *b)).collect();
    assert!(over.len() > 20);
    for (found, start) in over {
        assert!((0.279..0.302).contains(&found.length()), "{}", found.length());
        let sideways = (found - start).reject_from(start.normalize()).length();
        assert!(sideways < 0.005, "{sideways}");
    }
}

#[test]
fn what_is_held_stays_and_what_is_far_from_the_scan_too() {
    let start = ball(0.28, 16);
    let freedom = |place: &Vec3| if place.y > 0.2 { Freedom::Held } else { Freedom::Drawn };
    let held: Vec<Freedom> = start.vertices.iter().map(freedom).collect();
    let found = free_form(&start, &held, &ball(0.3, 48)).unwrap();
    let kept = found.vertices.iter().zip(&start.vertices).zip(&held).filter(|(_, freedom)| **freedom == Freedom::Held);
    assert!(kept.into_iter().all(|((found, start), _)| found == start));
    assert!(
        found.vertices.iter().zip(&held).all(|(place, freedom)| *freedom == Freedom::Held || place.length() > 0.28)
    );
    let far = free_form(&start, &free(&start), &ball(0.5, 48)).unwrap();
    assert_eq!(far.vertices, start.vertices);
}

#[test]
fn the_bits_are_the_same_whatever_the_threads() {
    let (start, scan) = (ball(0.28, 16), folded(ball(0.3, 48)));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| free_form(&start, &free(&start), &scan)).unwrap().vertices
    };
    assert_eq!(with(1), with(3));
}

// A vertex that was drawn through its own ring comes back among its neighbours.
#[test]
fn faces_that_were_turned_over_are_smoothed() {
    let body = ball(0.3, 16);
    let start: Vec<DVec3> = body.vertices.iter().map(|place| place.as_dvec3() * UNIT).collect();
    let mesh = Mesh::new(&body.faces, &start);
    let mut moves = vec![DVec3::ZERO; start.len()];
    moves[8 * 32 + 4] = DVec3::new(-1.0, 0.5, 0.0);
    assert!(!turned_faces(&body, &moved(&body, &moves)).is_empty());
    smooth_turned_faces(&body, &mesh, &free(&body), &mut moves);
    assert!(turned_faces(&body, &moved(&body, &moves)).is_empty());
}

// A cap that nothing draws goes out with what is around it.
#[test]
fn what_is_carried_goes_with_its_neighbours() {
    let start = ball(0.28, 16);
    let freedom = |place: &Vec3| if place.z > 0.25 { Freedom::Carried } else { Freedom::Drawn };
    let freedoms: Vec<Freedom> = start.vertices.iter().map(freedom).collect();
    let found = free_form(&start, &freedoms, &ball(0.3, 48)).unwrap();
    let carried = found.vertices.iter().zip(&freedoms).filter(|(_, freedom)| **freedom == Freedom::Carried);
    let lengths: Vec<f32> = carried.map(|(place, _)| place.length()).collect();
    assert!(!lengths.is_empty() && lengths.iter().all(|length| (0.29..0.305).contains(length)), "{lengths:?}");
}

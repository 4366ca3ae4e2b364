//! Pictures against the analytic projection: silhouettes, depths, colours, and meshes that break rasterisers.

use glam::{Mat3, Vec2, Vec3};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use xavatar::mesh::camera::pixel_centre;
use xavatar::mesh::camera::{FRONT, PinholeCamera};
use xavatar::mesh::{Colouring, TriangleMesh};
use xavatar::render::{View, render_depth, render_mesh, render_rgbd};

const POSITION: Vec3 = Vec3::new(1.5, 0.9, 3.0);
const TARGET: Vec3 = Vec3::new(0.1, 0.05, 0.0);
const FIELD_OF_VIEW: f32 = 0.8;
const WIDTH: u32 = 203;
const HEIGHT: u32 = 157;

fn camera() -> PinholeCamera {
    PinholeCamera::looking_at(POSITION, TARGET, FIELD_OF_VIEW, [WIDTH, HEIGHT]).unwrap()
}

/// From +Z, at this distance, towards the origin.
fn front(distance: f32, field_of_view: f32, size: [u32; 2]) -> PinholeCamera {
    PinholeCamera::looking_at(distance * Vec3::Z, Vec3::ZERO, field_of_view, size).unwrap()
}

/// The rays through the pixel centres, row by row, as unit directions in the world: written out, not taken from the renderer.
fn rays() -> Vec<Vec3> {
    let forward = (TARGET - POSITION).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let tangent = (FIELD_OF_VIEW / 2.0).tan();
    let (width, height) = (WIDTH as f32, HEIGHT as f32);
    (0..WIDTH * HEIGHT)
        .map(|index| {
            let (column, row) = ((index % WIDTH) as f32 + 0.5, (index / WIDTH) as f32 + 0.5);
            let (x, y) = ((2.0 * column - width) / height, (height - 2.0 * row) / height);
            (forward + tangent * (x * right + y * up)).normalize()
        })
        .collect()
}

/// A sphere about the origin by latitude and longitude, wound outward.
fn sphere(radius: f32, rings: u32) -> TriangleMesh {
    let (pi, columns) = (std::f32::consts::PI, 2 * rings);
    let mut mesh = TriangleMesh::default();
    for ring in 0..=rings {
        for column in 0..columns {
            let (latitude, longitude) = (pi * ring as f32 / rings as f32, 2.0 * pi * column as f32 / columns as f32);
            let (sin, cos) = latitude.sin_cos();
            mesh.vertices.push(radius * Vec3::new(sin * longitude.sin(), cos, sin * longitude.cos()));
        }
    }
    for ring in 0..rings {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let [a, b] = [ring * columns + column, ring * columns + next];
            mesh.faces.push([a, a + columns, b]);
            mesh.faces.push([b, a + columns, b + columns]);
        }
    }
    mesh
}

fn cube(half: f32) -> TriangleMesh {
    let corner = |index: u32, bit: u32| if index >> bit & 1 == 0 { -half } else { half };
    let vertices = (0..8).map(|index| Vec3::new(corner(index, 0), corner(index, 1), corner(index, 2))).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { vertices, faces, ..Default::default() }
}

fn hits_sphere(origin: Vec3, ray: Vec3, radius: f32) -> bool {
    (origin - origin.dot(ray) * ray).length() < radius
}

fn hits_cube(origin: Vec3, ray: Vec3, half: f32) -> bool {
    let (first, second) = ((-half - origin) / ray, (half - origin) / ray);
    first.min(second).max_element() < first.max(second).min_element()
}

/// Every pixel whose ray meets the body made smaller by `slack` is covered, and none that misses it made larger; and the picture's
/// edge is no wider than a pixel.
fn assert_silhouette(mesh: &TriangleMesh, size: f32, slack: f32, hits: impl Fn(Vec3, Vec3, f32) -> bool) {
    let depths = render_depth(mesh, &camera()).unwrap();
    let mut covered = 0;
    for (index, (&depth, &ray)) in depths.iter().zip(&rays()).enumerate() {
        let place = || format!("pixel {}, {}", index as u32 % WIDTH, index as u32 / WIDTH);
        if hits(POSITION, ray, size * (1.0 - slack)) {
            assert!(depth.is_finite(), "{} should see the body", place());
        }
        if !hits(POSITION, ray, size * (1.0 + slack)) {
            assert!(depth.is_infinite(), "{} should be empty", place());
        }
        covered += usize::from(depth.is_finite());
    }
    assert!((2000..20_000).contains(&covered), "{covered} pixels");

    let black = TriangleMesh { colouring: Colouring::Vertex(vec![[0; 3]; mesh.vertices.len()]), ..mesh.clone() };
    let picture = render_mesh(&black, &camera(), View::Data).unwrap();
    let seen = |x: u32, y: u32| depths[(y * WIDTH + x) as usize].is_finite();
    let mut mixed = 0;
    for (x, y, Rgb([shade, ..])) in picture.enumerate_pixels() {
        let around = || {
            (y.max(1) - 1..(y + 2).min(HEIGHT)).flat_map(|y| (x.max(1) - 1..(x + 2).min(WIDTH)).map(move |x| (x, y)))
        };
        match shade {
            0 => assert!(around().any(|(x, y)| seen(x, y)), "({x}, {y}) is covered but next to nothing of the body"),
            255 => assert!(around().any(|(x, y)| !seen(x, y)), "({x}, {y}) is empty within the body"),
            _ => {
                assert!(around().any(|(x, y)| seen(x, y)) && around().any(|(x, y)| !seen(x, y)), "({x}, {y}) mixes");
                mixed += 1;
            }
        }
    }
    assert!(mixed > 100, "edges are anti-aliased: {mixed} pixels");
}

#[test]
fn silhouette_of_a_sphere_is_its_projection() {
    // Slack: the chord error (pi / 400)^2 / 2 of the tessellation and 1/512 pixel (1e-5 rad) of snapping.
    assert_silhouette(&sphere(0.8, 400), 0.8, 6e-5, hits_sphere);
}

#[test]
fn silhouette_of_a_cube_is_its_projection() {
    assert_silhouette(&cube(0.6), 0.6, 6e-5, hits_cube);
}

#[test]
fn depth_of_a_plane_is_exact_even_through_the_camera() {
    // The floor y = -0.5 from far behind the camera to far in front: clipped at the near plane, cut at the sides.
    let floor = TriangleMesh {
        vertices: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, z]| Vec3::new(50.0 * x, -0.5, 50.0 * z))
            .to_vec(),
        faces: vec![[0, 2, 1], [0, 3, 2]],
        ..Default::default()
    };
    let forward = (TARGET - POSITION).normalize();
    let mut seen = 0;
    for (&depth, ray) in render_depth(&floor, &camera()).unwrap().iter().zip(rays()) {
        let distance = (-0.5 - POSITION.y) / ray.y;
        let hit = POSITION + distance * ray;
        if distance > 0.0 && hit.x.abs().max(hit.z.abs()) < 49.0 {
            let expected = distance * ray.dot(forward);
            assert!((depth - expected).abs() < 1e-5 * expected, "{depth} m, expected {expected}");
            seen += 1;
        } else if distance < 0.0 {
            assert!(depth.is_infinite(), "the sky has no depth");
        }
    }
    assert!(seen > 15_000, "{seen} pixels see the floor");
}

// A sphere of radius r about c: the ray d meets it at t = d.c - sqrt((d.c)^2 - c^2 + r^2), in camera space.
#[test]
fn a_depth_camera_with_an_odd_calibration_sees_depths_and_colours_of_the_same_points() {
    let rotation = Mat3::from_euler(glam::EulerRot::YXZ, 2.7, 0.2, 0.1);
    let translation = Vec3::new(-0.05, 0.1, 2.4);
    let camera =
        PinholeCamera { fx: 180.0, fy: 175.0, cx: 61.3, cy: 88.9, width: 150, height: 160, rotation, translation };
    let mut ball = sphere(0.7, 400);
    let colour = |place: Vec3| (place * 0.5 / 0.7 + 0.5) * 255.0;
    ball.colouring = Colouring::Vertex(
        ball.vertices.iter().map(|&place| colour(place).round().to_array().map(|c| c as u8)).collect(),
    );
    let image = render_rgbd(&ball, &camera).unwrap();
    assert_eq!(image.depth, render_depth(&ball, &camera).unwrap());
    let centre = camera.to_camera(Vec3::ZERO);
    let mut seen = 0;
    for (x, y, Rgb(pixel)) in image.colour.enumerate_pixels() {
        let depth = image.depth[(y * 150 + x) as usize];
        let place = pixel_centre(x, y);
        let ray = camera.ray(place).normalize();
        let under_root = ray.dot(centre).powi(2) - centre.length_squared() + 0.49;
        if under_root < 0.0 {
            assert!(depth.is_infinite() && *pixel == [0; 3]);
        } else if under_root > 0.01 {
            let expected = (ray.dot(centre) - under_root.sqrt()) * ray.z;
            assert!((depth - expected).abs() < 1e-4, "({x}, {y}): {depth} m, expected {expected} m");
            let world = camera.back_project(place, depth);
            assert!((world.length() - 0.7).abs() < 1e-4);
            assert!((colour(world) - Vec3::from(pixel.map(f32::from))).abs().max_element() < 2.0);
            seen += 1;
        }
    }
    assert!(seen > 5000, "{seen} pixels");
}

#[test]
fn the_nearer_surface_wins_in_any_order() {
    let near = sphere(0.3, 20).vertices.iter().map(|&vertex| vertex + Vec3::new(0.75, 0.45, 1.5)).collect();
    let (small, large) = (TriangleMesh { vertices: near, ..sphere(0.3, 20) }, sphere(0.8, 20));
    let joined = |first: &TriangleMesh, second: &TriangleMesh| {
        let offset = first.vertices.len() as u32;
        TriangleMesh {
            vertices: [first.vertices.clone(), second.vertices.clone()].concat(),
            faces: first.faces.iter().copied().chain(second.faces.iter().map(|f| f.map(|v| v + offset))).collect(),
            ..Default::default()
        }
    };
    let depths = |mesh: &TriangleMesh| render_depth(mesh, &camera()).unwrap();
    let nearest: Vec<f32> = depths(&small).iter().zip(depths(&large)).map(|(a, b)| a.min(b)).collect();
    assert_eq!(depths(&joined(&small, &large)), nearest);
    assert_eq!(depths(&joined(&large, &small)), nearest);
}

#[test]
fn faces_that_share_edges_leave_no_gap() {
    // A fan of slivers around a point fills the picture: a gap would have no depth.
    let count = 257;
    let mut mesh = TriangleMesh { vertices: vec![Vec3::new(0.013, -0.007, 0.0)], ..Default::default() };
    for index in 0..count {
        let angle = std::f32::consts::TAU * index as f32 / count as f32;
        mesh.vertices.push(Vec3::new(angle.cos(), angle.sin(), 0.0));
        mesh.faces.push([0, 1 + index, 1 + (index + 1) % count]);
    }
    let camera = front(2.0, 0.4, [WIDTH, HEIGHT]);
    assert!(render_depth(&mesh, &camera).unwrap().iter().all(|&depth| (depth - 2.0).abs() < 1e-4));
}

#[test]
fn normals_view_shows_the_axes() {
    let camera = front(4.0, FIELD_OF_VIEW, [201, 201]);
    let picture = render_mesh(&sphere(1.0, 60), &camera, View::Normals).unwrap();
    let Rgb([red, green, blue]) = *picture.get_pixel(100, 100);
    assert!(red.abs_diff(128) < 3 && green.abs_diff(128) < 3 && blue > 252, "the middle faces the camera");
    assert!(picture.get_pixel(150, 100).0[0] > 180, "right is red");
    assert!(picture.get_pixel(100, 50).0[1] > 180, "up is green");
    assert_eq!(picture.get_pixel(0, 0).0, [255; 3]);
}

#[test]
fn vertex_colours_and_textures_agree() {
    // Red grows with x and green with y, once as vertex colours and once as a 2 x 2 texture.
    let mut wall = TriangleMesh {
        vertices: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        colouring: Colouring::Vertex(vec![[0, 0, 0], [255, 0, 0], [255, 255, 0], [0, 255, 0]]),
        ..Default::default()
    };
    let camera = front(3.0, FIELD_OF_VIEW, [WIDTH, HEIGHT]);
    let by_vertex = render_mesh(&wall, &camera, View::Colour).unwrap();
    let uvs = wall.vertices.iter().map(|vertex| Vec2::new(vertex.x + 2.0, vertex.y + 2.0) / 4.0).collect();
    let image = RgbImage::from_fn(2, 2, |x, y| Rgb([255 * x as u8, 255 * y as u8, 0]));
    wall.colouring = Colouring::Texture { uvs, image: image.into() };
    let by_texture = render_mesh(&wall, &camera, View::Colour).unwrap();
    let difference = by_vertex.iter().zip(by_texture.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(difference <= 1, "differ by {difference}");
    let Rgb([red, green, _]) = *by_vertex.get_pixel(150, 110);
    assert!(red > green + 50, "red on the right, green on top: {red} {green}");
}

#[test]
fn both_sides_of_an_open_surface_are_lit_alike() {
    let mut wall = cube(0.6);
    wall.faces.truncate(2);
    let front = render_mesh(&wall, &camera(), View::Shaded).unwrap();
    for face in &mut wall.faces {
        face.swap(1, 2);
    }
    assert_eq!(render_mesh(&wall, &camera(), View::Shaded).unwrap(), front);
}

#[test]
fn threads_do_not_change_the_picture() {
    let mesh = sphere(0.8, 120);
    let draw = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render_mesh(&mesh, &camera(), View::Shaded).unwrap())
    };
    assert_eq!(draw(1), draw(5));
}

#[test]
fn wrong_meshes_are_errors() {
    let good = cube(0.5);
    let refused = |mesh: TriangleMesh| render_mesh(&mesh, &camera(), View::Colour).unwrap_err().to_string();
    assert!(refused(TriangleMesh { faces: vec![[0, 1, 8]], ..good.clone() }).contains("8"));
    assert!(refused(TriangleMesh { vertices: vec![Vec3::NAN; 8], ..good.clone() }).contains("NaN"));
    assert!(refused(TriangleMesh { normals: Some(vec![]), ..good.clone() }).contains("normals"));
    assert!(refused(TriangleMesh { colouring: Colouring::Vertex(vec![[0; 3]; 7]), ..good.clone() }).contains("7"));
    let (uvs, image) = (vec![Vec2::ZERO; 8], RgbImage::new(0, 0).into());
    assert!(refused(TriangleMesh { colouring: Colouring::Texture { uvs, image }, ..good.clone() }).contains("texture"));
    assert!(refused(TriangleMesh { vertices: vec![Vec3::splat(f32::MAX); 8], ..good.clone() }).contains("1000000 m"));
    let camera = PinholeCamera::framing(Vec3::splat(-0.5), Vec3::splat(0.5), FRONT, 64, 64).unwrap();
    assert!(render_mesh(&TriangleMesh::default(), &camera, View::Shaded).is_ok(), "an empty mesh is an empty picture");
}

/// Coordinates from the ordinary to the absurd, many of them repeated, so that faces degenerate and surround the camera.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0), Just(0.9), Just(3.0), -4.0..4.0_f32, -1e6..1e6_f32, Just(1e-30), Just(-1e6)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_finite_mesh_can_be_drawn(
        corners in proptest::collection::vec([coordinate(), coordinate(), coordinate()], 12),
        faces in proptest::collection::vec([0..12_u32, 0..12_u32, 0..12_u32], 0..40),
    ) {
        let mesh = TriangleMesh { vertices: corners.into_iter().map(Vec3::from).collect(), faces, ..Default::default() };
        let camera = front(3.0, FIELD_OF_VIEW, [40, 30]);
        for view in [View::Shaded, View::Normals, View::Depth { near: 1.0, far: 5.0 }] {
            prop_assert!(render_mesh(&mesh, &camera, view).is_ok());
        }
        prop_assert!(render_depth(&mesh, &camera).unwrap().iter().all(|&depth| depth > 0.0));
    }
}

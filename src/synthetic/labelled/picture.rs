//! One labelled picture: who is drawn, filmed, lit, and what each pixel and joint is.
//!
//! The colour picture is anti-aliased; labels of pixels are those of the ray through the pixel's centre, without mixtures: mask, depth, normal
//! and joint belong to the same point. A pixel's joint is that with the largest weight of the body's vertex nearest to the point.

use glam::Vec3;
use image::{GrayImage, Luma, Rgb, RgbImage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::backdrop::Backdrops;
use super::drawn;
use super::keypoints::{BodyPlace, body_places};
use super::labels::{CameraLabels, JointLabel, Labels, PoseLabels, Visibility, runs};
use crate::Result;
use crate::body::{BodyModel, PartLabels, Pose, Registration};
use crate::data::BACKGROUND;
use crate::mesh::TriangleMesh;
use crate::mesh::camera::PinholeCamera;
use crate::render::{Scene, SeenPoint, View, render_points};

/// What clothes add to the body: a joint is hidden by what is nearer than that before its own surface, metres.
const CLOTHING: f32 = 0.03;

/// Somebody in a pose.
#[derive(Clone, Debug)]
pub struct Person {
    /// What the pose is called.
    pub name: String,
    /// The surface, in the world.
    pub mesh: TriangleMesh,
    /// The pose and shape of the body within.
    pub pose: Pose,
}

/// People in poses that pictures are taken of.
pub trait People: Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// One of them.
    ///
    /// # Errors
    /// Why there is no surface.
    fn person(&self, index: usize) -> Result<Person>;
}

/// Makes labelled pictures.
pub struct LabelledPictures<'a> {
    people: &'a dyn People,
    body: &'a BodyModel,
    parts: &'a PartLabels,
    backdrops: &'a Backdrops,
    size: [u32; 2],
    seed: u64,
    /// The joint of the largest weight of each vertex of the body.
    joints: Vec<usize>,
    places: Vec<Option<(String, BodyPlace)>>,
}

/// A picture and its labels.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledPicture {
    /// The person before the backdrop.
    pub colour: RgbImage,
    /// 255 where the person is.
    pub mask: GrayImage,
    /// The number of the joint, counted from 1; 0 where the person is not.
    pub joints: GrayImage,
    /// z of the surface, metres; infinite where there is none.
    pub depth: Vec<f32>,
    /// In camera space: red right, green up, blue towards the camera, each from -1 (0) to 1 (255); black where there is none.
    pub normals: RgbImage,
    /// The rest.
    pub labels: Labels,
}

impl<'a> LabelledPictures<'a> {
    /// Of people who have this body, before these backdrops.
    pub fn new(
        people: &'a dyn People,
        body: &'a BodyModel,
        parts: &'a PartLabels,
        backdrops: &'a Backdrops,
        size: [u32; 2],
        seed: u64,
    ) -> Self {
        let count = body.skeleton().joints.len();
        let dominant = |row: &[f32]| (0..count).rev().max_by(|a, b| row[*a].total_cmp(&row[*b])).unwrap_or(0);
        let joints: Vec<usize> = body.skinning_weights().chunks_exact(count).map(dominant).collect();
        let places = body_places(body, &joints);
        Self { people, body, parts, backdrops, size, seed, joints, places }
    }

    /// The picture of a number.
    ///
    /// # Errors
    /// Those of the person, of reading the backdrop, and of drawing.
    pub fn picture(&self, number: usize) -> Result<LabelledPicture> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number as u64);
        let (who, behind) =
            (random.random_range(0..self.people.count()), random.random_range(0..self.backdrops.count()));
        let backdrop = self.backdrops.cut(behind, self.size, &mut random)?;
        let Person { name, mesh, pose } = self.people.person(who)?;
        let camera = drawn::camera(&mesh.vertices, self.size, &mut random)?;
        let scene = Scene::new(&mesh)?.with_ambient_occlusion(None)?.lit_by(drawn::light(&mut random));
        let colour = scene.render_before(&camera, View::Colour, &backdrop)?;
        let seen = render_points(&mesh, &camera)?;
        let posed = self.body.pose(&pose)?;
        let registration = Registration::new(&posed.vertices, self.parts)?;
        let joint = |vertex: &Vec3| self.joints[registration.nearest_vertex(*vertex)];
        let of_mesh: Vec<usize> = mesh.vertices.par_iter().map(joint).collect();
        let film = Film { camera, mesh: &mesh, seen: &seen };
        let label = |name: &str, place: Vec3| {
            let within = registration.nearest(place).1;
            film.joint(name, place, 2.0 * within + CLOTHING)
        };
        let names = self.body.skeleton().joints.iter().zip(&posed.joints);
        let keypoint = |place: &Option<(String, BodyPlace)>| {
            let (name, place) = place.as_ref()?;
            let place = match place {
                BodyPlace::Joint(joint) => posed.joints[*joint],
                BodyPlace::Vertex(vertex) => posed.vertices[*vertex],
            };
            Some(label(name, place))
        };
        let mask: Vec<bool> = seen.iter().map(Option::is_some).collect();
        let labels = Labels {
            number,
            person: name,
            backdrop: self.backdrops.name(behind),
            camera: CameraLabels::of(&camera),
            bounds: bounds(&mask, self.size),
            area: mask.iter().filter(|is_in| **is_in).count(),
            runs: runs(&mask, self.size),
            joints: names.map(|(name, place)| label(name, *place)).collect(),
            keypoints: self.places.iter().map(keypoint).collect(),
            pose: PoseLabels::of(&pose, self.body.skeleton()),
        };
        let [width, height] = self.size;
        let at = |x: u32, y: u32| seen[(y * width + x) as usize];
        Ok(LabelledPicture {
            colour,
            mask: GrayImage::from_fn(width, height, |x, y| Luma([if at(x, y).is_some() { 255 } else { 0 }])),
            joints: GrayImage::from_fn(width, height, |x, y| Luma([film.nearest_label(at(x, y), &of_mesh)])),
            depth: seen.iter().map(|seen| seen.map_or(BACKGROUND, |seen| seen.depth)).collect(),
            normals: RgbImage::from_fn(width, height, |x, y| Rgb(film.normal(at(x, y)))),
            labels,
        })
    }
}

/// What a camera sees.
struct Film<'a> {
    camera: PinholeCamera,
    mesh: &'a TriangleMesh,
    /// (height x width).
    seen: &'a [Option<SeenPoint>],
}

impl Film<'_> {
    /// A place that is seen unless something is more than `cover` metres before it.
    fn joint(&self, name: &str, place: Vec3, cover: f32) -> JointLabel {
        let place = place.to_array().map(f64::from);
        let (pixel, depth) = CameraLabels::of(&self.camera).project(place);
        let [width, height] = [self.camera.width, self.camera.height];
        let is_inside = (0.0..f64::from(width)).contains(&pixel[0]) && (0.0..f64::from(height)).contains(&pixel[1]);
        let visibility = match is_inside && depth > 0.0 {
            false => Visibility::Outside,
            true => match self.seen[pixel[1] as usize * width as usize + pixel[0] as usize] {
                Some(seen) if depth > f64::from(seen.depth + cover) => Visibility::Hidden,
                _ => Visibility::Seen,
            },
        };
        JointLabel { name: name.to_owned(), place, pixel, visibility }
    }

    /// The joint, counted from 1, of the vertex (V) nearest to what is seen.
    fn nearest_label(&self, seen: Option<SeenPoint>, joints: &[usize]) -> u8 {
        let Some(SeenPoint { place, .. }) = seen else { return 0 };
        let [a, b, c] = place.barycentric;
        let corner = if a >= b && a >= c { 0 } else { 1 + usize::from(c > b) };
        u8::try_from(joints[self.mesh.faces[place.face as usize][corner] as usize] + 1).unwrap_or(u8::MAX)
    }

    fn normal(&self, seen: Option<SeenPoint>) -> [u8; 3] {
        let Some(SeenPoint { place, .. }) = seen else { return [0; 3] };
        let normal = self.camera.rotation * self.mesh.normal_at(&place);
        [normal.x, -normal.y, -normal.z].map(|along| ((along * 0.5 + 0.5) * 255.0).round() as u8)
    }
}

/// Left, top, width and height of the box around what is in a mask; zeros if nothing is.
fn bounds(mask: &[bool], [width, _]: [u32; 2]) -> [u32; 4] {
    let places = || (0..mask.len() as u32).filter(|place| mask[*place as usize]);
    let (left, right) = places().fold((u32::MAX, 0), |(left, right), place| {
        let column = place % width;
        (left.min(column), right.max(column + 1))
    });
    match (places().next(), places().next_back()) {
        (Some(first), Some(last)) => [left, first / width, right - left, last / width + 1 - first / width],
        _ => [0; 4],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::write_picture;
    use crate::mesh::SurfaceIndex;
    use crate::mesh::camera::pixel_centre;
    use crate::synthetic::BuiltInSubject;

    /// The built-in body itself, bowed to one side.
    struct Bodies(BuiltInSubject);

    impl People for Bodies {
        fn count(&self) -> usize {
            3
        }

        fn person(&self, index: usize) -> Result<Person> {
            let body = self.0.model();
            let mut pose = body.skeleton().rest_pose();
            pose.rotations[3].0.x = 0.3 * index as f32;
            pose.rotations[16].0.z = -1.0;
            pose.translation = Vec3::new(0.4, -0.1, 2.0);
            let mesh = body.mesh(body.pose(&pose)?.vertices);
            Ok(Person { name: index.to_string(), mesh, pose })
        }
    }

    #[test]
    fn labels_of_pixels_and_joints_are_those_of_the_person_that_is_filmed() {
        let folder = tempfile::tempdir().unwrap();
        write_picture(&folder.path().join("room.png"), &RgbImage::from_pixel(40, 30, Rgb([10, 90, 200]))).unwrap();
        let backdrops = Backdrops::of_folder(folder.path()).unwrap();
        let bodies = Bodies(BuiltInSubject::new().unwrap());
        let (body, parts) = (bodies.0.model(), bodies.0.part_labels());
        let pictures = LabelledPictures::new(&bodies, body, parts, &backdrops, [160, 120], 3);
        let made = pictures.picture(1).unwrap();
        assert_eq!(made, pictures.picture(1).unwrap(), "a picture is a function of its number");
        assert_ne!(made.labels.camera, pictures.picture(2).unwrap().labels.camera);

        let labels = &made.labels;
        let person = bodies.person(labels.person.parse().unwrap()).unwrap();
        let posed = body.pose(&person.pose).unwrap();
        for (joint, (label, place)) in labels.joints.iter().zip(&posed.joints).enumerate() {
            assert_eq!(label.name, body.skeleton().joints[joint]);
            assert_eq!(label.place, place.to_array().map(f64::from));
            assert_eq!(labels.camera.project(label.place).0, label.pixel, "reprojected to the last digit");
            assert!((0.0..160.0).contains(&label.pixel[0]) && (0.0..120.0).contains(&label.pixel[1]));
        }
        // Pixels lie on the person, where their depth says.
        let rotation = labels.camera.rotation.map(|row| Vec3::from_array(row.map(|entry| entry as f32)));
        let camera = PinholeCamera {
            width: 160,
            height: 120,
            fx: labels.camera.focal[0] as f32,
            fy: labels.camera.focal[1] as f32,
            cx: labels.camera.centre[0] as f32,
            cy: labels.camera.centre[1] as f32,
            rotation: glam::Mat3::from_cols_array_2d(&rotation.map(|row| row.to_array())).transpose(),
            translation: Vec3::from_array(labels.camera.translation.map(|along| along as f32)),
        };
        let surface = SurfaceIndex::new(&person.mesh).unwrap();
        let (mut area, mut left, mut joints) = (0, u32::MAX, std::collections::BTreeSet::new());
        for (x, y, pixel) in made.mask.enumerate_pixels() {
            let depth = made.depth[(y * 160 + x) as usize];
            assert_eq!(pixel.0 == [255], depth.is_finite());
            assert_eq!(made.joints.get_pixel(x, y).0 == [0], depth.is_infinite());
            if depth.is_finite() {
                let place = camera.back_project(pixel_centre(x, y), depth);
                assert!(surface.closest(place).distance < 1e-4);
                (area, left) = (area + 1, left.min(x));
                joints.insert(made.joints.get_pixel(x, y).0[0]);
                assert!(made.normals.get_pixel(x, y).0[2] > 100, "what is seen looks at the camera");
            }
        }
        assert_eq!((labels.area, labels.bounds[0]), (area, left));
        assert_eq!(labels.runs.iter().sum::<u32>(), 160 * 120);
        assert!(joints.len() > 10, "{joints:?}");
        assert_eq!(made.colour.get_pixel(0, 0).0, [10, 90, 200]);
        let seen = labels.joints.iter().filter(|joint| joint.visibility == Visibility::Seen).count();
        assert!(seen > 10, "{seen} joints are seen");
    }
}

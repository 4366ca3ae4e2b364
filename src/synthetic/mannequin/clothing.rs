//! What a scanner would see of the mannequin: a finer skin, pushed out by clothes and hair, and coloured.
//!
//! Cloth stands off the T-posed skin along its normals; creases grow with the bend of the joints around them,
//! (1 - cos angle) depth sin(2 pi u / wavelength). Then everything is skinned like the body. Metres, sRGB.

use std::f32::consts::TAU;

use glam::{Affine3A, Vec3};

use super::directions::LeftView;
use super::flesh::Flesh;
use super::model::Mannequin;
use super::recipe::{Garment, Paint, Recipe, Wrinkle, joint_index, twin};
use super::surface::Subdivision;
use crate::body::skin;
use crate::formats::Result;
use crate::mesh::{Colouring, TriangleMesh};

/// Over which length colours change: about an edge, so that borders do not follow the triangles.
const COLOUR_CHANGE: f32 = 0.011;
/// Over which length a hem's flare fades.
const HEM_FADE: f32 = 0.05;

/// The surface that is scanned. W vertices.
pub(super) struct DressedSurface {
    subdivision: Subdivision,
    /// The bare surface in the T-pose, of the mean shape (W).
    skin: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// (W, J).
    weights: Vec<f32>,
    /// Height of clothes and hair over the skin (W).
    height: Vec<f32>,
    colours: Vec<[u8; 3]>,
    creases: Vec<Crease>,
}

/// One joint's creases: height per unit of 1 - cos(angle), where it is not zero.
struct Crease {
    joint: usize,
    heights: Vec<(usize, f32)>,
}

impl DressedSurface {
    pub(super) fn of(recipe: &Recipe, flesh: &Flesh, mannequin: &Mannequin) -> Result<Self> {
        let detail = &recipe.scan;
        let longest = |middle: Vec3| if middle.y > detail.head_above { detail.head_edge } else { detail.edge };
        let mut skin = mannequin.mesh.vertices[..mannequin.skin_vertices].to_vec();
        let subdivision = Subdivision::of(
            &mannequin.mesh.faces[..mannequin.skin_faces],
            &mut skin,
            |start, end| start.distance(end) > longest((start + end) / 2.0),
            |point| flesh.onto_surface(point),
        );
        let bare = TriangleMesh { vertices: skin, faces: subdivision.faces.clone(), ..TriangleMesh::default() };
        let normals = bare.vertex_normals();
        let skin = bare.vertices;
        let rows = subdivision.spread(&mannequin.weights, |a, b| a.iter().zip(b).map(|(a, b)| (a + b) / 2.0).collect());
        let views: Vec<LeftView> =
            (0..skin.len()).map(|vertex| LeftView::of(skin[vertex], normals[vertex], &rows[vertex])).collect();

        let height: Vec<f32> = views.iter().map(|view| height_over_skin(&recipe.garments, view.position)).collect();
        let colours = views.iter().map(|view| colour(recipe, view.position)).collect();
        let mut creases = Vec::new();
        for wrinkle in &recipe.wrinkles {
            let joint = joint_index(&wrinkle.joint)?;
            creases.push(Crease::of(wrinkle, joint, &mannequin.joints, &skin, &height));
            if twin(joint) != joint {
                creases.push(Crease::of(wrinkle, twin(joint), &mannequin.joints, &skin, &height));
            }
        }
        Ok(Self { subdivision, skin, normals, weights: rows.concat(), height, colours, creases })
    }

    /// The scan of a body: `displacements` of its vertices from the template (V), its joints' turns (radians, J), its bone
    /// transforms (J) and place.
    pub(super) fn posed(
        &self,
        displacements: &[Vec3],
        angles: &[f32],
        transforms: &[Affine3A],
        translation: Vec3,
    ) -> TriangleMesh {
        let mut height = self.height.clone();
        for crease in &self.creases {
            let bend = 1.0 - angles[crease.joint].cos();
            for (vertex, share) in &crease.heights {
                height[*vertex] += bend * share;
            }
        }
        let mut vertices = self.subdivision.spread(displacements, |a, b| (a + b) / 2.0);
        for (vertex, displaced) in vertices.iter_mut().enumerate() {
            *displaced += self.skin[vertex] + self.normals[vertex] * height[vertex];
        }
        skin(&mut vertices, &self.weights, transforms);
        vertices.iter_mut().for_each(|vertex| *vertex += translation);
        let mut scan = TriangleMesh {
            vertices,
            faces: self.subdivision.faces.clone(),
            normals: None,
            colouring: Colouring::Vertex(self.colours.clone()),
        };
        scan.normals = Some(scan.vertex_normals());
        scan
    }
}

impl Crease {
    /// Only cloth creases: less where it is thin, and never into the skin by more than half of its height.
    fn of(wrinkle: &Wrinkle, joint: usize, places: &[Vec3], skin: &[Vec3], height: &[f32]) -> Self {
        let axis = Vec3::from(wrinkle.axis).normalize();
        let share = |vertex: &usize| {
            let offset = skin[*vertex] - places[joint];
            let toward_left = if places[joint].x < 0.0 { Vec3::new(-offset.x, offset.y, offset.z) } else { offset };
            let fade = (-(offset.length() / wrinkle.radius).powi(2)).exp();
            let wave = (TAU * toward_left.dot(axis) / wrinkle.wavelength).sin();
            (wrinkle.depth * fade * wave).max(-0.5 * height[*vertex]) * (height[*vertex] / 0.01).min(1.0)
        };
        let heights = (0..skin.len()).map(|vertex| (vertex, share(&vertex))).filter(|(_, share)| share.abs() > 1e-5);
        Self { joint, heights: heights.collect() }
    }
}

/// How far a point of the skin is inside all borders of a garment, metres; negative outside.
fn inside_by(garment: &Garment, point: Vec3) -> f32 {
    let depth = garment.borders.iter().map(|border| Vec3::from(border.normal).dot(point) - border.offset);
    depth.fold(f32::MAX, f32::min)
}

fn height_over_skin(garments: &[Garment], point: Vec3) -> f32 {
    let height = |garment: &Garment| {
        let inside = inside_by(garment, point);
        let rise = smooth_step(inside / garment.rise);
        rise * (garment.thickness + garment.hem * (-inside.max(0.0) / HEM_FADE).exp())
    };
    garments.iter().map(height).fold(0.0, f32::max)
}

fn colour(recipe: &Recipe, point: Vec3) -> [u8; 3] {
    let mut colour = of_bytes(recipe.scan.skin);
    for paint in &recipe.paints {
        colour = colour.lerp(of_bytes(paint.colour), paint_cover(paint, point));
    }
    for garment in &recipe.garments {
        let mut cloth = of_bytes(garment.colour);
        if let Some(stripes) = &garment.stripes {
            // The distance to the nearest stripe's edge, positive on the stripe.
            let phase = (point.y / stripes.period).rem_euclid(1.0) - 0.5;
            let on_stripe = (stripes.share / 2.0 - phase.abs()) * stripes.period;
            cloth = cloth.lerp(of_bytes(stripes.colour), smooth_step(on_stripe / COLOUR_CHANGE + 0.5));
        }
        colour = colour.lerp(cloth, smooth_step(inside_by(garment, point) / COLOUR_CHANGE + 0.5));
    }
    colour.to_array().map(|channel| channel.round() as u8)
}

fn paint_cover(paint: &Paint, point: Vec3) -> f32 {
    let radii = Vec3::from(paint.radii);
    let inside = (1.0 - ((point - Vec3::from(paint.centre)) / radii).length()) * radii.min_element();
    smooth_step(inside / 0.003 + 0.5)
}

fn of_bytes(colour: [u8; 3]) -> Vec3 {
    Vec3::from(colour.map(f32::from))
}

fn smooth_step(value: f32) -> f32 {
    let clamped = value.clamp(0.0, 1.0);
    clamped * clamped * (3.0 - 2.0 * clamped)
}

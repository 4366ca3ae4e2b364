//! GLB file -> mesh.

use std::path::Path;

use glam::{Mat3, Mat4, Vec2, Vec3};

use super::container::Container;
use super::document::{Mesh, Primitive};
use super::material::{Coat, Materials, encoded};
use crate::Parsed;
use crate::ReadMesh;
use crate::draft::{Corner, Draft, Paint, Triangle};
use crate::notes::{Loss, Note, counted, missing_pictures};
use xavatar_formats::{Error, Fault, Result, excerpt};

/// Extensions that a file may require; without those that are not understood it looks different, but is no other mesh.
const KNOWN_EXTENSIONS: [&str; 4] =
    ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp"];

/// Reads the GLB file at `path`, which holds `bytes`.
///
/// # Errors
/// [`Error::Mismatch`] for compressed meshes and other extensions that are required; [`Error::Malformed`] for a file that is cut
/// short or inconsistent, or a picture that is none; [`Error::Refused`] for one that asks for more than its size can explain.
pub(crate) fn read_glb(path: &Path, bytes: &[u8]) -> Result<ReadMesh> {
    let container = Container::parse(bytes).map_err(|fault| fault.in_file(path, "GLB"))?;
    check_extensions(path, &container)?;
    let placed = container.document.placed_nodes().map_err(|fault| fault.in_file(path, "GLB"))?;
    let mut reader = Reader {
        path,
        container: &container,
        draft: Draft::default(),
        materials: Materials::new(path, &container),
        points: 0,
        morphed: 0,
        budget: container.length,
    };
    for (node, (transform, shown)) in container.document.nodes.iter().zip(&placed) {
        let Some(mesh) = node.mesh.filter(|_| *shown) else { continue };
        let Some(mesh) = container.document.meshes.get(mesh) else {
            return Err(reader.malformed(Fault::malformed(format!("mesh {mesh}"), "missing", "one that there is")));
        };
        let joints = node.skin.map(|skin| container.joint_transforms(skin, &placed)).transpose();
        let place = Place { transform: *transform, joints: joints.map_err(|fault| reader.malformed(fault))? };
        reader.morphed += usize::from(node.weights.iter().chain(&mesh.weights).any(|weight| *weight != 0.0));
        reader.add_mesh(mesh, &place)?;
    }
    Ok(reader.finish())
}

fn check_extensions(path: &Path, container: &Container) -> Result<()> {
    let is_known = |name: &&String| KNOWN_EXTENSIONS.contains(&name.as_str()) || name.starts_with("KHR_materials_");
    match container.document.extensions_required.iter().find(|name| !is_known(name)) {
        None => Ok(()),
        Some(name) => Err(Error::Mismatch {
            path: path.into(),
            found: format!("a GLB that needs the extension {}", excerpt(name)),
            expected: "one without compression and the like".into(),
            remedy: "export it again without that".into(),
        }),
    }
}

/// Where a mesh stands.
struct Place {
    transform: Mat4,
    /// Those of its skin, which then stand for that of its node.
    joints: Option<Vec<Mat4>>,
}

struct Reader<'a> {
    path: &'a Path,
    container: &'a Container<'a>,
    draft: Draft,
    materials: Materials<'a>,
    /// Primitives of points or lines.
    points: usize,
    /// Meshes with weights of morph targets.
    morphed: usize,
    /// Vertices, faces and primitives that may still be added.
    budget: usize,
}

impl Reader<'_> {
    fn malformed(&self, fault: Fault) -> Error {
        fault.in_file(self.path, "GLB")
    }

    fn add_mesh(&mut self, mesh: &Mesh, place: &Place) -> Result<()> {
        for primitive in &mesh.primitives {
            let mode = primitive.mode.unwrap_or(4);
            if !(4..=6).contains(&mode) {
                self.points += 1;
                continue;
            }
            let coat = self.materials.coat(primitive.material)?;
            let part = Part::read(self.container, primitive, place, &coat).map_err(|fault| self.malformed(fault))?;
            let size = 1 + part.positions.len() + part.triangles.len();
            self.budget = self.budget.checked_sub(size).ok_or_else(|| Error::Refused {
                path: self.path.into(),
                found: "more vertices and faces than the file has bytes".into(),
            })?;
            self.add(part, &coat);
        }
        Ok(())
    }

    /// Appends a part, whose vertices have each its own row of everything.
    fn add(&mut self, part: Part, coat: &Coat) {
        let draft = &mut self.draft;
        let (first, count) = (draft.positions.len(), part.positions.len());
        let (has_uvs, has_normals) = (part.uvs.is_some(), part.normals.is_some());
        // A colour of vertices is multiplied with the material's, which is left out where both are there.
        let paint = match coat.paint {
            Paint::Plain(_) if part.colours.is_some() => Paint::Vertices,
            paint => paint,
        };
        draft.positions.extend(part.positions);
        draft.uvs.extend(part.uvs.unwrap_or_else(|| vec![Vec2::ZERO; count]));
        draft.normals.extend(part.normals.unwrap_or_else(|| vec![Vec3::ZERO; count]));
        if part.colours.is_some() || !draft.colours.is_empty() {
            draft.colours.resize(first, None);
            draft.colours.extend(part.colours.unwrap_or_else(|| vec![None; count]));
        }
        draft.triangles.extend(part.triangles.into_iter().map(|corners| Triangle {
            corners: corners.map(|corner| {
                let place = first as u32 + corner;
                Corner { position: place, uv: has_uvs.then_some(place), normal: has_normals.then_some(place) }
            }),
            paint,
        }));
    }

    fn finish(mut self) -> ReadMesh {
        let mut notes = Vec::new();
        if self.points > 0 {
            notes.push(Note::new(Loss::Other, format!("{} of points or lines", counted(self.points, "part"))));
        }
        if self.morphed > 0 {
            notes.push(Note::new(Loss::Other, format!("the morph targets of {}", counted(self.morphed, "node"))));
        }
        self.draft.pictures = self.materials.pictures.into_inner();
        self.draft.drop_plain_without_meaning();
        let mut reasons: Vec<String> = self.materials.unread.into_iter().collect();
        reasons.extend(missing_pictures(&self.materials.missing.into_iter().collect::<Vec<String>>()));
        let has_uvs = self.draft.triangles.iter().any(|triangle| triangle.corners[0].uv.is_some());
        if reasons.is_empty() && has_uvs && self.draft.is_colourless() {
            reasons.push("texture coordinates, but no material with a base colour picture".into());
        }
        let mesh = self.draft.assemble(reasons, &mut notes);
        ReadMesh { mesh, notes }
    }
}

/// The vertices (V) and faces of a primitive, in the world.
struct Part {
    positions: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    uvs: Option<Vec<Vec2>>,
    colours: Option<Vec<Option<[u8; 3]>>>,
    triangles: Vec<[u32; 3]>,
}

impl Part {
    fn read(container: &Container, primitive: &Primitive, place: &Place, coat: &Coat) -> Parsed<Self> {
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let Some(position) = attribute("POSITION") else {
            return Err(Fault::malformed("a primitive", "without POSITION", "vertices"));
        };
        let mut positions: Vec<Vec3> = container.vectors::<3>(position)?.into_iter().map(Vec3::from).collect();
        let count = positions.len();
        let check = |name: &str, length: usize| match length == count {
            true => Ok(()),
            false => Err(Fault::malformed(name, format!("{length} rows"), format!("{count}, one a vertex"))),
        };
        let mut normals = None;
        if let Some(accessor) = attribute("NORMAL") {
            let rows = container.vectors::<3>(accessor)?;
            check("NORMAL", rows.len())?;
            normals = Some(rows.into_iter().map(Vec3::from).collect::<Vec<Vec3>>());
        }
        let mut uvs = None;
        if let Some(accessor) = attribute(&format!("TEXCOORD_{}", coat.coordinates)) {
            let rows = container.vectors::<2>(accessor)?;
            check("TEXCOORD", rows.len())?;
            let look_up = |uv: [f32; 2]| coat.transform.map_or(Vec2::from(uv), |transform| transform.apply(uv.into()));
            uvs = Some(rows.into_iter().map(look_up).collect());
        }
        let mut colours = None;
        if let Some(accessor) = attribute("COLOR_0") {
            let rows = container.vectors::<3>(accessor)?;
            check("COLOR_0", rows.len())?;
            let byte = colour_encoding(container);
            colours = Some(rows.into_iter().map(|colour| Some(colour.map(byte))).collect());
        }
        let indices = match primitive.indices {
            Some(accessor) => container.indices(accessor)?,
            None => (0..count as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= count) {
            return Err(Fault::malformed("a primitive", format!("vertex index {index}"), format!("less than {count}")));
        }
        let mut triangles = triangles(primitive.mode.unwrap_or(4), &indices);
        place_vertices(container, primitive, place, &mut positions, normals.as_deref_mut())?;
        if place.joints.is_none() && place.transform.determinant() < 0.0 {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        Ok(Self { positions, normals, uvs, colours, triangles })
    }
}

/// How channels of vertex colours become bytes.
fn colour_encoding(container: &Container) -> fn(f32) -> u8 {
    if container.document.is_of_trimesh() {
        |channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8
    } else {
        |channel| encoded(channel.clamp(0.0, 1.0))
    }
}

/// The faces of a list, a strip or a fan of triangles.
fn triangles(mode: u32, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => indices.as_chunks::<3>().0.to_vec(),
        5 => {
            let turned = |(place, corners): (usize, &[u32])| match (place % 2, corners) {
                (0, &[a, b, c]) => Some([a, b, c]),
                (_, &[a, b, c]) => Some([b, a, c]),
                _ => None,
            };
            indices.windows(3).enumerate().filter_map(turned).collect()
        }
        _ => match indices {
            [first, rest @ ..] => rest.windows(2).map(|pair| [*first, pair[0], pair[1]]).collect(),
            [] => Vec::new(),
        },
    }
}

/// Moves vertices and normals from the mesh's own space to the world.
fn place_vertices(
    container: &Container,
    primitive: &Primitive,
    place: &Place,
    positions: &mut [Vec3],
    normals: Option<&mut [Vec3]>,
) -> Parsed<()> {
    let transforms = match &place.joints {
        Some(joints) => skinned(container, primitive, joints, positions.len())?,
        None => vec![place.transform],
    };
    let of = |vertex: usize| transforms[if transforms.len() == 1 { 0 } else { vertex }];
    for (vertex, position) in positions.iter_mut().enumerate() {
        *position = of(vertex).transform_point3(*position);
    }
    for (vertex, normal) in normals.into_iter().flatten().enumerate() {
        // A normal is perpendicular to what the transform makes of its surface.
        *normal = (Mat3::from_mat4(of(vertex)).inverse().transpose() * *normal).normalize_or_zero();
    }
    Ok(())
}

/// The transform of each of `count` vertices by the joints that move it; the identity for those that none does.
fn skinned(container: &Container, primitive: &Primitive, joints: &[Mat4], count: usize) -> Parsed<Vec<Mat4>> {
    let mut sums = vec![(Mat4::ZERO, 0.0); count];
    for set in 0.. {
        let attribute = |name: &str| primitive.attributes.get(&format!("{name}_{set}")).copied();
        let Some((moved_by, weights)) = attribute("JOINTS").zip(attribute("WEIGHTS")) else { break };
        let (moved_by, weights) = (container.joints(moved_by)?, container.vectors::<4>(weights)?);
        if moved_by.len() != count || weights.len() != count {
            let found = format!("{} and {} rows", moved_by.len(), weights.len());
            return Err(Fault::malformed("JOINTS and WEIGHTS", found, format!("{count}, one a vertex")));
        }
        for ((sum, total), (moved_by, weights)) in sums.iter_mut().zip(moved_by.iter().zip(&weights)) {
            for (joint, weight) in moved_by.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                let Some(transform) = joints.get(*joint as usize) else {
                    return Err(Fault::malformed(
                        "JOINTS",
                        format!("joint {joint}"),
                        format!("less than {}", joints.len()),
                    ));
                };
                *sum += *transform * *weight;
                *total += weight;
            }
        }
    }
    let mean = |(sum, total): (Mat4, f32)| if total > 0.0 { sum * total.recip() } else { Mat4::IDENTITY };
    Ok(sums.into_iter().map(mean).collect())
}

//! MakeHuman's default rig: 163 bones whose ends are means of vertices, and which vertices each moves.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Deserialize;

use super::base_mesh::BaseMesh;
use super::source::Source;
use xavatar_formats::Result;

const BONES: &str = "mpfb2/rigs/standard/rig.default.json";
const WEIGHTS: &str = "mpfb2/rigs/standard/weights.default.json";

/// A bone.
pub(super) struct Bone {
    pub name: String,
    /// Before it among the bones.
    pub parent: Option<usize>,
    /// The vertices whose mean is where it begins, and where it ends.
    head: Vec<usize>,
    tail: Vec<usize>,
}

/// The bones, parents first, and what they move.
pub(super) struct Rig {
    pub bones: Vec<Bone>,
    /// The bones of each vertex with their weights, which sum to 1 where there are any.
    pub weights: Vec<Vec<(usize, f64)>>,
}

#[derive(Deserialize)]
struct BoneFile {
    parent: String,
    head: PlaceFile,
    tail: PlaceFile,
}

/// Where an end of a bone is.
#[derive(Deserialize)]
#[serde(tag = "strategy", rename_all = "UPPERCASE")]
enum PlaceFile {
    Cube { cube_name: String },
    Vertex { vertex_index: usize },
    Mean { vertex_indices: Vec<usize> },
}

#[derive(Deserialize)]
struct WeightsFile {
    weights: BTreeMap<String, Vec<(usize, f64)>>,
}

impl Rig {
    pub fn read(source: &mut Source, base: &BaseMesh) -> Result<Self> {
        let files: BTreeMap<String, BoneFile> = source.json(BONES)?;
        let mut bones: Vec<Bone> = Vec::with_capacity(files.len());
        while bones.len() < files.len() {
            let before = bones.len();
            for (name, file) in &files {
                let place = |name: &str| bones.iter().position(|bone| bone.name == *name);
                let parent = place(&file.parent);
                if place(name).is_some() || (parent.is_none() && !file.parent.is_empty()) {
                    continue;
                }
                let end = |end: &PlaceFile| {
                    vertices_of(end, base).ok_or_else(|| {
                        source.malformed(BONES, format!("{name}, an end that is nowhere"), "vertices of the mesh")
                    })
                };
                let bone = Bone { name: name.clone(), parent, head: end(&file.head)?, tail: end(&file.tail)? };
                bones.push(bone);
            }
            if bones.len() == before {
                return Err(source.malformed(BONES, "bones that hang on none", "a tree"));
            }
        }
        let mut weights = vec![Vec::new(); base.vertices.len()];
        let file: WeightsFile = source.json(WEIGHTS)?;
        for (bone, name) in bones.iter().map(|bone| &bone.name).enumerate() {
            for (vertex, weight) in file.weights.get(name).into_iter().flatten() {
                match weights.get_mut(*vertex) {
                    Some(row) if *weight >= 0.0 => row.push((bone, *weight)),
                    _ => {
                        return Err(source.malformed(
                            WEIGHTS,
                            format!("{name}, vertex {vertex}: {weight}"),
                            "a weight of a vertex",
                        ));
                    }
                }
            }
        }
        for row in &mut weights {
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        }
        if let Some(vertex) =
            base.used_vertices().into_iter().find(|vertex| !weights[*vertex].iter().any(|(_, weight)| *weight > 0.0))
        {
            return Err(source.malformed(
                WEIGHTS,
                format!("vertex {vertex}, moved by no bone"),
                "bones for every vertex of the body",
            ));
        }
        Ok(Self { bones, weights })
    }

    /// The bone of this name.
    pub fn bone(&self, name: &str) -> Option<usize> {
        self.bones.iter().position(|bone| bone.name == name)
    }

    /// Where the bones of a shaped mesh begin.
    pub fn heads(&self, vertices: &[DVec3]) -> Vec<DVec3> {
        self.bones.iter().map(|bone| mean(&bone.head, vertices)).collect()
    }

    /// Where they end.
    pub fn tails(&self, vertices: &[DVec3]) -> Vec<DVec3> {
        self.bones.iter().map(|bone| mean(&bone.tail, vertices)).collect()
    }
}

fn vertices_of(place: &PlaceFile, base: &BaseMesh) -> Option<Vec<usize>> {
    let vertices = match place {
        PlaceFile::Cube { cube_name } => base.group(cube_name)?.to_vec(),
        PlaceFile::Vertex { vertex_index } => vec![*vertex_index],
        PlaceFile::Mean { vertex_indices } => vertex_indices.clone(),
    };
    let is_known = !vertices.is_empty() && vertices.iter().all(|vertex| *vertex < base.vertices.len());
    is_known.then_some(vertices)
}

fn mean(of: &[usize], vertices: &[DVec3]) -> DVec3 {
    of.iter().map(|vertex| vertices[*vertex]).sum::<DVec3>() / of.len() as f64
}

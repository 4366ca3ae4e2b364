//! `mhr_model.pt`: what is read of MHR's TorchScript file, which is of its level of detail 1. V vertices, J joints; centimetres.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::correctives::Network;
use super::joints::map;
use super::rig::{Rig, Similarity};
use xavatar_formats::{Array, Error, Result, Value, read_torch};

const FILE: &str = "mhr_model.pt";
const REMEDY: &str = "give mhr_model.pt of the assets that belong to a release of MHR (facebookresearch/MHR)";

/// MHR's body.
pub(super) struct Body {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
    /// What a unit of each coefficient of identity moves the vertices by (V).
    pub identity: Vec<Vec<DVec3>>,
    /// The same of expressions.
    pub expressions: Vec<Vec<DVec3>>,
    pub rig: Rig,
    pub correctives: Network,
}

/// The file's tensors.
struct Tensors {
    path: PathBuf,
    value: Value,
}

impl Body {
    /// Reads the file, or the one in a folder of assets.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is none, [`Error::Mismatch`] naming the tensor that is not there or not what it should be.
    pub fn read(path: &Path) -> Result<Self> {
        let path =
            [path.to_owned(), path.join(FILE), path.join("assets").join(FILE)].into_iter().find(|path| path.is_file());
        let path = path.ok_or_else(|| Error::Missing {
            path: FILE.into(),
            what: "MHR's model".into(),
            remedy: REMEDY.into(),
        })?;
        let tensors = Tensors { value: read_torch(&path)?, path };
        tensors.body()
    }
}

impl Tensors {
    fn body(&self) -> Result<Body> {
        let vertices = self.vectors("character_torch.blend_shape.base_shape", None)?;
        let count = vertices.len();
        let faces = self.indices("character_torch.mesh.faces", count)?;
        let faces: Vec<[u32; 3]> = faces.as_chunks::<3>().0.to_vec();
        let shapes = |name: &str| -> Result<Vec<Vec<DVec3>>> {
            let all = self.vectors(name, None)?;
            if count == 0 || !all.len().is_multiple_of(count) {
                return Err(self.wrong(
                    name,
                    format!("{} offsets", all.len()),
                    &format!("some for each of {count} vertices"),
                ));
            }
            Ok(all.chunks_exact(count).map(<[DVec3]>::to_vec).collect())
        };
        let identity = shapes("character_torch.blend_shape.shape_vectors")?;
        let expressions = shapes("face_expressions_model.shape_vectors")?;
        let rig = self.rig(count, identity.len())?;
        let correctives = self.correctives(count, rig.parents.len())?;
        Ok(Body { vertices, faces, identity, expressions, rig, correctives })
    }

    fn rig(&self, vertices: usize, identity: usize) -> Result<Rig> {
        let joints = map().names.len();
        let name = "character_torch.skeleton.joint_parents";
        let parents = self.numbers(name, Some(joints))?;
        let parent = |(joint, parent): (usize, &f64)| match *parent {
            parent if parent < 0.0 => Ok(None),
            parent if (parent as usize) < joint => Ok(Some(parent as usize)),
            parent => Err(self.wrong(name, format!("{parent} as the parent of joint {joint}"), "a joint before it")),
        };
        let parents: Vec<Option<usize>> = parents.iter().enumerate().map(parent).collect::<Result<_>>()?;
        let quaternion = |of: &[f64]| DQuat::from_slice(of).normalize();
        let prerotations = self.numbers("character_torch.skeleton.joint_prerotations", Some(4 * joints))?;
        let name = "character_torch.linear_blend_skinning.inverse_bind_pose";
        let bind = self.numbers(name, Some(8 * joints))?;
        let inverse_bind = bind.as_chunks::<8>().0.iter().map(|row| Similarity {
            shift: DVec3::from_slice(row),
            turn: quaternion(&row[3..7]),
            scale: row[7],
        });
        let inverse_bind: Vec<Similarity> = inverse_bind.collect();
        let prerotations: Vec<DQuat> = prerotations.as_chunks::<4>().0.iter().map(|row| quaternion(row)).collect();
        if let Some(joint) =
            (0..joints).find(|joint| !(prerotations[*joint].is_finite() && inverse_bind[*joint].turn.is_finite()))
        {
            return Err(self.wrong(name, format!("no rotation at joint {joint}"), "unit quaternions"));
        }
        let name = "character_torch.parameter_transform.parameter_transform";
        let transform = self.numbers(name, None)?;
        let columns = transform.len() / (7 * joints);
        if columns <= identity || transform.len() != 7 * joints * columns {
            let expected = format!("seven rows a joint of more than {identity} columns");
            return Err(self.wrong(name, format!("{} numbers", transform.len()), &expected));
        }
        Ok(Rig {
            offsets: self.vectors("character_torch.skeleton.joint_translation_offsets", Some(joints))?,
            prerotations,
            transform,
            parameters: columns - identity,
            inverse_bind,
            weights: self.weights(vertices, joints)?,
            parents,
        })
    }

    /// The joints that each vertex follows (V); weights that sum to 1.
    fn weights(&self, vertices: usize, joints: usize) -> Result<Vec<Vec<(usize, f64)>>> {
        let name = |what: &str| format!("character_torch.linear_blend_skinning.{what}_flattened");
        let of_vertex = self.indices(&name("vert_indices"), vertices)?;
        let of_joint = self.indices(&name("skin_indices"), joints)?;
        let shares = self.numbers(&name("skin_weights"), Some(of_vertex.len()))?;
        if of_joint.len() != of_vertex.len() {
            let found = format!("{} joints for {} vertices", of_joint.len(), of_vertex.len());
            return Err(self.wrong(&name("skin_indices"), found, "as many as vertices"));
        }
        let mut rows = vec![Vec::new(); vertices];
        for ((vertex, joint), share) in of_vertex.iter().zip(&of_joint).zip(shares) {
            rows[*vertex as usize].push((*joint as usize, share));
        }
        for (vertex, row) in rows.iter_mut().enumerate() {
            let sum: f64 = row.iter().map(|(_, share)| share).sum();
            if sum <= 0.0 || !sum.is_finite() {
                return Err(self.wrong(
                    &name("skin_weights"),
                    format!("{sum} in all at vertex {vertex}"),
                    "weights that sum to 1",
                ));
            }
            row.iter_mut().for_each(|(_, share)| *share /= sum);
        }
        Ok(rows)
    }

    fn correctives(&self, vertices: usize, joints: usize) -> Result<Network> {
        let name = |what: &str| format!("pose_correctives_model.pose_dirs_predictor.{what}");
        let features = Network::features(joints);
        let second = name("2.weight");
        let output = self.array(&second)?;
        let hidden = match output.shape[..] {
            [rows, hidden] if rows == 3 * vertices && hidden > 0 => hidden,
            _ => return Err(self.wrong(&second, output.description(), &format!("{} rows", 3 * vertices))),
        };
        let weights = self.numbers(&name("0.sparse_weight"), None)?;
        let places = self.indices(&name("0.sparse_indices"), hidden.max(features))?;
        let (rows, columns) = places.split_at(places.len() / 2);
        let fits = rows.len() == weights.len()
            && columns.len() == weights.len()
            && rows.iter().all(|row| (*row as usize) < hidden)
            && columns.iter().all(|column| (*column as usize) < features);
        if !fits {
            let expected = format!("{} places in {hidden} rows of {features}", weights.len());
            return Err(self.wrong(&name("0.sparse_indices"), format!("{} numbers", places.len()), &expected));
        }
        let entries = rows.iter().zip(columns).zip(weights).map(|((row, column), weight)| (*row, *column, weight));
        let finite = output.to_f32().filter(|values| values.iter().all(|value| value.is_finite()));
        let second = finite.ok_or_else(|| self.wrong(&second, output.description(), "finite numbers"))?;
        Ok(Network { hidden, first: entries.collect(), second })
    }

    fn array(&self, name: &str) -> Result<&Array> {
        let found = name.split('.').try_fold(&self.value, |value, key| value.get(key));
        match found {
            Some(Value::Array(array)) => Ok(array),
            found => Err(self.wrong(
                name,
                found.map_or("nothing of this name".into(), |found| found.kind().into()),
                "a tensor",
            )),
        }
    }

    /// Finite numbers, so many if it is known.
    fn numbers(&self, name: &str, count: Option<usize>) -> Result<Vec<f64>> {
        let array = self.array(name)?;
        let numbers = array.to_f64().filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        let numbers = numbers.filter(|numbers| count.is_none_or(|count| numbers.len() == count));
        numbers.ok_or_else(|| {
            let expected = count.map_or("finite numbers".into(), |count| format!("{count} finite numbers"));
            self.wrong(name, array.description(), &expected)
        })
    }

    fn vectors(&self, name: &str, count: Option<usize>) -> Result<Vec<DVec3>> {
        let numbers = self.numbers(name, count.map(|count| 3 * count))?;
        Ok(numbers.as_chunks::<3>().0.iter().map(|row| DVec3::from_array(*row)).collect())
    }

    fn indices(&self, name: &str, length: usize) -> Result<Vec<u32>> {
        let array = self.array(name)?;
        array
            .to_indices(length)
            .ok_or_else(|| self.wrong(name, array.description(), &format!("numbers from 0 to below {length}")))
    }

    fn wrong(&self, name: &str, found: String, expected: &str) -> Error {
        Error::Mismatch {
            path: self.path.clone(),
            found: format!("`{name}`: {found}"),
            expected: expected.into(),
            remedy: REMEDY.into(),
        }
    }
}

//! The file of a BLSM body: an npz of plain arrays, in double precision.
//!
//! `blsm_template` (V, 3), `f` (F, 3), `weights` (V, J), `parents` (J), `joint_names`, `offsets` (J, 3), `matter` (J), `atoms` (A, 2) of joint and axis,
//! `atom_limits` (A, 2), `bone_mean` (J), `bone_basis` (K, J), `bone_correctives` (K, V, 3), `shape_basis` (S, V, 3).

use std::path::Path;

use glam::DVec3;
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result, read_npz};

use super::{Atom, Atoms, BlsmBody, ScaledSkeleton};

const TEMPLATE: &str = "blsm_template";
const FORMAT: &str = "file of a BLSM body";
/// How far a row of weights may sum from 1.
const TOLERANCE: f64 = 1e-3;

impl BlsmBody {
    /// Whether arrays are those of such a body.
    pub fn is_in(arrays: &ArrayMap) -> bool {
        arrays.contains_key(TEMPLATE)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Those of [`from_arrays`](Self::from_arrays) and of reading an npz.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_arrays(path, &read_npz(path)?)
    }

    /// A body of the arrays of its file; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing, has another shape, or holds numbers that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let file = File { path, arrays };
        let (template, vertices) = file.points(TEMPLATE, 1)?;
        let template = template.into_iter().next().unwrap_or_default();
        let (parents, joints) = file.rows("parents", 1)?;
        let names = arrays.get("joint_names").and_then(|array| array.text()).unwrap_or_default();
        let names: Vec<String> = names.lines().map(str::to_owned).collect();
        file.expect("joint_names", names.len() == joints && joints > 0, format_args!("{joints} names"))?;
        let parents: Vec<Option<usize>> = parents.iter().map(|parent| index(parent[0])).collect();
        let is_tree = parents.iter().enumerate().all(|(joint, parent)| match parent {
            None => joint == 0,
            Some(parent) => *parent < joint,
        });
        file.expect("parents", is_tree, "one root, the first, and parents before their children")?;
        let (weights, width) = file.rows_of("weights", vertices)?;
        file.expect("weights", width == joints, format_args!("{joints} columns"))?;
        let is_sum = |row: &Vec<f64>| {
            row.iter().all(|weight| *weight >= 0.0) && (row.iter().sum::<f64>() - 1.0).abs() < TOLERANCE
        };
        file.expect("weights", weights.iter().all(is_sum), "rows of weights of sum 1")?;
        let sparse = |row: Vec<f64>| row.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
        let (faces, _) = file.rows("f", 3)?;
        let corner = |value: &f64| index(*value).filter(|corner| *corner < vertices).map(|corner| corner as u32);
        let faces: Option<Vec<[u32; 3]>> =
            faces.iter().map(|row| Some([corner(&row[0])?, corner(&row[1])?, corner(&row[2])?])).collect();
        let Some(faces) = faces else { return Err(file.wrong("f", format_args!("corners below {vertices}"))) };
        let (offsets, count) = file.points("offsets", 1)?;
        file.expect("offsets", count == joints, format_args!("{joints} rows"))?;
        let (matter, count) = file.rows("matter", 1)?;
        let matter: Vec<usize> = matter.iter().filter_map(|row| index(row[0]).filter(|bone| *bone < joints)).collect();
        file.expect("matter", count == joints && matter.len() == joints, format_args!("{joints} joints"))?;
        let (atoms, count) = file.rows("atoms", 2)?;
        let (limits, its_count) = file.rows("atom_limits", 2)?;
        let atom = |(atom, limits): (&Vec<f64>, &Vec<f64>)| {
            let (joint, axis) = (index(atom[0]).filter(|at| *at < joints)?, index(atom[1]).filter(|at| *at < 3)?);
            (limits[0] < limits[1]).then_some(Atom { joint, axis, low: limits[0], high: limits[1] })
        };
        let list: Vec<Atom> = atoms.iter().zip(&limits).filter_map(atom).collect();
        file.expect("atoms", list.len() == count && count == its_count, "joints, axes, and limits that ascend")?;
        let (bone_mean, count) = file.rows("bone_mean", 1)?;
        file.expect("bone_mean", count == joints, format_args!("{joints} scales"))?;
        let (bone_basis, width) = file.rows_of("bone_basis", file.length("bone_basis"))?;
        file.expect("bone_basis", width == joints || bone_basis.is_empty(), format_args!("{joints} columns"))?;
        let (bone_correctives, count) = file.points("bone_correctives", bone_basis.len())?;
        file.expect("bone_correctives", count == vertices || bone_basis.is_empty(), "a row a vertex")?;
        let shapes = file.length("shape_basis");
        let (shape_basis, count) = file.points("shape_basis", shapes)?;
        file.expect("shape_basis", count == vertices || shapes == 0, "a row a vertex")?;
        Ok(Self {
            names,
            skeleton: ScaledSkeleton { parents, offsets: offsets.into_iter().next().unwrap_or_default(), matter },
            atoms: Atoms { list, joints },
            template,
            faces,
            weights: weights.into_iter().map(sparse).collect(),
            bone_mean: bone_mean.into_iter().map(|row| row[0]).collect(),
            bone_basis,
            bone_correctives,
            shape_basis,
        })
    }

    /// The arrays of a file that reads as this body.
    pub fn to_arrays(&self) -> ArrayMap {
        let (vertices, joints) = (self.template.len(), self.names.len());
        let flat = |points: &[DVec3]| points.iter().flat_map(|point| point.to_array()).collect::<Vec<f64>>();
        let all = |directions: &[Vec<DVec3>]| directions.iter().flat_map(|direction| flat(direction)).collect();
        let mut weights = vec![0.0; vertices * joints];
        for (row, own) in weights.chunks_exact_mut(joints).zip(&self.weights) {
            own.iter().for_each(|(joint, weight)| row[*joint] = *weight);
        }
        let parents = self.skeleton.parents.iter().map(|parent| parent.map_or(-1.0, |parent| parent as f64));
        let atoms = self.atoms.list.iter();
        let (count, modes, shapes) = (self.atoms.count(), self.bone_basis.len(), self.shape_basis.len());
        let corners = self.faces.iter().flatten().map(|corner| f64::from(*corner)).collect();
        let matter = self.skeleton.matter.iter().map(|bone| *bone as f64).collect();
        let arrays: [(&str, Vec<usize>, Vec<f64>); 12] = [
            (TEMPLATE, vec![vertices, 3], flat(&self.template)),
            ("f", vec![self.faces.len(), 3], corners),
            ("weights", vec![vertices, joints], weights),
            ("parents", vec![joints], parents.collect()),
            ("offsets", vec![joints, 3], flat(&self.skeleton.offsets)),
            ("matter", vec![joints], matter),
            ("atoms", vec![count, 2], atoms.clone().flat_map(|atom| [atom.joint as f64, atom.axis as f64]).collect()),
            ("atom_limits", vec![count, 2], atoms.flat_map(|atom| [atom.low, atom.high]).collect()),
            ("bone_mean", vec![joints], self.bone_mean.clone()),
            ("bone_basis", vec![modes, joints], self.bone_basis.concat()),
            ("bone_correctives", vec![modes, vertices, 3], all(&self.bone_correctives)),
            ("shape_basis", vec![shapes, vertices, 3], all(&self.shape_basis)),
        ];
        let array = |(name, shape, data): (&str, _, _)| (name.to_owned(), Array { shape, data: ArrayData::F64(data) });
        let names = ("joint_names".to_owned(), Array::from_text(self.names.join("\n")));
        arrays.into_iter().map(array).chain([names]).collect()
    }
}

/// Arrays, and where they are from.
struct File<'a> {
    path: &'a Path,
    arrays: &'a ArrayMap,
}

impl File<'_> {
    fn wrong(&self, name: &str, expected: impl std::fmt::Display) -> Error {
        let found = self.arrays.get(name).map_or("missing".into(), |array| format!("an array {:?}", array.shape));
        let (path, place) = (self.path.into(), format!("`{name}`"));
        Error::Malformed { path, format: FORMAT, place, found, expected: expected.to_string() }
    }

    fn expect(&self, name: &str, holds: bool, expected: impl std::fmt::Display) -> Result<()> {
        if holds { Ok(()) } else { Err(self.wrong(name, expected)) }
    }

    /// How many entries an array has along its first axis.
    fn length(&self, name: &str) -> usize {
        self.arrays.get(name).and_then(|array| array.shape.first()).copied().unwrap_or(0)
    }

    /// Finite numbers.
    fn numbers(&self, name: &str) -> Result<Vec<f64>> {
        let numbers = self.arrays.get(name).and_then(Array::to_f64);
        let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        finite.ok_or_else(|| self.wrong(name, "finite numbers"))
    }

    /// Rows of this width, and how many.
    fn rows(&self, name: &str, width: usize) -> Result<(Vec<Vec<f64>>, usize)> {
        let numbers = self.numbers(name)?;
        self.expect(name, numbers.len().is_multiple_of(width), format_args!("rows of {width}"))?;
        let rows: Vec<Vec<f64>> = numbers.chunks_exact(width).map(<[f64]>::to_vec).collect();
        let count = rows.len();
        Ok((rows, count))
    }

    /// So many rows, and their width.
    fn rows_of(&self, name: &str, count: usize) -> Result<(Vec<Vec<f64>>, usize)> {
        let numbers = self.numbers(name)?;
        let is_possible = if count == 0 { numbers.is_empty() } else { numbers.len().is_multiple_of(count) };
        self.expect(name, is_possible, format_args!("{count} rows"))?;
        let width = numbers.len().checked_div(count).unwrap_or(0);
        self.expect(name, width > 0 || count == 0, format_args!("{count} rows"))?;
        Ok((numbers.chunks_exact(width.max(1)).map(<[f64]>::to_vec).collect(), width))
    }

    /// So many lists of points, and how many points each has.
    fn points(&self, name: &str, lists: usize) -> Result<(Vec<Vec<DVec3>>, usize)> {
        let (rows, width) = self.rows_of(name, lists)?;
        self.expect(name, width.is_multiple_of(3), "three numbers a point")?;
        let points = |row: &Vec<f64>| row.as_chunks::<3>().0.iter().map(|point| DVec3::from_array(*point)).collect();
        Ok((rows.iter().map(points).collect(), width / 3))
    }
}

fn index(value: f64) -> Option<usize> {
    (value >= 0.0 && value.fract() == 0.0 && value < f64::from(u32::MAX)).then_some(value as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blsm::derivatives::tests::reference_body;
    use xavatar_formats::write_npz;

    #[test]
    fn a_body_survives_its_file() {
        let (body, _) = reference_body();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("body.npz");
        write_npz(&path, &body.to_arrays()).unwrap();
        assert_eq!(BlsmBody::read(&path).unwrap(), body);
        let bare = BlsmBody { bone_basis: Vec::new(), bone_correctives: Vec::new(), shape_basis: Vec::new(), ..body };
        assert_eq!(BlsmBody::from_arrays(&path, &bare.to_arrays()).unwrap(), bare);
    }

    #[test]
    fn what_cannot_be_is_named() {
        let (body, _) = reference_body();
        let arrays = body.to_arrays();
        for name in arrays.keys().filter(|name| !name.starts_with("bone_basis") && !name.starts_with("shape_basis")) {
            let mut missing = arrays.clone();
            missing.remove(name);
            let message = BlsmBody::from_arrays(Path::new("a.npz"), &missing).unwrap_err().to_string();
            assert!(message.contains("a.npz") && message.contains(&format!("`{name}`")), "{name}: {message}");
        }
        let with = |name: &str, at: usize, value: f64| {
            let mut wrong = arrays.clone();
            let mut numbers = wrong[name].to_f64().unwrap();
            numbers[at] = value;
            let shape = wrong[name].shape.clone();
            wrong.insert(name.into(), Array { shape, data: ArrayData::F64(numbers) });
            BlsmBody::from_arrays(Path::new("a.npz"), &wrong).unwrap_err().to_string()
        };
        for (name, at, value) in [
            ("weights", 3, -0.5),
            ("parents", 2, 7.0),
            ("f", 0, 96.0),
            ("matter", 1, 24.0),
            ("atoms", 1, 3.0),
            ("atom_limits", 0, 9.0),
            ("bone_mean", 4, f64::NAN),
            ("offsets", 0, f64::INFINITY),
        ] {
            let message = with(name, at, value);
            assert!(message.contains(if name == "atom_limits" { "atoms" } else { name }), "{name}: {message}");
        }
    }
}

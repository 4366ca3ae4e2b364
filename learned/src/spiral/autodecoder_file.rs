//! An auto-decoder among the arrays of a file.
//!
//! `spiral.points` (V, 3) and `spiral.0.faces` (F, 3) are the finest level, `spiral.N.kept` and `spiral.N.faces` each coarser one, on vertices of the one before;
//! `spiral.mean` and `spiral.deviation` (V, 3), `spiral.components` (Z, V, 3); `spiral.origin` (Z) and `spiral.axes` (Z, K) of codes; `spiral.network.*` the network.

use std::path::Path;

use glam::{DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
use xavatar_formats::{Array, ArrayData, ArrayMap, Error, Result};
use xavatar_mesh::TriangleMesh;

use super::autodecoder::Codes;
use super::{Autodecoder, Level, Pooling, Standard};
use crate::descent::of_tensors;

const NETWORK: &str = "spiral.network.";
/// Coarser levels at most.
const LEVELS: usize = 4;

impl Autodecoder {
    /// Whether arrays hold one.
    pub fn is_in(arrays: &ArrayMap) -> bool {
        arrays.contains_key("spiral.points")
    }

    /// Its arrays.
    ///
    /// # Errors
    /// candle's.
    pub fn to_arrays(&self) -> Result<ArrayMap> {
        let mut arrays = self.parameters.to_arrays(NETWORK).map_err(of_tensors)?;
        let mut add = |name: &str, shape: &[usize], numbers: Vec<f64>| {
            let array = Array { shape: shape.to_vec(), data: ArrayData::F64(numbers) };
            arrays.insert(format!("spiral.{name}"), array);
        };
        let flat = |points: &[DVec3]| points.iter().flat_map(|point| point.to_array()).collect::<Vec<f64>>();
        for (number, level) in self.levels.iter().enumerate() {
            let corners = level.faces.iter().flatten().map(|corner| f64::from(*corner)).collect();
            add(&format!("{number}.faces"), &[level.faces.len(), 3], corners);
            match &level.from_finer {
                None => add("points", &[level.points.len(), 3], flat(&level.points)),
                Some(pooling) => add(
                    &format!("{number}.kept"),
                    &[pooling.kept.len()],
                    pooling.kept.iter().map(|vertex| f64::from(*vertex)).collect(),
                ),
            }
        }
        let Standard { mean, deviation } = &self.standard;
        add("mean", &[mean.len(), 3], flat(mean));
        add("deviation", &[deviation.len(), 3], flat(deviation));
        let all = self.components.iter().flat_map(|component| flat(component)).collect();
        add("components", &[self.components.len(), mean.len(), 3], all);
        let Codes { origin, axes } = &self.codes;
        add("origin", &[origin.len()], origin.as_slice().to_vec());
        add("axes", &[axes.nrows(), axes.ncols()], axes.transpose().as_slice().to_vec());
        Ok(arrays)
    }

    /// One of arrays; `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the array that is missing, has another shape, or holds numbers that cannot be.
    pub fn from_arrays(path: &Path, arrays: &ArrayMap) -> Result<Self> {
        let file = File { path, arrays };
        let points = file.points("points", None)?;
        let vertices = points.len();
        let faces = file.faces(0, vertices)?;
        let standard = Standard {
            mean: file.points("mean", Some(vertices))?,
            deviation: file.points("deviation", Some(vertices))?,
        };
        let mut levels = vec![Level { points, faces, from_finer: None }];
        while levels.len() <= LEVELS && arrays.contains_key(&format!("spiral.{}.kept", levels.len())) {
            levels.push(file.coarser(&levels)?);
        }
        let origin = file.numbers("origin")?;
        let axes = file.numbers("axes")?;
        let shape = arrays.get("spiral.axes").map_or(&[][..], |array| &array.shape);
        let [height, width] = *shape else { return Err(file.wrong("axes", "a row a code of the network")) };
        if height != origin.len() || height == 0 || width == 0 {
            return Err(file.wrong("axes", format_args!("{} rows, and a column a code", origin.len())));
        }
        let components = file.points("components", height.checked_mul(vertices))?;
        let components = components.chunks_exact(vertices).map(<[DVec3]>::to_vec).collect();
        // Before memory is taken for it.
        let first = Self::first_weights(&levels, height);
        if arrays.get(&format!("{NETWORK}code.W")).is_none_or(|array| array.shape != first) {
            return Err(file.wrong("network.code.W", format_args!("shape {first:?}")));
        }
        let mut decoder = Self::new(levels, standard, components, 0)?;
        decoder.parameters.set(path, arrays, NETWORK)?;
        decoder.codes =
            Codes { origin: DVector::from_vec(origin), axes: DMatrix::from_row_slice(height, width, &axes) };
        Ok(decoder)
    }
}

/// Arrays, and where they are from.
struct File<'a> {
    path: &'a Path,
    arrays: &'a ArrayMap,
}

impl File<'_> {
    fn wrong(&self, name: &str, expected: impl std::fmt::Display) -> Error {
        let name = format!("spiral.{name}");
        let found = self.arrays.get(&name).map_or("missing".into(), |array| format!("an array {:?}", array.shape));
        let (path, place) = (self.path.into(), format!("`{name}`"));
        Error::Malformed { path, format: "file of a spiral network", place, found, expected: expected.to_string() }
    }

    /// Finite numbers.
    fn numbers(&self, name: &str) -> Result<Vec<f64>> {
        let numbers = self.arrays.get(&format!("spiral.{name}")).and_then(Array::to_f64);
        let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        finite.ok_or_else(|| self.wrong(name, "finite numbers"))
    }

    fn points(&self, name: &str, count: Option<usize>) -> Result<Vec<DVec3>> {
        let numbers = self.numbers(name)?;
        let (rows, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() || rows.is_empty() || count.is_some_and(|count| count != rows.len()) {
            return Err(self.wrong(name, "three numbers a vertex"));
        }
        Ok(rows.iter().map(|row| DVec3::from_array(*row)).collect())
    }

    /// Numbers of vertices below a limit.
    fn vertices(&self, name: &str, limit: usize) -> Result<Vec<u32>> {
        let numbers = self.numbers(name)?;
        let vertex = |number: &f64| {
            (*number >= 0.0 && number.fract() == 0.0 && *number < limit as f64).then_some(*number as u32)
        };
        let vertices: Option<Vec<u32>> = numbers.iter().map(vertex).collect();
        vertices
            .filter(|vertices| !vertices.is_empty())
            .ok_or_else(|| self.wrong(name, format_args!("numbers of vertices, below {limit}")))
    }

    fn faces(&self, level: usize, limit: usize) -> Result<Vec<[u32; 3]>> {
        let name = format!("{level}.faces");
        let corners = self.vertices(&name, limit)?;
        let (faces, rest) = corners.as_chunks::<3>();
        if rest.is_empty() { Ok(faces.to_vec()) } else { Err(self.wrong(&name, "three corners a face")) }
    }

    /// The level after these.
    fn coarser(&self, levels: &[Level]) -> Result<Level> {
        let number = levels.len();
        let fine = &levels[number - 1].points;
        let kept = self.vertices(&format!("{number}.kept"), fine.len())?;
        let points: Vec<DVec3> = kept.iter().map(|vertex| fine[*vertex as usize]).collect();
        let faces = self.faces(number, points.len())?;
        let vertices: Vec<Vec3> = points.iter().map(|point| point.as_vec3()).collect();
        let mesh = TriangleMesh { vertices, faces: faces.clone(), ..TriangleMesh::default() };
        let pooling = Pooling::new(fine, kept, &mesh)?;
        Ok(Level { points, faces, from_finer: Some(pooling) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spiral::autodecoder::tests::trained;

    #[test]
    fn an_autodecoder_survives_its_arrays() {
        let (decoder, _, codes) = trained(2);
        let arrays = decoder.to_arrays().unwrap();
        assert!(Autodecoder::is_in(&arrays));
        let again = Autodecoder::from_arrays(Path::new("body.npz"), &arrays).unwrap();
        assert_eq!(again.decoded(&codes[3]).unwrap().shape, decoder.decoded(&codes[3]).unwrap().shape);
    }

    #[test]
    fn what_cannot_be_is_named() {
        let arrays = trained(1).0.to_arrays().unwrap();
        let read = |arrays: &ArrayMap| Autodecoder::from_arrays(Path::new("body.npz"), arrays);
        let mut without = arrays.clone();
        without.insert("spiral.axes".into(), Array { shape: vec![4, 0], data: ArrayData::F64(Vec::new()) });
        let message = read(&without).unwrap_err().to_string();
        assert!(message.contains("`spiral.axes`") && message.contains("a column a code"), "{message}");
        for name in arrays.keys().filter(|name| !name.ends_with("kept")) {
            let mut missing = arrays.clone();
            missing.remove(name);
            let message = read(&missing).unwrap_err().to_string();
            assert!(message.contains("body.npz") && message.contains(&format!("`{name}`")), "{name}: {message}");
        }
        for (name, value) in [
            ("spiral.0.faces", 42.0),
            ("spiral.1.kept", -1.0),
            ("spiral.1.faces", 0.5),
            ("spiral.mean", f64::NAN),
            ("spiral.axes", f64::INFINITY),
        ] {
            let mut wrong = arrays.clone();
            let mut numbers = wrong[name].to_f64().unwrap();
            numbers[0] = value;
            let shape = wrong[name].shape.clone();
            wrong.insert(name.into(), Array { shape, data: ArrayData::F64(numbers) });
            let message = read(&wrong).unwrap_err().to_string();
            assert!(message.contains(&format!("`{name}`")), "{name}: {message}");
        }
    }
}

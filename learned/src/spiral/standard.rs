//! Shapes as a network sees them: every coordinate of every vertex less its mean, over its deviation. N shapes, V vertices.

use candle_core::{DType, Device, Result, Tensor};
use glam::DVec3;
use xavatar_formats::Error;

/// Deviations are at least so large, metres.
const LEAST: f64 = 1e-6;

/// Mean and deviation of every coordinate (V).
#[derive(Clone, Debug, PartialEq)]
pub struct Standard {
    /// Metres.
    pub mean: Vec<DVec3>,
    /// Metres.
    pub deviation: Vec<DVec3>,
}

impl Standard {
    /// Of these shapes (N, V) of a mesh of V vertices.
    ///
    /// # Errors
    /// [`Error::Value`] for a shape of another number of vertices, or with numbers that are not finite.
    pub fn of(shapes: &[Vec<DVec3>], vertices: usize) -> std::result::Result<Self, Error> {
        for (number, shape) in shapes.iter().enumerate() {
            let is_finite = shape.iter().all(|place| place.is_finite());
            if shape.len() != vertices || !is_finite {
                return Err(Error::Value {
                    name: format!("shape {number}"),
                    found: if is_finite {
                        format!("{} vertices", shape.len())
                    } else {
                        "NaN or infinite numbers".into()
                    },
                    expected: format!("{vertices} vertices, all finite"),
                });
            }
        }
        let count = shapes.len().max(1) as f64;
        let mean = |vertex: usize| shapes.iter().map(|shape| shape[vertex]).sum::<DVec3>() / count;
        let mean: Vec<DVec3> = (0..vertices).map(mean).collect();
        let deviation = |(vertex, mean): (usize, &DVec3)| {
            let square = |shape: &Vec<DVec3>| (shape[vertex] - *mean) * (shape[vertex] - *mean);
            let variance = shapes.iter().map(square).sum::<DVec3>() / count;
            DVec3::from_array(variance.to_array().map(f64::sqrt)).max(DVec3::splat(LEAST))
        };
        let deviation = mean.iter().enumerate().map(deviation).collect();
        Ok(Self { mean, deviation })
    }

    /// Whether shapes are all the same, but for rounding.
    pub(super) fn is_still(&self) -> bool {
        self.deviation.iter().all(|deviation| deviation.max_element() <= LEAST)
    }

    /// Mean and deviation as tensors (1, V, 3).
    pub(crate) fn tensors(&self, kind: DType) -> Result<[Tensor; 2]> {
        let tensor = |places: &[DVec3]| {
            let numbers: Vec<f64> = places.iter().flat_map(|place| place.to_array()).collect();
            Tensor::from_vec(numbers, (1, places.len(), 3), &Device::Cpu)?.to_dtype(kind)
        };
        Ok([tensor(&self.mean)?, tensor(&self.deviation)?])
    }

    /// Shapes (N, V) as a tensor (N, V, 3).
    pub(crate) fn tensor_of(&self, shapes: &[Vec<DVec3>], kind: DType) -> Result<Tensor> {
        let rows = shapes.iter().flat_map(|shape| shape.iter().zip(self.mean.iter().zip(&self.deviation)));
        let values: Vec<f64> =
            rows.flat_map(|(place, (mean, deviation))| ((*place - *mean) / *deviation).to_array()).collect();
        Tensor::from_vec(values, (shapes.len(), self.mean.len(), 3), &Device::Cpu)?.to_dtype(kind)
    }

    /// A tensor (N, V, 3) as shapes.
    pub(crate) fn shapes_of(&self, values: &Tensor) -> Result<Vec<Vec<DVec3>>> {
        let shape =
            |directions: Vec<DVec3>| directions.iter().zip(&self.mean).map(|(own, mean)| *own + *mean).collect();
        Ok(self.directions_of(values)?.into_iter().map(shape).collect())
    }

    /// Directions (T, V) as rows of a tensor of differences (T, 3 V).
    pub(super) fn directions_as_rows(&self, directions: &[Vec<DVec3>], kind: DType) -> Result<Tensor> {
        let places = directions.iter().flat_map(|direction| direction.iter().zip(&self.deviation));
        let rows: Vec<f64> = places.flat_map(|(place, deviation)| (*place / *deviation).to_array()).collect();
        Tensor::from_vec(rows, (directions.len(), 3 * self.mean.len()), &Device::Cpu)?.to_dtype(kind)
    }

    /// A tensor of differences (T, V, 3) as directions.
    pub(super) fn directions_of(&self, values: &Tensor) -> Result<Vec<Vec<DVec3>>> {
        let rows = values.flatten_from(1)?.to_dtype(DType::F64)?.to_vec2::<f64>()?;
        let direction = |row: Vec<f64>| {
            let places = row.as_chunks::<3>().0.iter().zip(&self.deviation);
            places.map(|(place, deviation)| DVec3::from_array(*place) * *deviation).collect()
        };
        Ok(rows.into_iter().map(direction).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_mean_0_and_variance_1_and_come_back() {
        let shapes = [vec![DVec3::new(1.0, 2.0, 0.0)], vec![DVec3::new(3.0, 2.0, 1.0)]];
        let standard = Standard::of(&shapes, 1).unwrap();
        let values = standard.tensor_of(&shapes, DType::F64).unwrap();
        assert_eq!(values.flatten_all().unwrap().to_vec1::<f64>().unwrap(), [-1.0, 0.0, -1.0, 1.0, 0.0, 1.0]);
        assert_eq!(standard.shapes_of(&values).unwrap(), shapes);
    }

    #[test]
    fn shapes_of_other_meshes_and_of_no_numbers_are_refused() {
        let message = Standard::of(&[vec![DVec3::ZERO; 3], vec![DVec3::ZERO; 2]], 3).unwrap_err().to_string();
        assert!(message.contains("shape 1") && message.contains("2 vertices"), "{message}");
        let message = Standard::of(&[vec![DVec3::NAN; 3]], 3).unwrap_err().to_string();
        assert!(message.contains("shape 0") && message.contains("NaN"), "{message}");
    }
}

//! The network: convolutions of 3 x 3 pixels, each of half as many as the one before, then the code and the camera, each linear in what is left.
//!
//! Loss: mean |V - D(c)| + mean |p - s (R K D(c))_xy - t|, metres and half pictures, K landmarks of the mesh; with a [`Judge`], how badly it makes the body again, in
//! metres as coordinates deviate.
//! N pictures of C channels, S x S pixels, S a power of two; V vertices.

use candle_core::{DType, Device, Result, Tensor};
use candle_nn::{Conv2d, Linear, Module};
use glam::DVec3;

use super::Judge;
use super::camera::{NUMBERS, PLAIN, projected};
use crate::descent::{Learner, Parameters, Rate, of_tensors};
use crate::spiral::Autodecoder;

/// Channels after each convolution.
const CHANNELS: [usize; 4] = [16, 32, 64, 64];
/// Numbers that code and camera are linear in.
const FEATURES: usize = 256;

/// Pictures, and what is in them.
#[derive(Debug)]
pub struct Drawn {
    /// (N, C, S, S).
    pub pictures: Tensor,
    /// The meshes (N, V), which no camera turned.
    pub shapes: Vec<Vec<DVec3>>,
    /// The landmarks' places (N, L, 2), half pictures, x right and y up.
    pub landmarks: Tensor,
    /// Rows of K (L, V).
    pub of_vertices: Tensor,
}

/// A network that learns what is in pictures.
#[derive(Debug)]
pub struct PictureNetwork<'a> {
    parameters: Parameters,
    convolutions: Vec<Conv2d>,
    features: Linear,
    code: Linear,
    camera: Linear,
    decoder: &'a Autodecoder,
    judge: Option<&'a Judge>,
    drawn: &'a Drawn,
    shapes: Tensor,
    /// What standardised meshes are times, and then more, in metres (1, V, 3).
    deviation: Tensor,
    mean: Tensor,
    /// Of the deviations.
    size: f64,
}

impl<'a> PictureNetwork<'a> {
    /// For these pictures, whose meshes an auto-decoder makes as it is; begun from a seed.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if pictures, meshes and decoder do not fit each other.
    pub fn new(
        drawn: &'a Drawn,
        decoder: &'a Autodecoder,
        judge: Option<&'a Judge>,
        seed: u64,
    ) -> xavatar_formats::Result<Self> {
        Self::begun(drawn, decoder, judge, seed).map_err(of_tensors)
    }

    fn begun(drawn: &'a Drawn, decoder: &'a Autodecoder, judge: Option<&'a Judge>, seed: u64) -> Result<Self> {
        let (_, mut channels, mut side, _) = drawn.pictures.dims4()?;
        let mut parameters = Parameters::new(seed, DType::F32);
        let mut convolutions = Vec::new();
        for (number, wanted) in CHANNELS.into_iter().enumerate() {
            convolutions.push(parameters.halving(&format!("picture.{number}"), channels, wanted)?);
            (channels, side) = (wanted, side.div_ceil(2));
        }
        let features = parameters.linear("features", channels * side * side, FEATURES)?;
        let code = parameters.linear("code", FEATURES, decoder.code_count())?;
        let nothing = Tensor::zeros((NUMBERS, FEATURES), DType::F32, &Device::Cpu)?;
        let plain = Tensor::new(&PLAIN, &Device::Cpu)?.to_dtype(DType::F32)?;
        let camera = Linear::new(parameters.given("camera.W", &nothing)?, Some(parameters.given("camera.b", &plain)?));
        let shapes = decoder.standard().tensor_of(&drawn.shapes, DType::F32)?;
        let [mean, deviation] = decoder.standard().tensors(DType::F32)?;
        let size = deviation.mean_all()?.to_dtype(DType::F64)?.to_scalar()?;
        Ok(Self {
            parameters,
            convolutions,
            features,
            code,
            camera,
            decoder,
            judge,
            drawn,
            shapes,
            mean,
            deviation,
            size,
        })
    }

    /// Meshes (B, V, 3), standardised, and cameras (B, 7) of pictures.
    fn found(&self, pictures: &Tensor) -> Result<(Tensor, Tensor)> {
        let activated = |values: Tensor, layer: &Conv2d| layer.forward(&values)?.elu(1.0);
        let values = self.convolutions.iter().try_fold(pictures.clone(), activated)?;
        let features = self.features.forward(&values.flatten_from(1)?)?.elu(1.0)?;
        Ok((self.decoder.of_codes(&self.code.forward(&features)?)?, self.camera.forward(&features)?))
    }

    /// The meshes (N, V) of pictures (N, C, S, S).
    ///
    /// # Errors
    /// candle's, if the pictures have other sizes.
    pub fn shapes_of(&self, pictures: &Tensor) -> xavatar_formats::Result<Vec<Vec<DVec3>>> {
        let found = self.found(pictures).and_then(|(meshes, _)| self.decoder.standard().shapes_of(&meshes));
        found.map_err(of_tensors)
    }

    /// Shows the judge the meshes of all pictures.
    ///
    /// # Errors
    /// candle's.
    pub fn show(&self, judge: &Judge) -> xavatar_formats::Result<()> {
        self.found(&self.drawn.pictures).map(|(meshes, _)| judge.show(&meshes)).map_err(of_tensors)
    }
}

impl Learner for PictureNetwork<'_> {
    const BATCH: usize = 16;
    const FALLS: f64 = 0.98;

    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn rate_of(_: &str) -> Rate {
        Rate { rate: 1e-3, decay: 1e-5 }
    }

    fn examples(&self) -> usize {
        self.drawn.shapes.len()
    }

    fn loss(&self, batch: &Tensor) -> Result<Tensor> {
        let Drawn { pictures, landmarks, of_vertices, .. } = self.drawn;
        let (made, cameras) = self.found(&pictures.index_select(batch, 0)?)?;
        let left = (&made - self.shapes.index_select(batch, 0)?)?;
        let of_shapes = left.abs()?.broadcast_mul(&self.deviation)?.mean_all()?;
        let metres = made.broadcast_mul(&self.deviation)?.broadcast_add(&self.mean)?;
        let places = of_vertices.unsqueeze(0)?.broadcast_matmul(&metres)?;
        let of_landmarks = (projected(&places, &cameras)? - landmarks.index_select(batch, 0)?)?.abs()?.mean_all()?;
        let loss = (of_shapes + of_landmarks)?;
        match self.judge {
            None => Ok(loss),
            Some(judge) => loss + (judge.loss_of(&made)? * self.size)?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descent::Descent;
    use crate::reference::{faces, reference, vectors};
    use crate::spiral::{AutodecoderTraining, levels};
    use xavatar_mesh::TriangleMesh;

    /// Balls that are long by their number, an auto-decoder of them, and pictures of one colour each that says how long.
    fn drawn() -> (Autodecoder, Judge, Drawn) {
        let golden = reference("spiral_convolution");
        let ball = vectors(&golden["points"]);
        let vertices = ball.iter().map(|point| point.as_vec3()).collect();
        let mesh = TriangleMesh { vertices, faces: faces(&golden["faces"]), ..TriangleMesh::default() };
        let levels = levels(&mesh, &[2, 2]).unwrap();
        let sizes: Vec<f64> = (0..16).map(|number| 1.0 + f64::from(number) / 8.0).collect();
        let long = |size: &f64| ball.iter().map(|place| *place * DVec3::new(1.0, *size, 1.0)).collect();
        let shapes: Vec<Vec<DVec3>> = sizes.iter().map(long).collect();
        let decoder = AutodecoderTraining::new(levels.clone(), &shapes, 2, 0).unwrap().finished().unwrap().0;
        let judge = Judge::new(&levels, &shapes, 2, 1).unwrap();
        let pixels: Vec<f32> = sizes.iter().flat_map(|size| std::iter::repeat_n(*size as f32, 16 * 16)).collect();
        let top: Vec<f32> = ball.iter().map(|place| f32::from(u8::from(place.y > 0.9))).collect();
        let count = top.iter().sum::<f32>();
        let places: Vec<f32> = sizes.iter().flat_map(|size| [0.0, *size as f32]).collect();
        let drawn = Drawn {
            pictures: Tensor::from_vec(pixels, (16, 1, 16, 16), &Device::Cpu).unwrap(),
            landmarks: Tensor::from_vec(places, (16, 1, 2), &Device::Cpu).unwrap(),
            of_vertices: (Tensor::from_vec(top, (1, ball.len()), &Device::Cpu).unwrap() / f64::from(count)).unwrap(),
            shapes,
        };
        (decoder, judge, drawn)
    }

    #[test]
    fn bodies_are_found_in_pictures_with_and_without_a_judge() {
        let (decoder, judge, drawn) = drawn();
        let distance = |network: &PictureNetwork<'_>| {
            let found = network.shapes_of(&drawn.pictures).unwrap();
            let pairs = found.iter().flatten().zip(drawn.shapes.iter().flatten());
            pairs.map(|(one, other)| one.distance(*other)).sum::<f64>()
        };
        for judge in [None, Some(&judge)] {
            let network = PictureNetwork::new(&drawn, &decoder, judge, 3).unwrap();
            let before = distance(&network);
            let mut descent = Descent::new(&network, 0).unwrap();
            let mut judging = judge.map(|judge| Descent::new(judge, 0).unwrap());
            // A judge that knows nothing of real meshes would call the mean the best.
            if let (Some(judge), Some(judging)) = (judge, &mut judging) {
                (0..20).for_each(|_| assert!(judging.epoch(judge).unwrap().is_finite()));
            }
            for _ in 0..60 {
                descent.epoch(&network).unwrap();
                if let (Some(judge), Some(judging)) = (judge, &mut judging) {
                    network.show(judge).unwrap();
                    judging.epoch(judge).unwrap();
                }
            }
            let after = distance(&network);
            assert!(after < 0.5 * before, "{after} of {before}, a judge: {}", judge.is_some());
        }
    }

    #[test]
    fn shapes_of_another_mesh_are_refused() {
        let (decoder, _, mut drawn) = drawn();
        drawn.shapes[4].pop();
        assert!(PictureNetwork::new(&drawn, &decoder, None, 3).is_err());
    }
}

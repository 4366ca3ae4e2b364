//! The training of feet's networks on registrations that stand on the ground (METHOD-BODY section 5).
//!
//! Loss: the mean distance of a vertex; Adam 1e-3, batches of 64, weights decay by 1e-5. Of ten people one is held out, of one person one frame of ten; the
//! networks are those of the epoch in which what is held out is nearest, and training ends when that is long ago. Both feet learn at once. N prints.

use std::path::Path;

use candle_core::{DType, Device, Result as TensorResult, Tensor};
use xavatar_body::BodyModel;
use xavatar_formats::{ArrayMap, Error, Result};

use super::foot::SIDES;
use super::network::{UNIT, distance, through};
use super::prints::{FittedPerson, Print, Twin, from_arrays, to_arrays};
use super::{Feet, Foot};
use crate::core::{FittedBody, Identity, Mirror};
use crate::descent::{Descent, Learner, Parameters, Rate, of_tensors};
use crate::kept::Kept;
use crate::named_arrays::{NamedArrays, array};
use crate::registrations::Registrations;

/// Of so many people, or of one person's frames, one is held out.
const HELD_OUT: usize = 10;
/// Epochs without a better one, and training ends.
const PATIENCE: usize = 40;
const NETWORK: &str = "network";
const BEST: &str = "best.";
const DISTANCES: &str = "held_out";

/// How feet are trained.
#[derive(Clone, Copy, Debug)]
pub struct FeetTraining {
    /// Times that all prints are seen, at most.
    pub epochs: usize,
    /// Of everything random.
    pub seed: u64,
    /// The height of the ground; without it each frame's own, where its feet are flat.
    pub ground: Option<f64>,
}

/// Feet that were trained.
#[derive(Debug)]
pub struct TrainedFeet {
    /// The feet.
    pub feet: Feet,
    /// How large what is to be learned is: the mean distance of a foot's vertex of what is held out from the body, metres.
    pub before: f64,
    /// The same with the networks' offsets, after each epoch.
    pub held_out: Vec<f64>,
}

/// The networks of both feet, and what they learn.
struct Pressing {
    feet: [Foot; 2],
    parameters: Parameters,
    trained: [Examples; 2],
    held: [Examples; 2],
}

/// Features (N, K), and offsets (N, 3 F) in the network's units.
struct Examples {
    features: Tensor,
    offsets: Tensor,
}

impl FeetTraining {
    /// Trains the feet of a body; none if that was stopped, and what is kept is gone on with. `progress` is told what is under way, and the share that is done.
    ///
    /// # Errors
    /// [`Error::Value`] for a body without SMPL's ankles, or fewer than two frames; those of reading registrations; what `progress` returns.
    pub fn train(
        &self,
        model: &BodyModel,
        registrations: &Registrations,
        kept: &mut Kept<'_>,
        mut progress: impl FnMut(&'static str, f64) -> Result<()>,
    ) -> Result<Option<TrainedFeet>> {
        let mut parameters = Parameters::new(self.seed, DType::F32);
        let [left, right] = SIDES.map(|(name, joint)| Foot::of(model, joint, &mut parameters, name));
        let feet = [left?, right?];
        let body = FittedBody::of(model);
        let (mut trained, mut held) = (Vec::new(), Vec::new());
        for (index, subject) in registrations.subjects.iter().enumerate() {
            progress("poses", index as f64 / registrations.subjects.len() as f64)?;
            let part = format!("feet-{index}");
            let prints = match kept.part(&part)? {
                Some((path, arrays)) => pairs_of(NamedArrays::of_state(&path, &arrays), &feet)?,
                None if kept.is_stopped() => return Ok(None),
                None => {
                    let frames = registrations.read_all(subject)?;
                    let person = FittedPerson::of(model, &body, &frames);
                    let prints = Foot::prints(&feet, &body, &person, &frames, self.ground);
                    kept.keep(&part, || Ok(arrays_of(&prints)))?;
                    prints
                }
            };
            let is_held = |frame: usize| match registrations.subjects.len() {
                1 => frame % HELD_OUT == HELD_OUT.min(prints.len()) - 1,
                people => index % HELD_OUT == HELD_OUT.min(people) - 1,
            };
            let (of_held, of_trained): (Vec<_>, Vec<_>) = (0..prints.len()).partition(|frame| is_held(*frame));
            held.extend(of_held.into_iter().map(|frame| prints[frame].clone()));
            trained.extend(of_trained.into_iter().map(|frame| prints[frame].clone()));
        }
        if trained.is_empty() || held.is_empty() {
            let found = format!("{} registrations", registrations.frames());
            let expected = "at least two: one is held out".into();
            return Err(Error::Value { name: "what feet are trained on".into(), found, expected });
        }
        let rest = Identity::of(model);
        let mirror = Mirror::of(&rest.template, &rest.joints);
        let pressing = Pressing::new(feet, parameters, mirror.as_ref(), [&trained, &held])?;
        pressing.descend(self, kept, progress)
    }
}

impl Pressing {
    fn new(
        feet: [Foot; 2],
        parameters: Parameters,
        mirror: Option<&Mirror>,
        [trained, held]: [&[[Print; 2]]; 2],
    ) -> Result<Self> {
        let twin = |side: usize| Twin::of(&feet[side], &feet[1 - side], mirror?);
        let twins = [twin(0), twin(1)];
        let examples = |prints: &[[Print; 2]], side: usize| {
            let own = prints.iter().map(|pair| pair[side].clone());
            let mirrored = twins[side].iter().flat_map(|twin| prints.iter().map(|pair| twin.mirrored(&pair[1 - side])));
            Examples::of(&feet[side], &own.chain(mirrored).collect::<Vec<Print>>())
        };
        let both = |prints: &[[Print; 2]]| Ok([examples(prints, 0)?, examples(prints, 1)?]);
        let trained = both(trained).map_err(of_tensors)?;
        let held = both(held).map_err(of_tensors)?;
        Ok(Self { trained, held, feet, parameters })
    }

    fn descend(
        self,
        training: &FeetTraining,
        kept: &mut Kept<'_>,
        mut progress: impl FnMut(&'static str, f64) -> Result<()>,
    ) -> Result<Option<TrainedFeet>> {
        let mut descent = Descent::new(&self, training.seed)?;
        let mut best = self.parameters.to_arrays(BEST).map_err(of_tensors)?;
        let mut distances: Vec<f64> = Vec::new();
        if let Some((path, arrays)) = kept.part(NETWORK)? {
            descent = Descent::resumed(&self, &path, &arrays)?;
            distances = NamedArrays::of_state(&path, &arrays).list(DISTANCES)?;
            best = arrays.into_iter().filter(|(name, _)| name.starts_with(BEST)).collect();
        }
        while distances.len() < training.epochs {
            let least = least(&distances);
            if least.is_some_and(|(epoch, _)| distances.len() > epoch + PATIENCE) {
                break;
            }
            progress("feet", distances.len() as f64 / training.epochs as f64)?;
            descent.epoch(&self)?;
            let found = self.held_out().map_err(of_tensors)?;
            if least.is_none_or(|(_, least)| found < least) {
                best = self.parameters.to_arrays(BEST).map_err(of_tensors)?;
            }
            distances.push(found);
            let state = || {
                let mut arrays = descent.to_arrays(&self)?;
                arrays.extend(best.clone());
                arrays.insert(DISTANCES.into(), array(&[distances.len()], distances.clone()));
                Ok(arrays)
            };
            if kept.pause(NETWORK, state)? {
                return Ok(None);
            }
        }
        self.parameters.set(Path::new(NETWORK), &best, BEST)?;
        let before = self.distance(|_, examples| examples.offsets.zeros_like()).map_err(of_tensors)?;
        let feet = Feet { feet: self.feet, parameters: self.parameters };
        Ok(Some(TrainedFeet { feet, before, held_out: distances }))
    }

    /// How far vertices are off with the networks' offsets in what is held out, metres.
    fn held_out(&self) -> TensorResult<f64> {
        self.distance(|foot, examples| through(&foot.layers, &examples.features))
    }

    fn distance(&self, offsets: impl Fn(&Foot, &Examples) -> TensorResult<Tensor>) -> TensorResult<f64> {
        let of_foot = |(foot, examples): (&Foot, &Examples)| {
            distance(&offsets(foot, examples)?, &examples.offsets)?.to_dtype(DType::F64)?.to_scalar::<f64>()
        };
        let both: Vec<f64> = self.feet.iter().zip(&self.held).map(of_foot).collect::<TensorResult<_>>()?;
        Ok(UNIT * both.iter().sum::<f64>() / both.len() as f64)
    }
}

impl Learner for Pressing {
    const BATCH: usize = 64;
    const FALLS: f64 = 0.99;

    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn rate_of(_: &str) -> Rate {
        Rate { rate: 1e-3, decay: 1e-5 }
    }

    fn examples(&self) -> usize {
        self.trained[0].features.dims()[0]
    }

    fn loss(&self, batch: &Tensor) -> TensorResult<Tensor> {
        let of_foot = |(foot, examples): (&Foot, &Examples)| {
            let made = through(&foot.layers, &examples.features.index_select(batch, 0)?)?;
            distance(&made, &examples.offsets.index_select(batch, 0)?)
        };
        let [left, right] = [0, 1].map(|side| of_foot((&self.feet[side], &self.trained[side])));
        (left? + right?)? * 0.5
    }
}

impl Examples {
    fn of(foot: &Foot, prints: &[Print]) -> TensorResult<Self> {
        let features: Vec<f64> = prints.iter().flat_map(|print| foot.features(&print.asked)).collect();
        let offsets: Vec<f64> =
            prints.iter().flat_map(|print| &print.offsets).flat_map(|offset| (*offset / UNIT).to_array()).collect();
        let rows = |values: Vec<f64>| Tensor::from_vec(values, (prints.len(), ()), &Device::Cpu)?.to_dtype(DType::F32);
        Ok(Self { features: rows(features)?, offsets: rows(offsets)? })
    }
}

/// The epoch whose distance is least, and that.
fn least(distances: &[f64]) -> Option<(usize, f64)> {
    let epochs = distances.iter().copied().enumerate();
    epochs.min_by(|one, other| one.1.total_cmp(&other.1))
}

/// Both feet's prints as arrays.
fn arrays_of(prints: &[[Print; 2]]) -> ArrayMap {
    let of_side = |side: usize| prints.iter().map(|pair| &pair[side]).collect::<Vec<&Print>>();
    let sides = SIDES.iter().enumerate();
    sides.flat_map(|(side, (name, _))| to_arrays(&of_side(side), &format!("{name}."))).collect()
}

fn pairs_of(file: NamedArrays<'_>, feet: &[Foot; 2]) -> Result<Vec<[Print; 2]>> {
    let of_side = |side: usize| from_arrays(file, &feet[side], &format!("{}.", SIDES[side].0));
    Ok(of_side(0)?.into_iter().zip(of_side(1)?).map(|(left, right)| [left, right]).collect())
}

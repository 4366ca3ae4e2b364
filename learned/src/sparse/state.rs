//! What the training of a STAR or SUPR body keeps: what a round starts from, and every subject as soon as it is fitted.
//!
//! A subject's file says of which round it is: those of the round that is under way are not fitted again, only summed. J joints, V vertices, F frames.

use glam::{DMat3, DVec3};
use xavatar_body::BodyModel;
use xavatar_formats::{Array, ArrayMap, Result};
use xavatar_register::linear::FramePose;

use super::acceleration::Acceleration;
use super::correctives::{PER_JOINT, SparseCorrectives};
use super::training::{State, TrainedSubject};
use crate::core::with_skin;
use crate::descent::{count_of, of_count};
use crate::kept::Kept;
use crate::named_arrays::{NamedArrays, array, flat, points_of, whole};

/// The part of what a round starts from.
const ROUND: &str = "round";

/// A training between two rounds.
pub(super) struct Alternation {
    /// The round that is next.
    pub round: usize,
    pub state: State,
    pub acceleration: Acceleration,
    /// After each round.
    pub held_out: Vec<f64>,
    /// The round in which each subject was fitted last.
    pub fitted: Vec<usize>,
}

impl Alternation {
    /// At its beginning, or where what is kept has it.
    pub fn begun(start: &BodyModel, subjects: usize, kept: &Kept<'_>) -> Result<Self> {
        let (state, acceleration, held_out) = (State::new(start)?, Acceleration::default(), Vec::new());
        let mut found = Self { round: 0, state, acceleration, held_out, fitted: Vec::new() };
        if let Some((path, arrays)) = kept.part(ROUND)? {
            found.resume(start, NamedArrays::of_state(&path, &arrays))?;
        }
        for subject in 0..subjects {
            let Some((path, arrays)) = kept.part(&part_of(subject))? else { break };
            let joints = start.skeleton().joints.len();
            let own = TrainedSubject::from_arrays(NamedArrays::of_state(&path, &arrays), start.vertex_count(), joints)?;
            found.state.subjects.push(own);
            found.fitted.push(count_of(&path, &arrays, ROUND)? as usize);
        }
        Ok(found)
    }

    /// Keeps what the next round starts from.
    pub fn keep(&self, kept: &mut Kept<'_>) -> Result<()> {
        kept.keep(ROUND, || {
            let skin = self.state.model.skinning_weights().to_vec();
            let mut arrays = ArrayMap::from([
                (ROUND.to_owned(), of_count(self.round as u64)),
                ("weights".to_owned(), Array::from_f32(&[skin.len()], skin)),
                ("held_out".to_owned(), array(&[self.held_out.len()], self.held_out.clone())),
            ]);
            arrays.extend(self.state.correctives.to_arrays("correctives."));
            for (number, (from, to)) in self.acceleration.rounds.iter().enumerate() {
                arrays.extend(from.to_arrays(&format!("{number}.from.")));
                arrays.extend(to.to_arrays(&format!("{number}.to.")));
            }
            Ok(arrays)
        })
    }

    /// Keeps a subject that was fitted in this round.
    pub fn keep_subject(&mut self, subject: usize, kept: &mut Kept<'_>) -> Result<()> {
        self.fitted.resize(self.state.subjects.len(), self.round);
        self.fitted[subject] = self.round;
        kept.keep(&part_of(subject), || {
            let mut arrays = self.state.subjects[subject].to_arrays();
            arrays.insert(ROUND.into(), of_count(self.round as u64));
            Ok(arrays)
        })
    }

    fn resume(&mut self, start: &BodyModel, file: NamedArrays<'_>) -> Result<()> {
        let (vertices, joints) = (start.vertex_count(), start.skeleton().joints.len());
        self.round = count_of(file.path, file.arrays, ROUND)? as usize;
        self.held_out = file.list("held_out")?;
        let skin = file.numbers("weights", &[vertices * joints])?;
        let row = |row: &[f64]| row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
        let rows: Vec<Vec<(usize, f64)>> = skin.chunks_exact(joints).map(row).collect();
        let correctives = |prefix: &str| SparseCorrectives::from_arrays(file, prefix, vertices, joints - 1);
        self.state.correctives = correctives("correctives.")?;
        self.state.model = with_skin(start, &rows, self.state.correctives.to_body(joints))?;
        for number in (0..).take_while(|number| file.arrays.contains_key(&format!("{number}.to.counts"))) {
            let pair = (correctives(&format!("{number}.from."))?, correctives(&format!("{number}.to."))?);
            self.acceleration.rounds.push(pair);
        }
        Ok(())
    }
}

fn part_of(subject: usize) -> String {
    format!("person-{subject}")
}

impl TrainedSubject {
    fn to_arrays(&self) -> ArrayMap {
        let (vertices, joints, frames) = (self.identity.template.len(), self.identity.joints.len(), self.poses.len());
        let turns = self.poses.iter().flat_map(|pose| &pose.rotations).flat_map(|turn| turn.to_cols_array()).collect();
        let expressions = self.poses.first().map_or(0, |pose| pose.expression.len());
        let expression = self.poses.iter().flat_map(|pose| pose.expression.clone()).collect();
        [
            ("template", array(&[vertices, 3], flat(&self.identity.template))),
            ("joints", array(&[joints, 3], flat(&self.identity.joints))),
            ("believed", array(&[joints, 3], flat(&self.believed))),
            ("turns", array(&[frames, joints, 9], turns)),
            ("translations", array(&[frames, 3], flat(self.poses.iter().map(|pose| &pose.translation)))),
            ("expressions", array(&[frames, expressions], expression)),
            ("name", Array::from_text(self.name.clone())),
        ]
        .map(|(name, array)| (name.to_owned(), array))
        .into()
    }

    fn from_arrays(file: NamedArrays<'_>, vertices: usize, joints: usize) -> Result<Self> {
        let [frames, _, _] = file.extents("turns");
        let [_, expressions] = file.extents("expressions");
        let turns = file.numbers("turns", &[frames, joints, 9])?;
        let turns: Vec<DMat3> = turns.as_chunks::<9>().0.iter().map(DMat3::from_cols_array).collect();
        let translations = file.points("translations", frames)?;
        let expression = file.numbers("expressions", &[frames, expressions])?;
        let pose = |frame: usize| FramePose {
            rotations: turns[frame * joints..(frame + 1) * joints].to_vec(),
            translation: translations[frame],
            expression: expression[frame * expressions..(frame + 1) * expressions].to_vec(),
        };
        let name = file.arrays.get("name").and_then(Array::text).ok_or_else(|| file.wrong("name", "text"))?;
        Ok(Self {
            name: name.to_owned(),
            identity: crate::core::Identity {
                template: file.points("template", vertices)?,
                joints: file.points("joints", joints)?,
            },
            believed: file.points("believed", joints)?,
            poses: (0..frames).map(pose).collect(),
        })
    }
}

impl SparseCorrectives {
    /// As arrays, their names after a prefix: how many blocks each vertex has (V), and of these N groups (N) and directions (N, 4, 3).
    fn to_arrays(&self, prefix: &str) -> ArrayMap {
        let blocks = || self.vertices.iter().flatten();
        let directions = flat(blocks().flat_map(|(_, block)| block));
        let arrays = [
            ("counts", whole(self.vertices.iter().map(Vec::len))),
            ("groups", whole(blocks().map(|(group, _)| *group))),
            ("directions", array(&[blocks().count(), PER_JOINT, 3], directions)),
        ];
        arrays.into_iter().map(|(name, array)| (format!("{prefix}{name}"), array)).collect()
    }

    fn from_arrays(file: NamedArrays<'_>, prefix: &str, vertices: usize, groups: usize) -> Result<Self> {
        let name = |name: &str| format!("{prefix}{name}");
        let counts = file.places(&name("counts"), groups + 1)?;
        let of_blocks = file.places(&name("groups"), groups)?;
        if counts.len() != vertices || counts.iter().sum::<usize>() != of_blocks.len() {
            return Err(file.wrong(&name("counts"), format_args!("{vertices} counts of {} blocks", of_blocks.len())));
        }
        let directions = points_of(&file.numbers(&name("directions"), &[of_blocks.len(), PER_JOINT, 3])?);
        let block = |block: &[DVec3]| std::array::from_fn(|feature| block[feature]);
        let mut blocks = of_blocks.into_iter().zip(directions.chunks_exact(PER_JOINT).map(block));
        Ok(Self { vertices: counts.into_iter().map(|count| blocks.by_ref().take(count).collect()).collect() })
    }
}

//! Frames that follow each other are fitted once more, to their scans and to their neighbours in time.
//!
//! Every other frame, given those between; then those between; and again. What is kept of frames is not touched: this is done anew by a
//! call that goes on, with the same result.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use xavatar_formats::Result;

use super::record::Record;
use super::{Observer, Working};
use crate::fit::Shaped;
use crate::terms::MotionTerm;

/// How often every frame is fitted again.
const ROUNDS: usize = 2;

impl Working<'_> {
    /// The records with poses that move as people do, if the frame rate is known; none if the job was stopped.
    pub(super) fn smoothed(
        &self,
        mut records: Vec<Option<Record>>,
        shaped: &Shaped,
        observe: &mut Observer<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<Option<Record>>>> {
        let Some(rate) = self.job.frames_per_second else { return Ok(Some(records)) };
        let bad = self.are_bad(&records);
        let sequences = self.sequences();
        let triples: Vec<[usize; 3]> = (sequences.iter().flat_map(|(_, places)| places.windows(3)))
            .filter_map(|window| <[usize; 3]>::try_from(window).ok())
            .filter(|window| window.iter().all(|place| !bad[*place]))
            .collect();
        for pass in 0..2 * ROUNDS {
            let own: Vec<&[usize; 3]> = triples.iter().filter(|[_, place, _]| place % 2 == pass % 2).collect();
            // A batch at a time, so that a long sequence can be stopped.
            for batch in own.chunks(2 * rayon::current_num_threads()) {
                if stop.load(Ordering::Relaxed) {
                    return Ok(None);
                }
                observe("motion", pass as f64 / (2 * ROUNDS) as f64, &self.files[batch[0][1]].id().to_string());
                let fitted = |places: &&&[usize; 3]| self.fitted_between(***places, &records, shaped, rate);
                let fitted: Vec<Option<Record>> =
                    batch.par_iter().map(|places| fitted(&places)).collect::<Result<_>>()?;
                for (places, record) in batch.iter().zip(fitted) {
                    records[places[1]] = record;
                }
            }
        }
        Ok(Some(records))
    }

    /// A frame fitted again between two others.
    fn fitted_between(
        &self,
        places: [usize; 3],
        records: &[Option<Record>],
        shaped: &Shaped,
        rate: f64,
    ) -> Result<Option<Record>> {
        let [Some(before), Some(own), Some(after)] = places.map(|place| records[place].as_ref()) else {
            return Ok(records[places[1]].clone());
        };
        let pose = |record: &Record| record.pose(self.fitter.linkage.extents());
        let mut frame = self.read(places[1])?.frame;
        frame.motion = Some(MotionTerm::of(&pose(before), &pose(after), 1.0 / rate));
        let fitted = self.fitter.fit_between(pose(own), &frame, shaped)?;
        let quality = self.quality(places[1], &fitted, &frame, shaped)?;
        Ok(Some(own.replaced(&fitted, quality)))
    }
}

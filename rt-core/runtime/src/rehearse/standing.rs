//! State of needles that stay in after earlier needles: each needle that comes and goes drags them, and they hold the
//! tissue elsewhere from then on.

use super::script::Script;
use super::{Motion, RehearseError, Rehearsed, Stage, drive, perform};
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use stylet_hw::Hand;
use stylet_shm_schema::{NeedleRehearsal, ParameterSet, SEED_LENGTH_M, StabilisingNeedle};
use stylet_sim::active::Active;
use stylet_sim::line::{LeftRecord, ReadyLine};

/// Ticks of the force loop until the body rests where needles that stay in hold it.
const HELD_TICKS: usize = 20;

/// Reused between rehearsals, as far as the earlier needles are the same.
pub(super) struct Standing {
    of: Of,
    /// State once they are in, before any other needle.
    first: LeftRecord,
    /// State after each needle that came and went.
    after: Vec<(StabilisingNeedle, LeftRecord)>,
}

/// Inputs that such a state depends on.
#[derive(Clone, PartialEq)]
struct Of {
    stabilising: Vec<StabilisingNeedle>,
    set: ParameterSet,
    hand: Hand,
    pace: [f64; 4],
    bends: bool,
}

impl Stage {
    /// Rehearses as [`rehearse`](Stage::rehearse) does, with needles that stay in and after `run.earlier`; `lines` are
    /// theirs and the needle's.
    pub(super) fn rehearse_after(
        &mut self,
        run: &NeedleRehearsal,
        set: &ParameterSet,
        active: &Active,
        mut lines: Vec<ReadyLine>,
        stop: &AtomicBool,
    ) -> Result<Rehearsed, RehearseError> {
        let own = lines.split_off(run.stabilising.len().min(lines.len()));
        let record = self.standing(run, set, active, &lines, stop)?;
        let mut rig = self.rig(run, active)?;
        let outcome = match rig.stand(&lines, &record) {
            true => {
                rig.take_lines(own);
                (0..HELD_TICKS).for_each(|_| _ = rig.tick());
                let script = (Script::beside(run), Motion::new(&self.target));
                perform(&mut rig, run, script, stop)
            }
            false => Err(RehearseError::BodyLost),
        };
        self.world = Some(rig.into_world());
        outcome
    }

    /// Returns their state after all earlier needles.
    fn standing(
        &mut self,
        run: &NeedleRehearsal,
        set: &ParameterSet,
        active: &Active,
        lines: &[ReadyLine],
        stop: &AtomicBool,
    ) -> Result<LeftRecord, RehearseError> {
        let of = Of {
            stabilising: run.stabilising.clone(),
            set: *set,
            hand: self.hand,
            pace: [
                run.insert_m_per_s,
                run.retract_m_per_s,
                run.approach_m_per_s,
                run.acceleration_m_per_s2,
            ],
            bends: active.force.bending.is_on(),
        };
        let mut standing = match self.standing.take().filter(|standing| standing.of == of) {
            Some(standing) => standing,
            None => Standing {
                first: self.put_in(run, active, lines, stop)?,
                after: Vec::new(),
                of,
            },
        };
        let same = standing
            .after
            .iter()
            .zip(&run.earlier)
            .take_while(|((a, _), b)| a == *b)
            .count();
        standing.after.truncate(same);
        for needle in run.earlier.iter().skip(same) {
            let before = standing.after.last().map_or(&standing.first, |(_, record)| record);
            let after = self.come_and_go((run, needle), active, lines, before, stop)?;
            standing.after.push((*needle, after));
        }
        let record = standing
            .after
            .last()
            .map_or(&standing.first, |(_, record)| record)
            .clone();
        self.standing = Some(standing);
        Ok(record)
    }

    /// Inserts the needles that stay in, and takes the hand out again.
    fn put_in(
        &mut self,
        run: &NeedleRehearsal,
        active: &Active,
        lines: &[ReadyLine],
        stop: &AtomicBool,
    ) -> Result<LeftRecord, RehearseError> {
        let mut rig = self.rig(run, active)?;
        rig.take_lines_of_many(lines.to_vec());
        let mut script = Script::new(run);
        let done = drive(&mut rig, stop, |rig, _| {
            script.advance(rig)?;
            Ok(script.is_at_needle())
        });
        let record = rig.standing();
        self.world = Some(rig.into_world());
        done.map(|()| record)
    }

    /// Moves one needle to its depth and out again, with those that stay in place.
    fn come_and_go(
        &mut self,
        (run, needle): (&NeedleRehearsal, &StabilisingNeedle),
        active: &Active,
        lines: &[ReadyLine],
        before: &LeftRecord,
        stop: &AtomicBool,
    ) -> Result<LeftRecord, RehearseError> {
        // A seed that would lie in its tip.
        let middle_m = needle.depth_m - 0.5 * SEED_LENGTH_M;
        let drop_m = Vector3::from(needle.entry_m) + Vector3::from(needle.direction) * middle_m;
        let run = NeedleRehearsal {
            entry_m: needle.entry_m,
            direction: needle.direction,
            drops_m: vec![drop_m.into()],
            stabilising: Vec::new(),
            earlier: Vec::new(),
            ..run.clone()
        };
        let others: Vec<_> = lines.iter().map(|line| line.stations.clone()).collect();
        let own = self.line_beside(
            lines.len() as u64 + 1,
            &run,
            active.force.bending.is_on(),
            &others,
            stop,
        )?;
        let mut rig = self.rig(&run, active)?;
        let mut done = Err(RehearseError::BodyLost);
        if rig.stand(lines, before) {
            rig.take_lines(vec![own]);
            let mut script = Script::pass(&run);
            done = drive(&mut rig, stop, |rig, _| script.advance(rig));
        }
        let record = rig.standing();
        self.world = Some(rig.into_world());
        done.map(|()| record)
    }
}

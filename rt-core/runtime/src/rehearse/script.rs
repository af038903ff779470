//! Drives the procedure over the ticks of a rehearsal, in simulated time.

use super::RehearseError;
use super::rig::Rig;
use nalgebra::Vector3;
use stylet_procedure::{HandRequest, NeedleWay, Next, Observed, Pace, Procedure, Reply};
use stylet_shm_schema::{NeedleRehearsal, SEED_LENGTH_M};

pub struct Script(Procedure);

impl Script {
    pub fn way(run: &NeedleRehearsal) -> (NeedleWay, Pace) {
        let (entry_m, direction) = (Vector3::from(run.entry_m), Vector3::from(run.direction));
        // The seed lies in the needle with its deeper end at the tip.
        let tip_m = |middle_m: &[f64; 3]| Vector3::from(*middle_m) + direction * (0.5 * SEED_LENGTH_M);
        let way = NeedleWay {
            entry_m,
            direction,
            drops_m: run.drops_m.iter().map(tip_m).collect(),
            retract_to_m: run.retract_to_m,
            strand_pitch_m: run.strand_pitch_m,
        };
        let pace = Pace {
            insert_m_per_s: run.insert_m_per_s,
            retract_m_per_s: run.retract_m_per_s,
            approach_m_per_s: run.approach_m_per_s,
            acceleration_m_per_s2: run.acceleration_m_per_s2,
        };
        (way, pace)
    }

    pub fn new(run: &NeedleRehearsal) -> Self {
        let (way, pace) = Self::way(run);
        let stabilising = run.stabilising.iter().map(|needle| {
            let (entry_m, direction) = (Vector3::from(needle.entry_m), Vector3::from(needle.direction));
            NeedleWay {
                entry_m,
                direction,
                drops_m: vec![entry_m + direction * needle.depth_m],
                retract_to_m: 0.0,
                strand_pitch_m: None,
            }
        });
        Self(Procedure::rehearsal(way, pace, stabilising.collect()))
    }

    /// Script of a needle, given those that already stay in.
    pub fn beside(run: &NeedleRehearsal) -> Self {
        let alone = NeedleRehearsal {
            stabilising: Vec::new(),
            ..run.clone()
        };
        Self::new(&alone)
    }

    /// Script of a needle that comes and goes without dropping a seed.
    pub fn pass(run: &NeedleRehearsal) -> Self {
        let (way, pace) = Self::way(run);
        Self(Procedure::pass(way, pace))
    }

    /// True once all needles that stay in are in and the needle that drops seeds is at work.
    pub fn is_at_needle(&self) -> bool {
        self.0.stabilising().is_none()
    }

    /// Advances after each force-loop tick; true when finished. A refused drop ends a rehearsal, since its seeds are
    /// compared one by one.
    pub fn advance(&mut self, rig: &mut Rig) -> Result<bool, RehearseError> {
        if let Some(why) = rig.refusal() {
            let drop = rig.state().seed_count;
            return Err(RehearseError::Refused { why, drop });
        }
        let observed = Observed {
            state: rig.state(),
            displacement_m: Some(rig.displacement_m()),
        };
        // Orders take effect at the next tick.
        let next = self.0.advance(rig.seconds(), Some(&observed), Reply::InEffect)?;
        match next {
            Next::Send(HandRequest::Engage) => rig.engage(),
            Next::Send(HandRequest::MoveHand(goal)) => rig.move_hand(&goal),
            Next::Send(HandRequest::DropSeed { strand_pitch_m }) => rig.drop_seed(strand_pitch_m),
            // A rehearsal begins from rest and publishes no plan.
            Next::Send(HandRequest::ExpectStabilising { .. } | HandRequest::PublishPlan { .. }) => rig.next_line(),
            Next::Send(HandRequest::LeaveNeedle) => rig.leave_needle(),
            // A rehearsal begins from rest, and ends with the needles that stay in still in place.
            Next::Send(HandRequest::Reset | HandRequest::DrawFirstLeft { .. }) => {}
            Next::Wait | Next::Continue | Next::Done => {}
        }
        Ok(next == Next::Done)
    }
}

//! Payloads of requests, converted for the loops.

use crate::rehearse::NeedleRun;
use stylet_hw::HandGoal;
use stylet_shm_schema::{HandMove, NeedleRehearsal};

pub fn hand_goal(hand: &HandMove) -> HandGoal {
    HandGoal {
        tip_in_world: hand.tip_m.into(),
        direction: hand.direction.into(),
        speed_m_per_s: hand.speed_m_per_s,
        acceleration_m_per_s2: hand.acceleration_m_per_s2,
    }
}

pub fn needle_run(run: &NeedleRehearsal) -> NeedleRun {
    NeedleRun {
        entry_m: run.entry_m.into(),
        direction: run.direction.into(),
        insert_m_per_s: run.insert_m_per_s,
        retract_m_per_s: run.retract_m_per_s,
        approach_m_per_s: run.approach_m_per_s,
        acceleration_m_per_s2: run.acceleration_m_per_s2,
        retract_to_m: run.retract_to_m,
        strand_pitch_m: run.strand_pitch_m,
        stabilising: run.stabilising.clone(),
        earlier: run.earlier.clone(),
        drops_m: run.drops_m.iter().map(|&drop| drop.into()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rehearsal_keeps_its_drops_in_order() {
        let run = needle_run(&NeedleRehearsal {
            entry_m: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            insert_m_per_s: 0.01,
            retract_m_per_s: 0.02,
            approach_m_per_s: 0.03,
            acceleration_m_per_s2: 2.0,
            retract_to_m: -0.01,
            strand_pitch_m: None,
            stabilising: Vec::new(),
            earlier: Vec::new(),
            drops_m: vec![[0.1, 0.0, 0.0], [0.0, 0.0, 0.2]],
        });
        assert_eq!((run.drops_m[0].x, run.drops_m[1].z, run.drops_m.len()), (0.1, 0.2, 2));
        assert_eq!(
            (run.insert_m_per_s, run.retract_m_per_s, run.approach_m_per_s),
            (0.01, 0.02, 0.03)
        );
    }
}

//! Seeds that a reset removed, in a run and in its recording.

use super::{Recorded, through_a_file};
use crate::replay::lines::solve_again;
use crate::replay::repeat;
use crate::rt::exchange::{TissueOrder, TissueStep};
use stylet_shm_schema::SeedPose;
use stylet_sim::force::ForceParameters;
use stylet_sim::scene::TissueKind;

impl Recorded {
    fn order(&mut self, step: TissueStep) {
        let order = TissueOrder::Step(0, step);
        self.loops.control.tissue_orders.push(order).expect("room");
        self.run(0.05);
    }

    fn seeds(&self) -> Vec<SeedPose> {
        self.loops.tissue.seeds().collect()
    }
}

/// A click on *Reset* removed 83 seeds, and nothing brought them back.
#[test]
fn undo_restores_what_a_reset_removed_and_a_replay_does_too() {
    let mut run = Recorded::new(TissueKind::ChainMail, &ForceParameters::default());
    run.insert();
    run.go(-8e-3);
    run.run(3.0);
    run.order(TissueStep::Reset);
    run.order(TissueStep::UndoSeed);
    let before = run.seeds();
    assert_eq!(before.len(), 1);
    // The second reset finds nothing to remove, and keeps what the first one removed.
    run.order(TissueStep::Reset);
    run.order(TissueStep::Reset);
    assert!(run.seeds().is_empty());
    // The next recording begins here.
    let _ = run.flight();
    run.order(TissueStep::UndoSeed);
    assert_eq!(run.seeds(), before);
    run.run(0.5);
    let flight = through_a_file(&run.flight());
    let tissue = flight.tissue.as_ref().expect("recorded");
    let lines = solve_again(&flight, tissue, None, &mut |_| {}).expect("solved");
    let found = repeat::tissue(&flight, tissue, lines).expect("can be run");
    assert!(found.is_identical(), "{found:?}");
    assert_eq!(run.heap_calls, 0);
}

#[test]
fn a_seed_that_is_dropped_ends_the_undo_of_a_reset() {
    let mut run = Recorded::new(TissueKind::ChainMail, &ForceParameters::default());
    run.insert();
    run.order(TissueStep::DropSeed { strand_pitch_m: None });
    assert_eq!(run.seeds().len(), 2);
    run.order(TissueStep::Reset);
    run.run(0.5);
    run.order(TissueStep::DropSeed { strand_pitch_m: None });
    assert_eq!(run.seeds().len(), 1);
    run.order(TissueStep::UndoSeed);
    assert!(run.seeds().is_empty());
    run.order(TissueStep::UndoSeed);
    assert!(run.seeds().is_empty(), "of the implant before the last seed");
}

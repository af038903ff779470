//! Needles that stay in, in both loops: left, taken again, drawn out, and in a recording that repeats in every bit.

use super::*;
use crate::rt::motion_lease::Promise;
use stylet_shm_schema::{RefusalCode, flags};
use stylet_sim::line::LeftNeedles;

/// Distance of the second needle from the first, across.
pub(super) const APART_M: f64 = 4e-3;

impl Recorded {
    /// Tissue that does not move as a whole, with room for needles that stay in.
    fn with_left(kind: TissueKind) -> Self {
        let mut run = Self::new(kind, &ForceParameters::default());
        run.make_room_to_leave();
        run
    }

    pub(super) fn make_room_to_leave(&mut self) {
        self.haptic(HapticOrder::Engage);
        self.haptic(HapticOrder::Parameters {
            generation: 2,
            needle: NeedleParameters::default(),
            force: ForceParameters {
                membrane_gain: 0.05,
                cutting_gain: 0.1,
                shaft_gain: 0.2,
                ..ForceParameters::default()
            },
        });
        let control = &mut self.loops.control;
        assert!(control.rooms.push(LeftNeedles::with_room()).is_ok());
        let room = TissueOrder::LeftRoom(crate::rt::tissue_tape::LeftTape::new());
        assert!(control.tissue_orders.push(room).is_ok());
    }

    /// A line next to the first one, which includes it.
    fn beside(&self, kind: TissueKind, generation: u64, apart_m: f64) -> ReadyLine {
        self.beside_in(&block(), kind, generation, apart_m)
    }

    pub(super) fn beside_in(&self, source: &SceneSource, kind: TissueKind, generation: u64, apart_m: f64) -> ReadyLine {
        let body = LineBody::of_source(source, kind).expect("valid").expect("has lines");
        let entry_m = self.entry_m + Vector3::x() * apart_m;
        let others = [self.line.stations.clone()];
        let line = body.prepare(generation, entry_m.into(), [0.0, 0.0, 1.0], false, &others, &mut || {
            true
        });
        line.expect("through the block")
    }

    pub(super) fn give(&mut self, line: &ReadyLine) {
        self.kept.push(line.hand.source());
        let control = &mut self.loops.control;
        control.lines.push(line.hand.clone()).expect("room");
        let order = TissueOrder::Line(line.body.clone());
        control.tissue_orders.push(order).expect("room");
    }

    /// Moves the hand on the axis at that distance from the first needle's.
    pub(super) fn go_beside(&mut self, apart_m: f64, depth_m: f64) {
        let entry_m = self.entry_m;
        self.entry_m += Vector3::x() * apart_m;
        self.go(depth_m);
        self.entry_m = entry_m;
    }

    pub(super) fn has(&self, flag: u32) -> bool {
        self.loops.haptic.memory.state.flags & flag != 0
    }

    pub(super) fn left_count(&self) -> u32 {
        self.loops.haptic.memory.state.left_count
    }

    /// Runs for that time and returns the refusals.
    fn refusals(&mut self, seconds: f64) -> Vec<RefusalCode> {
        let mut refused = Vec::new();
        for _ in 0..(1e3 * seconds) as u64 {
            self.loops.step();
            let control = &mut self.loops.control;
            while let Ok(notice) = control.haptic_notices.pop() {
                if let crate::rt::exchange::Notice::Refused { why, .. } = notice {
                    refused.push(why);
                }
            }
            while control.tissue_notices.pop().is_ok() {}
            while control.old_hand_lines.pop().is_ok() || control.old_body_lines.pop().is_ok() {}
        }
        refused
    }

    /// Inserts and leaves the first needle; the hand comes out.
    fn leave_first(&mut self) {
        self.give_line(1);
        self.run(0.1);
        self.go(12e-3);
        self.run(1.6);
        self.haptic(HapticOrder::LeaveNeedle);
        self.run(0.05);
        assert!(self.left_count() == 1 && self.has(flags::HAND_EMPTY) && !self.has(flags::IN_CONTACT));
        self.go(-8e-3);
        self.run(1.5);
        assert!(!self.has(flags::IN_CONTACT));
    }
}

#[test]
fn a_recording_with_a_needle_that_stays_in_repeats_in_every_bit() {
    for kind in [TissueKind::Fem, TissueKind::ChainMail] {
        let mut run = Recorded::with_left(kind);
        run.leave_first();
        let second = run.beside(kind, 2, APART_M);
        run.go_beside(APART_M, -8e-3);
        run.run(0.6);
        run.give(&second);
        run.run(0.1);
        // From before the second insertion to after the first needle was drawn out.
        run.go_beside(APART_M, 10e-3);
        run.run(2.0);
        assert!(
            run.has(flags::IN_CONTACT) && run.has(flags::LINE_READY),
            "{kind:?}: on its line"
        );
        assert_eq!(run.left_count(), 1);
        run.go_beside(APART_M, 7e-3);
        run.run(2.0);
        run.haptic(HapticOrder::DrawNeedle {
            number: 1,
            speed_m_per_s: 0.02,
            promise: None,
        });
        run.run(0.3);
        assert_eq!(run.left_count(), 1);
        run.run(0.7);
        assert_eq!(run.left_count(), 0, "drawn out");
        run.go_beside(APART_M, 9e-3);
        run.run(0.6);
        let flight = through_a_file(&run.flight());
        assert_eq!(run.heap_calls, 0, "heap calls of the loops");
        let haptic = flight.haptic.as_ref().expect("recorded");
        assert_eq!(
            haptic.left.line_numbers().collect::<Vec<_>>(),
            [1],
            "it begins with one left in"
        );
        let tissue = flight.tissue.as_ref().expect("recorded");
        assert!(tissue.left.iter().any(|(_, left)| !left.needles().is_empty()));
        assert_identical(&flight);
        // Loads of a needle that stays in count.
        let mut other = flight.clone();
        let tissue = other.tissue.as_mut().expect("recorded");
        tissue.left.clear();
        let tissue = other.tissue.as_ref().expect("recorded");
        let lines = solve_again(&other, tissue, None, &mut |_| {}).expect("solved");
        let found = repeat::tissue(&other, tissue, lines).expect("can be run");
        assert!(found.different > 0 || found.different_positions > 0, "{found:?}");
    }
}

#[test]
fn a_needle_is_taken_up_again_where_it_was_left_and_comes_out_by_hand() {
    for kind in [TissueKind::Fem, TissueKind::ChainMail] {
        let mut run = Recorded::with_left(kind);
        run.leave_first();
        let held = run.loops.tissue.displacement_m();
        let take = HapticOrder::TakeNeedle(1);
        run.haptic(take);
        assert_eq!(run.refusals(0.01), [RefusalCode::NotAtNeedle]);
        // The hand returns empty: no contact, no force.
        run.go(11e-3);
        for _ in 0..1600 {
            let output = run.loops.step();
            assert!(output.wrench.force_n.norm() < 1e-9 && !run.has(flags::IN_CONTACT));
            while run.loops.control.haptic_notices.pop().is_ok() || run.loops.control.tissue_notices.pop().is_ok() {}
        }
        // ChainMail recovers where its tip held it; finite elements do not move.
        let now = run.loops.tissue.displacement_m();
        assert!(
            now < held + 1e-9 && (kind != TissueKind::Fem || held - now < 0.02e-3),
            "{now} {held}"
        );
        run.haptic(take);
        assert_eq!(run.refusals(0.05), []);
        assert!(
            run.left_count() == 0 && run.has(flags::IN_CONTACT) && run.has(flags::LINE_READY),
            "{kind:?}"
        );
        run.haptic(HapticOrder::DrawNeedle {
            number: 1,
            speed_m_per_s: 0.02,
            promise: None,
        });
        run.haptic(HapticOrder::LeaveNeedle);
        run.haptic(HapticOrder::LeaveNeedle);
        let refused = run.refusals(0.05);
        assert_eq!(
            refused,
            [RefusalCode::NoLeftNeedle, RefusalCode::NoNeedleToLeave],
            "one of the two was left"
        );
        run.haptic(take);
        assert_eq!(run.refusals(0.05), []);
        run.go(-8e-3);
        let mut most_n = 0.0_f64;
        for _ in 0..3500 {
            most_n = most_n.max(run.loops.step().wrench.force_n.norm());
            while run.loops.control.haptic_notices.pop().is_ok() || run.loops.control.tissue_notices.pop().is_ok() {}
        }
        println!(
            "{kind:?}: held {:.3} mm, drawn out by hand with up to {most_n:.3} N",
            held * 1e3
        );
        assert!(most_n > 0.05, "friction of the shaft is felt again");
        assert!(!run.has(flags::IN_CONTACT) && !run.has(flags::HAND_EMPTY));
        assert!(
            run.loops.tissue.displacement_m() < 0.05e-3,
            "{} m",
            run.loops.tissue.displacement_m()
        );
    }
}

/// The second needle meets the track of the first within its radius, although a third went in between.
#[test]
fn a_track_is_met_again_after_another_needle() {
    let kind = TissueKind::ChainMail;
    let mut run = Recorded::with_left(kind);
    run.give_line(1);
    run.run(0.1);
    run.go(10e-3);
    run.run(1.5);
    let fresh_n = run.peak_n();
    run.go(-8e-3);
    run.run(1.2);
    let track = run.line_track().expect("cut");
    let mut other = run.beside(kind, 2, APART_M);
    other.hand.open_track(&track);
    run.go_beside(APART_M, -8e-3);
    run.run(0.6);
    run.give(&other);
    run.run(0.1);
    run.go_beside(APART_M, 10e-3);
    run.run(1.5);
    run.go_beside(APART_M, -8e-3);
    run.run(1.2);
    // The control thread adds its tracks of earlier needles to each line.
    let mut again = run.beside(kind, 3, 0.4e-3);
    again.hand.open_track(&track);
    run.go_beside(0.4e-3, -8e-3);
    run.run(0.6);
    run.give(&again);
    run.run(0.1);
    run.loops.haptic.memory.state.peak_force_n = 0.0;
    run.go_beside(0.4e-3, 9e-3);
    run.run(1.5);
    let again_n = run.peak_n();
    println!("fresh {fresh_n:.3} N, again {again_n:.3} N");
    assert!(again_n < 0.8 * fresh_n, "{again_n} {fresh_n}");
}

impl Recorded {
    fn peak_n(&self) -> f64 {
        self.loops.haptic.memory.state.peak_force_n
    }

    fn line_track(&self) -> Option<stylet_sim::line::Track> {
        self.loops.haptic.line_track()
    }
}

/// The needle was drawn to the end even after the host that had asked for it ended.
#[test]
fn a_needle_that_is_drawn_waits_for_its_host() {
    let mut run = Recorded::with_left(TissueKind::ChainMail);
    run.leave_first();
    let promise = Promise::first(7);
    run.haptic(HapticOrder::DrawNeedle {
        number: 1,
        speed_m_per_s: 0.05,
        promise: Some(promise),
    });
    run.run(0.3);
    assert_eq!(run.left_count(), 1, "held on its way");
    for _ in 0..40 {
        run.haptic(HapticOrder::KeepMoving(promise));
        run.run(0.01);
    }
    assert_eq!(run.left_count(), 0, "drawn out");
    assert_eq!(run.heap_calls, 0, "heap calls of the loops");
    assert_identical(&run.flight());
}

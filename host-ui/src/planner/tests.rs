//! What may be changed of a plan that is being carried out, and which needle comes next.

use super::*;
use crate::panel::workflow::{Progress as Stage, is_needle_done, next_action, progress};
use crate::panel::{Action, PlanAction, Shown};
use bytemuck::Zeroable;
use stylet_host::link::LinkStatus;
use stylet_shm_schema::{HapticState, PlanInForce, SceneHeader, SeedPose, flags};

fn hole(name: &str) -> Hole {
    name.parse().expect("a hole")
}

/// Two needles of two seeds each, 80 and 70 mm deep.
fn planned() -> ImplantPlan {
    let template = Template {
        middle_m: [0.05, 0.05, -0.01],
        columns: [-1.0, 0.0, 0.0],
        rows: [0.0, 1.0, 0.0],
        inwards: [0.0, 0.0, 1.0],
        pitch_m: 5e-3,
    };
    let plan = ImplantPlan {
        template,
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        needles: Vec::new(),
    };
    let plan = plan.with_needle(hole("E7"), 0.08).unwrap();
    let plan = plan.with_strand(0, 2, 0.08, 0.5).unwrap();
    let plan = plan.with_needle(hole("I7"), 0.08).unwrap();
    plan.with_strand(1, 2, 0.08, 0.5).unwrap()
}

fn planner() -> Planner {
    let mut planner = Planner::default();
    planner.put(planned());
    planner.show();
    planner
}

#[test]
fn a_needle_that_has_gone_in_stays_and_those_after_it_can_be_changed() {
    let mut planner = planner();
    planner.edit(|plan| plan.with_needle_at(0, hole("F7")));
    planner.begin_needle(0, 0);
    let before = planner.plan().cloned();
    planner.edit(|plan| plan.without_needle(0));
    assert!(planner.said().is_some_and(|said| said.is_err()));
    planner.undo();
    assert!(
        planner.said().is_some_and(|said| said.is_err()),
        "it would move the needle"
    );
    assert_eq!(planner.plan().cloned(), before);
    planner.edit(|plan| plan.without_needle(1));
    assert_eq!(planner.said(), None);
    planner.undo();
    assert_eq!(planner.plan().cloned(), before);
}

#[test]
fn more_seeds_than_the_core_can_hold_are_refused() {
    let mut planner = planner();
    let row = Row {
        count: MAX_SEEDS,
        deepest_m: 0.08,
        pitch_m: 5e-3,
        stranded: false,
        strength_u: 0.5,
    };
    planner.set_row(0, row);
    assert!(planner.said().is_some_and(|said| said.is_err()));
    assert_eq!(planner.plan(), Some(&planned()));
}

#[test]
fn what_was_rehearsed_for_a_needle_holds_until_the_needle_is_changed() {
    let mut planner = planner();
    let needle = planned().needles[0].clone();
    let mut drops = Drops::as_planned(&needle);
    drops.along_m[0] += 2e-3;
    let done = Compensation {
        drops,
        before_m: None,
        after_m: vec![[0.0; 3]; 2],
        rehearsals: 1,
    };
    planner.compensated.push((needle, done));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.082);
    planner.edit(|plan| plan.with_needle_at(1, hole("J7")));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.082, "another needle");
    planner.edit(|plan| plan.with_needle_at(0, hole("D7")));
    assert_eq!(planner.task(0).unwrap().drops.along_m[0], 0.08);
    assert!(planner.compensated.is_empty());
}

/// The needle at work in force, its tip at a depth, seeds dropped so far along their needles.
fn shown(planner: &mut Planner, depth_m: f64, dropped_m: &[f64]) -> Shown {
    planner.show();
    let mut shown = Shown::empty("lab");
    shown.status = LinkStatus::Live;
    shown.scene = Some(SceneHeader::zeroed());
    shown.planning = planner.planning();
    let mut state = HapticState::zeroed();
    let at_work = shown.planning.at_work().map(|(_, needle)| needle.clone());
    if let Some(needle) = &at_work {
        let mut plan = PlanInForce::zeroed();
        (plan.generation, plan.seed_count) = (1, 2);
        (plan.entry_m, plan.direction) = (needle.entry_m, needle.direction);
        for (seed, place_m) in plan.seeds.iter_mut().zip(needle.seeds_m()) {
            seed.position_m = place_m;
        }
        shown.plan = Some(plan);
        (state.tick, state.tip_in_scene_m) = (1, needle.at_m(depth_m));
        state.flags = if depth_m > 0.02 { flags::PUNCTURED } else { 0 };
    }
    shown.state = Some(state);
    let pose = |(number, &along_m): (usize, &f64)| {
        let position_m = planned().needles[number / 2].at_m(along_m);
        SeedPose {
            position_m,
            axis: [0.0, 0.0, 1.0],
            dropped_at_m: position_m,
        }
    };
    shown.seeds = dropped_m.iter().enumerate().map(pose).collect();
    shown
}

#[test]
fn the_next_needle_is_the_thing_to_do_once_one_is_outside_and_its_seeds_are_dropped() {
    let mut planner = planner();
    let next = Some(Action::Plan(PlanAction::NextNeedle));
    let before = shown(&mut planner, 0.0, &[]);
    assert_eq!((progress(&before), next_action(&before)), (Stage::Plan, next.clone()));
    planner.begin_needle(0, 0);
    let placed = shown(&mut planner, 0.0, &[]);
    assert_eq!(next_action(&placed), Some(Action::Insert));
    let dropped = shown(&mut planner, 0.07, &[0.08, 0.07]);
    assert_eq!(next_action(&dropped), Some(Action::Retract));
    let out = shown(&mut planner, 0.0, &[0.08, 0.07]);
    assert!(is_needle_done(&out));
    assert_eq!((progress(&out), next_action(&out)), (Stage::Place, next));
    planner.finish_needle();
    planner.begin_needle(1, 2);
    // Those of the first needle are not its own.
    let second = shown(&mut planner, 0.0, &[0.08, 0.07]);
    assert!(!is_needle_done(&second));
    assert_eq!(next_action(&second), Some(Action::Insert));
    let last = shown(&mut planner, 0.0, &[0.08, 0.07, 0.08, 0.07]);
    assert!(is_needle_done(&last));
    assert_eq!((progress(&last), next_action(&last)), (Stage::Debrief, None));
}

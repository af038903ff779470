//! The next needle of a plan, and the steps of the script.

use super::run::{run_name, waits};
use super::{Progress, SCRIPTED_STEPS, is_needle_done, next_action, progress, run_ui};
use crate::action::{Action, PlanAction};
use crate::planner::Planner;
use crate::planner::tests::{planned, planner, planning};
use crate::shown::Shown;
use crate::theme;
use bytemuck::Zeroable;
use stylet_host::link::LinkStatus;
use stylet_procedure::{Step, Waiting, WaitsFor};
use stylet_shm_schema::{HapticState, PlanInForce, SceneHeader, SeedPose, flags};

/// Returns the present needle, its tip at a depth, and the seeds dropped so far along their
/// needles.
fn shown(planner: &mut Planner, depth_m: f64, dropped_m: &[f64]) -> Shown {
    let mut shown = Shown::empty("lab");
    shown.status = LinkStatus::Live;
    shown.scene = Some(SceneHeader::zeroed());
    shown.planning = planning(planner);
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
fn the_next_needle_follows_a_finished_one() {
    let mut planner = planner();
    let next = Some(Action::Plan(PlanAction::NextNeedle));
    let before = shown(&mut planner, 0.0, &[]);
    assert_eq!(
        (progress(&before), next_action(&before)),
        (Progress::Plan, next.clone())
    );
    planner.begin_needle(0, 0);
    let placed = shown(&mut planner, 0.0, &[]);
    assert_eq!(next_action(&placed), Some(Action::Insert));
    let dropped = shown(&mut planner, 0.07, &[0.08, 0.07]);
    assert_eq!(next_action(&dropped), Some(Action::Retract));
    let out = shown(&mut planner, 0.0, &[0.08, 0.07]);
    assert!(is_needle_done(&out));
    assert_eq!((progress(&out), next_action(&out)), (Progress::Place, next));
    planner.finish_needle(2);
    planner.begin_needle(1, 2);
    // The seeds of the first needle do not count here.
    let second = shown(&mut planner, 0.0, &[0.08, 0.07]);
    assert!(!is_needle_done(&second));
    assert_eq!(next_action(&second), Some(Action::Insert));
    let last = shown(&mut planner, 0.0, &[0.08, 0.07, 0.08, 0.07]);
    assert!(is_needle_done(&last));
    assert_eq!((progress(&last), next_action(&last)), (Progress::Debrief, None));
}

/// Guards against a window that was opened while the tip stood before the next hole and asked to
/// withdraw the needle.
#[test]
fn a_tip_before_another_hole_is_outside() {
    let mut planner = planner();
    planner.begin_needle(0, 0);
    let mut elsewhere = shown(&mut planner, 5e-3, &[0.08, 0.07]);
    assert_eq!(progress(&elsewhere), Progress::Retract, "on its path");
    let tip_m = &mut elsewhere.state.as_mut().expect("a state").tip_in_scene_m;
    *tip_m = [tip_m[0] + 5e-3, tip_m[1], tip_m[2]];
    assert!(is_needle_done(&elsewhere));
    assert_eq!(progress(&elsewhere), Progress::Place);
    // In tissue off its path it must still be withdrawn.
    elsewhere.state.as_mut().expect("a state").flags |= flags::IN_CONTACT;
    assert_eq!(progress(&elsewhere), Progress::Retract);
}

/// Guards against a button that said "all four steps" over a list of seven.
#[test]
fn the_button_names_the_scripted_steps() {
    let [first, last] = [Progress::Plan, Progress::Retract].map(Progress::number);
    assert_eq!(SCRIPTED_STEPS, format!("steps {first} to {last}"));
    assert_eq!(run_name(&Shown::empty("lab")), format!("Run {SCRIPTED_STEPS}"));
    let mut planner = planner();
    assert_eq!(run_name(&shown(&mut planner, 0.0, &[])), "Run all 2 needles");
}

/// Guards against a row that put needle and step on one line, so that the panel widened and "Stop"
/// was cut off.
#[test]
fn the_run_row_shows_its_start_and_its_wait() {
    let mut shown = Shown::empty("lab");
    shown.continues_at = Some((2, 19));
    assert_eq!(run_name(&shown), "Continue at needle 3 of 19");
    let mut waiting = Waiting {
        waits_for: WaitsFor::Reply("DropSeed"),
        for_s: 1.5,
    };
    shown.run_waits = Some(waiting);
    assert_eq!(waits(&shown), None, "as long as it usually takes");
    waiting.for_s = 12.4;
    shown.run_waits = Some(waiting);
    assert_eq!(waits(&shown).as_deref(), Some("waiting for a reply to DropSeed, 12 s"));
}

/// Tests the end of many needles, in the longest step.
#[test]
fn the_row_of_a_run_stays_inside_its_panel() {
    let mut shown = Shown::empty("lab");
    (shown.running, shown.run_needle, shown.run_step) = (true, Some((18, 19)), Some(Step::Settle));
    shown.run_waits = Some(Waiting {
        waits_for: WaitsFor::Line,
        for_s: 3_600.0,
    });
    let width = theme::LEFT_WIDTH - 20.0;
    let ctx = egui::Context::default();
    let mut needed = egui::Rect::NOTHING;
    for _ in 0..3 {
        let mut output = ctx.run_ui(egui::RawInput::default(), |ui| {
            let panel = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, 600.0));
            let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(panel));
            run_ui(&mut ui, &shown, &mut super::Guide::default(), &mut Vec::new());
            needed = ui.min_rect();
        });
        output.textures_delta.clear();
    }
    assert!(needed.width() <= width + 0.5, "{needed:?}");
}

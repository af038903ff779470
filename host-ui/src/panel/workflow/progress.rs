//! How far the operator is, what each step lacks, and the one thing to do next.

use crate::panel::{Action, PlanAction, Shown};
use stylet_base::format;
use stylet_shm_schema::Request;

/// Beside the path by less than this, the needle counts as placed.
const PLACED_WITHIN_M: f64 = 1.5e-3;
/// The tip is at a goal when it is this near.
const REACHED_WITHIN_M: f64 = 1.0e-3;

/// A hand that the force holds back from its goal is there when it rests this near.
const HELD_BACK_M: f64 = 2.0e-3;
const REST_M_PER_S: f64 = 1e-3;

/// A step of the procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Progress {
    Scene,
    Plan,
    Place,
    Insert,
    Drop,
    Retract,
    Debrief,
}

impl Progress {
    pub const ALL: [Self; 7] = [
        Self::Scene,
        Self::Plan,
        Self::Place,
        Self::Insert,
        Self::Drop,
        Self::Retract,
        Self::Debrief,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "Choose the scene",
            Self::Plan => "Plan the seeds",
            Self::Place => "Place the needle",
            Self::Insert => "Insert",
            Self::Drop => "Drop the seeds",
            Self::Retract => "Retract",
            Self::Debrief => "Debrief",
        }
    }

    pub fn number(self) -> usize {
        self as usize + 1
    }
}

/// From what the core says alone, so that it survives a restart of this program.
pub fn progress(shown: &Shown) -> Progress {
    if shown.scene.is_none() {
        return Progress::Scene;
    }
    if shown.planning.waits() {
        return Progress::Plan;
    }
    let (Some(depth), Some(beside)) = (shown.path_depth_m(), shown.off_path_m()) else {
        return Progress::Plan;
    };
    let dropped = shown.own_seeds().len();
    if shown.next_seed_m().is_none() {
        return if !is_out_at(depth) {
            Progress::Retract
        } else if next_needle(shown).is_some() {
            Progress::Place
        } else {
            Progress::Debrief
        };
    }
    let is_deep = shown
        .deepest_seed_m()
        .is_some_and(|deepest| depth >= deepest - HELD_BACK_M);
    if dropped > 0 || is_deep {
        Progress::Drop
    } else if beside > PLACED_WITHIN_M || depth < -REACHED_WITHIN_M * 5.0 {
        Progress::Place
    } else {
        Progress::Insert
    }
}

fn is_out_at(depth_m: f64) -> bool {
    depth_m < REACHED_WITHIN_M + 0.002
}

/// The needle of a plan that is to go in now: the first one, or the one after a needle whose seeds are all dropped.
pub fn next_needle(shown: &Shown) -> Option<usize> {
    let next = shown.planning.next_needle()?;
    let is_free = shown.planning.waits() || is_needle_done(shown);
    is_free.then_some(next)
}

/// Nothing of a plan has gone in yet, so that another one may take its place.
pub fn is_before_needles(shown: &Shown) -> bool {
    shown.planning.course.begun() == 0
}

/// All its seeds are dropped and its tip is outside.
pub fn is_needle_done(shown: &Shown) -> bool {
    let is_out = shown.path_depth_m().is_some_and(is_out_at);
    // One that was taken back leaves no path, and those before it are done.
    shown.planning.course.is_done() || (shown.planning.at_work().is_some() && shown.next_seed_m().is_none() && is_out)
}

/// The needle at work is outside, whatever it has dropped.
pub fn can_leave_needle(shown: &Shown) -> bool {
    shown.planning.next_needle().is_some() && shown.path_depth_m().is_none_or(is_out_at)
}

/// What is missing before `step` can be done; `None` when nothing is.
pub fn missing(shown: &Shown, step: Progress) -> Option<String> {
    if !shown.is_live() {
        return Some("rt-core must run".to_owned());
    }
    if step == Progress::Scene {
        return None;
    }
    if shown.scene.is_none() {
        return Some("the scene has not arrived yet".to_owned());
    }
    if step == Progress::Plan {
        return None;
    }
    if shown.plan.is_none() {
        return Some("plan the seeds first".to_owned());
    }
    match (step, shown.off_path_m()) {
        (Progress::Insert, Some(beside)) if beside > PLACED_WITHIN_M => Some(format!(
            "place the needle first: it is {} beside the path",
            format::length(beside)
        )),
        (Progress::Drop, _) if !shown.has_punctured() && shown.seeds.is_empty() => {
            Some("insert the needle first: the tip is not in the tissue".to_owned())
        }
        (Progress::Debrief, _) if shown.seeds.is_empty() => Some("no seed has been dropped yet".to_owned()),
        _ => None,
    }
}

/// What the key for it does; `None` where something is missing or nothing is left.
pub fn next_action(shown: &Shown) -> Option<Action> {
    let step = progress(shown);
    if missing(shown, step).is_some() {
        return None;
    }
    match step {
        Progress::Scene | Progress::Debrief => None,
        Progress::Plan | Progress::Place if next_needle(shown).is_some() => Some(Action::Plan(PlanAction::NextNeedle)),
        // An empty plan of many needles waits for its first one.
        Progress::Plan if shown.planning.implant.is_some() => None,
        Progress::Plan => Some(Action::PlanSeeds),
        Progress::Place => Some(Action::PlaceNeedle),
        Progress::Insert => Some(Action::Insert),
        Progress::Drop if is_at_next_seed(shown) => Some(Action::Send(Request::DropSeed)),
        Progress::Drop => shown.next_seed_m().map(Action::MoveTo),
        Progress::Retract => Some(Action::Retract),
    }
}

pub fn is_at_next_seed(shown: &Shown) -> bool {
    match (shown.path_depth_m(), shown.next_seed_m()) {
        (Some(depth), Some(next)) => {
            let off = (depth - next).abs();
            let at_rest = shown.state.is_some_and(|s| s.speed_m_per_s.abs() < REST_M_PER_S);
            off <= REACHED_WITHIN_M || (off <= HELD_BACK_M && at_rest)
        }
        _ => false,
    }
}

/// What Ctrl+Z takes back: the last seed, or else the plan while the needle is outside.
pub fn undo_action(shown: &Shown) -> Option<Undo> {
    if !shown.is_live() {
        None
    } else if !shown.own_seeds().is_empty() {
        Some(Undo::Seed)
    } else if shown.plan.is_some() && !shown.has_punctured() {
        Some(Undo::Plan)
    } else {
        None
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undo {
    Seed,
    Plan,
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_host::link::LinkStatus;
    use stylet_shm_schema::{HapticState, PlanInForce, SceneHeader, SeedPose, flags};

    /// Seeds at 30 and 20 mm along z; the tip at a depth.
    fn shown(depth_m: f64, dropped_m: &[f64]) -> Shown {
        let mut shown = Shown::empty("lab");
        shown.status = LinkStatus::Live;
        shown.scene = Some(SceneHeader::zeroed());
        let mut plan = PlanInForce::zeroed();
        (plan.generation, plan.seed_count, plan.direction) = (1, 2, [0.0, 0.0, 1.0]);
        plan.seeds[0].position_m = [0.0, 0.0, 0.03];
        plan.seeds[1].position_m = [0.0, 0.0, 0.02];
        shown.plan = Some(plan);
        let mut state = HapticState::zeroed();
        (state.tick, state.tip_in_scene_m) = (1, [0.0, 0.0, depth_m]);
        state.flags = if depth_m > 0.01 { flags::PUNCTURED } else { 0 };
        shown.state = Some(state);
        shown.seeds = dropped_m
            .iter()
            .map(|&z| SeedPose {
                position_m: [0.0, 0.0, z],
                axis: [0.0, 0.0, 1.0],
                dropped_at_m: [0.0, 0.0, z],
            })
            .collect();
        shown
    }

    #[test]
    fn the_procedure_goes_through_its_steps_one_thing_at_a_time() {
        let drop = Action::Send(Request::DropSeed);
        let way: [(f64, &[f64], Progress, Option<Action>); 7] = [
            (-0.05, &[], Progress::Place, Some(Action::PlaceNeedle)),
            (0.0, &[], Progress::Insert, Some(Action::Insert)),
            (0.03, &[], Progress::Drop, Some(drop.clone())),
            (0.03, &[0.03], Progress::Drop, Some(Action::MoveTo(0.02))),
            (0.02, &[0.03], Progress::Drop, Some(drop)),
            (0.02, &[0.03, 0.02], Progress::Retract, Some(Action::Retract)),
            (0.0, &[0.03, 0.02], Progress::Debrief, None),
        ];
        for (depth_m, dropped, step, action) in way {
            let shown = shown(depth_m, dropped);
            assert_eq!(progress(&shown), step, "at {depth_m} m with {dropped:?}");
            assert_eq!(missing(&shown, step), None, "{step:?}");
            assert_eq!(next_action(&shown), action, "{step:?}");
        }
    }

    #[test]
    fn undo_takes_back_a_seed_then_the_plan_and_never_with_the_needle_inside() {
        assert_eq!(undo_action(&shown(0.02, &[0.03])), Some(Undo::Seed));
        assert_eq!(undo_action(&shown(0.0, &[])), Some(Undo::Plan));
        assert_eq!(undo_action(&shown(0.02, &[])), None);
        assert_eq!(undo_action(&Shown::empty("lab")), None);
    }

    #[test]
    fn without_a_core_every_step_says_what_is_missing() {
        for step in Progress::ALL {
            assert_eq!(missing(&Shown::empty("lab"), step).as_deref(), Some("rt-core must run"));
        }
        let mut live = Shown::empty("lab");
        live.status = LinkStatus::Live;
        assert_eq!(progress(&live), Progress::Scene);
        assert!(missing(&live, Progress::Insert).is_some());
    }
}

//! Progress of the operator, missing preconditions of each step, and the next action.

use crate::action::{Action, PlanAction};
use crate::shown::Shown;
use stylet_base::format;
use stylet_procedure::tolerance::PLACED_WITHIN_M;
use stylet_procedure::{AtHand, Operation, Step};

/// Step of the procedure.
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

/// Returns the present step from the core's state alone, so that it survives a restart of this
/// program.
pub fn progress(shown: &Shown) -> Progress {
    if shown.scene.is_none() {
        return Progress::Scene;
    }
    if shown.planning.waits() {
        return Progress::Plan;
    }
    // The last needle of a plan is done even if it has lost a seed.
    if shown.planning.progress.is_done() && shown.planning.next_needle().is_none() {
        return Progress::Debrief;
    }
    match needle_at_hand(shown).map(|needle| needle.step()) {
        None | Some(Step::Plan) => Progress::Plan,
        Some(Step::Place) => Progress::Place,
        Some(Step::Insert) => Progress::Insert,
        Some(Step::Drop) => Progress::Drop,
        Some(Step::Retract | Step::Settle) => Progress::Retract,
        Some(Step::Done) if next_needle(shown).is_some() => Progress::Place,
        Some(Step::Done) => Progress::Debrief,
    }
}

/// Returns the present needle; `None` without a plan or a tip.
pub fn needle_at_hand(shown: &Shown) -> Option<AtHand> {
    let (depth_m, beside_m) = (shown.path_depth_m()?, shown.off_path_m()?);
    // At the hole of another needle the tip may be deeper along this one's path than its entry.
    let is_elsewhere = beside_m > PLACED_WITHIN_M && !shown.is_in_tissue();
    Some(AtHand {
        depth_m: if is_elsewhere { depth_m.min(0.0) } else { depth_m },
        beside_m,
        is_free_inside: shown.is_free_inside && !is_elsewhere,
        speed_m_per_s: shown.state.map(|s| s.speed_m_per_s),
        dropped: shown.own_seeds().len(),
        deepest_drop_m: shown.deepest_seed_m(),
        next_drop_m: shown.next_seed_m(),
    })
}

/// Returns the needle of a plan to insert now: the first one, or the one after a needle whose seeds
/// are all dropped.
pub fn next_needle(shown: &Shown) -> Option<usize> {
    let next = shown.planning.next_needle()?;
    let is_free = shown.planning.waits() || is_needle_done(shown);
    is_free.then_some(next)
}

/// Returns whether no needle of a plan was inserted yet, so that another plan may replace it.
pub fn is_before_needles(shown: &Shown) -> bool {
    shown.planning.progress.begun() == 0
}

/// Returns whether all its seeds are dropped and its tip is outside.
pub fn is_needle_done(shown: &Shown) -> bool {
    let is_out = needle_at_hand(shown).is_some_and(|needle| needle.is_outside());
    // A withdrawn needle leaves no path, and those before it are done.
    shown.planning.progress.is_done() || (shown.planning.at_work().is_some() && shown.next_seed_m().is_none() && is_out)
}

/// Returns whether the present needle is outside, with any number of seeds left.
pub fn can_leave_needle(shown: &Shown) -> bool {
    shown.planning.next_needle().is_some() && needle_at_hand(shown).is_none_or(|needle| needle.is_outside())
}

/// Returns the missing precondition of `step`; `None` if there is none.
pub fn missing(shown: &Shown, step: Progress) -> Option<String> {
    if !shown.is_live() {
        return Some("the simulator core is not running".to_owned());
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
    match (step, needle_at_hand(shown)) {
        (Progress::Insert, Some(needle)) if !needle.is_on_path() => Some(format!(
            "place the needle first: it is {} off the path",
            format::length(needle.beside_m)
        )),
        (Progress::Drop, _) if !shown.has_punctured() && shown.seeds.is_empty() => {
            Some("insert the needle first: no membrane has opened yet".to_owned())
        }
        (Progress::Debrief, _) if shown.seeds.is_empty() => Some("no seed has been dropped yet".to_owned()),
        _ => None,
    }
}

/// Returns the main action of the step; `None` if a precondition is missing or nothing is left.
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
        Progress::Place | Progress::Insert | Progress::Drop | Progress::Retract => {
            let needle = needle_at_hand(shown)?;
            match needle.next()? {
                Operation::Place => Some(Action::PlaceNeedle),
                Operation::Insert | Operation::InsertTo(_) => Some(Action::Insert),
                Operation::Drop(_) => Some(Action::DropSeed),
                Operation::DrawBack(_) => needle.next_drop_m.map(Action::MoveTo),
                Operation::Retract | Operation::TakeOut => Some(Action::Retract),
                Operation::Reset
                | Operation::PublishPlan
                | Operation::Engage
                | Operation::Leave
                | Operation::DrawOut
                | Operation::Settle => None,
            }
        }
    }
}

/// Returns whether the next seed may be dropped at the tip's place.
pub fn is_at_next_seed(shown: &Shown) -> bool {
    needle_at_hand(shown).is_some_and(|needle| needle.is_at_next_drop())
}

/// Returns the action of Ctrl+Z: it restores a discarded plan, or undoes the last seed, or a reset, or else the plan
/// while the needle is outside.
pub fn undo_action(shown: &Shown) -> Option<Undo> {
    if !shown.is_live() {
        None
    } else if shown.planning.can_restore && shown.plan.is_none() {
        Some(Undo::Discard)
    } else if !shown.own_seeds().is_empty() {
        Some(Undo::Seed)
    } else if shown.removed > 0 {
        Some(Undo::Reset)
    } else if shown.plan.is_some() && !shown.has_punctured() {
        Some(Undo::Plan)
    } else {
        None
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undo {
    Seed,
    /// Restores the seeds that the last reset removed.
    Reset,
    Plan,
    /// Restores the plan of many needles that was discarded.
    Discard,
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_host::link::LinkStatus;
    use stylet_implant::plan::SEED_LENGTH_M;
    use stylet_shm_schema::{HapticState, PlanInForce, SceneHeader, SeedPose, flags};

    /// Returns a state with seeds at 30 and 20 mm along z, and the tip at a depth.
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
        let drop = Action::DropSeed;
        // The tip is half a seed deeper than the middle of a seed that leaves it.
        let [first, second] = [0.03, 0.02].map(|seed_m| seed_m + 0.5 * SEED_LENGTH_M);
        let way: [(f64, &[f64], Progress, Option<Action>); 7] = [
            (-0.05, &[], Progress::Place, Some(Action::PlaceNeedle)),
            (0.0, &[], Progress::Insert, Some(Action::Insert)),
            (first, &[], Progress::Drop, Some(drop.clone())),
            (first, &[0.03], Progress::Drop, Some(Action::MoveTo(second))),
            (second, &[0.03], Progress::Drop, Some(drop)),
            (second, &[0.03, 0.02], Progress::Retract, Some(Action::Retract)),
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
    fn undo_removes_a_seed_then_the_plan() {
        assert_eq!(undo_action(&shown(0.02, &[0.03])), Some(Undo::Seed));
        assert_eq!(undo_action(&shown(0.0, &[])), Some(Undo::Plan));
        let after_reset = Shown {
            removed: 83,
            ..shown(0.0, &[])
        };
        assert_eq!(undo_action(&after_reset), Some(Undo::Reset));
        assert_eq!(undo_action(&shown(0.02, &[])), None);
        assert_eq!(undo_action(&Shown::empty("lab")), None);
    }

    #[test]
    fn a_last_needle_with_a_lost_seed_is_done() {
        let mut shown = shown(-0.05, &[0.03]);
        assert_eq!(progress(&shown), Progress::Drop);
        shown.planning.progress.begin(0, 0);
        shown.planning.progress.finish(1);
        assert_eq!(progress(&shown), Progress::Debrief);
        shown.seeds.clear();
        shown.planning.progress.take(0);
        assert_eq!(progress(&shown), Progress::Place);
    }

    #[test]
    fn without_a_core_every_step_names_its_precondition() {
        for step in Progress::ALL {
            assert_eq!(
                missing(&Shown::empty("lab"), step).as_deref(),
                Some("the simulator core is not running")
            );
        }
        let mut live = Shown::empty("lab");
        live.status = LinkStatus::Live;
        assert_eq!(progress(&live), Progress::Scene);
        assert!(missing(&live, Progress::Insert).is_some());
    }
}

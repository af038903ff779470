//! The scripted procedure as a list of actions, each with its own time limit.

use super::{NeedlePlan, Pace, move_values, plan_values};
use crate::link::{Link, LinkStatus};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use stylet_shm_schema::{CommandKind, Fault, HapticState, flags};

/// The tip is at its target within this distance along the needle.
const AT_TARGET_M: f64 = 0.3e-3;
/// A hand that the force holds back from its goal is taken as arrived within this distance.
const STALLED_M: f64 = 2e-3;
const STALLED_AFTER: Duration = Duration::from_millis(1500);
const REST_SPEED_M_PER_S: f64 = 1e-3;
const REST_FOR: Duration = Duration::from_millis(60);
const TISSUE_REST_M: f64 = 0.05e-3;
const TISSUE_REST_FOR: Duration = Duration::from_millis(200);
/// Tissue that takes longer to come back is left to do so.
const TISSUE_REST_LIMIT: Duration = Duration::from_secs(10);
const REPLY_LIMIT: Duration = Duration::from_secs(3);
const MOVE_MARGIN: Duration = Duration::from_secs(6);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    Plan,
    PlaceNeedle,
    Insert,
    DropAndRetract,
    Done,
}

impl Step {
    pub fn name(self) -> &'static str {
        match self {
            Self::Plan => "plan the needle and the seeds",
            Self::PlaceNeedle => "place the needle",
            Self::Insert => "insert",
            Self::DropAndRetract => "drop seeds and retract",
            Self::Done => "done",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunStatus {
    Working,
    Done,
    Failed(String),
}

#[derive(Clone, Debug)]
enum Action {
    Command(CommandKind, Vec<f64>),
    Move { to_m: [f64; 3], speed_m_per_s: f64 },
    SeedCount(u32),
    TissueRest,
}

/// One scripted implantation. Call [`Run::advance`] after each [`Link::poll`].
pub struct Run {
    plan: NeedlePlan,
    pace: Pace,
    actions: VecDeque<(Step, Action)>,
    status: RunStatus,
    session_id: Option<u64>,
    /// The armed force may fault from here on.
    armed: bool,
    begun: Instant,
    sent: Option<u64>,
    /// The tick from which the state shows the command.
    effective_tick: Option<u64>,
    condition_since: Option<Instant>,
}

impl Run {
    pub fn new(plan: NeedlePlan, pace: Pace) -> Self {
        Self {
            actions: script(&plan, &pace),
            plan,
            pace,
            status: RunStatus::Working,
            session_id: None,
            armed: false,
            begun: Instant::now(),
            sent: None,
            effective_tick: None,
            condition_since: None,
        }
    }

    pub fn step(&self) -> Step {
        self.actions.front().map_or(Step::Done, |(step, _)| *step)
    }

    pub fn plan(&self) -> &NeedlePlan {
        &self.plan
    }

    /// Does what can be done now.
    pub fn advance(&mut self, link: &mut Link) -> RunStatus {
        while self.status == RunStatus::Working {
            let Some((step, action)) = self.actions.front().cloned() else {
                self.status = RunStatus::Done;
                break;
            };
            match self.try_finish(link, &action) {
                Ok(true) => self.next(&action),
                Ok(false) => break,
                Err(why) => {
                    let failed = format!("step \"{}\" failed: {why}", step.name());
                    self.status = RunStatus::Failed(failed);
                }
            }
        }
        self.status.clone()
    }

    fn next(&mut self, finished: &Action) {
        self.armed |= matches!(finished, Action::Command(CommandKind::Engage, _));
        self.actions.pop_front();
        (self.sent, self.effective_tick, self.condition_since) = (None, None, None);
        self.begun = Instant::now();
    }

    fn try_finish(&mut self, link: &mut Link, action: &Action) -> Result<bool, String> {
        self.check_core(link)?;
        let Some(state) = link.state().copied() else {
            return self.in_time("the state of the force loop", REPLY_LIMIT).map(|()| false);
        };
        let fault = Fault::from_number(state.fault).unwrap_or(Fault::None);
        if self.armed && fault != Fault::None {
            return Err(format!("the force is off: {}", fault.message()));
        }
        match action {
            Action::Command(kind, values) => self.command(link, &state, *kind, values),
            Action::Move { to_m, speed_m_per_s } => {
                let (direction, acceleration) = (self.plan.direction, self.pace.acceleration_m_per_s2);
                let values = move_values(*to_m, direction, *speed_m_per_s, acceleration);
                if !self.command(link, &state, CommandKind::MoveHand, &values)? {
                    return Ok(false);
                }
                self.arrived(&state, *to_m, *speed_m_per_s)
            }
            Action::SeedCount(count) => {
                self.in_time("the seed in the tissue", REPLY_LIMIT)?;
                Ok(state.seed_count >= *count)
            }
            Action::TissueRest => {
                let moved = link.snapshot().map(|s| s.header.max_displacement_m);
                let at_rest = moved.is_some_and(|d| d < TISSUE_REST_M);
                Ok(self.held_for(at_rest, TISSUE_REST_FOR) || self.begun.elapsed() > TISSUE_REST_LIMIT)
            }
        }
    }

    fn check_core(&mut self, link: &Link) -> Result<(), String> {
        if let LinkStatus::Absent { why } = link.status() {
            return Err(why);
        }
        let id = link.session().map(|s| s.session_id);
        if self.session_id.is_some() && id != self.session_id {
            return Err("rt-core was started anew during the procedure; start the procedure again".to_owned());
        }
        self.session_id = id;
        Ok(())
    }

    /// True once the command was accepted and the state shows it.
    fn command(
        &mut self,
        link: &mut Link,
        state: &HapticState,
        kind: CommandKind,
        values: &[f64],
    ) -> Result<bool, String> {
        let Some(id) = self.sent else {
            self.sent = Some(link.send(kind, values).map_err(|e| e.0)?);
            return Ok(false);
        };
        if self.effective_tick.is_none() {
            match link.reply(id) {
                Some(answer) if answer.accepted => self.effective_tick = Some(answer.effective_tick),
                Some(answer) => return Err(format!("{kind:?} was refused: {}", answer.text)),
                None => {
                    return self
                        .in_time(&format!("an answer to {kind:?}"), REPLY_LIMIT)
                        .map(|()| false);
                }
            }
        }
        let shown = self.effective_tick.is_some_and(|tick| state.tick > tick);
        if !shown {
            self.in_time(&format!("{kind:?} to take effect"), REPLY_LIMIT)?;
        }
        Ok(shown)
    }

    fn arrived(&mut self, state: &HapticState, to_m: [f64; 3], speed_m_per_s: f64) -> Result<bool, String> {
        let off_m = self.plan.along_m(state.tip_in_scene_m) - self.plan.along_m(to_m);
        let at_rest = state.speed_m_per_s.abs() < REST_SPEED_M_PER_S;
        let there = off_m.abs() <= AT_TARGET_M && (state.flags & flags::AT_GOAL != 0 || state.depth_m > 0.0);
        let near = off_m.abs() <= STALLED_M;
        if !(at_rest && near) {
            self.condition_since = None;
        } else if self.held_for(true, if there { REST_FOR } else { STALLED_AFTER }) {
            return Ok(true);
        }
        let limit = MOVE_MARGIN + Duration::from_secs_f64((0.5 / speed_m_per_s.max(1e-4)).min(600.0));
        self.in_time(
            &format!(
                "the tip at its target; it is {:.2} mm from it along the needle",
                off_m * 1e3
            ),
            limit,
        )?;
        Ok(false)
    }

    fn held_for(&mut self, holds: bool, long: Duration) -> bool {
        if !holds {
            self.condition_since = None;
            return false;
        }
        self.condition_since.get_or_insert_with(Instant::now).elapsed() >= long
    }

    fn in_time(&self, awaited: &str, limit: Duration) -> Result<(), String> {
        if self.begun.elapsed() <= limit {
            return Ok(());
        }
        Err(format!("waited {:.1} s for {awaited}", limit.as_secs_f64()))
    }
}

fn script(plan: &NeedlePlan, pace: &Pace) -> VecDeque<(Step, Action)> {
    let command = |kind| Action::Command(kind, Vec::new());
    let go = |to_m, speed_m_per_s| Action::Move { to_m, speed_m_per_s };
    let mut actions = vec![
        (Step::Plan, command(CommandKind::Reset)),
        (Step::Plan, Action::Command(CommandKind::SetPlan, plan_values(plan))),
        (Step::PlaceNeedle, command(CommandKind::Engage)),
        (Step::PlaceNeedle, go(plan.entry_m, pace.approach_m_per_s)),
    ];
    for (index, seed) in plan.deepest_first().into_iter().enumerate() {
        actions.push(if index == 0 {
            (Step::Insert, go(seed, pace.insert_m_per_s))
        } else {
            (Step::DropAndRetract, go(seed, pace.retract_m_per_s))
        });
        actions.push((Step::DropAndRetract, command(CommandKind::DropSeed)));
        actions.push((Step::DropAndRetract, Action::SeedCount(index as u32 + 1)));
    }
    actions.push((Step::DropAndRetract, go(plan.entry_m, pace.retract_m_per_s)));
    actions.push((Step::DropAndRetract, Action::TissueRest));
    actions.into()
}

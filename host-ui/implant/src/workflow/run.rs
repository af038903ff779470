//! The scripted procedure as a list of actions, each with its own time limit.

use super::{NeedlePlan, Pace, move_request, plan_request};
use crate::plan::{Drops, Needle};
use nalgebra::Vector3;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use stylet_host::link::{Answer, Link, LinkStatus};
use stylet_shm_schema::script::{TISSUE_REST_FOR, TISSUE_REST_LIMIT, TISSUE_REST_M, arrived_after, move_limit};
use stylet_shm_schema::{CommandKind, Fault, HapticState, RefusalCode, Request};

const REPLY_LIMIT: Duration = Duration::from_secs(3);

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
    Command(Request),
    Move {
        to_m: [f64; 3],
        direction: [f64; 3],
        speed_m_per_s: f64,
    },
    /// With its number, counted from 0 over all needles.
    Drop(usize),
    TissueRest,
}

/// Why a command was not carried out.
#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error("{kind:?} was refused: {}", answer.text)]
    Refused { kind: CommandKind, answer: Answer },
    #[error("{0}")]
    Other(String),
}

impl From<String> for CommandError {
    fn from(why: String) -> Self {
        Self::Other(why)
    }
}

impl From<CommandError> for String {
    fn from(error: CommandError) -> Self {
        error.to_string()
    }
}

/// One needle of a script: what is planned, and what is done for it.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleTask {
    pub plan: NeedlePlan,
    pub drops: Drops,
}

impl NeedleTask {
    /// A needle of a plan, its seeds dropped so.
    pub fn of(needle: &Needle, drops: Drops) -> Self {
        Self {
            plan: NeedlePlan {
                entry_m: needle.entry_m,
                direction: needle.direction,
                seeds_m: needle.seeds_m().collect(),
            },
            drops,
        }
    }

    /// Each seed dropped where it is planned.
    pub fn as_planned(plan: NeedlePlan) -> Self {
        let drops = Drops {
            entry_m: plan.entry_m,
            direction: plan.direction,
            along_m: plan
                .deepest_first()
                .into_iter()
                .map(|seed| plan.along_m(seed))
                .collect(),
            retract_to_m: 0.0,
        };
        Self { plan, drops }
    }
}

/// One scripted implantation. Call [`Run::advance`] after each [`Link::poll`].
pub struct Run {
    tasks: Vec<NeedleTask>,
    pace: Pace,
    /// Each with the number of its needle.
    actions: VecDeque<(usize, Step, Action)>,
    /// Drops that the core refused because the tip was outside the tissue.
    lost: Vec<usize>,
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
    /// One needle, each seed dropped where it is planned.
    pub fn new(plan: NeedlePlan, pace: Pace) -> Self {
        Self::of_needles(vec![NeedleTask::as_planned(plan)], pace)
    }

    /// One needle after another; between two of them the tissue comes to rest.
    pub fn of_needles(tasks: Vec<NeedleTask>, pace: Pace) -> Self {
        Self {
            actions: script(&tasks, &pace),
            tasks,
            lost: Vec::new(),
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
        self.actions.front().map_or(Step::Done, |(_, step, _)| *step)
    }

    /// Which needle is at work, counted from 0; the last one when all are done.
    pub fn needle(&self) -> usize {
        let last = self.tasks.len().saturating_sub(1);
        self.actions.front().map_or(last, |(needle, _, _)| *needle)
    }

    /// Numbers of the drops that left no seed, counted from 0 over all needles: the tip was outside the tissue.
    pub fn lost(&self) -> &[usize] {
        &self.lost
    }

    /// Of the needle at work.
    pub fn plan(&self) -> Option<&NeedlePlan> {
        self.tasks.get(self.needle()).map(|task| &task.plan)
    }

    /// Does what can be done now.
    pub fn advance(&mut self, link: &mut Link) -> RunStatus {
        while self.status == RunStatus::Working {
            let Some((_, step, action)) = self.actions.front().cloned() else {
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
        self.armed |= matches!(finished, Action::Command(Request::Engage));
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
            Action::Command(request) => Ok(self.command(link, &state, request)?),
            Action::Move {
                to_m,
                direction,
                speed_m_per_s,
            } => {
                let acceleration = self.pace.acceleration_m_per_s2;
                let request = move_request(*to_m, *direction, *speed_m_per_s, acceleration);
                if !self.command(link, &state, &request)? {
                    return Ok(false);
                }
                let off = Vector3::from(state.tip_in_scene_m) - Vector3::from(*to_m);
                self.arrived(&state, off.dot(&Vector3::from(*direction)), *speed_m_per_s)
            }
            Action::Drop(number) => self.dropped(link, &state, *number),
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

    /// True once the seed lies in the tissue, or is lost because the tip is not in it.
    fn dropped(&mut self, link: &mut Link, state: &HapticState, number: usize) -> Result<bool, String> {
        match self.command(link, state, &Request::DropSeed) {
            Ok(false) => return Ok(false),
            Ok(true) => {}
            Err(CommandError::Refused { answer, .. }) if answer.is_refused_for(RefusalCode::TipOutsideTissue) => {
                self.lost.push(number);
                return Ok(true);
            }
            Err(error) => return Err(error.into()),
        }
        self.in_time("the seed in the tissue", REPLY_LIMIT)?;
        Ok(state.seed_count as usize + self.lost.len() > number)
    }

    /// True once the command was accepted and the state shows it.
    fn command(&mut self, link: &mut Link, state: &HapticState, request: &Request) -> Result<bool, CommandError> {
        let kind = request.kind();
        let Some(id) = self.sent else {
            self.sent = Some(link.send(request).map_err(|e| e.0)?);
            return Ok(false);
        };
        if self.effective_tick.is_none() {
            match link.reply(id) {
                Some(answer) if answer.accepted => self.effective_tick = Some(answer.effective_tick),
                Some(answer) => return Err(CommandError::Refused { kind, answer }),
                None => {
                    self.in_time(&format!("an answer to {kind:?}"), REPLY_LIMIT)?;
                    return Ok(false);
                }
            }
        }
        let shown = self.effective_tick.is_some_and(|tick| state.tick > tick);
        if !shown {
            self.in_time(&format!("{kind:?} to take effect"), REPLY_LIMIT)?;
        }
        Ok(shown)
    }

    fn arrived(&mut self, state: &HapticState, off_m: f64, speed_m_per_s: f64) -> Result<bool, String> {
        match arrived_after(state, off_m) {
            None => self.condition_since = None,
            Some(long) if self.held_for(true, long) => return Ok(true),
            Some(_) => {}
        }
        self.in_time(
            &format!(
                "the tip at its target; it is {:.2} mm from it along the needle",
                off_m * 1e3
            ),
            move_limit(speed_m_per_s),
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

fn script(tasks: &[NeedleTask], pace: &Pace) -> VecDeque<(usize, Step, Action)> {
    let command = Action::Command;
    let mut actions = VecDeque::new();
    let mut seeds = 0;
    for (number, task) in tasks.iter().enumerate() {
        let drops = &task.drops;
        let go = |along_m: f64, speed_m_per_s| Action::Move {
            to_m: drops.at_m(along_m),
            direction: drops.direction,
            speed_m_per_s,
        };
        let mut then = |step, action| actions.push_back((number, step, action));
        if number == 0 {
            then(Step::Plan, command(Request::Reset));
        }
        then(Step::Plan, Action::Command(plan_request(&task.plan)));
        if number == 0 {
            then(Step::PlaceNeedle, command(Request::Engage));
        }
        then(Step::PlaceNeedle, go(0.0, pace.approach_m_per_s));
        for (index, &along_m) in drops.along_m.iter().enumerate() {
            if index == 0 {
                then(Step::Insert, go(along_m, pace.insert_m_per_s));
            } else {
                then(Step::DropAndRetract, go(along_m, pace.retract_m_per_s));
            }
            then(Step::DropAndRetract, Action::Drop(seeds));
            seeds += 1;
        }
        if drops.retract_to_m > 0.0 {
            then(Step::DropAndRetract, go(drops.retract_to_m, pace.retract_m_per_s));
        }
        then(Step::DropAndRetract, go(0.0, pace.retract_m_per_s));
        then(Step::DropAndRetract, Action::TissueRest);
    }
    actions
}

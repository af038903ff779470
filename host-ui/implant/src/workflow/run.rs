//! The procedure driven over the link: requests out, replies and the state of the force loop in.

use super::{NeedlePlan, plan_request};
use crate::plan::{Drops, Needle};
use std::time::Instant;
use stylet_host::link::{Link, LinkError, LinkStatus};
use stylet_procedure::{HandRequest, Next, Observed, Pace, Procedure, Reply, Step, StepFailure};
use stylet_shm_schema::{HapticState, NeedleAxis, RefusalCode, Request};

/// How a run ended, or that it has not.
#[derive(Clone, Debug, PartialEq)]
pub enum RunStatus {
    /// Not done yet.
    Working,
    /// Every step was completed.
    Done,
    /// A step could not be completed; nothing more is sent.
    Failed(RunError),
}

/// The step that could not be completed, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("step \"{}\" failed: {why}", step.name())]
pub struct RunError {
    /// The step at that time.
    pub step: Step,
    /// What went wrong.
    pub why: RunFailure,
}

/// Why a step could not be completed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunFailure {
    /// The core is absent; the text says what to do.
    #[error("{0}")]
    Absent(String),
    /// Another run of the core has begun.
    #[error("rt-core was restarted during the procedure; start the procedure again")]
    Restarted,
    /// A request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The procedure itself cannot go on.
    #[error(transparent)]
    Procedure(#[from] StepFailure),
}

/// One needle of a script: what is planned, and what is done for it.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleTask {
    /// What is planned.
    pub plan: NeedlePlan,
    /// Where the seeds are dropped for it.
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
    procedure: Procedure,
    status: RunStatus,
    session_id: Option<u64>,
    started: Instant,
    sent: Option<u64>,
    /// The tick from which the state shows the request.
    effective_tick: Option<u64>,
}

impl Run {
    /// One needle, each seed dropped where it is planned.
    pub fn new(plan: NeedlePlan, pace: Pace) -> Self {
        Self::of_needles(vec![NeedleTask::as_planned(plan)], pace)
    }

    /// One needle after another; between two of them the tissue comes to rest.
    pub fn of_needles(tasks: Vec<NeedleTask>, pace: Pace) -> Self {
        let ways = tasks.iter().map(|task| task.drops.way()).collect();
        Self {
            tasks,
            procedure: Procedure::of_needles(ways, pace),
            status: RunStatus::Working,
            session_id: None,
            started: Instant::now(),
            sent: None,
            effective_tick: None,
        }
    }

    /// The step at present.
    pub fn step(&self) -> Step {
        self.procedure.step()
    }

    /// Which needle is at work, counted from 0; the last one when all are done.
    pub fn needle(&self) -> usize {
        self.procedure.needle()
    }

    /// Numbers of the drops that left no seed, counted from 0 over all needles: the tip was outside the tissue.
    pub fn lost(&self) -> &[usize] {
        self.procedure.lost()
    }

    /// Plan of the needle at work.
    pub fn plan(&self) -> Option<&NeedlePlan> {
        self.tasks.get(self.needle()).map(|task| &task.plan)
    }

    /// Does what can be done now.
    pub fn advance(&mut self, link: &mut Link) -> RunStatus {
        while self.status == RunStatus::Working {
            match self.try_advance(link) {
                Ok(Next::Continue) => (self.sent, self.effective_tick) = (None, None),
                Ok(Next::Done) => self.status = RunStatus::Done,
                Ok(Next::Send(_) | Next::Wait) => break,
                Err(why) => {
                    let step = self.step();
                    self.status = RunStatus::Failed(RunError { step, why });
                }
            }
        }
        self.status.clone()
    }

    fn try_advance(&mut self, link: &mut Link) -> Result<Next, RunFailure> {
        self.check_core(link)?;
        let now_s = self.started.elapsed().as_secs_f64();
        let state = link.state().copied();
        let reply = state.as_ref().map_or(Reply::Pending, |state| self.reply(link, state));
        let displacement_m = link.snapshot().map(|s| s.header.max_displacement_m);
        let observed = state.as_ref().map(|state| Observed { state, displacement_m });
        let next = self.procedure.advance(now_s, observed.as_ref(), reply)?;
        if let Next::Send(request) = next {
            self.sent = Some(self.send(link, request)?);
        }
        Ok(next)
    }

    fn check_core(&mut self, link: &Link) -> Result<(), RunFailure> {
        if let LinkStatus::Absent { why } = link.status() {
            return Err(RunFailure::Absent(why));
        }
        let id = link.session().map(|s| s.session_id);
        if self.session_id.is_some() && id != self.session_id {
            return Err(RunFailure::Restarted);
        }
        self.session_id = id;
        Ok(())
    }

    fn send(&self, link: &mut Link, request: HandRequest) -> Result<u64, LinkError> {
        let sent = link.send(&match request {
            HandRequest::Reset => Request::Reset,
            HandRequest::PublishPlan { needle } => plan_request(&self.tasks[needle].plan),
            HandRequest::Engage => Request::Engage,
            HandRequest::MoveHand(goal) => Request::MoveHand(goal),
            HandRequest::DropSeed => Request::DropSeed,
        })?;
        if let HandRequest::PublishPlan { needle } = request
            && let Some(next) = self.tasks.get(needle + 1)
        {
            // A courtesy, whose reply nothing waits for.
            link.send(&Request::ExpectNeedle(NeedleAxis {
                entry_m: next.drops.entry_m,
                direction: next.drops.direction,
            }))?;
        }
        Ok(sent)
    }

    /// What became of the request that was sent last.
    fn reply(&mut self, link: &mut Link, state: &HapticState) -> Reply {
        let Some(id) = self.sent else { return Reply::Pending };
        if self.effective_tick.is_none() {
            match link.reply(id) {
                None => return Reply::Pending,
                Some(answer) if answer.accepted => self.effective_tick = Some(answer.effective_tick),
                Some(answer) if answer.is_refused_for(RefusalCode::TipOutsideTissue) => return Reply::TipOutsideTissue,
                Some(answer) => return Reply::Refused(answer.text),
            }
        }
        if self.effective_tick.is_some_and(|tick| state.tick > tick) {
            Reply::InEffect
        } else {
            Reply::Accepted
        }
    }
}

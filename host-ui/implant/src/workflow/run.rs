//! The procedure driven over the link: requests out, replies and the state of the force loop in.

mod failure;

use crate::pairing;
use crate::plan::stabilise::{Stabilising, first_left, shows_left};
use crate::plan::{Drops, ImplantPlan};
pub use failure::{RunError, RunFailure, RunStatus};
use stylet_host::link::{Link, LinkError, LinkStatus};
use stylet_procedure::{
    Done, HandRequest, NeedleWay, Next, Observed, Pace, Patience, Procedure, Reply, Step, StepFailure, Waiting,
    needle_inside,
};
use stylet_shm_schema::{Event, EventKind, Fault, HapticState, NeedleAxis, PlannedNeedle, RefusalCode, Request};
use web_time::{Duration, Instant};

/// Longest absence of a core that is tolerated: a busy machine may delay it.
const ABSENT_LIMIT: Duration = Duration::from_secs(10);

/// Value of [`EventKind::MotionGivenUp`] for the second hand.
const SECOND_HAND: u32 = 1;
/// Standstill after which a program may not continue its motion by itself; a shorter one happens on
/// a busy machine.
const GOES_ON_AFTER: Duration = Duration::from_secs(2);

/// Needle of a script: its plan, and its drops.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleTask {
    /// Plan.
    pub plan: PlannedNeedle,
    /// Drops of its seeds.
    pub drops: Drops,
}

impl NeedleTask {
    /// Creates a needle of a plan, counted from 0, with these drops; `None` if the plan has no such
    /// needle.
    pub fn of(plan: &ImplantPlan, number: usize, drops: Drops) -> Option<Self> {
        let plan = plan.planned(number)?;
        Some(Self { plan, drops })
    }

    /// Creates a needle whose seeds are dropped at their planned places.
    pub fn as_planned(plan: PlannedNeedle) -> Self {
        let drops = Drops {
            entry_m: plan.entry_m,
            direction: plan.direction,
            along_m: plan.seeds_m.iter().map(|seed| plan.along_m(*seed)).collect(),
            retract_to_m: 0.0,
            strand_pitch_m: None,
        };
        Self { plan, drops }
    }
}

/// Part of a script's needles that is in the tissue already.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placed {
    done: Done,
    /// Number of seeds of each needle in the tissue.
    seeds: Vec<usize>,
    drops: usize,
    /// First needle with something left to do; the number of needles if there is none.
    next: usize,
}

impl Placed {
    /// Finds placed seeds by the places at which the needle left them, and the tip's present place; `lost` are
    /// the numbers of drops known to have left no seed.
    pub fn find(tasks: &[NeedleTask], dropped_at_m: &[[f64; 3]], tip_m: Option<[f64; 3]>, lost: &[usize]) -> Self {
        let ways: Vec<NeedleWay> = tasks.iter().map(|task| task.drops.way()).collect();
        let drops_m: Vec<[f64; 3]> = tasks.iter().flat_map(|task| task.drops.drops_m()).collect();
        let made = pairing::made(&drops_m, dropped_at_m);
        let mut from = 0;
        let mut count = |way: &NeedleWay| {
            let own = from..from + way.drops_m.len();
            from = own.end;
            made[own].iter().filter(|made| **made).count()
        };
        let seeds = ways.iter().map(&mut count).collect();
        let lost: Vec<usize> = lost.iter().copied().filter(|&n| made.get(n) == Some(&false)).collect();
        let is_done = |number: &usize| made[*number] || lost.contains(number);
        let done = Done {
            drops: (0..made.len()).filter(is_done).collect(),
            inside: tip_m.and_then(|tip_m| needle_inside(&ways, tip_m)),
            lost,
        };
        let is_left = |(needle, way): (usize, &NeedleWay)| {
            let first: usize = ways[..needle].iter().map(|way| way.drops_m.len()).sum();
            (first..first + way.drops_m.len())
                .any(|n| !done.drops.contains(&n))
                .then_some(needle)
        };
        let next = ways.iter().enumerate().find_map(is_left);
        let next = done.inside.map(|(needle, _)| needle).or(next);
        Self {
            seeds,
            drops: made.len(),
            next: next.unwrap_or(ways.len()),
            done,
        }
    }

    /// Returns whether it can be continued: something was done and something is left.
    pub fn is_partial(&self) -> bool {
        let made = self.done.drops.len();
        made > 0 && (made < self.drops || self.done.inside.is_some())
    }

    /// Returns whether a drop was made.
    pub fn has_begun(&self) -> bool {
        !self.done.drops.is_empty()
    }

    /// Returns whether a needle has left a seed, or is in the tissue.
    pub fn is_begun(&self, needle: usize) -> bool {
        self.seeds_of(needle) > 0 || self.done.inside.is_some_and(|(inside, _)| inside == needle)
    }

    /// Returns the needle to continue with, counted from 0; the number of needles if all are done.
    pub fn next_needle(&self) -> usize {
        self.next
    }

    /// Returns the number of a needle's seeds in the tissue.
    pub fn seeds_of(&self, needle: usize) -> usize {
        self.seeds.get(needle).copied().unwrap_or(0)
    }
}

/// Scripted implantation. Call [`Run::advance`] after each [`Link::poll`].
pub struct Run {
    tasks: Vec<NeedleTask>,
    stabilising: Vec<Stabilising>,
    procedure: Procedure,
    /// True if a fault of the second device does not prevent the start: re-arming was requested, or
    /// there was no fault.
    rearms: bool,
    status: RunStatus,
    session_id: Option<u64>,
    absent_since: Option<Instant>,
    started: Instant,
    sent: Option<u64>,
    /// Motion that it requested, to be requested again if the core gave it up.
    motion: Option<Request>,
    /// First tick whose state shows the request.
    effective_tick: Option<u64>,
}

impl Run {
    /// Creates a run of one needle, each seed dropped at its planned place.
    pub fn new(plan: PlannedNeedle, pace: Pace) -> Self {
        Self::of_needles(vec![NeedleTask::as_planned(plan)], pace)
    }

    /// Creates a run of one needle after another; between two of them the tissue comes to rest.
    pub fn of_needles(tasks: Vec<NeedleTask>, pace: Pace) -> Self {
        let ways = tasks.iter().map(|task| task.drops.way()).collect();
        Self::of(tasks, Procedure::of_needles(ways, pace))
    }

    /// Creates a run that continues from where it was stopped: nothing is reset, and no seed is
    /// dropped twice.
    pub fn continuing(tasks: Vec<NeedleTask>, pace: Pace, placed: &Placed) -> Self {
        let ways = tasks.iter().map(|task| task.drops.way()).collect();
        Self::of(tasks, Procedure::continuing(ways, pace, &placed.done))
    }

    /// Adds needles that go in first, stay while the others come and go, and are withdrawn at the
    /// end.
    #[must_use]
    pub fn stabilised(self, stabilising: &[Stabilising]) -> Self {
        let ways = stabilising.iter().map(Stabilising::way).collect();
        Self {
            procedure: self.procedure.stabilised(ways),
            stabilising: stabilising.to_vec(),
            ..self
        }
    }

    /// Returns the stabilising needle in use, counted from 0; `None` while one that leaves seeds
    /// is.
    pub fn stabilising(&self) -> Option<usize> {
        self.procedure.stabilising()
    }

    /// Allows re-arming after a fault that stands at the beginning, on the operator's request.
    #[must_use]
    pub fn rearming(self) -> Self {
        Self {
            procedure: self.procedure.rearming(),
            rearms: true,
            ..self
        }
    }

    /// Sets how long it waits; without this, until the operator decides.
    #[must_use]
    pub fn with_patience(self, patience: Patience) -> Self {
        let procedure = self.procedure.with_patience(patience);
        Self { procedure, ..self }
    }

    fn of(tasks: Vec<NeedleTask>, procedure: Procedure) -> Self {
        Self {
            tasks,
            stabilising: Vec::new(),
            procedure: procedure.with_patience(Patience::Operator),
            rearms: false,
            status: RunStatus::Working,
            session_id: None,
            absent_since: None,
            started: Instant::now(),
            sent: None,
            motion: None,
            effective_tick: None,
        }
    }

    /// Returns the present step.
    pub fn step(&self) -> Step {
        self.procedure.step()
    }

    /// Returns the condition for which it waits, and for how long.
    pub fn waiting(&self) -> Waiting {
        self.procedure.waiting()
    }

    /// Returns the needle in use, counted from 0; the last one when all are done.
    pub fn needle(&self) -> usize {
        self.procedure.needle()
    }

    /// Returns the numbers of the drops that left no seed, because the tip was outside the tissue,
    /// counted from 0 over all needles.
    pub fn lost(&self) -> &[usize] {
        self.procedure.lost()
    }

    /// Returns the plan of the needle in use.
    pub fn plan(&self) -> Option<&PlannedNeedle> {
        self.tasks.get(self.needle()).map(|task| &task.plan)
    }

    /// Does everything that is possible now.
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
        if !self.has_core(link)? {
            return Ok(Next::Wait);
        }
        if self.sent.is_none() && self.stabilising().is_some() && !shows_left(link) {
            return Ok(Next::Wait);
        }
        self.order_again(link)?;
        // Turning the force on re-arms both devices.
        let second = link
            .second_state()
            .filter(|_| !std::mem::replace(&mut self.rearms, true));
        if let Some(fault) = second.map(|s| s.fault).filter(|fault| *fault != 0) {
            let fault = Fault::from_number(fault).unwrap_or(Fault::DeviceError);
            return Err(StepFailure::FaultStands(fault).into());
        }
        let (now_s, state) = (self.started.elapsed().as_secs_f64(), link.state().copied());
        let reply = state.as_ref().map_or(Reply::Pending, |state| self.reply(link, state));
        let displacement_m = link.snapshot().map(|s| s.header.max_displacement_m);
        let observed = state.as_ref().map(|state| Observed { state, displacement_m });
        let next = self.procedure.advance(now_s, observed.as_ref(), reply)?;
        if let Next::Send(request) = next {
            self.sent = Some(self.send(link, request)?);
        }
        Ok(next)
    }

    /// Returns whether there is a core; false while a missing one is tolerated.
    fn has_core(&mut self, link: &Link) -> Result<bool, RunFailure> {
        if let LinkStatus::Absent { why } = link.status() {
            let since = *self.absent_since.get_or_insert_with(Instant::now);
            return match since.elapsed() > ABSENT_LIMIT || self.session_id.is_none() {
                true => Err(LinkError::Absent(why).into()),
                false => Ok(false),
            };
        }
        self.absent_since = None;
        let id = link.session().map(|s| s.session_id);
        if self.session_id.is_some() && id != self.session_id {
            return Err(RunFailure::Restarted);
        }
        self.session_id = id;
        Ok(true)
    }

    /// Requests again the motion that the core gave up while this program stood still for a moment.
    fn order_again(&mut self, link: &mut Link) -> Result<(), RunFailure> {
        let (Some(motion), Some(from)) = (&self.motion, self.effective_tick) else {
            return Ok(());
        };
        let is_given_up =
            |e: &Event| e.kind == EventKind::MotionGivenUp as u32 && e.code != SECOND_HAND && e.tick >= from;
        if !link.events().iter().any(is_given_up) {
            return Ok(());
        }
        let stood_still = link.longest_pause();
        if stood_still > GOES_ON_AFTER {
            return Err(RunFailure::StoodStill(stood_still.as_secs_f64()));
        }
        (self.sent, self.effective_tick) = (Some(link.send(motion)?), None);
        Ok(())
    }

    fn send(&mut self, link: &mut Link, request: HandRequest) -> Result<u64, LinkError> {
        let asked = match request {
            HandRequest::Reset => Request::Reset,
            HandRequest::PublishPlan { needle } => Request::SetPlan(Some(self.tasks[needle].plan.clone())),
            HandRequest::ExpectStabilising { number } => {
                let needle = &self.stabilising[number].needle;
                Request::ExpectNeedle(NeedleAxis {
                    entry_m: needle.entry_m,
                    direction: needle.direction,
                })
            }
            HandRequest::LeaveNeedle => Request::LeaveNeedle,
            HandRequest::DrawFirstLeft { speed_m_per_s } => Request::DrawNeedle {
                number: first_left(link).unwrap_or(u32::MAX),
                speed_m_per_s,
            },
            HandRequest::Engage => Request::Engage,
            HandRequest::MoveHand(goal) => Request::MoveHand(goal),
            HandRequest::DropSeed { strand_pitch_m } => Request::DropSeed { strand_pitch_m },
        };
        let sent = link.send(&asked)?;
        let moves = matches!(asked, Request::MoveHand(_) | Request::DrawNeedle { .. });
        self.motion = moves.then_some(asked);
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

    /// Returns the reply to the last request.
    fn reply(&mut self, link: &mut Link, state: &HapticState) -> Reply {
        let Some(id) = self.sent else { return Reply::Pending };
        if self.effective_tick.is_none() {
            match link.reply(id) {
                None => return Reply::Pending,
                Some(Ok(tick)) => self.effective_tick = Some(tick),
                Some(Err(why)) if why.is_for(RefusalCode::TipOutsideTissue) => return Reply::TipOutsideTissue,
                Some(Err(why)) => return Reply::Refused(why.text),
            }
        }
        if self.effective_tick.is_some_and(|tick| state.tick > tick) {
            Reply::InEffect
        } else {
            Reply::Accepted
        }
    }
}

#[cfg(test)]
mod tests;

//! The scripted procedure: the next request, and the end of each operation.

mod continuing;
mod failure;
mod request;
mod stabilising;
mod waiting;

use crate::tolerance::{TISSUE_REST_FOR_S, TISSUE_REST_LIMIT_S, TISSUE_REST_M, arrived_after_s, move_limit_s};
use crate::{NeedleWay, Operation, Pace, Step};
use continuing::ahead;
pub use continuing::{Done, needle_inside};
pub use failure::StepFailure;
use nalgebra::Vector3;
pub use request::HandRequest;
use std::collections::VecDeque;
use stylet_shm_schema::{Fault, HandMove, HapticState, flags};
pub use waiting::{Patience, Waiting, WaitsFor};

/// In a rehearsal, time after which a request without an answer or effect has failed, s.
const REPLY_LIMIT_S: f64 = 3.0;

/// Time limit for preparing the tissue for a needle: seconds on an idle machine, many on a busy one.
const LINE_LIMIT_S: f64 = 120.0;

/// Time limit for drawing a needle out slowly.
const LEFT_LIMIT_S: f64 = 30.0;

/// Status of the last request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Not answered yet.
    Pending,
    /// Accepted, but the state does not show it yet.
    Accepted,
    /// Accepted and in effect.
    InEffect,
    /// A seed was refused because the tip is outside the tissue.
    TipOutsideTissue,
    /// Refused for another reason, given as text.
    Refused(String),
}

/// Observed state of needle and tissue.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The latest tick of the force.
    pub state: &'a HapticState,
    /// Largest displacement of any element, m; `None` while unknown.
    pub displacement_m: Option<f64>,
}

/// Next action of the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Send this request.
    Send(HandRequest),
    /// Wait for a new observation.
    Wait,
    /// An operation is done; another follows.
    Continue,
    /// All operations are done.
    Done,
}

/// Needles in sequence. Call [`Procedure::advance`] on every new observation.
#[derive(Clone, Debug)]
pub struct Procedure {
    ways: Vec<NeedleWay>,
    /// Needles that go in first and stay: each goes to its first drop and drops no seed. Their numbers follow those of
    /// the others.
    stabilising: Vec<NeedleWay>,
    pace: Pace,
    /// Remaining operations, each with the number of its needle.
    ahead: VecDeque<(usize, Operation)>,
    /// Drops that were refused because the tip was outside the tissue.
    lost: Vec<usize>,
    /// From here on a fault ends the procedure.
    is_engaged: bool,
    /// Re-arm if a fault stands at the beginning.
    rearms: bool,
    patience: Patience,
    waits_for: WaitsFor,
    now_s: f64,
    /// Seeds in the tissue when the present drop was sent.
    seeds_before: u32,
    /// Needles that stayed in when the present operation began.
    left_before: u32,
    /// A displacement at which the tissue has remained, when needles stay in.
    kept_m: f64,
    is_sent: bool,
    begun_s: f64,
    /// Time at which the tissue was last not ready for the needle.
    ready_s: f64,
    holds_since_s: Option<f64>,
}

fn waits_for_line(state: &HapticState) -> bool {
    state.flags & flags::LINE_NEEDED != 0 && state.flags & flags::LINE_READY == 0
}

impl Procedure {
    /// Returns the whole procedure from a reset: each needle is planned, inserted and taken out; the tissue comes to
    /// rest between two of them.
    pub fn of_needles(ways: Vec<NeedleWay>, pace: Pace) -> Self {
        let mut ahead = VecDeque::new();
        let mut drops = 0;
        for (needle, way) in ways.iter().enumerate() {
            let mut then = |operation| ahead.push_back((needle, operation));
            if needle == 0 {
                then(Operation::Reset);
            }
            then(Operation::PublishPlan);
            if needle == 0 {
                then(Operation::Engage);
            }
            way.to_the_last_drop(drops).for_each(&mut then);
            drops += way.drops_m.len();
            if way.retract_to_m > 0.0 {
                then(Operation::Retract);
            }
            then(Operation::TakeOut);
            then(Operation::Settle);
        }
        Self::new(ways, pace, ahead)
    }

    /// Continues a stopped procedure from its present state: without a reset, and no drop twice.
    pub fn continuing(ways: Vec<NeedleWay>, pace: Pace, done: &Done) -> Self {
        let ahead = ahead(&ways, done);
        Self {
            lost: done.lost.clone(),
            ..Self::new(ways, pace, ahead)
        }
    }

    /// Sets how long it waits.
    #[must_use]
    pub fn with_patience(self, patience: Patience) -> Self {
        Self { patience, ..self }
    }

    /// Returns what it waits for, and for how long.
    pub fn waiting(&self) -> Waiting {
        Waiting {
            waits_for: self.waits_for,
            for_s: self.now_s - self.begun_s,
        }
    }

    fn way(&self, needle: usize) -> Option<&NeedleWay> {
        self.ways
            .get(needle)
            .or_else(|| self.stabilising.get(needle.checked_sub(self.ways.len())?))
    }

    fn new(ways: Vec<NeedleWay>, pace: Pace, ahead: VecDeque<(usize, Operation)>) -> Self {
        Self {
            stabilising: Vec::new(),
            left_before: 0,
            kept_m: f64::NAN,
            ways,
            pace,
            ahead,
            lost: Vec::new(),
            is_engaged: false,
            rearms: false,
            patience: Patience::Usual,
            waits_for: WaitsFor::State,
            now_s: 0.0,
            seeds_before: 0,
            is_sent: false,
            begun_s: 0.0,
            ready_s: 0.0,
            holds_since_s: None,
        }
    }

    /// Returns the present step.
    pub fn step(&self) -> Step {
        self.ahead.front().map_or(Step::Done, |(_, operation)| operation.step())
    }

    /// Returns the present needle, counted from 0; the last one when all are done.
    pub fn needle(&self) -> usize {
        let last = self.ways.len().saturating_sub(1);
        // A stabilising needle counts with the needle that comes next, or with the last.
        let own = self.ahead.iter().find(|(needle, _)| *needle <= last);
        own.map_or(last, |(needle, _)| *needle)
    }

    /// Returns the numbers of the drops that left no seed, counted from 0 over all needles: the tip was outside the
    /// tissue.
    pub fn lost(&self) -> &[usize] {
        &self.lost
    }

    /// Returns the next action at `now_s`, in seconds since the procedure began; `reply` is the status of the last
    /// request. `observed` is `None` while the force loop shows nothing. The procedure must not continue after a
    /// failure.
    pub fn advance(&mut self, now_s: f64, observed: Option<&Observed>, reply: Reply) -> Result<Next, StepFailure> {
        let Some(&(needle, operation)) = self.ahead.front() else {
            return Ok(Next::Done);
        };
        self.now_s = now_s;
        let Some(observed) = observed else {
            self.waits(now_s, WaitsFor::State)?;
            return Ok(Next::Wait);
        };
        let fault = Fault::from_number(observed.state.fault).unwrap_or(Fault::None);
        if self.is_engaged && fault != Fault::None {
            return Err(StepFailure::ForceOff(fault));
        }
        if !self.is_engaged && !self.rearms && fault != Fault::None {
            return Err(StepFailure::FaultStands(fault));
        }
        if !self.is_sent {
            self.is_sent = true;
            self.seeds_before = observed.state.seed_count;
            self.left_before = observed.state.left_count;
            return Ok(self.request(needle, operation).map_or(Next::Wait, Next::Send));
        }
        if !self.is_over(now_s, observed, reply, (needle, operation))? {
            return Ok(Next::Wait);
        }
        self.is_engaged |= operation == Operation::Engage;
        self.ahead.pop_front();
        (self.is_sent, self.holds_since_s, self.begun_s) = (false, None, now_s);
        Ok(if self.ahead.is_empty() {
            Next::Done
        } else {
            Next::Continue
        })
    }

    fn goal(&self, needle: usize, operation: Operation) -> Option<HandMove> {
        let way = self.way(needle)?;
        let (tip_m, speed_m_per_s) = operation.target(way, &self.pace)?;
        Some(HandMove {
            tip_m: tip_m.into(),
            direction: way.direction.into(),
            speed_m_per_s,
            acceleration_m_per_s2: self.pace.acceleration_m_per_s2,
        })
    }

    fn request(&self, needle: usize, operation: Operation) -> Option<HandRequest> {
        match operation {
            Operation::Reset => Some(HandRequest::Reset),
            Operation::PublishPlan => Some(match needle.checked_sub(self.ways.len()) {
                Some(number) => HandRequest::ExpectStabilising { number },
                None => HandRequest::PublishPlan { needle },
            }),
            Operation::Leave => Some(HandRequest::LeaveNeedle),
            Operation::DrawOut => Some(HandRequest::DrawFirstLeft {
                speed_m_per_s: self.pace.retract_m_per_s,
            }),
            Operation::Engage => Some(HandRequest::Engage),
            Operation::Drop(_) => Some(HandRequest::DropSeed {
                strand_pitch_m: self.ways.get(needle).and_then(|way| way.strand_pitch_m),
            }),
            Operation::Settle => None,
            Operation::Place
            | Operation::Insert
            | Operation::InsertTo(_)
            | Operation::DrawBack(_)
            | Operation::Retract
            | Operation::TakeOut => self.goal(needle, operation).map(HandRequest::MoveHand),
        }
    }

    fn is_over(
        &mut self,
        now_s: f64,
        observed: &Observed,
        reply: Reply,
        (needle, operation): (usize, Operation),
    ) -> Result<bool, StepFailure> {
        if let (Operation::Drop(number), Reply::TipOutsideTissue) = (operation, &reply) {
            self.lost.push(number);
            return Ok(true);
        }
        if let Some(request) = self.request(needle, operation)
            && !self.is_in_effect(now_s, &request, reply)?
        {
            return Ok(false);
        }
        match operation {
            Operation::Reset | Operation::PublishPlan | Operation::Engage => Ok(true),
            Operation::Leave => {
                self.waits(now_s, WaitsFor::Left)?;
                Ok(observed.state.left_count > self.left_before)
            }
            Operation::DrawOut => {
                self.waits(now_s, WaitsFor::Left)?;
                Ok(observed.state.left_count < self.left_before)
            }
            Operation::Drop(_) => {
                self.waits(now_s, WaitsFor::Seed)?;
                Ok(observed.state.seed_count > self.seeds_before)
            }
            Operation::Settle => {
                self.waits_for = WaitsFor::Rest;
                let beside = observed.state.left_count > 0;
                let at_rest = observed
                    .displacement_m
                    .is_some_and(|d| d < TISSUE_REST_M || (beside && self.keeps(d)));
                let waited = now_s - self.begun_s > TISSUE_REST_LIMIT_S;
                Ok(self.holds_for(at_rest, TISSUE_REST_FOR_S, now_s) || waited)
            }
            Operation::Place if waits_for_line(observed.state) => {
                self.waits(now_s, WaitsFor::Line)?;
                // The time for arrival counts from when the line is ready.
                self.ready_s = now_s;
                Ok(false)
            }
            Operation::Place
            | Operation::Insert
            | Operation::InsertTo(_)
            | Operation::DrawBack(_)
            | Operation::Retract
            | Operation::TakeOut => self.has_arrived(now_s, observed.state, (needle, operation)),
        }
    }

    fn is_in_effect(&mut self, now_s: f64, request: &HandRequest, reply: Reply) -> Result<bool, StepFailure> {
        let request = request.name();
        match reply {
            Reply::InEffect => return Ok(true),
            Reply::Pending => self.waits(now_s, WaitsFor::Reply(request))?,
            Reply::Accepted => self.waits(now_s, WaitsFor::Effect(request))?,
            Reply::TipOutsideTissue => {
                let why = "the tip is outside the tissue".to_owned();
                return Err(StepFailure::Refused { request, why });
            }
            Reply::Refused(why) => return Err(StepFailure::Refused { request, why }),
        }
        Ok(false)
    }

    fn has_arrived(
        &mut self,
        now_s: f64,
        state: &HapticState,
        (needle, operation): (usize, Operation),
    ) -> Result<bool, StepFailure> {
        let (Some(goal), Some(way)) = (self.goal(needle, operation), self.way(needle)) else {
            return Ok(true);
        };
        let along_m = |place_m: Vector3<f64>| (place_m - way.entry_m).dot(&way.direction);
        let off_along_m = along_m(Vector3::from(state.tip_in_scene_m)) - along_m(Vector3::from(goal.tip_m));
        let waited_s = now_s - self.begun_s.max(self.ready_s);
        let usual_s = move_limit_s(goal.speed_m_per_s);
        self.has_waited(waited_s, usual_s, WaitsFor::Tip { off_along_m })?;
        let after_s = arrived_after_s(state, off_along_m);
        Ok(self.holds_for(after_s.is_some(), after_s.unwrap_or(0.0), now_s))
    }

    fn holds_for(&mut self, holds: bool, least_s: f64, now_s: f64) -> bool {
        if !holds {
            self.holds_since_s = None;
            return false;
        }
        now_s - *self.holds_since_s.get_or_insert(now_s) >= least_s
    }

    fn waits(&mut self, now_s: f64, waits_for: WaitsFor) -> Result<(), StepFailure> {
        let usual_s = match waits_for {
            WaitsFor::Line => LINE_LIMIT_S,
            WaitsFor::Left => LEFT_LIMIT_S,
            _ => REPLY_LIMIT_S,
        };
        self.has_waited(now_s - self.begun_s, usual_s, waits_for)
    }

    /// Fails once its patience has run out.
    fn has_waited(&mut self, waited_s: f64, usual_s: f64, waits_for: WaitsFor) -> Result<(), StepFailure> {
        self.waits_for = waits_for;
        let limit_s = self.patience.limit_s(usual_s);
        match waited_s <= limit_s {
            true => Ok(()),
            false => Err(StepFailure::Waited { waits_for, limit_s }),
        }
    }
}

#[cfg(test)]
mod tests;

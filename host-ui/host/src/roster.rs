//! Several cores at a glance, for an instructor.

use crate::link::{Link, LinkError};
use crate::moments::STOPPED;
use std::time::Instant;
use stylet_shm_schema::Instance;
use stylet_shm_schema::{HapticState, Mark, PlanInForce, Relayed, Request, Session};

/// A trainee and their core.
#[derive(Clone, Debug, PartialEq)]
pub struct Trainee {
    /// Name for people.
    pub name: String,
    /// Instance of their core, or of a relay in its place.
    pub instance: Instance,
}

/// State of one trainee.
#[derive(Clone, Debug)]
pub struct Glance {
    /// The trainee.
    pub trainee: Trainee,
    /// Time at which its core was last heard; `None` if never.
    pub heard: Option<Instant>,
    /// The last valid state.
    pub state: Option<HapticState>,
    /// The present run.
    pub session: Option<Session>,
    /// Plan in force: seeds, entry and direction.
    pub plan: Option<PlanInForce>,
    /// Connection to a core on another machine.
    pub relayed: Option<Relayed>,
}

impl Glance {
    /// Returns the state of a trainee, as the link to their core has it.
    pub fn of(trainee: &Trainee, link: &Link) -> Self {
        Self {
            trainee: trainee.clone(),
            heard: link.heard(),
            state: link.state().copied(),
            session: link.session().copied(),
            plan: link.plan().copied(),
            relayed: link.relayed().copied(),
        }
    }
}

/// Stops the hand of a trainee, and marks the moment.
pub fn stop(link: &mut Link) -> Result<(), LinkError> {
    link.send(&Request::StopHand)?;
    let text = STOPPED.to_owned();
    link.send(&Request::Mark(Mark { text, before_s: 0.0 })).map(|_| ())
}

//! Several cores at a glance, for an instructor.

use crate::link::{Link, LinkError};
use crate::moments::STOPPED;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use stylet_shm_schema::{HapticState, Instance, InstanceError, Mark, PlanInForce, Relayed, Request, Session};
use web_time::Instant;

/// A trainee and their core.
#[derive(Clone, Debug, PartialEq)]
pub struct Trainee {
    /// Name for people.
    pub name: String,
    /// Instance of their core, or of a relay in its place.
    pub instance: Instance,
}

/// Problem of a name or a trainee on the command line.
#[derive(Debug, thiserror::Error)]
pub enum RosterError {
    /// The name cannot be that of a folder.
    #[error("a name is 1 to {LONGEST_NAME} letters, digits, spaces, '-', '_' or '.', and begins with no '.'")]
    Name,
    /// No name and instance.
    #[error("give NAME=INSTANCE, such as Otto=seat-1")]
    NoPair,
    /// The instance.
    #[error(transparent)]
    Instance(#[from] InstanceError),
}

impl FromStr for Trainee {
    type Err = RosterError;

    fn from_str(text: &str) -> Result<Self, RosterError> {
        let (who, instance) = text.split_once('=').ok_or(RosterError::NoPair)?;
        Ok(Self {
            name: name(who)?,
            instance: Instance::new(instance)?,
        })
    }
}

/// Longest name of a trainee, in bytes.
const LONGEST_NAME: usize = 60;

/// Parses a name that is valid for a folder inside a class: not empty, not hidden, no path.
pub fn name(text: &str) -> Result<String, RosterError> {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_' | '.');
    let is_name = (1..=LONGEST_NAME).contains(&text.len())
        && text.trim() == text
        && !text.starts_with('.')
        && text.chars().all(is_plain);
    is_name.then(|| text.to_owned()).ok_or(RosterError::Name)
}

/// Returns the folder for a debrief that is written now.
pub fn folder_of(class: &Path, name: &str) -> PathBuf {
    class.join(name).join(stylet_base::format::utc_now())
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

#[cfg(test)]
mod tests {
    use super::name;

    #[test]
    fn a_name_is_valid_for_a_folder() {
        for text in ["Otto", "Ida Ö.", "group_2-b"] {
            assert!(name(text).is_ok(), "{text}");
        }
        for text in ["", ".hidden", "..", "a/b", " a", "a\nb", &"x".repeat(61)] {
            assert!(name(text).is_err(), "{text:?}");
        }
    }
}

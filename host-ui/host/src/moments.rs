//! Marks, exercises and faults: the moments that a debrief names, in bounded memory.

use std::collections::VecDeque;
use stylet_shm_schema::{Event, EventKind};

/// Most moments kept for one run of the core; the oldest are dropped.
const MOST: usize = 512;

/// Words of the mark for an instructor's stop.
pub const STOPPED: &str = "stopped by the instructor";

/// Kind of a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MomentKind {
    /// A mark.
    Mark,
    /// An instructor injected a fault, or removed all.
    Exercise,
    /// A fault turned the force off.
    Fault,
}

impl MomentKind {
    /// Returns the kind in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mark => "mark",
            Self::Exercise => "exercise",
            Self::Fault => "fault",
        }
    }
}

/// One moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moment {
    /// `CLOCK_MONOTONIC` of the core.
    pub time_ns: u64,
    /// Kind of the moment.
    pub kind: MomentKind,
    /// Text for people.
    pub text: String,
}

impl Moment {
    /// Converts an event; `None` for other kinds.
    pub fn of(event: &Event) -> Option<Self> {
        let (kind, text) = match EventKind::from_number(event.kind)? {
            EventKind::Mark => (MomentKind::Mark, event.text.read()),
            EventKind::ExerciseBegun => (MomentKind::Exercise, event.text.read()),
            EventKind::ExercisesEnded => (MomentKind::Exercise, "all exercises ended".to_owned()),
            EventKind::FaultRaised | EventKind::MotionGivenUp => (MomentKind::Fault, event.text.read()),
            _ => return None,
        };
        Some(Self {
            time_ns: event.time_ns,
            kind,
            text,
        })
    }
}

/// Moments of one run of the core.
#[derive(Clone, Debug, Default)]
pub struct Moments {
    session_id: u64,
    sequence: u64,
    all: VecDeque<Moment>,
}

impl Moments {
    /// Takes events, some of which may have been taken before. True if a reset is among the new ones.
    pub fn take<'a>(&mut self, events: impl IntoIterator<Item = &'a Event>) -> bool {
        let mut was_reset = false;
        for event in events {
            if event.session_id != self.session_id {
                *self = Self {
                    session_id: event.session_id,
                    ..Self::default()
                };
            }
            if event.sequence <= self.sequence {
                continue;
            }
            self.sequence = event.sequence;
            was_reset |= event.kind == EventKind::Reset as u32;
            if let Some(moment) = Moment::of(event) {
                if self.all.len() >= MOST {
                    self.all.pop_front();
                }
                self.all.push_back(moment);
            }
        }
        was_reset
    }

    /// All moments in the order in which they were reported.
    pub fn all(&self) -> impl DoubleEndedIterator<Item = &Moment> {
        self.all.iter()
    }

    /// Returns the moments from that time on.
    pub fn since(&self, time_ns: u64) -> Vec<Moment> {
        let later = self.all.iter().filter(|moment| moment.time_ns >= time_ns);
        later.cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::Text;

    fn event(session_id: u64, sequence: u64, kind: EventKind, text: &str) -> Event {
        Event {
            session_id,
            sequence,
            time_ns: 1000 * sequence,
            kind: kind as u32,
            text: Text::new(text),
            ..Event::zeroed()
        }
    }

    #[test]
    fn each_moment_is_kept_once_and_those_of_another_run_go() {
        let mut moments = Moments::default();
        let first = [
            event(1, 1, EventKind::Mark, "left lobe"),
            event(1, 2, EventKind::Contact, ""),
            event(1, 3, EventKind::FaultRaised, "the device"),
        ];
        assert!(!moments.take(&first));
        assert!(moments.take(first.iter().chain(&[event(1, 4, EventKind::Reset, "")])));
        let words: Vec<_> = moments.all().map(|m| (m.kind.name(), m.text.as_str())).collect();
        assert_eq!(words, [("mark", "left lobe"), ("fault", "the device")]);
        assert_eq!(moments.since(2000).len(), 1);
        moments.take(&[event(2, 1, EventKind::ExerciseBegun, "device lost")]);
        assert_eq!(moments.all().count(), 1);
    }
}

//! Requests that await an answer, and the loops that each answer depends on.

use crate::rt::exchange::Ticket;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Host id and command id of a request.
pub type Asker = (u64, u64);

/// Requests not yet answered.
#[derive(Default)]
pub struct Answers {
    waiting: HashMap<Ticket, Waiting>,
    tickets: Ticket,
}

struct Waiting {
    asker: Asker,
    /// Loops that have not yet carried out the request.
    loops: usize,
    /// First tick of the force loop with the change, once it is known.
    tick: Option<u64>,
}

impl Answers {
    /// Issues the ticket under which `asker` waits for one loop.
    pub fn ticket(&mut self, asker: Asker) -> Ticket {
        self.tickets += 1;
        let waiting = Waiting {
            asker,
            loops: 1,
            tick: None,
        };
        self.waiting.insert(self.tickets, waiting);
        self.tickets
    }

    /// Makes `ticket` wait for that many loops.
    pub fn await_loops(&mut self, ticket: Ticket, loops: usize) {
        if let Some(waiting) = self.waiting.get_mut(&ticket) {
            waiting.loops = loops;
        }
    }

    /// Returns the asker behind `ticket`.
    pub fn asker(&self, ticket: Ticket) -> Option<Asker> {
        self.waiting.get(&ticket).map(|waiting| waiting.asker)
    }

    /// Records the force-loop tick from which a change holds.
    pub fn holds_from(&mut self, ticket: Ticket, tick: u64) {
        if let Some(waiting) = self.waiting.get_mut(&ticket) {
            waiting.tick = Some(tick);
        }
    }

    /// Records that one loop carried out a request. After the last loop, returns the asker and the tick to report: the
    /// force loop's, or this loop's if the force loop has no part in the request.
    pub fn carried_out(&mut self, ticket: Ticket, tick: u64) -> Option<(Asker, u64)> {
        let Entry::Occupied(mut entry) = self.waiting.entry(ticket) else {
            return None;
        };
        entry.get_mut().loops -= 1;
        (entry.get().loops == 0).then(|| {
            let waiting = entry.remove();
            (waiting.asker, waiting.tick.unwrap_or(tick))
        })
    }

    /// Drops a refused request and returns the asker to notify.
    pub fn refused(&mut self, ticket: Ticket) -> Option<Asker> {
        self.waiting.remove(&ticket).map(|waiting| waiting.asker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Replies used to be sent once the force loop had a change, even if the tissue loop and the second device did not.
    #[test]
    fn a_change_is_answered_once_every_loop_has_it() {
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
            let mut answers = Answers::default();
            let ticket = answers.ticket((7, 8));
            answers.await_loops(ticket, 3);
            let mut given = Vec::new();
            for from in order {
                if from == 0 {
                    answers.holds_from(ticket, 1000);
                }
                given.push(answers.carried_out(ticket, [1000, 200, 1003][from]));
            }
            assert_eq!(given, [None, None, Some(((7, 8), 1000))], "{order:?}");
            assert_eq!(answers.carried_out(ticket, 5), None, "once");
        }
    }

    #[test]
    fn a_refusal_is_final() {
        let mut answers = Answers::default();
        let ticket = answers.ticket((7, 8));
        answers.await_loops(ticket, 2);
        assert_eq!(answers.refused(ticket), Some((7, 8)));
        assert_eq!((answers.refused(ticket), answers.carried_out(ticket, 1)), (None, None));
    }
}

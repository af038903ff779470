//! Hosts that wait for answers, and the loops that each answer waits for.

use crate::rt::exchange::Ticket;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Numbers of a host and of its command.
pub type Asker = (u64, u64);

/// Requests that are not answered yet.
#[derive(Default)]
pub struct Answers {
    waiting: HashMap<Ticket, Waiting>,
    tickets: Ticket,
}

struct Waiting {
    asker: Asker,
    /// Loops that have not yet carried the request out.
    loops: usize,
    /// First tick of the force loop with the change, once it is known.
    tick: Option<u64>,
}

impl Answers {
    /// Returns the ticket under which `asker` waits for one loop.
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

    /// Makes `ticket` wait for so many loops.
    pub fn await_loops(&mut self, ticket: Ticket, loops: usize) {
        if let Some(waiting) = self.waiting.get_mut(&ticket) {
            waiting.loops = loops;
        }
    }

    /// Returns who waits behind `ticket`.
    pub fn asker(&self, ticket: Ticket) -> Option<Asker> {
        self.waiting.get(&ticket).map(|waiting| waiting.asker)
    }

    /// Takes the tick of the force loop that a change is reported to hold from.
    pub fn holds_from(&mut self, ticket: Ticket, tick: u64) {
        if let Some(waiting) = self.waiting.get_mut(&ticket) {
            waiting.tick = Some(tick);
        }
    }

    /// Takes word of one loop that it carried a request out. After the last of them returns whom to answer, and with which tick: that of
    /// the force loop, or of this loop where the force loop has no part in the request.
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

    /// Returns whom to tell of a refusal.
    pub fn refused(&mut self, ticket: Ticket) -> Option<Asker> {
        self.waiting.remove(&ticket).map(|waiting| waiting.asker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The reply used to come once the force loop had a change, whether or not the tissue loop and the second device had it.
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

//! Parameter changes on their way to the loops: each builds on the one before it, and reaches both loops or neither.

use crate::rt::exchange::Ticket;
use std::collections::BTreeMap;
use stylet_shm_schema::{ParameterChange, ParameterSet, ParametersInForce};

/// The set in force, and those ordered after it.
pub struct ParameterChanges {
    pub in_force: ParametersInForce,
    /// Ordered generations and sets, by the number of the request.
    ordered: BTreeMap<Ticket, (u64, ParameterSet)>,
}

impl ParameterChanges {
    pub fn new(session_id: u64) -> Self {
        let in_force = ParametersInForce {
            session_id,
            generation: 1,
            effective_tick: 0,
            set: ParameterSet::default(),
        };
        Self {
            in_force,
            ordered: BTreeMap::new(),
        }
    }

    /// Returns the set that follows all ordered changes, with `changes` applied.
    pub fn with(&self, changes: &[ParameterChange]) -> ParameterSet {
        let mut set = self.newest().1;
        for change in changes {
            set.set(change.id, change.value);
        }
        set
    }

    /// Generation of the next change.
    pub fn next_generation(&self) -> u64 {
        self.newest().0 + 1
    }

    fn newest(&self) -> (u64, ParameterSet) {
        let newest = self.ordered.values().next_back().copied();
        newest.unwrap_or((self.in_force.generation, self.in_force.set))
    }

    /// Records that the next change was ordered from the loops.
    pub fn ordered(&mut self, ticket: Ticket, set: ParameterSet) {
        self.ordered.insert(ticket, (self.next_generation(), set));
    }

    /// Records that the force loop carried out a request; true if it was an ordered change.
    pub fn take_effect(&mut self, ticket: Ticket, tick: u64) -> bool {
        let Some((generation, set)) = self.ordered.remove(&ticket) else {
            return false;
        };
        self.in_force = ParametersInForce {
            generation,
            effective_tick: tick,
            set,
            ..self.in_force
        };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::ParameterId;

    fn change(id: ParameterId, value: f64) -> [ParameterChange; 1] {
        [ParameterChange { id, value }]
    }

    /// A change that arrived before the last one was in force used to start from the set in force, and undid the last
    /// one.
    #[test]
    fn a_second_change_in_flight_keeps_the_first() {
        let mut changes = ParameterChanges::new(7);
        let first = changes.with(&change(ParameterId::MembranePeak, 5.0));
        changes.ordered(11, first);
        let second = changes.with(&change(ParameterId::CuttingForce, 1.0));
        assert_eq!(second.get(ParameterId::MembranePeak), 5.0);
        changes.ordered(12, second);
        assert!(changes.take_effect(11, 100) && changes.take_effect(12, 101));
        assert!(!changes.take_effect(12, 102));
        let now = changes.in_force;
        assert_eq!((now.session_id, now.generation, now.effective_tick), (7, 3, 101));
        assert_eq!(now.set, second);
        assert_eq!(changes.with(&[]), second);
        assert_eq!(changes.next_generation(), 4);
    }
}

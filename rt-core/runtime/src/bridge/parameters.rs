//! Changes of parameters on their way to the loops: each starts from the one before it, and reaches both loops or none.

use crate::rt::exchange::{HapticOrder, TissueOrder};
use std::collections::BTreeMap;
use stylet_shm_schema::{ParameterChange, ParameterSet, ParametersInForce};

/// The set in force, and those ordered after it.
pub struct ParameterChanges {
    pub in_force: ParametersInForce,
    /// By generation.
    ordered: BTreeMap<u64, ParameterSet>,
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

    /// What will be in force once every change has arrived, with `changes` made to it.
    pub fn with(&self, changes: &[ParameterChange]) -> ParameterSet {
        let mut set = self.ordered.values().next_back().copied().unwrap_or(self.in_force.set);
        for change in changes {
            set.set(change.id, change.value);
        }
        set
    }

    /// Generation of the next change.
    pub fn next_generation(&self) -> u64 {
        self.ordered
            .keys()
            .next_back()
            .map_or(self.in_force.generation, |&newest| newest)
            + 1
    }

    /// A change was ordered from the loops.
    pub fn ordered(&mut self, generation: u64, set: ParameterSet) {
        self.ordered.insert(generation, set);
    }

    /// The force loop has taken a change up; true when it was one of these.
    pub fn take_effect(&mut self, generation: u64, tick: u64) -> bool {
        let Some(set) = self.ordered.remove(&generation) else {
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

/// Orders something from both loops, or from none where either ring is full: false then.
pub fn order_from_both(
    haptic_orders: &mut rtrb::Producer<HapticOrder>,
    tissue_orders: &mut rtrb::Producer<TissueOrder>,
    (haptic, tissue): (HapticOrder, TissueOrder),
) -> bool {
    // The loops only take orders out, so the room does not shrink.
    let room = haptic_orders.slots() > 0 && tissue_orders.slots() > 0;
    room && haptic_orders.push(haptic).is_ok() && tissue_orders.push(tissue).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::ParameterId;

    fn change(id: ParameterId, value: f64) -> [ParameterChange; 1] {
        [ParameterChange { id, value }]
    }

    /// A change that came before the last one was in force used to start from the set in force, and undid the last one.
    #[test]
    fn a_second_change_in_flight_keeps_the_first() {
        let mut changes = ParameterChanges::new(7);
        let first = changes.with(&change(ParameterId::MembranePeak, 5.0));
        changes.ordered(changes.next_generation(), first);
        let second = changes.with(&change(ParameterId::CuttingForce, 1.0));
        assert_eq!(second.get(ParameterId::MembranePeak), 5.0);
        changes.ordered(changes.next_generation(), second);
        assert!(changes.take_effect(2, 100) && changes.take_effect(3, 101));
        assert!(!changes.take_effect(3, 102));
        let now = changes.in_force;
        assert_eq!((now.session_id, now.generation, now.effective_tick), (7, 3, 101));
        assert_eq!(now.set, second);
        assert_eq!(changes.with(&[]), second);
        assert_eq!(changes.next_generation(), 4);
    }

    /// The limits of the tissue used to be ordered even when the force loop had no room for its part.
    #[test]
    fn a_full_ring_of_one_loop_leaves_the_other_alone() {
        let both = || (HapticOrder::Reset { ticket: 1 }, TissueOrder::Reset);
        for full in [0, 1] {
            let (mut haptic, haptic_out) = rtrb::RingBuffer::new(1);
            let (mut tissue, tissue_out) = rtrb::RingBuffer::new(1);
            match full {
                0 => haptic.push(HapticOrder::HandOverTape).unwrap(),
                _ => tissue.push(TissueOrder::HandOverTape).ok().unwrap(),
            }
            assert!(!order_from_both(&mut haptic, &mut tissue, both()));
            assert_eq!(haptic_out.slots() + tissue_out.slots(), 1);
        }
        let (mut haptic, haptic_out) = rtrb::RingBuffer::new(1);
        let (mut tissue, tissue_out) = rtrb::RingBuffer::new(1);
        assert!(order_from_both(&mut haptic, &mut tissue, both()));
        assert_eq!((haptic_out.slots(), tissue_out.slots()), (1, 1));
    }
}

//! Packets replayed to each new bridge: the newest of each state, and the last events and answers.

use super::outbox::Outgoing;
use std::collections::VecDeque;
use stylet_wall::packet::Kind;

/// Kinds in the order in which a bridge gets them, each with the number of packets kept.
const KEPT: [(Kind, usize); 11] = [
    (Kind::Start, 1),
    (Kind::State, 1),
    (Kind::SecondState, 1),
    (Kind::Session, 1),
    (Kind::Snapshots, 1),
    (Kind::Scene, 1),
    (Kind::Parameters, 1),
    (Kind::Plan, 1),
    (Kind::Event, 64),
    (Kind::Rehearsal, 8),
    (Kind::Reply, 128),
];

/// Packets by kind.
#[derive(Default)]
pub struct Kept([VecDeque<Outgoing>; KEPT.len()]);

impl Kept {
    /// Keeps a packet; the oldest of its kind makes room.
    pub fn put(&mut self, packet: Outgoing) {
        for ((kind, most), queue) in KEPT.iter().zip(&mut self.0) {
            if *kind == packet.0 {
                queue.truncate(most - 1);
                queue.push_front(packet);
                return;
            }
        }
    }

    /// Returns all packets in the order for a new bridge, of each kind the oldest first.
    pub fn packets(&self) -> impl Iterator<Item = &Outgoing> {
        self.0.iter().flat_map(|queue| queue.iter().rev())
    }
}

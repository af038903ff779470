//! Filters a seat's messages by kind and first bytes, before they queue with those of others.

use super::allowance::Allowance;
use super::lock;
use super::rights::right_to_upload;
use crate::keys::{Members, Role, now_s};
use crate::wire::{self, Kind};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

/// Most messages of one seat queued for the server, which takes all of them every 2 ms.
const WAITING: usize = 64;
/// Most parts of one volume queued.
const PARTS_WAITING: usize = 512;

/// Admitted seats and their rate limits.
#[derive(Default)]
pub struct Door(Mutex<Inside>);

#[derive(Default)]
struct Inside {
    roles: BTreeMap<u16, Role>,
    gates: BTreeMap<u16, Gate>,
}

/// Limits of one seat, whoever holds it and however often it connects.
struct Gate {
    waiting: usize,
    turned_away: u64,
    /// Signs of life, twenty a second.
    greetings: Allowance,
    /// A window sends one or two for each frame, and a promise for its motion every 8 ms.
    requests: Allowance,
    /// Orders for the lease.
    orders: Allowance,
    /// A member asks at most seven times a second while it gets no answer.
    again: Allowance,
    /// One for each snapshot.
    seen: Allowance,
    /// Messages that are refused anyway, with the reason.
    refused: Allowance,
}

impl Gate {
    fn new(now: Instant) -> Self {
        Self {
            waiting: 0,
            turned_away: 0,
            greetings: Allowance::new(20.0, 40.0, now),
            requests: Allowance::new(500.0, 500.0, now),
            orders: Allowance::new(5.0, 2.0, now),
            again: Allowance::new(20.0, 20.0, now),
            seen: Allowance::new(120.0, 120.0, now),
            refused: Allowance::new(5.0, 2.0, now),
        }
    }

    fn lets_in(&mut self, role: Option<Role>, bytes: &[u8], now: Instant) -> bool {
        let (Ok(message), Some(role)) = (wire::decode(bytes), role) else {
            return self.refused.take(1.0, now);
        };
        if message.kind == Kind::Upload && right_to_upload(role).is_some() && bytes.len() <= wire::MAX_PART_BYTES {
            return self.waiting < PARTS_WAITING;
        }
        let allowance = match message.kind {
            Kind::Hello => &mut self.greetings,
            Kind::Command => &mut self.requests,
            Kind::Lease => &mut self.orders,
            Kind::Again => &mut self.again,
            Kind::Seen => &mut self.seen,
            _ => &mut self.refused,
        };
        self.waiting < WAITING && allowance.take(1.0, now)
    }
}

impl Door {
    /// Admits members in the list whose time has not expired.
    pub fn admit(&self, members: &Members) {
        let now_s = now_s();
        let open = members.members.iter().filter(|m| m.why_closed(now_s).is_none());
        lock(&self.0).roles = open.map(|m| (m.seat, m.role)).collect();
    }

    /// True if a message may queue for the server; call [`Door::took`] afterwards for an admitted one.
    pub fn lets_in(&self, seat: u16, bytes: &[u8], now: Instant) -> bool {
        let inside = &mut *lock(&self.0);
        let gate = inside.gates.entry(seat).or_insert_with(|| Gate::new(now));
        let role = inside.roles.get(&seat).copied();
        let lets_in = gate.lets_in(role, bytes, now);
        gate.waiting += usize::from(lets_in);
        // A seat that is not admitted keeps greeting, and hears the reason.
        gate.turned_away += u64::from(!lets_in && role.is_some());
        lets_in
    }

    /// Records that a message of the seat has left the queue.
    pub fn took(&self, seat: u16) {
        if let Some(gate) = lock(&self.0).gates.get_mut(&seat) {
            gate.waiting = gate.waiting.saturating_sub(1);
        }
    }

    /// Returns the seats whose messages were turned away since the last call, with their numbers.
    pub fn turned_away(&self) -> Vec<(u16, u64)> {
        let gates = &mut lock(&self.0).gates;
        let counts = gates
            .iter_mut()
            .map(|(seat, gate)| (*seat, std::mem::take(&mut gate.turned_away)));
        counts.filter(|(_, count)| *count > 0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::Member;
    use crate::wire::{Stamp, encode};

    fn door() -> Door {
        let member = |(seat, role, until_s, revoked)| Member {
            seat,
            name: format!("seat {seat}"),
            role,
            until_s,
            revoked,
        };
        let all = [
            (1, Role::Operator, i64::MAX, false),
            (2, Role::Observer, i64::MAX, false),
            (3, Role::Observer, 0, false),
            (4, Role::Operator, i64::MAX, true),
        ];
        let door = Door::default();
        door.admit(&Members {
            members: all.map(member).to_vec(),
        });
        door
    }

    fn passed(door: &Door, seat: u16, kind: Kind, length: usize, times: usize) -> usize {
        let (bytes, now) = (encode(kind, Stamp::default(), &[&vec![0; length]]), Instant::now());
        let let_in = (0..times).filter(|_| door.lets_in(seat, &bytes, now));
        let_in.inspect(|_| door.took(seat)).count()
    }

    #[test]
    fn a_flood_leaves_another_seats_allowance_alone() {
        let door = door();
        for (kind, most) in [
            (Kind::Command, 500),
            (Kind::Hello, 20),
            (Kind::Again, 20),
            (Kind::Lease, 5),
        ] {
            assert!(
                (most..most + 5).contains(&passed(&door, 2, kind, 8, 10_000)),
                "{kind:?}"
            );
            assert_eq!(passed(&door, 1, kind, 8, most), most, "{kind:?} of another seat");
        }
        assert!(
            door.turned_away()
                .iter()
                .all(|(seat, count)| (*seat, *count > 30_000) == (2, true))
        );
        assert_eq!(door.turned_away(), []);
    }

    #[test]
    fn messages_that_nobody_takes_wait_in_a_bounded_number() {
        let (door, now) = (door(), Instant::now());
        let bytes = encode(Kind::Command, Stamp::default(), &[]);
        assert_eq!((0..1000).filter(|_| door.lets_in(1, &bytes, now)).count(), WAITING);
    }

    #[test]
    fn parts_of_a_volume_pass_from_those_alone_who_may_change_the_scene() {
        let door = door();
        assert_eq!(passed(&door, 1, Kind::Upload, wire::PART_BYTES, 2000), 2000);
        for seat in [2, 3, 4, 5] {
            assert!(
                passed(&door, seat, Kind::Upload, wire::PART_BYTES, 2000) <= 6,
                "seat {seat}"
            );
        }
        assert!(
            passed(&door, 1, Kind::Upload, 2 * wire::MAX_PART_BYTES, 2000) <= 6,
            "too large"
        );
    }

    #[test]
    fn a_seat_that_is_closed_or_given_to_nobody_has_its_refusals_and_no_more() {
        let door = door();
        for seat in [3, 4, 5] {
            assert!(passed(&door, seat, Kind::Command, 8, 1000) <= 6, "seat {seat}");
        }
        door.admit(&Members::default());
        assert!(passed(&door, 1, Kind::Command, 8, 1000) <= 6, "removed");
    }
}

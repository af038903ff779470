//! One pass of the server after the other: what the core says, who is alive, who operates, and the hand that is stopped.

use super::announce::Announcements;
use super::lease::{Held, Holder, Lease};
use super::rights::operates;
use super::streams::Jobs;
use super::{Server, asked};
use crate::control::{Order, Orders};
use crate::keys::{Lab, Member, Members, Role};
use crate::say::say;
use crate::wire::{Present, Who};
use crate::{RelayError, now_ns};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_ports::SlicePublisher;
use stylet_shm_schema::{Request, UploadHeader};

const WHO_EVERY: Duration = Duration::from_millis(200);
const MEMBERS_EVERY: Duration = Duration::from_millis(500);
/// The list is read for a seat that is not in it so often at most.
const UNKNOWN_EVERY: Duration = Duration::from_millis(20);
/// A member that was silent for so long has left.
const LEFT_AFTER: Duration = Duration::from_secs(2);
/// The same refusal of a greeting is printed once in this time.
const REFUSAL_EVERY: Duration = Duration::from_secs(10);
/// What the server calls a host beside the core.
const LOCAL: &str = "a window beside the core";

/// A member that is connected.
pub(super) struct Presence {
    /// Which run and silence of the member it is.
    pub epoch: (u64, u64),
    pub heard: Instant,
    pub round_trip_ns: u64,
    pub lost: u64,
}

/// All of the server but the threads of the streams.
pub(super) struct Rounds {
    pub(super) server: Arc<Server>,
    pub(super) announcements: Announcements,
    pub(super) lease: Lease,
    pub(super) present: BTreeMap<u16, Presence>,
    pub(super) members: Members,
    pub(super) jobs: Jobs,
    pub(super) upload: Option<SlicePublisher<u8, UploadHeader>>,
    closed_at_start: Vec<u16>,
    refusals: BTreeMap<u16, Instant>,
    orders: Orders,
    lab: Lab,
    host_id: u64,
    stops: u64,
    who_sent: Instant,
    members_read: Instant,
    members_due: bool,
    passed: Instant,
}

impl Rounds {
    pub(super) fn new(server: Arc<Server>, lab: Lab, members: Members, jobs: Jobs) -> Result<Self, RelayError> {
        let now = Instant::now();
        Ok(Self {
            announcements: Announcements::new(Arc::clone(&server)),
            orders: Orders::listen(&server.instance)?,
            lease: Lease::new(now),
            present: BTreeMap::new(),
            closed_at_start: members.closed(),
            refusals: BTreeMap::new(),
            members,
            jobs,
            upload: None,
            lab,
            // No host takes the answers to the server's own requests.
            host_id: server.run ^ 0x5354_5954_4c45_5400,
            stops: 0,
            who_sent: now,
            members_read: now,
            members_due: false,
            passed: now,
            server,
        })
    }

    /// True when another seat has been closed since the session began.
    pub(super) fn pass(&mut self) -> bool {
        let now = Instant::now();
        if now - self.passed >= super::lease::SILENCE {
            // This process stood still itself: whoever operated could not be heard.
            self.stop_hand_of_the_net("the relay stood still");
        }
        self.passed = now;
        self.announcements.pass();
        self.watch_local_hosts(now);
        if let Some(seat) = self.lease.silent(now) {
            let name = self.name(seat);
            self.stop_hand(&format!("{name} operated and is silent"));
        }
        self.present.retain(|_, presence| now - presence.heard < LEFT_AFTER);
        super::lock(&self.server.paces).retain(|seat, _| self.present.contains_key(seat));
        if self.who_sent.elapsed() >= WHO_EVERY {
            self.who_sent = now;
            self.announcements.show(&self.who());
        }
        self.take_orders(now);
        self.read_members()
    }

    /// At once where a seat is not in the list: it may have been given a moment ago.
    pub(super) fn read_members_for(&mut self, seat: u16) {
        if self.members.at(seat).is_none() && self.members_read.elapsed() >= UNKNOWN_EVERY {
            self.members_due = true;
            self.read_members();
        }
    }

    /// A list that cannot be read leaves the one before in force.
    fn read_members(&mut self) -> bool {
        if self.members_due || self.members_read.elapsed() >= MEMBERS_EVERY {
            self.members_due = false;
            self.members_read = Instant::now();
            if let Ok(members) = self.lab.members() {
                self.members = members;
            }
        }
        self.members.closed() != self.closed_at_start
    }

    /// A hand beside the core goes before any on the net.
    fn watch_local_hosts(&mut self, now: Instant) {
        let Some(near) = self.announcements.near() else { return };
        let mut local = false;
        while let Some(command) = near.request_of_others() {
            local |= Request::decode(&command).is_ok_and(|request| operates(request.kind()));
        }
        if local && let Some(seat) = self.lease.local_operates(now) {
            say(format!("{LOCAL} operates now, and {} no longer", self.name(seat)));
        }
    }

    pub(super) fn is_operated_from_the_net(&self) -> bool {
        matches!(self.lease.holder(), Holder::Seat(_))
    }

    pub(super) fn stop_hand_of_the_net(&mut self, why: &str) {
        if self.is_operated_from_the_net() {
            self.lease.give(Holder::Nobody, Instant::now());
            self.stop_hand(why);
        }
    }

    fn stop_hand(&mut self, why: &str) {
        self.stops += 1;
        let command = Request::StopHand.encode(self.host_id, self.stops);
        if let (Some(near), Ok(command)) = (self.announcements.near(), command) {
            let _ = near.ask(command);
        }
        say(format!("the hand is stopped: {why}"));
    }

    /// Name and role for the log.
    pub(super) fn name(&self, seat: u16) -> String {
        match self.members.at(seat) {
            Some(member) => format!("{} ({}, seat {seat})", member.name, member.role),
            None => format!("seat {seat}, which nobody was given"),
        }
    }

    /// Says who was refused what and why; greetings come twenty times a second and are said once in a while.
    pub(super) fn refuse(&mut self, seat: u16, what: &str, why: &str, is_greeting: bool) {
        let last = self.refusals.get(&seat).copied();
        if is_greeting && last.is_some_and(|last| last.elapsed() < REFUSAL_EVERY) {
            return;
        }
        if is_greeting {
            self.refusals.insert(seat, Instant::now());
        }
        say(format!("refused: {}: {what}: {why}", self.name(seat)));
    }

    pub(super) fn take(&mut self, seat: u16, bytes: &[u8]) {
        asked::take(self, seat, bytes, now_ns());
    }

    /// Why a seat does not operate, in words.
    pub(super) fn held_words(&self, held: Held) -> String {
        match held {
            Held::ByLocal => format!("{LOCAL} operates; ask there to hand over"),
            Held::BySeat(other) => format!("{} operates; ask for the needle to be handed over", self.name(other)),
        }
    }

    fn who(&self) -> Who {
        let name = |seat| {
            self.members
                .at(seat)
                .map_or_else(|| format!("seat {seat}"), |m| m.name.clone())
        };
        let present = self.present.iter().map(|(seat, presence)| Present {
            name: name(*seat),
            role: self.members.at(*seat).filter(|m| !m.revoked).map(|m| m.role),
            round_trip_ms: presence.round_trip_ns as f64 * 1e-6,
            lost: presence.lost,
            silent_ms: presence.heard.elapsed().as_secs_f64() * 1e3,
        });
        Who {
            operator: match self.lease.holder() {
                Holder::Nobody => None,
                Holder::Local => Some(LOCAL.to_owned()),
                Holder::Seat(seat) => Some(name(seat)),
            },
            local: self.lease.holder() == Holder::Local,
            asked: self.lease.asked().map(name),
            present: present.collect(),
        }
    }

    /// Orders from this machine, of its terminals and windows: whoever sits here decides who operates.
    fn take_orders(&mut self, now: Instant) {
        let class = self.announcements.class();
        let mut given: Vec<Holder> = std::iter::from_fn(|| class?.order())
            .filter_map(|order| self.decide(&order).1)
            .collect();
        self.orders.pass(|order| {
            let (words, to) = self.decide(&order);
            given.extend(to);
            words
        });
        for to in given {
            self.hand_over(to, now);
        }
    }

    /// What is answered, and who operates then.
    fn decide(&self, order: &Order) -> (String, Option<Holder>) {
        match order {
            Order::Status => (self.who().words(), None),
            Order::Take => ("a window here operates now".to_owned(), Some(Holder::Local)),
            Order::Release => (
                "the first operator who asks may operate".to_owned(),
                Some(Holder::Nobody),
            ),
            Order::Give(name) => match self.operator(name) {
                Some(seat) => (format!("{name} operates now"), Some(Holder::Seat(seat))),
                None => (format!("{name} is no operator who is connected"), None),
            },
        }
    }

    /// The seat of an operator who is connected.
    pub(super) fn operator(&self, name: &str) -> Option<u16> {
        let valid = |m: &&Member| m.role == Role::Operator && !m.revoked && self.present.contains_key(&m.seat);
        let mut members = self.members.members.iter().filter(valid);
        members.find(|m| m.name == name).map(|m| m.seat)
    }

    /// The hand does not go on for one who has handed it over.
    pub(super) fn hand_over(&mut self, to: Holder, now: Instant) {
        let before = self.lease.give(to, now);
        if before != to {
            if let Holder::Seat(seat) = before {
                let name = self.name(seat);
                self.stop_hand(&format!("{name} operates no longer"));
            }
            say(format!(
                "operates now: {}",
                match to {
                    Holder::Nobody => "nobody".to_owned(),
                    Holder::Local => LOCAL.to_owned(),
                    Holder::Seat(seat) => self.name(seat),
                }
            ));
        }
    }
}

//! Passes of the server: the core's publications, living members, the operator, and stops of the hand.

use super::allowance::Patience;
use super::announce::Announcements;
use super::lease::{Held, Holder, Lease};
use super::outlet::Outlet;
use super::rights::operates;
use super::volume::Volume;
use super::{Server, asked, lock};
use crate::control::{Order, Orders};
use crate::keys::{Lab, Member, Members, Role, now_s};
use crate::net::{Place, Priority, put};
use crate::say::say;
use crate::wire::{Kind, class_words, encode};
use crate::{RelayError, now_ns};
use bytemuck::Zeroable;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_ports::SlicePublisher;
use stylet_shm_schema::{Class, ClassMember, MAX_CLASS, Request, Text, UploadHeader};

const CLASS_EVERY: Duration = Duration::from_millis(200);
const MEMBERS_EVERY: Duration = Duration::from_millis(500);
/// Shortest interval at which the list is read for an unlisted seat.
const UNKNOWN_EVERY: Duration = Duration::from_millis(20);
/// Silence after which a member has left.
const LEFT_AFTER: Duration = Duration::from_secs(2);
/// Time for which an unreadable list stays in force, since an editor may be writing it; after that no seat is admitted.
const LIST_PATIENCE: Duration = Duration::from_secs(2);
/// Interval of reports on messages turned away at the door.
const TURNED_AWAY_EVERY: Duration = Duration::from_secs(10);
/// The server's name for a host next to the core.
const LOCAL: &str = "a window beside the core";

/// A connected member.
pub(super) struct Presence {
    /// The member's run and its silences so far.
    pub epoch: (u64, u64),
    pub heard: Instant,
    pub round_trip_ns: u64,
    pub lost: u64,
}

/// State of the server, except for the threads of the streams.
pub(super) struct Rounds {
    pub(super) server: Arc<Server>,
    pub(super) announcements: Announcements,
    pub(super) lease: Lease,
    pub(super) present: BTreeMap<u16, Presence>,
    pub(super) members: Members,
    pub(super) upload: Option<SlicePublisher<u8, UploadHeader>>,
    /// The volume arriving in parts.
    pub(super) volume: Option<Volume>,
    patience: BTreeMap<u16, Patience>,
    orders: Orders,
    lab: Lab,
    host_id: u64,
    stops: u64,
    class_sent: Instant,
    members_read: Instant,
    /// Time at which the list was last read without an error.
    members_known: Instant,
    members_due: bool,
    turned_away: Instant,
    passed: Instant,
}

impl Rounds {
    pub(super) fn new(server: Arc<Server>, lab: Lab, members: Members) -> Result<Self, RelayError> {
        let now = Instant::now();
        Ok(Self {
            announcements: Announcements::new(Arc::clone(&server)),
            orders: Orders::listen(&server.instance)?,
            lease: Lease::new(now),
            present: BTreeMap::new(),
            members,
            upload: None,
            volume: None,
            patience: BTreeMap::new(),
            lab,
            // No host takes the answers to the server's own requests.
            host_id: server.run ^ 0x5354_5954_4c45_5400,
            stops: 0,
            class_sent: now,
            members_read: now,
            members_known: now,
            members_due: false,
            turned_away: now,
            passed: now,
            server,
        })
    }

    pub(super) fn pass(&mut self) {
        let now = Instant::now();
        if now - self.passed >= super::lease::SILENCE {
            // This process itself was suspended, so it could not hear the operator.
            self.stop_hand_of_the_net("the relay stood still");
        }
        self.passed = now;
        self.announcements.pass();
        self.watch_local_hosts(now);
        if let Some(seat) = self.lease.silent(now) {
            let name = self.name(seat);
            self.stop_hand(&format!("{name} operated and is silent"));
        }
        self.read_members();
        let silent = self
            .present
            .iter()
            .filter(|(_, presence)| now - presence.heard >= LEFT_AFTER);
        for seat in silent.map(|(seat, _)| *seat).collect::<Vec<_>>() {
            self.forget(seat);
        }
        if self.class_sent.elapsed() >= CLASS_EVERY {
            self.class_sent = now;
            self.announcements.show(self.class());
        }
        self.take_orders(now);
        if self.turned_away.elapsed() >= TURNED_AWAY_EVERY {
            self.turned_away = now;
            for (seat, count) in self.server.door.turned_away() {
                say(format!(
                    "turned away: {count} messages of {}, more than a seat may send",
                    self.name(seat)
                ));
            }
        }
    }

    /// Stops sending to the seat.
    fn forget(&mut self, seat: u16) {
        lock(&self.server.outlets).remove(&seat);
        lock(&self.server.paces).remove(&seat);
        self.present.remove(&seat);
    }

    /// Starts sending the core's data to the seat.
    pub(super) fn admit(&self, seat: u16) {
        let new = || Outlet::new(&self.server, seat);
        lock(&self.server.outlets).entry(seat).or_insert_with(new);
        lock(&self.server.paces).entry(seat).or_default();
    }

    /// Reads the list at once for an unlisted seat: it may just have been assigned.
    pub(super) fn read_members_for(&mut self, seat: u16) {
        if self.members.at(seat).is_none() && self.members_read.elapsed() >= UNKNOWN_EVERY {
            self.members_due = true;
            self.read_members();
        }
    }

    fn read_members(&mut self) {
        if !self.members_due && self.members_read.elapsed() < MEMBERS_EVERY {
            return;
        }
        self.members_due = false;
        self.members_read = Instant::now();
        match self.lab.members() {
            Ok(members) => (self.members, self.members_known) = (members, self.members_read),
            Err(why) if self.members_known.elapsed() >= LIST_PATIENCE && !self.members.members.is_empty() => {
                self.members = Members::default();
                say(format!("nobody is admitted: the list of members cannot be read: {why}"));
            }
            Err(_) => {}
        }
        self.server.door.admit(&self.members);
        self.dismiss();
    }

    /// Drops members who are no longer in the list or whose role has changed.
    fn dismiss(&mut self) {
        if let Holder::Seat(seat) = self.lease.holder()
            && self.valid(seat).map(|member| member.role) != Ok(Role::Operator)
        {
            self.stop_hand_of_the_net("whoever operated is no operator any more");
        }
        for seat in self.present.keys().copied().collect::<Vec<_>>() {
            if let Err(why) = self.valid(seat) {
                self.forget(seat);
                say(format!("dismissed: {}: {why}", self.name(seat)));
                self.tell_refused(seat, why);
            }
        }
    }

    /// Returns the member while its entry in the list is valid.
    pub(super) fn valid(&self, seat: u16) -> Result<Member, &'static str> {
        let member = self
            .members
            .at(seat)
            .ok_or("nobody has this seat in the list of the lab")?;
        match member.why_closed(now_s()) {
            Some(why) => Err(why),
            None => Ok(member.clone()),
        }
    }

    /// Informs the holder of a lab's certificate why it is refused.
    fn tell_refused(&self, seat: u16, why: &str) {
        let bytes = encode(Kind::Refused, self.server.stamp(), &[why.as_bytes()]);
        put(&self.server.session, Place::To(seat), Priority::InteractiveLow, bytes);
    }

    fn patience(&mut self, seat: u16) -> &mut Patience {
        self.patience
            .entry(seat)
            .or_insert_with(|| Patience::new(Instant::now()))
    }

    /// True if the seat may be greeted again now.
    pub(super) fn greets(&mut self, seat: u16) -> bool {
        self.patience(seat).greetings.take(1.0, Instant::now())
    }

    /// Gives precedence to a hand next to the core.
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

    /// Returns name and role for the log.
    pub(super) fn name(&self, seat: u16) -> String {
        match self.members.at(seat) {
            Some(member) => format!("{} ({}, seat {seat})", member.name, member.role),
            None => format!("seat {seat}, which nobody was given"),
        }
    }

    /// Logs a refusal and its reason, within the seat's limit.
    pub(super) fn refuse(&mut self, seat: u16, what: &str, why: &str) {
        let name = self.name(seat);
        self.log(seat, format!("refused: {name}: {what}: {why}"));
    }

    /// Refuses a greeting. Greetings arrive twenty times a second: the member always hears the reason, but the log
    /// repeats it only once in a while.
    pub(super) fn refuse_greeting(&mut self, seat: u16, why: &str) {
        self.tell_refused(seat, why);
        if self.patience(seat).refusals.take(1.0, Instant::now()) {
            say(format!("refused: {}: to connect: {why}", self.name(seat)));
        }
    }

    /// Logs a line on behalf of a seat.
    pub(super) fn log(&mut self, seat: u16, line: String) {
        let patience = self.patience(seat);
        if !patience.lines.take(1.0, Instant::now()) {
            patience.unsaid += 1;
            return;
        }
        say(match std::mem::take(&mut patience.unsaid) {
            0 => line,
            unsaid => format!("{line} ({unsaid} lines of this seat were left out before)"),
        });
    }

    pub(super) fn take(&mut self, seat: u16, bytes: &[u8]) {
        asked::take(self, seat, bytes, now_ns());
    }

    /// Describes why a seat does not operate.
    pub(super) fn held_words(&self, held: Held) -> String {
        match held {
            Held::ByLocal => format!("{LOCAL} operates; ask there to hand over"),
            Held::BySeat(other) => format!("{} operates; ask for the needle to be handed over", self.name(other)),
        }
    }

    fn class(&self) -> Class {
        let name = |seat| {
            self.members
                .at(seat)
                .map_or_else(|| format!("seat {seat}"), |m| m.name.clone())
        };
        let mut class = Class {
            count: self.present.len().min(MAX_CLASS) as u32,
            unlisted: self.present.len().saturating_sub(MAX_CLASS) as u32,
            local_operates: u32::from(self.lease.holder() == Holder::Local),
            operator: Text::new(&match self.lease.holder() {
                Holder::Nobody => String::new(),
                Holder::Local => LOCAL.to_owned(),
                Holder::Seat(seat) => name(seat),
            }),
            asked: Text::new(&self.lease.asked().map_or_else(String::new, name)),
            ..Class::zeroed()
        };
        for (member, (&seat, presence)) in class.members.iter_mut().zip(&self.present) {
            let role = self.members.at(seat).filter(|m| !m.revoked).map(|m| m.role);
            *member = ClassMember {
                name: Text::new(&name(seat)),
                role: Text::new(&role.map_or_else(String::new, |role| role.to_string())),
                round_trip_ns: presence.round_trip_ns,
                records_lost: presence.lost,
                silent_ns: presence.heard.elapsed().as_nanos() as u64,
            };
        }
        class
    }

    /// Takes orders of this machine's terminals and windows: its user decides who operates.
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

    /// Returns the answer, and the new holder.
    fn decide(&self, order: &Order) -> (String, Option<Holder>) {
        match order {
            Order::Status => (class_words(&self.class()), None),
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

    /// Returns the seat of a connected operator.
    pub(super) fn operator(&self, name: &str) -> Option<u16> {
        let valid = |m: &&Member| m.role == Role::Operator && !m.revoked && self.present.contains_key(&m.seat);
        let mut members = self.members.members.iter().filter(valid);
        members.find(|m| m.name == name).map(|m| m.seat)
    }

    /// Hands the lease over and stops the motion of the former holder.
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

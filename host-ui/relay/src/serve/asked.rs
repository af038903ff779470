//! Handles one message of a member, from the seat of its certificate to the request to the core. Nothing passes without
//! the right to it.

use super::lease::Holder;
use super::rights::{Right, right, right_to_upload};
use super::rounds::{Presence, Rounds};
use super::volume::Volume;
use crate::control::Order;
use crate::keys::{Member, Role};
use crate::wire::{self, Hello, Kind, Message, Ticks, encode};
use bytemuck::Zeroable;
use std::time::Instant;
use stylet_shm_schema::{Command, CommandKind, Reply, ReplyStatus, Request, Text};

/// Largest age of a request, by the server messages that its member had heard: the hand that made an older one does not
/// know the later events.
const LATE_NS: u64 = 500_000_000;
/// Largest age of a promise to continue a motion, which holds for 0.3 s at most: the hand of an older one may be gone.
const PROMISE_LATE_NS: u64 = 250_000_000;

const LATE: &str = "it was made before the connection was lost, or arrives late: look, and ask again";

pub(super) fn take(rounds: &mut Rounds, seat: u16, bytes: &[u8], now_ns: u64) {
    let message = match wire::decode(bytes) {
        Ok(message) => message,
        Err(why) => return rounds.refuse(seat, "a message", &why.to_string()),
    };
    rounds.read_members_for(seat);
    let member = match rounds.valid(seat) {
        Ok(member) => member,
        Err(why) => return rounds.refuse_greeting(seat, why),
    };
    let limit_ns = match is_promise(&message) {
        true => PROMISE_LATE_NS,
        false => LATE_NS,
    };
    // After a reboot the message's time may be ahead of the clock.
    let late = message.stamp.heard_ns > now_ns || now_ns - message.stamp.heard_ns > limit_ns;
    match message.kind {
        Kind::Hello => greeting(rounds, seat, &message, late),
        Kind::Seen => {
            if let Some(pace) = super::lock(&rounds.server.paces).get_mut(&seat) {
                pace.seen(message.stamp.number, message.body == wire::OF_USE, Instant::now());
            }
        }
        Kind::Again => {
            if let Ok(ticks) = wire::one::<Ticks>(message.body)
                && ticks.from <= ticks.to
                && let Some(outlet) = super::lock(&rounds.server.outlets).get(&seat)
            {
                outlet.again(ticks);
            }
        }
        Kind::Command | Kind::Lease if late => refuse(rounds, seat, &message, LATE),
        Kind::Command => command(rounds, seat, &member, &message),
        Kind::Upload => upload(rounds, seat, &member, &message, late),
        Kind::Lease => lease(rounds, seat, &member, &message),
        _ => rounds.refuse(seat, "a message", "members do not send this kind"),
    }
}

/// True for a message that renews a motion; many arrive each second.
fn is_promise(message: &Message<'_>) -> bool {
    let promises = |command: Command| command.kind == CommandKind::KeepMoving as u32;
    message.kind == Kind::Command && wire::one::<Command>(message.body).is_ok_and(promises)
}

fn greeting(rounds: &mut Rounds, seat: u16, message: &Message<'_>, late: bool) {
    let Ok(hello) = wire::one::<Hello>(message.body) else {
        return rounds.refuse(seat, "a greeting", "length of a payload");
    };
    let (now, epoch) = (Instant::now(), (message.stamp.number, hello.epoch));
    if !late {
        rounds.lease.heard(seat, now);
    }
    let known = rounds.present.get(&seat).map(|presence| presence.epoch);
    if known.is_none() {
        rounds.admit(seat);
        let line = format!("connected: {}", rounds.name(seat));
        rounds.log(seat, line);
    }
    let is_new = known != Some(epoch);
    // A member that keeps asking for everything waits: its next greeting is new as well.
    let greets = is_new && rounds.greets(seat);
    if greets {
        rounds.announcements.greet(seat);
        if let Some(pace) = super::lock(&rounds.server.paces).get_mut(&seat) {
            pace.forget();
        }
    }
    if greets
        && known.is_none_or(|(process, _)| process != epoch.0)
        && let Some(outlet) = super::lock(&rounds.server.outlets).get_mut(&seat)
    {
        outlet.forget_scene();
    }
    let has_scene = rounds.announcements.has_scene(&hello);
    if !has_scene {
        rounds.announcements.send_scene(seat, now);
    }
    if let Some(pace) = super::lock(&rounds.server.paces).get_mut(&seat) {
        pace.note_scene(has_scene);
    }
    let presence = Presence {
        epoch: if is_new && !greets {
            known.unwrap_or_default()
        } else {
            epoch
        },
        heard: now,
        round_trip_ns: hello.round_trip_ns,
        lost: hello.lost,
    };
    rounds.present.insert(seat, presence);
    answer(rounds, seat, Kind::Echo, bytemuck::bytes_of(&message.stamp.sent_ns));
}

fn answer(rounds: &Rounds, seat: u16, kind: Kind, body: &[u8]) {
    if let Some(outlet) = super::lock(&rounds.server.outlets).get(&seat) {
        outlet.message(encode(kind, rounds.server.stamp(), &[body]).into());
    }
}

/// Reports a refusal here, and to the host that asked; refusals of promises are not reported.
fn refuse(rounds: &mut Rounds, seat: u16, message: &Message<'_>, why: &str) {
    if is_promise(message) {
        return;
    }
    let (what, asker) = match message.kind {
        Kind::Command => match wire::one::<Command>(message.body) {
            Ok(command) => {
                let kind = CommandKind::try_from(command.kind);
                let what = kind.map_or("an unknown request".to_owned(), |kind| format!("{kind:?}"));
                (what, Some((command.host_id, command.command_id)))
            }
            Err(_) => ("a request of invalid length".to_owned(), None),
        },
        Kind::Upload => {
            let header = message
                .body
                .get(..size_of::<[u64; 2]>())
                .map(bytemuck::pod_read_unaligned::<[u64; 2]>);
            (
                "a volume".to_owned(),
                header.map(|[host_id, command_id]| (host_id, command_id)),
            )
        }
        Kind::Lease => ("the needle".to_owned(), None),
        _ => ("a message".to_owned(), None),
    };
    rounds.refuse(seat, &what, why);
    if let Some((host_id, command_id)) = asker {
        let mut reply = Reply::zeroed();
        (reply.session_id, reply.host_id, reply.command_id) = (rounds.announcements.session_id(), host_id, command_id);
        reply.status = ReplyStatus::Refused as u32;
        reply.text = Text::new(&format!("the relay refused it: {why}"));
        answer(rounds, seat, Kind::Reply, bytemuck::bytes_of(&reply));
    }
}

/// True if the member has the right now; takes the lease if it is free.
fn allowed(rounds: &mut Rounds, seat: u16, member: &Member, right: Option<Right>) -> Result<(), String> {
    match right {
        None => Err(format!("an {} may not do this", member.role)),
        Some(Right::Role) => Ok(()),
        Some(Right::Lease) => {
            let before = rounds.lease.holder();
            let taken = rounds.lease.take(seat, Instant::now());
            if taken.is_ok() && before != Holder::Seat(seat) {
                let line = format!("operates now: {}", rounds.name(seat));
                rounds.log(seat, line);
            }
            taken.map_err(|held| rounds.held_words(held))
        }
    }
}

fn command(rounds: &mut Rounds, seat: u16, member: &Member, message: &Message<'_>) {
    let checked = wire::one::<Command>(message.body)
        .map_err(|invalid| invalid.to_string())
        .and_then(|command| {
            let request = Request::decode(&command).map_err(|errors| errors.to_string())?;
            Ok((command, right(member.role, request.kind())))
        });
    let passed = checked.and_then(|(command, right)| {
        // Renewing a motion does not take the lease.
        let is_promise = command.kind == CommandKind::KeepMoving as u32;
        if is_promise && rounds.lease.holder() != Holder::Seat(seat) {
            return Ok(());
        }
        allowed(rounds, seat, member, right)?;
        let near = rounds.announcements.near().ok_or("no core runs there")?;
        near.ask(command).map_err(|e| e.to_string())
    });
    if let Err(why) = passed {
        refuse(rounds, seat, message, &why);
    }
}

/// Takes a part of a volume. The right is checked before the first part is kept, and again when the volume is whole.
fn upload(rounds: &mut Rounds, seat: u16, member: &Member, message: &Message<'_>, late: bool) {
    if let Err(why) = part(rounds, seat, member, message, late) {
        refuse(rounds, seat, message, &why);
    }
}

fn part(rounds: &mut Rounds, seat: u16, member: &Member, message: &Message<'_>, late: bool) -> Result<(), String> {
    let now = Instant::now();
    let (header, at, cells) = wire::part(message.body).map_err(|invalid| invalid.to_string())?;
    if at == 0 {
        if late {
            return Err(LATE.to_owned());
        }
        allowed(rounds, seat, member, right_to_upload(member.role))?;
        if rounds.volume.as_ref().is_some_and(|volume| volume.keeps_out(seat, now)) {
            return Err("the volume of another member is on its way; ask again".to_owned());
        }
        rounds.volume = Some(Volume::begin(seat, header, now));
    }
    // Parts of a refused volume are still arriving.
    let Some(volume) = rounds.volume.as_mut().filter(|volume| volume.seat == seat) else {
        return Ok(());
    };
    if !volume.goes_on(seat, &header, at, &cells, now) {
        rounds.volume = None;
        return Err("a part of the volume was lost: send it again".to_owned());
    }
    if volume.cells.len() < wire::cells(&header) {
        return Ok(());
    }
    allowed(rounds, seat, member, right_to_upload(member.role))?;
    let volume = rounds.volume.take().ok_or("no volume")?;
    rounds.upload = None;
    let near = rounds.announcements.near().ok_or("no core runs there")?;
    rounds.upload = Some(near.upload(&volume.header, &volume.cells).map_err(|e| e.to_string())?);
    Ok(())
}

/// Handles a request to operate, to stop operating, or to hand over.
fn lease(rounds: &mut Rounds, seat: u16, member: &Member, message: &Message<'_>) {
    let order = std::str::from_utf8(message.body).ok().and_then(Order::of_line);
    let mine = rounds.lease.holder() == Holder::Seat(seat);
    let passed = match order {
        _ if member.role != Role::Operator => Err(format!("an {} does not operate", member.role)),
        Some(Order::Take) => allowed(rounds, seat, member, Some(Right::Lease)),
        Some(Order::Release) if mine => {
            rounds.hand_over(Holder::Nobody, Instant::now());
            Ok(())
        }
        Some(Order::Give(name)) if mine => give(rounds, &name),
        Some(Order::Release | Order::Give(_)) => Err("only who operates hands over".to_owned()),
        _ => Err("an unknown word".to_owned()),
    };
    if let Err(why) = passed {
        refuse(rounds, seat, message, &why);
    }
}

fn give(rounds: &mut Rounds, name: &str) -> Result<(), String> {
    let to = rounds.operator(name);
    let to = to.ok_or_else(|| format!("{name} is no operator who is connected"))?;
    rounds.hand_over(Holder::Seat(to), Instant::now());
    Ok(())
}

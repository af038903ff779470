//! The threads of the streams: restore the order of records, and whole snapshots. Invalid data is dropped.

use super::last::Last;
use super::order::Order;
use super::{Bytes, Member};
use crate::ports::{far_records, far_snapshots};
use crate::wire::{self, Displacements, Kind, Rest, Ticks, decode_snapshot};
use crate::{RelayError, now_ns};
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use stylet_ports::SlicePublisher;
use stylet_shm_schema::{TickRecord, check};

/// Interval at which, without messages, they check for the end and for missing records.
const WAIT: Duration = Duration::from_millis(20);

/// Largest age of a shown snapshot: the next one is on its way. A line on which all of them are slow gets half of it on
/// top of its travel time.
const LATE_NS: u64 = 200_000_000;
/// Largest distance between the numbers of snapshots that overtake one another.
const LATE_NUMBERS: u64 = 32;
/// Time without a shown snapshot after which a late one is shown.
const BLIND: Duration = Duration::from_secs(2);

/// The scene at rest, from the thread of the other messages.
pub type Scenes = Arc<Mutex<Arc<Rest>>>;

pub(super) fn records(member: &Member, messages: &Receiver<Bytes>) -> Result<(), RelayError> {
    let (port, _node) = far_records(&member.instance)?;
    let (last, next) = Last::open(&member.instance, now_ns())?;
    let mut order = Order::from(next);
    while !member.ends() {
        if let Ok(bytes) = messages.recv_timeout(WAIT) {
            take(&mut order, &bytes);
            messages
                .try_iter()
                .take(1024)
                .for_each(|bytes| take(&mut order, &bytes));
        }
        let now = Instant::now();
        // Until then they wait here, with room for more than a minute of them.
        if member.is_announced.load(Ordering::Relaxed)
            && hand_on(member, &port, &mut order, now)
            && let Some(next) = order.next()
        {
            last.note(next, now_ns());
        }
        if let Some(ticks) = order.missing(now) {
            member.say(Kind::Again, 0, bytemuck::bytes_of(&ticks));
        }
        member.lost.store(order.lost(), Ordering::Relaxed);
    }
    Ok(())
}

/// Publishes the next records to hosts here; returns whether there were any.
fn hand_on(member: &Member, port: &SlicePublisher<TickRecord, u64>, order: &mut Order, now: Instant) -> bool {
    let mut any = false;
    while let Some(mut batch) = order.take(now) {
        for record in &mut batch {
            record.session_id = member.run(record.session_id);
        }
        if let Some(first) = batch.first() {
            any = true;
            let _ = port.send(&first.session_id, &batch);
        }
    }
    any
}

fn take(order: &mut Order, bytes: &[u8]) {
    let Ok(message) = wire::decode(bytes) else { return };
    match message.kind {
        Kind::Records => {
            let records = wire::unpack(message.body);
            // A batch with an invalid record counts as lost.
            let valid = records
                .ok()
                .filter(|batch| batch.iter().all(|r| check::record(r).is_ok()));
            if let Some(batch) = valid {
                order.put(batch);
            }
        }
        Kind::Missing => {
            if let Ok(ticks) = wire::one::<Ticks>(message.body) {
                order.give_up(ticks);
            }
        }
        _ => {}
    }
}

/// Returns how many snapshots between the newest and another are missing; `None` if the other is older and late.
/// Numbers restart if the server had considered this member gone.
fn missed(newest: (u64, u64), other: (u64, u64)) -> Option<u64> {
    if other.0 != newest.0 || other.1 + LATE_NUMBERS < newest.1 {
        return Some(0);
    }
    other.1.checked_sub(newest.1 + 1)
}

pub(super) fn snapshots(member: &Member, messages: &Receiver<Bytes>, scenes: &Scenes) -> Result<(), RelayError> {
    crate::slice::let_others_first();
    let (port, _node) = far_snapshots(&member.instance)?;
    let (mut known, mut newest, mut shown) = (Displacements::default(), (0, 0), Instant::now());
    while !member.ends() {
        let Ok(bytes) = messages.recv_timeout(WAIT) else {
            continue;
        };
        let Ok(message) = wire::decode(&bytes) else { continue };
        let at = (message.stamp.run, message.stamp.number);
        let Some(missed) = missed(newest, at) else { continue };
        member.snapshots_lost.fetch_add(missed, Ordering::Relaxed);
        newest = at;
        let rest = Arc::clone(&scenes.lock().unwrap_or_else(PoisonError::into_inner));
        let decoded = decode_snapshot(&rest, &mut known, message.body);
        let is_of_use = matches!(decoded, Ok(Some(_)));
        member.say(Kind::Seen, at.1, if is_of_use { wire::OF_USE } else { &[] });
        if let Ok(Some((mut header, vertices))) = decoded {
            let (made_ns, way_ns) = {
                let clock = member.clock();
                (clock.here_ns(header.time_ns), clock.way_ns())
            };
            // A late snapshot is still needed for its contents.
            if now_ns().saturating_sub(made_ns) > LATE_NS.max(way_ns + LATE_NS / 2) && shown.elapsed() < BLIND {
                member.snapshots_lost.fetch_add(1, Ordering::Relaxed);
                continue;
            }
            shown = Instant::now();
            member.snapshot_made_ns.store(made_ns, Ordering::Relaxed);
            header.session_id = member.run(header.session_id);
            let _ = port.send(&header, &vertices);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::missed;

    #[test]
    fn a_late_snapshot_is_dropped_and_one_of_numbers_that_began_anew_is_not() {
        assert_eq!(missed((0, 0), (7, 900)), Some(0), "the first");
        assert_eq!(missed((7, 900), (7, 901)), Some(0));
        assert_eq!(missed((7, 900), (7, 904)), Some(3));
        assert_eq!(missed((7, 900), (7, 900)), None);
        assert_eq!(missed((7, 900), (7, 898)), None);
        assert_eq!(
            missed((7, 900), (7, 0)),
            Some(0),
            "the server had forgotten this member"
        );
        assert_eq!(missed((7, 900), (8, 0)), Some(0), "another server");
    }
}

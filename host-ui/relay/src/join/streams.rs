//! The threads of the streams: records in order and whole, snapshots made whole again. What is invalid is dropped.

use super::order::Order;
use super::{Bytes, Member};
use crate::ports::{far_records, far_snapshots};
use crate::wire::{self, Displacements, Kind, Rest, Ticks, decode_snapshot};
use crate::{RelayError, now_ns};
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use stylet_shm_schema::service::MAX_BATCH;
use stylet_shm_schema::{TickRecord, check};

const WAIT: Duration = Duration::from_millis(5);

/// What the scene at rest is, as the thread of the rest has it.
pub type Scenes = Arc<Mutex<Arc<Rest>>>;

pub(super) fn records(member: &Member, messages: &Receiver<Bytes>) -> Result<(), RelayError> {
    let (port, _node) = far_records(&member.instance)?;
    let mut order = Order::default();
    while !member.ends() {
        if let Ok(bytes) = messages.recv_timeout(WAIT) {
            take(&mut order, &bytes);
            messages
                .try_iter()
                .take(1024)
                .for_each(|bytes| take(&mut order, &bytes));
        }
        let now = Instant::now();
        while let Some(mut batch) = order.take(now) {
            for record in &mut batch {
                record.session_id = member.run(record.session_id);
            }
            if let Some(first) = batch.first() {
                let _ = port.send(&first.session_id, &batch);
            }
        }
        if let Some(ticks) = order.missing(now) {
            member.say(Kind::Again, 0, bytemuck::bytes_of(&ticks));
        }
        member.lost.store(order.lost(), Ordering::Relaxed);
    }
    Ok(())
}

fn take(order: &mut Order, bytes: &[u8]) {
    let Ok(message) = wire::decode(bytes) else { return };
    match message.kind {
        Kind::Records => {
            let records = wire::many::<TickRecord>(message.body, MAX_BATCH);
            // A batch with an invalid record is one that was lost.
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

pub(super) fn snapshots(member: &Member, messages: &Receiver<Bytes>, scenes: &Scenes) -> Result<(), RelayError> {
    let (port, _node) = far_snapshots(&member.instance)?;
    let (mut known, mut newest) = (Displacements::default(), (0, 0));
    while !member.ends() {
        let Ok(bytes) = messages.recv_timeout(WAIT) else {
            continue;
        };
        let Ok(message) = wire::decode(&bytes) else { continue };
        let at = (message.stamp.run, message.stamp.number);
        // An older one of the same run came late.
        if at.0 == newest.0 && at.1 <= newest.1 {
            continue;
        }
        let missed = if at.0 == newest.0 { at.1 - newest.1 - 1 } else { 0 };
        member.snapshots_lost.fetch_add(missed, Ordering::Relaxed);
        newest = at;
        member.say(Kind::Seen, at.1, &[]);
        let rest = Arc::clone(&scenes.lock().unwrap_or_else(PoisonError::into_inner));
        if let Ok(Some((mut header, vertices))) = decode_snapshot(&rest, &mut known, message.body) {
            let age_ns = message.stamp.sent_ns.saturating_sub(header.time_ns);
            member
                .snapshot_made_ns
                .store(now_ns().saturating_sub(age_ns), Ordering::Relaxed);
            header.session_id = member.run(header.session_id);
            let _ = port.send(&header, &vertices);
        }
    }
    Ok(())
}

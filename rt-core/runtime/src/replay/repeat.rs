//! Runs both loops again from a recording, and says where they come out differently.

use super::file::Flight;
use crate::rt::exchange::{HapticOrder, TipPose, TissueOrder, TissueResponse};
use crate::rt::haptic::{HapticLoop, HapticPorts};
use crate::rt::haptic_tape::{HapticEntry, HapticFlight, HapticTape};
use crate::rt::recorder::recorder;
use crate::rt::tissue::{TissueLoop, TissuePorts};
use crate::rt::tissue_tape::{TapedOrder, TissueEntry, TissueFlight, TissueMemory, TissueTape};
use crate::rt::world::World;
use std::sync::Arc;
use stylet_hw::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use stylet_shm_schema::TickRecord;

/// What one loop's repetition gave.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Repeated {
    pub ticks: usize,
    /// Ticks whose output differs in any bit.
    pub different: usize,
    /// The first of them, counted from the start of the recording.
    pub first_different: Option<usize>,
    /// Positions compared, and how many differ in any bit: each element at each checkpoint and at the end.
    pub positions: usize,
    pub different_positions: usize,
}

impl Repeated {
    pub fn is_identical(&self) -> bool {
        self.ticks > 0 && self.different == 0 && self.different_positions == 0
    }

    fn count(&mut self, index: usize, same: bool) {
        self.ticks += 1;
        if !same {
            self.different += 1;
            self.first_different.get_or_insert(index);
        }
    }
}

/// Answers as the device answered then.
struct RecordedDevice {
    info: DeviceInfo,
    answers: std::vec::IntoIter<(Result<Sample, DeviceFault>, bool)>,
    write_failed: bool,
}

impl Device for RecordedDevice {
    fn info(&self) -> DeviceInfo {
        self.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        let (read, write_failed) = self.answers.next().unwrap_or((Err(DeviceFault::NotConnected), true));
        self.write_failed = write_failed;
        read
    }

    fn write(&mut self, _wrench: &Wrench) -> Result<(), DeviceFault> {
        if self.write_failed {
            Err(DeviceFault::Driver)
        } else {
            Ok(())
        }
    }
}

/// All of a record but how long the tick took.
fn without_times(record: &TickRecord) -> TickRecord {
    TickRecord {
        force_written_ns: 0,
        work_ns: 0,
        ..*record
    }
}

/// The haptic chain: forces, phases, faults and flags of each tick.
pub fn haptic(flight: &Flight, recorded: &HapticFlight) -> Repeated {
    let (mut tissue_in, response) = triple_buffer::triple_buffer(&TissueResponse::default());
    let (pose, _pose_out) = triple_buffer::triple_buffer(&TipPose::default());
    let (mut orders_in, orders) = rtrb::RingBuffer::new(recorded.orders.len().max(1));
    let (notices, mut notices_out) = rtrb::RingBuffer::new(1024);
    let (records, mut records_out) = rtrb::RingBuffer::new(4);
    let (tape, _desk) = recorder(Box::new(HapticTape::new(&recorded.memory)));
    let answers: Vec<_> = recorded.ticks.iter().map(|e| (e.read, e.write_failed)).collect();
    let device = RecordedDevice {
        info: flight.device.info(),
        answers: answers.into_iter(),
        write_failed: false,
    };
    let ports = HapticPorts {
        pose,
        response,
        orders,
        notices,
        records,
        flight: tape,
    };
    let (session_id, period_s) = (flight.session_id, flight.haptic_period_s);
    let mut again = HapticLoop::new(session_id, Box::new(device), ports, &recorded.memory, period_s);
    let mut found = Repeated::default();
    let mut orders = recorded.orders.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        while let Some((_, order)) = orders.next_if(|(tick, _)| *tick == index as u64) {
            // A tape that is handed over changes nothing of what the loop does.
            if !matches!(order, HapticOrder::HandOverTape) {
                let _ = orders_in.push(*order);
            }
        }
        tissue_in.write(entry.tissue);
        again.tick(entry.record.due_ns, entry.woke_ns, entry.record.missed);
        while notices_out.pop().is_ok() {}
        found.count(index, records_out.pop().is_ok_and(|record| is_same(&record, entry)));
    }
    found
}

fn is_same(record: &TickRecord, entry: &HapticEntry) -> bool {
    bytemuck::bytes_of(&without_times(record)) == bytemuck::bytes_of(&without_times(&entry.record))
}

/// The tissue chain: response and held element of each tick, and every element's position at each checkpoint.
pub fn tissue(flight: &Flight, recorded: &TissueFlight) -> Result<Repeated, String> {
    let scene = recorded.scene.build().map_err(|e| e.to_string())?;
    let world = || World::new(scene.clone(), recorded.memory.limits.clone(), 1).map(Box::new);
    let reference = world()?;
    if reference.tissue.memory_len() != recorded.memory.body.len() {
        return Err("the recorded tissue is not that of its scene: another version recorded it".to_owned());
    }
    let (mut pose_in, pose) = triple_buffer::triple_buffer(&TipPose::default());
    let (response, _response_out) = triple_buffer::triple_buffer(&TissueResponse::default());
    let (mut orders_in, orders) = rtrb::RingBuffer::new(recorded.orders.len().max(1));
    let (notices, mut notices_out) = rtrb::RingBuffer::new(1024);
    let (old_worlds, _old) = rtrb::RingBuffer::new(1);
    let (_slots_in, slots) = rtrb::RingBuffer::new(1);
    let (filled, _filled_out) = rtrb::RingBuffer::new(1);
    let (tape, _desk) = recorder(Box::new(TissueTape::new(&reference, Arc::new(recorded.scene.clone()))));
    let ports = TissuePorts {
        pose,
        response,
        orders,
        notices,
        old_worlds,
        slots,
        filled,
        flight: tape,
    };
    let mut again = TissueLoop::new(flight.session_id, ports, world()?, flight.tissue_period_s);
    again.remember(&recorded.memory);
    let mut compare = Bodies {
        reference,
        found: Repeated::default(),
    };
    let mut orders = recorded.orders.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        if let Some((_, memory)) = recorded.middle.as_ref().filter(|(tick, _)| *tick == index as u64) {
            compare.positions(&again, memory);
        }
        while let Some((_, order)) = orders.next_if(|(tick, _)| *tick == index as u64) {
            let _ = orders_in.push(order_of(order));
        }
        pose_in.write(entry.pose);
        again.tick(entry.woke_ns);
        while notices_out.pop().is_ok() {}
        compare.found.count(index, same_step(&again, entry));
    }
    compare.positions(&again, &recorded.end);
    Ok(compare.found)
}

fn order_of(order: &TapedOrder) -> TissueOrder {
    match order {
        TapedOrder::Limits(limits) => TissueOrder::Limits(limits.clone()),
        TapedOrder::DropSeed => TissueOrder::DropSeed { ticket: 0 },
        TapedOrder::UndoSeed => TissueOrder::UndoSeed { ticket: 0 },
        TapedOrder::Reset => TissueOrder::Reset,
    }
}

/// In every bit, but for how long things took.
fn same_step(again: &TissueLoop, entry: &TissueEntry) -> bool {
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let response = |r: &TissueResponse| {
        let numbers = bits(&[r.worst_residual]);
        let places = [bits(r.contact_in_scene.as_slice()), bits(r.path_direction.as_slice())];
        (r.time_ns, r.tick, r.contact, r.seed_count, r.unsolved, numbers, places)
    };
    let (held, residual) = again.last_step();
    let place =
        |held: Option<stylet_sim::tissue::Held>| held.map(|h| (h.element, bits(&h.position_m), h.patch_m.to_bits()));
    response(again.response()) == response(&entry.response)
        && place(held) == place(entry.held)
        && residual.to_bits() == entry.residual.to_bits()
}

/// Compares whole bodies.
struct Bodies {
    /// Takes up what was recorded.
    reference: Box<World>,
    found: Repeated,
}

impl Bodies {
    fn positions(&mut self, again: &TissueLoop, recorded: &TissueMemory) {
        self.reference.tissue.load(&recorded.body);
        let (then, now) = (self.reference.tissue.deformed(), again.body());
        let bits = |u: [f64; 3]| u.map(f64::to_bits);
        for element in 0..then.lattice.element_count() as u32 {
            self.found.positions += 1;
            if bits(then.displacement(element)) != bits(now.displacement(element)) {
                self.found.different_positions += 1;
            }
        }
    }
}

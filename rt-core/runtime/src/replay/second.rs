//! Runs the second device's loop again from a recording.

use super::file::Flight;
use super::repeat::{RecordedDevice, Repeated, capacities};
use crate::rt::second::{SecondFlight, SecondLoop, SecondOrder, SecondTape, wire};
use stylet_shm_schema::SecondRecord;

/// Repeats forces, faults and flags of each tick. Repeats nothing if the recording does not name the device.
pub fn second(flight: &Flight, recorded: &SecondFlight) -> Repeated {
    let mut found = Repeated::default();
    let Some(figures) = &flight.second_device else {
        return found;
    };
    let tape = Box::new(SecondTape::new(&recorded.memory));
    let (ports, mut tissue, mut control) = wire(capacities(recorded.orders.len()), Some(tape));
    let answers = recorded.ticks.iter().map(|e| (e.read, e.write_failed)).collect();
    let device = Box::new(RecordedDevice::new(figures.device.info(), answers));
    let mut again = SecondLoop::new(flight.session_id, device, ports, &recorded.memory, figures.period_s);
    let mut orders = recorded.orders.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        while let Some((_, order)) = orders.next_if(|(tick, _)| *tick == index as u64) {
            // Handing over a tape does not affect the loop.
            if *order != SecondOrder::HandOverTape {
                let _ = control.orders.push(*order);
            }
        }
        tissue.response.write(entry.response);
        again.tick(entry.record.due_ns, entry.woke_ns, entry.record.missed);
        while control.notices.pop().is_ok() {}
        let record = control.records.pop();
        found.count(index, record.is_ok_and(|record| is_same(&record, &entry.record)));
    }
    found
}

/// True if every bit is the same, except the durations of work.
fn is_same(a: &SecondRecord, b: &SecondRecord) -> bool {
    let [a, b] = [a, b].map(|record| SecondRecord {
        force_written_ns: 0,
        work_ns: 0,
        ..*record
    });
    bytemuck::bytes_of(&a) == bytemuck::bytes_of(&b)
}

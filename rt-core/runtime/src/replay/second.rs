//! Runs the second device's loop again from a recording.

use super::file::Flight;
use super::repeat::{RecordedDevice, Repeated, at, capacities, push_order};
use crate::rt::second::{SecondFlight, SecondLoop, SecondTape, wire};
use stylet_shm_schema::SecondRecord;

/// Repeats forces, faults and flags of each tick. Repeats nothing if the recording does not name the device.
pub fn second(flight: &Flight, recorded: &SecondFlight) -> Repeated {
    let mut found = Repeated::default();
    let Some(figures) = &flight.second_device else {
        return found;
    };
    let tape = Box::new(SecondTape::new(&recorded.memory));
    let (ports, mut tissue, mut control) = wire(capacities(recorded.orders.len()), Some(tape));
    let device = RecordedDevice::boxed(figures.device, &recorded.ticks);
    let mut again = SecondLoop::new(flight.session_id, device, ports, &recorded.memory, figures.period_s);
    let mut orders = recorded.orders.iter().peekable();
    for (index, entry) in recorded.ticks.iter().enumerate() {
        at(&mut orders, index).for_each(|order| push_order(&mut control.orders, *order));
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

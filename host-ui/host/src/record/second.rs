//! The second device in a recording: its ticks as messages, and their export.

use super::messages::{Channel, object, vector, whole};
use serde_json::{Value, json};
use std::io::Write;
use stylet_shm_schema::SecondRecord;
use stylet_shm_schema::motion::MotionSample;

pub const SECOND: Channel = Channel {
    topic: "/stylet/second",
    schema: "stylet.SecondTick",
    text: second_schema,
};

fn second_schema() -> Value {
    object(
        SECOND.schema,
        json!({
            "session_id": whole("run of rt-core"), "tick": whole("of the loop of the second device"),
            "due_ns": whole("CLOCK_MONOTONIC, on the ideal grid"), "wake_latency_ns": whole("from due to awake"),
            "force_written_ns": whole("from awake to force written"), "work_ns": whole("from awake to done"),
            "missed": whole("deadlines skipped just before"), "fault": whole("of this device, 0 none"),
            "flags": whole("bits, as those of a tick: 1 real-time, 2 engaged, 4 in contact, 16 simulated device, 32 at goal, 64 gate acted, 128 waiting"),
            "buttons": whole("one bit each"), "tip_in_scene_m": vector(3, "m, tip of what the hand holds"),
            "world_from_tool": vector(4, "quaternion i, j, k, w; what the hand holds lies along +z"),
            "force_on_hand_n": vector(3, "N, after the gate"), "torque_on_hand_nm": vector(3, "N m, after the gate"),
            "contact_force_n": { "type": "number", "description": "N, size of the force of the contact before the gate" },
            "tissue_tick": whole("of the tissue loop, whose answer was used"),
        }),
    )
}

pub fn motion_sample(record: &SecondRecord) -> MotionSample {
    MotionSample {
        tip_in_scene_m: record.tip_in_scene_m,
        world_from_tool: record.world_from_tool,
        buttons: record.buttons,
        reserved: 0,
    }
}

const COLUMNS: [&str; 25] = [
    "session_id",
    "tick",
    "due_ns",
    "wake_latency_ns",
    "force_written_ns",
    "work_ns",
    "missed",
    "fault",
    "flags",
    "buttons",
    "tissue_tick",
    "tip_x_m",
    "tip_y_m",
    "tip_z_m",
    "tool_i",
    "tool_j",
    "tool_k",
    "tool_w",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "torque_x_nm",
    "torque_y_nm",
    "torque_z_nm",
    "contact_force_n",
];

pub fn csv(records: &[SecondRecord], file: &mut impl Write) -> std::io::Result<()> {
    let mut table = csv::Writer::from_writer(file);
    table.write_record(COLUMNS)?;
    for r in records {
        let whole = [
            r.session_id,
            r.tick,
            r.due_ns,
            r.wake_latency_ns,
            r.force_written_ns,
            r.work_ns,
        ];
        let small = [r.missed, r.fault, r.flags, r.buttons].map(u64::from);
        let real = [
            &r.tip_in_scene_m[..],
            &r.world_from_tool,
            &r.force_on_hand_n,
            &r.torque_on_hand_nm,
        ];
        let row = whole.iter().chain(&small).chain([&r.tissue_tick]).map(u64::to_string);
        let real = real
            .into_iter()
            .flatten()
            .chain([&r.contact_force_n])
            .map(f64::to_string);
        table.write_record(row.chain(real))?;
    }
    table.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_tick_of_the_second_device_reads_back_to_the_same_bits() {
        let mut record = SecondRecord::zeroed();
        (record.tick, record.fault, record.flags) = (u64::MAX - 1, 9, 0b101);
        record.tip_in_scene_m = [0.1, 1.0 / 3.0, -2e-17];
        record.force_on_hand_n = [-0.0, f64::MIN_POSITIVE, 8.5];
        let again: SecondRecord = serde_json::from_slice(&serde_json::to_vec(&record).unwrap()).expect("a tick");
        assert_eq!(bytemuck::bytes_of(&again), bytemuck::bytes_of(&record));
        let mut table = Vec::new();
        csv(&[record], &mut table).unwrap();
        let text = String::from_utf8(table).unwrap();
        let counts: Vec<_> = text.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(counts, [COLUMNS.len(); 2]);
    }
}

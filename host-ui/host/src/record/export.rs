//! Exports of a recording: a table, and a motion for the core's replay device.

use super::error::RecordError;
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};
use stylet_base::{write_streamed, write_whole};
use stylet_recordings::{FileProblem, read};
use stylet_shm_schema::motion::{Motion, MotionSample};
use stylet_shm_schema::{SecondRecord, TickRecord};

/// The period of the force loop's ideal grid.
const PERIOD_NS: u64 = 1_000_000;

/// Options of `host-ui export`: tables and motions of a recording.
#[derive(Args, Debug)]
#[group(id = "made", required = true, multiple = true, args = ["csv", "motion", "csv_2", "motion_2"])]
pub struct Export {
    /// Recording made by 'host-ui record'
    recording: PathBuf,
    /// Table with one row per tick
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Motion of the hand, for 'rt-core --device replay:FILE'
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Table with one row per tick of the second device
    #[arg(long = "csv-2", value_name = "FILE.csv")]
    csv_2: Option<PathBuf>,
    /// Motion of the second hand, for 'rt-core --device-2 replay:FILE'
    #[arg(long = "motion-2", value_name = "FILE")]
    motion_2: Option<PathBuf>,
}

/// Writes the requested exports, and prints the contents of the recording.
pub fn export(options: &Export) -> Result<(), RecordError> {
    let recording = read(&options.recording)?;
    println!(
        "{} ticks of {} session(s), {} missing in {} gaps",
        recording.gaps.records(),
        recording.gaps.sessions(),
        recording.gaps.missing(),
        recording.gaps.gaps().len()
    );
    if let Some(why) = &recording.cut_off {
        println!(
            "note: the recording was cut off ({}); what came before is used",
            stylet_base::format::printable_line(why)
        );
    }
    if let Some(path) = &options.csv {
        write_streamed(path, |file| csv(&recording.ticks, file))?;
        println!("written: {}", path.display());
    }
    if let Some(path) = &options.motion {
        let sample = |t: &TickRecord| sample(t.tip_in_scene_m, t.world_from_tool, t.buttons);
        let samples = recording.ticks.iter().map(|t| (t.session_id, t.due_ns, sample(t)));
        write_motion(path, samples, "--device")?;
    }
    let has_second = !recording.second.is_empty();
    let wanted = options.csv_2.as_ref().or(options.motion_2.as_ref());
    if let Some(path) = wanted.filter(|_| !has_second) {
        return Err(RecordError::of_file(path, FileProblem::NoSecond));
    }
    if let Some(path) = &options.csv_2 {
        write_streamed(path, |file| csv_of_second(&recording.second, file))?;
        println!("written: {}", path.display());
    }
    if let Some(path) = &options.motion_2 {
        let sample = |r: &SecondRecord| sample(r.tip_in_scene_m, r.world_from_tool, r.buttons);
        let samples = recording.second.iter().map(|r| (r.session_id, r.due_ns, sample(r)));
        write_motion(path, samples, "--device-2")?;
    }
    Ok(())
}

fn write_motion(
    path: &Path,
    samples: impl Iterator<Item = (u64, u64, MotionSample)>,
    option: &str,
) -> Result<(), RecordError> {
    let (motion, filled) = motion(samples);
    write_whole(path, &motion.to_bytes())?;
    println!(
        "written: {}, {} samples, {filled} of them held where the recording has none; play it with: rt-core {option} replay:{}",
        path.display(),
        motion.samples.len(),
        path.display()
    );
    Ok(())
}

fn sample(tip_in_scene_m: [f64; 3], world_from_tool: [f64; 4], buttons: u32) -> MotionSample {
    MotionSample {
        tip_in_scene_m,
        world_from_tool,
        buttons,
        reserved: 0,
    }
}

/// Columns of both tables.
const TICK: &str = "session_id,tick,due_ns,wake_latency_ns,force_written_ns,work_ns,missed,phase,fault,flags,\
    tip_x_m,tip_y_m,tip_z_m,force_x_n,force_y_n,force_z_n,past_membrane_m,speed_m_per_s,\
    membrane_n,guide_n,damping_n,friction_n,gravity_n,tissue_tick,tool_i,tool_j,tool_k,tool_w,buttons,\
    deflection_x_m,deflection_y_m,deflection_z_m,missing_before,session_begins";
const SECOND: &str = "session_id,tick,due_ns,wake_latency_ns,force_written_ns,work_ns,missed,fault,flags,buttons,\
    tissue_tick,tip_x_m,tip_y_m,tip_z_m,tool_i,tool_j,tool_k,tool_w,force_x_n,force_y_n,force_z_n,\
    torque_x_nm,torque_y_nm,torque_z_nm,contact_force_n";

fn csv(ticks: &[TickRecord], file: &mut impl Write) -> std::io::Result<()> {
    let mut table = csv::Writer::from_writer(file);
    table.write_record(TICK.split(','))?;
    let mut before: Option<&TickRecord> = None;
    for t in ticks {
        let same = before.filter(|b| b.session_id == t.session_id);
        let missing = same.map_or(0, |b| t.tick - b.tick - 1);
        let whole = [
            t.session_id,
            t.tick,
            t.due_ns,
            t.wake_latency_ns,
            t.force_written_ns,
            t.work_ns,
        ];
        let small = [t.missed, t.phase, t.fault, t.flags];
        let one = [t.depth_m, t.speed_m_per_s];
        let real = t
            .tip_in_scene_m
            .iter()
            .chain(&t.force_on_hand_n)
            .chain(&one)
            .chain(&t.force_terms_n);
        let mut row: Vec<String> = whole
            .iter()
            .map(u64::to_string)
            .chain(small.iter().map(u32::to_string))
            .collect();
        row.extend(real.map(f64::to_string));
        row.push(t.tissue_tick.to_string());
        row.extend(t.world_from_tool.iter().map(f64::to_string));
        row.push(t.buttons.to_string());
        row.extend(t.tip_deflection_m.iter().map(f64::to_string));
        row.extend([missing.to_string(), u8::from(same.is_none()).to_string()]);
        table.write_record(&row)?;
        before = Some(t);
    }
    table.flush()
}

fn csv_of_second(records: &[SecondRecord], file: &mut impl Write) -> std::io::Result<()> {
    let mut table = csv::Writer::from_writer(file);
    table.write_record(SECOND.split(','))?;
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

/// Returns a hand's motion in the first session, on the grid of the force loop, from the session, due time and sample
/// of each tick; and the number of samples that were held because the loop missed a deadline or the recording lacks a
/// tick.
fn motion(ticks: impl Iterator<Item = (u64, u64, MotionSample)>) -> (Motion, usize) {
    let mut motion = Motion {
        period_ns: PERIOD_NS,
        samples: Vec::new(),
    };
    let (mut filled, mut last_due_ns, mut first) = (0, None, None);
    for (session_id, due_ns, sample) in ticks {
        if *first.get_or_insert(session_id) != session_id {
            continue;
        }
        let periods = last_due_ns.map_or(1, |last| due_ns.saturating_sub(last) / PERIOD_NS);
        if let Some(held) = motion.samples.last().copied() {
            let held = std::iter::repeat_n(held, periods.saturating_sub(1) as usize);
            filled += held.len();
            motion.samples.extend(held);
        }
        motion.samples.push(sample);
        last_due_ns = Some(due_ns);
    }
    (motion, filled)
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
        csv_of_second(&[record], &mut table).unwrap();
        let text = String::from_utf8(table).unwrap();
        let counts: Vec<_> = text.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(counts, [25; 2]);
    }
}

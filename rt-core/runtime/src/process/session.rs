//! Description of the run for hosts and flight recordings.

use super::Options;
use super::threads::Threads;
use crate::replay::file::{Flight, SecondFigures};
use crate::rt::clock::{self, TISSUE_PERIOD_NS};
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{Session, Text};

/// Returns the announcement of the run.
pub(super) fn session(
    options: &Options,
    session_id: u64,
    (device, second): (&DeviceInfo, Option<&DeviceInfo>),
    threads: &Threads,
    unlocked: Option<&str>,
) -> Session {
    let [haptic, tissue, of_second] = threads.grants();
    Session {
        session_id,
        exercises: Default::default(),
        schema_version: stylet_shm_schema::SCHEMA_VERSION,
        pid: std::process::id(),
        time_ns: 0,
        started_ns: clock::now_ns(),
        period_ns: options.haptic_period_ns,
        tissue_period_ns: TISSUE_PERIOD_NS,
        second_period_ns: options.second.as_ref().map_or(0, |second| second.period_ns),
        haptic,
        tissue,
        second: of_second,
        memory_locked: u32::from(unlocked.is_none()),
        no_rt_asked: u32::from(options.no_rt_asked),
        refused: 0,
        device: Text::new(device.name),
        second_device: Text::new(second.map_or("", |second| second.name)),
        version: Text::new(env!("CARGO_PKG_VERSION")),
        advice: Text::new(&missing_rights(options, unlocked)),
    }
}

/// Returns the part common to every flight recording of the run.
pub(super) fn flight(
    options: &Options,
    session_id: u64,
    (device, second): (&DeviceInfo, Option<&DeviceInfo>),
) -> Flight {
    let second = second.zip(options.second.as_ref());
    Flight {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        session_id,
        reason: String::new(),
        device_name: device.name.to_owned(),
        device: *device,
        haptic_period_s: options.haptic_period_ns as f64 / 1e9,
        tissue_period_s: TISSUE_PERIOD_NS as f64 / 1e9,
        lines: Vec::new(),
        haptic: None,
        tissue: None,
        second_device: second.map(|(device, options)| SecondFigures {
            device_name: device.name.to_owned(),
            device: *device,
            period_s: options.period_ns as f64 / 1e9,
        }),
        second: None,
    }
}

fn missing_rights(options: &Options, unlocked: Option<&str>) -> String {
    match (&options.rights_missing, unlocked) {
        (Some(why), _) => why.clone(),
        (None, Some(why)) => why.to_owned(),
        (None, None) if !options.no_rt => String::new(),
        (None, None) => "started with --no-rt: real-time scheduling was not asked for. Restart without it".to_owned(),
    }
}

//! The bridge as a process: where its program is, and what the kernel says of it.

use std::path::PathBuf;
use std::time::Duration;

/// The bridge's program, which is installed beside this one; a test's is a folder below.
pub fn program() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    let places = own
        .ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join("stylet-bridge"));
    let mut places = places.collect::<Vec<_>>();
    let found = places.iter().position(|place| place.is_file());
    match places.is_empty() {
        true => PathBuf::from("stylet-bridge"),
        false => places.swap_remove(found.unwrap_or(0)),
    }
}

/// Whether a process wants the processor, and how much of it it has had.
pub fn processor_time(pid: u32) -> Option<(bool, Duration)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // Behind the name, which may hold anything: the state, and from the 12th field on the times in hundredths of a second.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let is_runnable = fields.next()? == "R";
    let mut ticks = fields.skip(10).take(2).filter_map(|field| field.parse::<u64>().ok());
    let busy = Duration::from_millis(10 * (ticks.next()? + ticks.next()?));
    Some((is_runnable, busy))
}

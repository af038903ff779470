//! `rt-core replay FILE`: shows a flight recording, and whether its repetition is bit-identical.

use clap::Args;
use std::path::PathBuf;
use stylet_runtime::kept_probe;
use stylet_runtime::replay::file::{Flight, FlightError};
use stylet_runtime::replay::lines::{self, LinesAgain};
use stylet_runtime::replay::repeat::{self, RepeatError, Repeated};
use stylet_runtime::replay::second::second;
use stylet_runtime::rt::arm::{self, Ask, Refused};
use stylet_runtime::rt::haptic_tape::HapticFlight;
use stylet_runtime::rt::tissue_tape::TissueFlight;
use stylet_shm_schema::{Fault, flags};
use stylet_text::printable_line;

/// Reason why a recording could not be repeated.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The recording cannot be read.
    #[error(transparent)]
    File(#[from] FlightError),
    /// The thread cannot be set up as the loops were.
    #[error(transparent)]
    Thread(#[from] Refused),
    /// A loop cannot be repeated.
    #[error(transparent)]
    Loop(#[from] RepeatError),
}

/// The command.
#[derive(Args, Debug)]
pub struct Replay {
    /// Flight recording that rt-core wrote (*.flight)
    file: PathBuf,
}

impl Replay {
    /// Prints the results; true if every force and position is bit-identical.
    pub fn run(&self) -> Result<bool, ReplayError> {
        let flight = Flight::read(&self.file)?;
        if flight.version != env!("CARGO_PKG_VERSION") {
            println!(
                "note: recorded by version {}, repeated by {}: another build may round otherwise",
                printable_line(&flight.version),
                env!("CARGO_PKG_VERSION")
            );
        }
        println!("reason   {}", printable_line(&flight.reason.to_string()));
        println!("device   {}", printable_line(&flight.device_name));
        // Before denormal numbers are off: they were on when the lines were prepared.
        let again = flight.tissue.as_ref().map(|recorded| solve_again(&flight, recorded));
        let again = again.transpose()?.unwrap_or_default();
        // The loops run with denormal numbers off, and so must their repetition.
        arm::arm(Ask {
            priority: None,
            core: None,
        })?;
        let forces = flight.haptic.as_ref().map(|recorded| {
            print_haptic(recorded);
            repeat::haptic(&flight, recorded)
        });
        let forces_are_same = print_result("forces", forces.transpose()?.as_ref());
        let tissue = flight.tissue.as_ref().map(|recorded| {
            print_tissue(recorded);
            repeat::tissue(&flight, recorded, again)
        });
        let tissue_is_same = print_result("tissue", tissue.transpose()?.as_ref());
        Ok(forces_are_same & tissue_is_same & repeat_second(&flight))
    }
}

/// Solves the columns of needle lines, which a recording does not hold: some seconds each.
fn solve_again(flight: &Flight, recorded: &TissueFlight) -> Result<LinesAgain, RepeatError> {
    if let Some(edge_m) = recorded.probe_edge_m() {
        println!(
            "probe    in elements of {:.1} mm, solved for again or kept",
            1e3 * edge_m
        );
    }
    let mut reported = None;
    lines::solve_again(
        flight,
        recorded,
        kept_probe::default_folder().as_deref(),
        &mut |progress| {
            let quarter = (progress.generation, 4 * progress.ready / progress.of.max(1));
            if reported.replace(quarter) != Some(quarter) {
                println!(
                    "line {}   {} of {} columns solved again",
                    progress.generation, progress.ready, progress.of
                );
            }
        },
    )
}

/// Repeats the second device; true as well if the run had none.
fn repeat_second(flight: &Flight) -> bool {
    let Some(figures) = &flight.second_device else {
        return true;
    };
    println!("second   {}", printable_line(&figures.device_name));
    let again = flight.second.as_ref().map(|recorded| {
        let peak_n = recorded
            .ticks
            .iter()
            .map(|e| e.record.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt());
        let missed: u64 = recorded.ticks.iter().map(|e| u64::from(e.record.missed)).sum();
        println!(
            "         {} ticks, peak force {:.3} N, {missed} deadlines missed, {} orders",
            recorded.ticks.len(),
            peak_n.fold(0.0, f64::max),
            recorded.orders.len()
        );
        print_faults(recorded.ticks.iter().map(|e| (e.record.tick, e.record.fault)));
        second(flight, recorded)
    });
    print_result("second", again.as_ref())
}

/// Prints each change of the fault, with its tick.
fn print_faults(ticks: impl Iterator<Item = (u64, u32)>) {
    let mut before = 0;
    for (tick, fault) in ticks {
        if fault != before {
            let text = Fault::from_number(fault).map_or("a fault that is not known", Fault::message);
            println!("         tick {tick}: {text}");
        }
        before = fault;
    }
}

fn print_haptic(recorded: &HapticFlight) {
    let records = recorded.ticks.iter().map(|e| &e.record);
    let peak_n = records
        .clone()
        .map(|r| r.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt());
    let missed: u64 = records.clone().map(|r| u64::from(r.missed)).sum();
    let longest =
        |of: fn(&stylet_shm_schema::TickRecord) -> u64| records.clone().map(of).max().unwrap_or(0) as f64 / 1e3;
    let engaged = records.clone().filter(|r| r.flags & flags::ENGAGED != 0).count();
    if let (Some(first), Some(last)) = (recorded.ticks.first(), recorded.ticks.last()) {
        println!(
            "haptic   ticks {} to {}, {:.3} s, {engaged} of them with the force on",
            first.record.tick,
            last.record.tick,
            (last.record.due_ns - first.record.due_ns) as f64 * 1e-9
        );
    }
    println!(
        "         peak force {:.3} N, {missed} deadlines missed, latest wake-up {:.1} µs, longest tick {:.1} µs, {} orders",
        peak_n.fold(0.0, f64::max),
        longest(|r| r.wake_latency_ns),
        longest(|r| r.work_ns),
        recorded.orders.len()
    );
    if let on_line @ 1.. = recorded.ticks_on_line() {
        println!(
            "         on a needle line in {on_line} of {} ticks",
            recorded.ticks.len()
        );
    }
    print_faults(records.map(|record| (record.tick, record.fault)));
}

fn print_tissue(recorded: &TissueFlight) {
    if let (Some(first), Some(last)) = (recorded.ticks.first(), recorded.ticks.last()) {
        println!(
            "tissue   ticks {} to {}, {:.3} s, {} seeds, {} orders",
            first.response.tick,
            last.response.tick,
            (last.woke_ns - first.woke_ns) as f64 * 1e-9,
            last.response.seed_count,
            recorded.orders.len()
        );
    }
}

fn print_result(what: &str, found: Option<&Repeated>) -> bool {
    let Some(r) = found else {
        println!("{what}   not in the recording");
        return true;
    };
    let verdict = if r.is_identical() { "bit-identical" } else { "DIFFERENT" };
    println!(
        "{what}   {verdict}: {} of {} ticks the same",
        r.ticks - r.different,
        r.ticks
    );
    for (what, all, different) in [
        ("element positions", r.positions, r.different_positions),
        ("needle lines", r.lines, r.different_lines),
    ] {
        if all > 0 {
            println!("         {} of {all} {what} the same", all - different);
        }
    }
    if let Some(first) = r.first_different {
        println!("         the first that differs is tick {} of the recording", first + 1);
    }
    r.is_identical()
}

//! `rt-core replay FILE`: what a flight recording holds, and whether it can be repeated bit by bit.

use clap::Args;
use std::path::PathBuf;
use stylet_runtime::replay::file::Flight;
use stylet_runtime::replay::repeat::{self, Repeated};
use stylet_runtime::rt::arm::{self, Ask};
use stylet_runtime::rt::haptic_tape::HapticFlight;
use stylet_runtime::rt::tissue_tape::TissueFlight;
use stylet_shm_schema::{Fault, flags};

#[derive(Args, Debug)]
pub struct Replay {
    /// Flight recording that rt-core wrote (*.flight)
    file: PathBuf,
}

impl Replay {
    /// True when everything came out the same in every bit.
    pub fn run(&self) -> Result<bool, String> {
        let flight = Flight::read(&self.file)?;
        if flight.version != env!("CARGO_PKG_VERSION") {
            println!(
                "note: recorded by version {}, repeated by {}: another build may round otherwise",
                flight.version,
                env!("CARGO_PKG_VERSION")
            );
        }
        println!("reason   {}", flight.reason);
        println!("device   {}", flight.device_name);
        // The loops run with denormal numbers off, and so must their repetition.
        arm::arm(Ask {
            priority: None,
            core: None,
        })
        .map_err(|e| e.to_string())?;
        let haptic = flight.haptic.as_ref().map(|recorded| {
            tell_haptic(recorded);
            repeat::haptic(&flight, recorded)
        });
        let tissue = flight
            .tissue
            .as_ref()
            .map(|recorded| {
                tell_tissue(recorded);
                repeat::tissue(&flight, recorded)
            })
            .transpose()?;
        Ok(tell("forces", haptic.as_ref()) & tell("tissue", tissue.as_ref()))
    }
}

fn tell_haptic(recorded: &HapticFlight) {
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
        "         peak force {:.3} N, {missed} deadlines missed, latest wake-up {:.1} us, longest tick {:.1} us, {} orders",
        peak_n.fold(0.0, f64::max),
        longest(|r| r.wake_latency_ns),
        longest(|r| r.work_ns),
        recorded.orders.len()
    );
    let mut before = None;
    for record in records {
        if before.is_some_and(|fault| fault != record.fault) || (before.is_none() && record.fault != 0) {
            let words = Fault::from_number(record.fault).map_or("a fault that is not known", Fault::message);
            println!("         tick {}: {words}", record.tick);
        }
        before = Some(record.fault);
    }
}

fn tell_tissue(recorded: &TissueFlight) {
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

fn tell(what: &str, found: Option<&Repeated>) -> bool {
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
    if r.positions > 0 {
        println!(
            "         {} of {} element positions the same",
            r.positions - r.different_positions,
            r.positions
        );
    }
    if let Some(first) = r.first_different {
        println!("         the first that differs is tick {} of the recording", first + 1);
    }
    r.is_identical()
}

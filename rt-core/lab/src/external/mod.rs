//! `rt-core latency --external FILE`: compares this program's measurement with an external instrument's.
//!
//! During a measurement with `--toggle` the force loop toggles a pin and notes the times. A logic analyser
//! records the pin and the responses to it. Afterwards the capture is read ([`capture`]), aligned with the notes by the
//! pattern of the times between edges ([`align`]), and each delay is given with its uncertainty ([`budget`]).

mod align;
mod budget;
mod capture;
mod page;
#[cfg(test)]
mod tests;

use crate::collect::ToggleTime;
use crate::disk::{self, DiskError};
use align::{Alignment, align};
use budget::{Begins, Delay};
use capture::{Capture, CaptureError};
use serde::Serialize;
use std::path::{Path, PathBuf};
use stylet_write::{WriteError, write_whole};

/// Notes of the loop: times at which the pin was toggled.
pub const TOGGLES: &str = "toggles.csv";
const HEAD: &str = "due_ns,before_ns,after_ns";

/// The capture cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ExternalError {
    /// The notes of the loop cannot be used.
    #[error("{}: {why}; expected the folder of a measurement with --toggle", .path.display())]
    Toggles {
        /// The file.
        path: PathBuf,
        /// Problem with it.
        why: String,
    },
    /// The instrument's file cannot be used.
    #[error("{}: {why}", .path.display())]
    Capture {
        /// The file.
        path: PathBuf,
        /// Problem with it.
        why: CaptureError,
    },
    /// The results cannot be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// Result of the capture.
#[derive(Clone, Debug, Serialize)]
pub struct External {
    schema: &'static str,
    capture: String,
    sample_us: f64,
    toggles: usize,
    edges: usize,
    pairs: usize,
    /// Relative rate by which the instrument's clock is faster than ours, in parts per million, with its expanded
    /// uncertainty (k = 2).
    drift_ppm: f64,
    drift_expanded_ppm: f64,
    /// Deviation of edges from our notes after removal of drift and offset.
    pin_deviation_us: f64,
    pin_worst_us: f64,
    /// Longest time that writing the pin took by our clock.
    pin_write_worst_us: f64,
    /// Time from the deadline of a tick until its pin had changed; by both clocks together.
    due_to_pin_us: [f64; 3],
    delays: Vec<Delay>,
    /// Inputs without a delay, with the reason.
    without: Vec<String>,
}

/// Writes the notes of a measurement.
pub fn keep(folder: &Path, toggles: &[ToggleTime]) -> Result<(), WriteError> {
    let rows = toggles
        .iter()
        .map(|t| format!("{},{},{}\n", t.due_ns, t.before_ns, t.after_ns));
    write_whole(
        &folder.join(TOGGLES),
        (format!("{HEAD}\n") + &rows.collect::<String>()).as_bytes(),
    )
}

fn read_toggles(folder: &Path) -> Result<Vec<ToggleTime>, ExternalError> {
    let path = folder.join(TOGGLES);
    let failed = |why: String| ExternalError::Toggles {
        path: path.clone(),
        why,
    };
    let text = std::fs::read_to_string(&path).map_err(|e| failed(e.to_string()))?;
    let mut lines = text.lines();
    if lines.next() != Some(HEAD) {
        return Err(failed(format!("the first line is not {HEAD}")));
    }
    let row = |line: &str| {
        let cells: Option<Vec<u64>> = line.split(',').map(|c| c.parse().ok()).collect();
        match cells.as_deref() {
            Some(&[due_ns, before_ns, after_ns]) if due_ns <= before_ns && before_ns <= after_ns => Ok(ToggleTime {
                due_ns,
                before_ns,
                after_ns,
            }),
            _ => Err(failed(format!("{line:?} is no row of three times in their order"))),
        }
    };
    lines.map(row).collect()
}

/// Evaluates `file` against the notes in `folder`; writes external.json and external.html there.
///
/// # Errors
/// The capture is of another run, or a file cannot be read or written.
pub fn run(folder: &Path, file: &Path, motion: Option<&str>) -> Result<u8, ExternalError> {
    let toggles = read_toggles(folder)?;
    let failed = |why| ExternalError::Capture {
        // With its folder, in which it may be missing.
        path: std::path::absolute(file).unwrap_or_else(|_| file.to_owned()),
        why,
    };
    let capture = capture::read(file).map_err(failed)?;
    let external = evaluate(&toggles, &capture, &file.display().to_string(), motion).map_err(failed)?;
    println!(
        "{} of {} edges are toggles of this run; clocks differ by {:.3} +- {:.3} ppm; edges lie within {:.2} us of our record",
        external.pairs, external.edges, external.drift_ppm, external.drift_expanded_ppm, external.pin_worst_us
    );
    for d in &external.delays {
        println!(
            "{}: {:.1} +- {:.1} us after {} (k = 2)",
            stylet_text::printable_line(&d.channel),
            d.mean_us,
            d.expanded_us,
            d.from
        );
    }
    external.without.iter().for_each(|why| println!("no delay: {why}"));
    disk::write_report(folder, "external", &external, &page::page(&external))?;
    Ok(0)
}

/// Evaluates a capture: the pin is the input that agrees best with the notes, `motion` the one that shows motion of the
/// handle.
fn evaluate(
    toggles: &[ToggleTime],
    capture: &Capture,
    name: &str,
    motion: Option<&str>,
) -> Result<External, CaptureError> {
    let first_ns = toggles.first().map_or(0, |t| t.before_ns);
    let middle_s = |t: &ToggleTime| ((t.before_ns - first_ns) as f64 + (t.after_ns - t.before_ns) as f64 / 2.0) / 1e9;
    let ours: Vec<f64> = toggles.iter().map(middle_s).collect();
    let mut best: Option<(usize, Alignment)> = None;
    let mut refused = Vec::new();
    for (i, channel) in capture.channels.iter().enumerate() {
        match align(&ours, &channel.edges_s) {
            Ok(found) if best.as_ref().is_none_or(|(_, b)| deviation(&found) < deviation(b)) => best = Some((i, found)),
            Ok(_) => {}
            Err(why) => refused.push((channel.name.clone(), why)),
        }
    }
    let Some((pin, alignment)) = best else {
        return Err(CaptureError::NoPin(refused));
    };
    let pin_channel = &capture.channels[pin];
    let (delays, without) = delays(capture, pin, &alignment, motion)?;
    let worst = |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, f64::max);
    let mut due_to_pin: Vec<f64> = alignment
        .pairs
        .iter()
        .zip(&alignment.residuals_s)
        .map(|(&(t, _), residual_s)| {
            middle_s(&toggles[t]) * 1e6 - (toggles[t].due_ns as f64 - first_ns as f64) / 1e3 + residual_s * 1e6
        })
        .collect();
    due_to_pin.sort_by(f64::total_cmp);
    let at = |q: f64| due_to_pin[((due_to_pin.len() - 1) as f64 * q) as usize];
    Ok(External {
        schema: "stylet.external/1",
        capture: name.to_owned(),
        sample_us: capture.step_s * 1e6,
        toggles: toggles.len(),
        edges: pin_channel.edges_s.len(),
        pairs: alignment.pairs.len(),
        drift_ppm: alignment.drift * 1e6,
        drift_expanded_ppm: 2e6 * alignment.drift_u,
        pin_deviation_us: deviation(&alignment) * 1e6,
        pin_worst_us: worst(&mut alignment.residuals_s.iter().map(|r| r.abs())) * 1e6,
        pin_write_worst_us: worst(&mut toggles.iter().map(|t| (t.after_ns - t.before_ns) as f64 / 1e3)),
        due_to_pin_us: [at(0.5), at(0.99), at(1.0)],
        delays,
        without,
    })
}

/// Returns the delays from the pin to every other input, then from the motion to every input but the pin; and those
/// missing, with the reason.
fn delays(
    capture: &Capture,
    pin: usize,
    alignment: &Alignment,
    motion: Option<&str>,
) -> Result<(Vec<Delay>, Vec<String>), CaptureError> {
    let pin = &capture.channels[pin];
    let named = |name: &str| {
        let found = capture.channels.iter().find(|c| c.name == name && c.name != pin.name);
        found.ok_or_else(|| CaptureError::NoInput {
            name: name.to_owned(),
            inputs: capture.channels.iter().map(|c| c.name.clone()).collect(),
        })
    };
    let motion = motion.map(named).transpose()?.map(Begins::at_motion);
    let from_pin = Begins::at_pin(pin, alignment);
    let (mut delays, mut without) = (Vec::new(), Vec::new());
    for from in [Some(&from_pin), motion.as_ref()].into_iter().flatten() {
        let others = capture.channels.iter().filter(|c| !c.edges_s.is_empty());
        for to in others.filter(|c| c.name != pin.name && c.name != from.channel.name) {
            match budget::delay(capture, from, alignment, to) {
                Ok(delay) => delays.push(delay),
                Err(why) => without.push(why.to_string()),
            }
        }
    }
    Ok((delays, without))
}

/// Returns the standard deviation of the pairs' residuals.
fn deviation(a: &Alignment) -> f64 {
    (a.residuals_s.iter().map(|r| r * r).sum::<f64>() / a.residuals_s.len().max(1) as f64).sqrt()
}

//! A flight recording, repeated and compared number by number.

use crate::Differences;
use sha2::{Digest, Sha256};
use std::path::Path;
use stylet_runtime::replay::file::{Flight, FlightError};
use stylet_runtime::replay::lines::{self, LinesAgain};
use stylet_runtime::replay::repeat::{self as loops, Again, RepeatError, Repeated};
use stylet_runtime::rt::response::TissueResponse;
use stylet_shm_schema::TickRecord;

/// Failure to repeat a recording.
#[derive(Debug, thiserror::Error)]
pub enum RepetitionError {
    /// The recording cannot be read.
    #[error(transparent)]
    File(#[from] FlightError),
    /// A loop cannot be repeated.
    #[error(transparent)]
    Loop(#[from] RepeatError),
}

/// What a repetition gave.
#[derive(Debug, Default)]
pub struct Repetition {
    /// The force loop and the tissue loop; default if not in the recording.
    pub loops: [Repeated; 2],
    /// Numbers of both that differ, and displacements of elements.
    pub differences: [Differences; 3],
    /// SHA-256 of the repeated numbers: two machines that agree print the same.
    pub digest: String,
}

/// Repeats both loops of a recording. `arm` sets the processor as the loops had it, once the lines are solved.
///
/// # Errors
/// The bytes are not a recording of this version, or cannot be repeated.
pub fn repeat(bytes: &[u8], arm: impl FnOnce()) -> Result<Repetition, RepetitionError> {
    let flight = Flight::of_bytes(bytes, Path::new("the recording"))?;
    let solved = flight
        .tissue
        .as_ref()
        .map(|recorded| lines::solve_again(&flight, recorded, None, &mut |_| {}));
    let solved: LinesAgain = solved.transpose()?.unwrap_or_default();
    arm();
    let mut found = Repetition::default();
    let mut digest = Sha256::new();
    let [forces, responses, displacements] = &mut found.differences;
    if let Some(recorded) = &flight.haptic {
        let mut see = |again: Again| {
            if let Again::Record(tick, record) = again {
                let then = numbers_of_record(&recorded.ticks[tick].record);
                let now = numbers_of_record(record);
                compare(forces, tick, &then, &now, &mut digest);
            }
        };
        found.loops[0] = loops::haptic_seen(&flight, recorded, &mut see)?;
    }
    if let Some(recorded) = &flight.tissue {
        let mut see = |again: Again| match again {
            Again::Response(tick, response) => {
                let then = numbers_of_response(&recorded.ticks[tick].response);
                let now = numbers_of_response(response);
                compare(responses, tick, &then, &now, &mut digest);
            }
            Again::Displacement(then_m, now_m) => {
                for (then, now) in then_m.into_iter().zip(now_m) {
                    let name = match then.abs().max(now.abs()) < f64::from(f32::MIN_POSITIVE) {
                        true => "displacement_m, denormal",
                        false => "displacement_m",
                    };
                    compare(displacements, 0, &[(name, then)], &[(name, now)], &mut digest);
                }
            }
            Again::Record(..) => {}
        };
        found.loops[1] = loops::tissue_seen(&flight, recorded, solved, &mut see)?;
    }
    found.digest = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(found)
}

impl Repetition {
    /// True if every number was repeated with the same bits.
    pub fn is_same(&self) -> bool {
        self.loops.iter().all(Repeated::is_identical) && self.differences.iter().all(Differences::is_empty)
    }
}

type Number = (&'static str, f64);

fn compare(into: &mut Differences, tick: usize, then: &[Number], now: &[Number], digest: &mut Sha256) {
    for (then, now) in then.iter().zip(now) {
        into.compare(tick, then.0, then.1, now.1);
        digest.update(now.1.to_bits().to_le_bytes());
    }
}

fn numbers_of_record(record: &TickRecord) -> Vec<Number> {
    let mut numbers = vec![
        ("phase", f64::from(record.phase)),
        ("fault", f64::from(record.fault)),
        ("flags", f64::from(record.flags)),
        ("depth_m", record.depth_m),
        ("speed_m_per_s", record.speed_m_per_s),
        ("folded_from_um", f64::from(record.folded_from_um)),
    ];
    let terms = ["membrane_n", "guide_n", "damping_n", "friction_n", "gravity_n"];
    numbers.extend(terms.into_iter().zip(record.force_terms_n));
    numbers.extend(record.force_on_hand_n.map(|n| ("force_on_hand_n", n)));
    numbers.extend(record.tip_in_scene_m.map(|m| ("tip_in_scene_m", m)));
    numbers.extend(record.tip_deflection_m.map(|m| ("tip_deflection_m", m)));
    numbers
}

fn numbers_of_response(response: &TissueResponse) -> Vec<Number> {
    let mut numbers = vec![
        ("contact", response.contact as f64),
        ("layer_number", response.layer_number as f64),
        ("worst_residual", response.worst_residual),
        ("least_corner", response.least_corner),
        ("folded_from_m", response.folded_from_m),
        ("seed_count", f64::from(response.seed_count)),
        ("unsolved", f64::from(u8::from(response.unsolved))),
    ];
    numbers.extend(response.contact_in_scene.iter().map(|m| ("contact_in_scene", *m)));
    numbers.extend(response.layer_in_scene.iter().map(|m| ("layer_in_scene", *m)));
    numbers.extend(
        response
            .local
            .displacement_m
            .iter()
            .map(|m| ("local.displacement_m", *m)),
    );
    let force_n = response.local.force_n.unwrap_or_default();
    numbers.extend(force_n.iter().map(|n| ("local.force_n", *n)));
    numbers
}

impl std::fmt::Display for Repetition {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        for (what, r) in ["forces", "tissue"].into_iter().zip(&self.loops) {
            let same = r.ticks - r.different;
            writeln!(f, "{what}: {same} of {} ticks the same", r.ticks)?;
            if let Some(first) = r.first_different {
                writeln!(f, "  the first that differs is tick {first}")?;
            }
            for (what, all, different) in [
                ("displacements", r.positions, r.different_positions),
                ("needle lines", r.lines, r.different_lines),
            ] {
                if all > 0 {
                    writeln!(f, "  {} of {all} {what} the same", all - different)?;
                }
            }
        }
        self.differences.iter().try_for_each(|found| write!(f, "{found}"))?;
        writeln!(f, "digest {}", self.digest)
    }
}

#[cfg(test)]
mod tests;

//! A flight recording on disk: magic, SHA-256 of the rest, and the recording itself.

#[cfg(not(target_family = "wasm"))]
use crate::environment::user_folder;
use crate::pieces;
use crate::rt::haptic_tape::HapticFlight;
use crate::rt::second::SecondFlight;
use crate::rt::tissue_tape::TissueFlight;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use stylet_hw::DeviceInfo;
use stylet_sim::line::LineSource;

/// Ends in the version of the layout.
const MAGIC: &[u8; 8] = b"STYFLT\0\x13";
/// Position of the version.
const VERSION_AT: usize = MAGIC.len() - 1;
const DIGEST: usize = 32;
/// Largest recording: two bodies of 8 MiB and the ticks.
const MAX_BYTES: u64 = 256 << 20;

/// Failure to read or write a flight recording; the text names the file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct FlightError {
    path: PathBuf,
    problem: Problem,
}

impl FlightError {
    fn new(path: &Path, problem: Problem) -> Self {
        Self {
            path: path.to_owned(),
            problem,
        }
    }
}

#[derive(Debug, thiserror::Error)]
enum Problem {
    #[error(transparent)]
    Io(std::io::Error),
    #[error("cannot be encoded: {0}")]
    Encoding(postcard::Error),
    #[error("too large for a flight recording")]
    TooLarge,
    #[error("not a flight recording")]
    OtherFormat,
    #[error(
        "a flight recording of layout {layout}, which another version of rt-core wrote: repeat it with that one; this one \
         reads layout {}",
        MAGIC[VERSION_AT]
    )]
    OtherLayout { layout: u8 },
    #[error("cut short")]
    CutShort,
    #[error("damaged: its digest does not match")]
    Damaged,
    #[error("cannot be read: {0}")]
    Decoding(postcard::Error),
}

/// The last ticks of both loops.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Flight {
    /// Version of the program that recorded it: another build may round otherwise.
    pub version: String,
    /// Number of the run.
    pub session_id: u64,
    /// Why it was written: a fault, the end, or a request.
    pub reason: String,
    /// Name of the device.
    pub device_name: String,
    /// Properties of the device, without its name.
    pub device: DeviceInfo,
    /// Time between two ticks of the force loop, s.
    pub haptic_period_s: f64,
    /// Time between two ticks of the tissue loop, s.
    pub tissue_period_s: f64,
    /// Needle lines that either loop had, each once.
    pub lines: Vec<LineSource>,
    /// The force loop. `None`: it did not hand its tape over in time.
    pub haptic: Option<HapticFlight>,
    /// The tissue loop. `None`: as above, or the body is too large to be recorded, or an elastic body was held without
    /// a needle line over the whole tape, in which case its solver's state is not recorded.
    pub tissue: Option<TissueFlight>,
    /// The second device; `None` in a run without one.
    pub second_device: Option<SecondFigures>,
    /// Its loop. `None`: as above.
    pub second: Option<SecondFlight>,
}

/// Description of the second device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SecondFigures {
    /// Name of the device.
    pub device_name: String,
    /// Properties of the device, without its name.
    pub device: DeviceInfo,
    /// Time between two ticks of its loop, s.
    pub period_s: f64,
}

impl Flight {
    /// Writes the file atomically.
    pub fn write(&self, path: &Path) -> Result<(), FlightError> {
        let body = postcard::to_stdvec(self).map_err(|e| FlightError::new(path, Problem::Encoding(e)))?;
        pieces::write(path, &[MAGIC, &Sha256::digest(&body), &body]).map_err(|e| FlightError::new(path, Problem::Io(e)))
    }

    /// Reads a file of [`Flight::write`]; anything else is refused with a reason.
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        let failed = |problem| FlightError::new(path, problem);
        let io = |e| failed(Problem::Io(e));
        let size = std::fs::metadata(path).map_err(io)?.len();
        if size > MAX_BYTES {
            return Err(failed(Problem::TooLarge));
        }
        Self::of_bytes(&std::fs::read(path).map_err(io)?, path)
    }

    /// As [`read`](Self::read), of the bytes of a file; errors name it `path`.
    pub fn of_bytes(bytes: &[u8], path: &Path) -> Result<Self, FlightError> {
        let failed = |problem| FlightError::new(path, problem);
        let rest = bytes
            .strip_prefix(MAGIC.as_slice())
            .ok_or_else(|| failed(other_format(bytes)))?;
        let (digest, body) = rest.split_at_checked(DIGEST).ok_or_else(|| failed(Problem::CutShort))?;
        if Sha256::digest(body).as_slice() != digest {
            return Err(failed(Problem::Damaged));
        }
        postcard::from_bytes(body).map_err(|e| failed(Problem::Decoding(e)))
    }
}

/// Returns why bytes that do not begin with [`MAGIC`] are refused.
fn other_format(bytes: &[u8]) -> Problem {
    let is_ours = bytes.starts_with(&MAGIC[..VERSION_AT]);
    match bytes.get(VERSION_AT) {
        Some(&layout) if is_ours => Problem::OtherLayout { layout },
        _ => Problem::OtherFormat,
    }
}

/// Returns the default folder of the recordings: `$XDG_STATE_HOME/stylet/flights`, by default under `~/.local/state`.
#[cfg(not(target_family = "wasm"))]
pub fn default_folder() -> PathBuf {
    let state = user_folder("XDG_STATE_HOME", ".local/state");
    state.unwrap_or_else(std::env::temp_dir).join("stylet/flights")
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_sim::force::ForceParameters;
    use stylet_sim::needle::NeedleParameters;

    /// Guards against recordings of the same version and another layout.
    #[test]
    fn a_new_setting_of_needle_or_force_has_a_new_version() {
        let settings = (NeedleParameters::default(), ForceParameters::default());
        let bytes = postcard::to_stdvec(&settings).expect("encoded").len();
        let is_known = (MAGIC[VERSION_AT], bytes) == (0x13, 467);
        assert!(
            is_known,
            "{bytes} bytes: increase the version in MAGIC, then correct both numbers"
        );
    }
}

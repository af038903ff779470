//! A flight recording on disk: magic, SHA-256 of the rest, and the recording itself.

use crate::rt::haptic_tape::HapticFlight;
use crate::rt::tissue_tape::TissueFlight;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::path::{Path, PathBuf};
use stylet_hw::DeviceInfo;

/// Ends in the version of the layout.
const MAGIC: &[u8; 8] = b"STYFLT\0\x01";
const DIGEST: usize = 32;
/// No recording is larger: two bodies of 8 MiB and the ticks.
const MAX_BYTES: u64 = 256 << 20;

/// Figures of the device that the gate and the estimator use.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct DeviceFigures {
    pub peak_force_n: f64,
    pub continuous_force_n: f64,
    pub peak_torque_nm: f64,
    pub max_stiffness_n_per_m: f64,
    pub position_step_m: f64,
    pub simulated: bool,
}

impl From<&DeviceInfo> for DeviceFigures {
    fn from(info: &DeviceInfo) -> Self {
        Self {
            peak_force_n: info.peak_force_n,
            continuous_force_n: info.continuous_force_n,
            peak_torque_nm: info.peak_torque_nm,
            max_stiffness_n_per_m: info.max_stiffness_n_per_m,
            position_step_m: info.position_step_m,
            simulated: info.simulated,
        }
    }
}

impl DeviceFigures {
    pub fn info(&self) -> DeviceInfo {
        DeviceInfo {
            name: "device of the recording",
            peak_force_n: self.peak_force_n,
            continuous_force_n: self.continuous_force_n,
            peak_torque_nm: self.peak_torque_nm,
            max_stiffness_n_per_m: self.max_stiffness_n_per_m,
            position_step_m: self.position_step_m,
            simulated: self.simulated,
        }
    }
}

/// The last ticks of both loops.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Flight {
    /// Of the program that recorded it: another build may round otherwise.
    pub version: String,
    pub session_id: u64,
    /// Why it was written: a fault, the end, or a request.
    pub reason: String,
    pub device_name: String,
    pub device: DeviceFigures,
    pub haptic_period_s: f64,
    pub tissue_period_s: f64,
    /// `None`: the loop did not hand its tape over in time.
    pub haptic: Option<HapticFlight>,
    /// `None`: as above, or the body is too large to be recorded.
    pub tissue: Option<TissueFlight>,
}

impl Flight {
    /// Writes to a file of that name, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        let told = |e: std::io::Error| format!("{}: {e}", path.display());
        let body = postcard::to_stdvec(self).map_err(|e| e.to_string())?;
        let unfinished = path.with_extension("part");
        let written = std::fs::File::create(&unfinished).and_then(|mut file| {
            file.write_all(MAGIC)?;
            file.write_all(&Sha256::digest(&body))?;
            file.write_all(&body)?;
            file.sync_all()
        });
        if let Err(why) = written {
            // What is half written helps nobody.
            let _ = std::fs::remove_file(&unfinished);
            return Err(told(why));
        }
        std::fs::rename(&unfinished, path).map_err(told)
    }

    /// Reads what [`Flight::write`] wrote; anything else is refused with a reason.
    pub fn read(path: &Path) -> Result<Self, String> {
        let told = |why: &str| format!("{}: {why}", path.display());
        let size = std::fs::metadata(path).map_err(|e| told(&e.to_string()))?.len();
        if size > MAX_BYTES {
            return Err(told("too large for a flight recording"));
        }
        let bytes = std::fs::read(path).map_err(|e| told(&e.to_string()))?;
        let rest = bytes
            .strip_prefix(MAGIC.as_slice())
            .ok_or_else(|| told("not a flight recording of this version of rt-core"))?;
        let (digest, body) = rest.split_at_checked(DIGEST).ok_or_else(|| told("cut short"))?;
        if Sha256::digest(body).as_slice() != digest {
            return Err(told("damaged: its digest does not match"));
        }
        postcard::from_bytes(body).map_err(|e| told(&format!("cannot be read: {e}")))
    }
}

/// Where recordings go unless told otherwise: `$XDG_STATE_HOME/stylet/flights`, by default under `~/.local/state`.
pub fn default_folder() -> PathBuf {
    let from = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let state = from("XDG_STATE_HOME")
        .filter(|p| p.is_absolute())
        .or_else(|| from("HOME").map(|home| home.join(".local/state")));
    state.unwrap_or_else(std::env::temp_dir).join("stylet/flights")
}

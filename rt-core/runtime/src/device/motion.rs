//! A motion that the host exported, as samples for the replay device.

use nalgebra::{Quaternion, Unit, Vector3};
use std::path::{Path, PathBuf};
use stylet_hw::{DeviceInfo, ReplayDevice, Sample};
use stylet_shm_schema::motion::{Motion, MotionSample};

/// Failure to play a motion; the text names the file and says how to make one.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}. Make one with: host-ui export RECORDING.mcap --motion FILE", path.display())]
pub struct MotionError {
    path: PathBuf,
    problem: String,
}

/// Returns the device that plays the motion in `path`.
pub fn device(path: &Path) -> Result<ReplayDevice, MotionError> {
    let failed = |problem: &dyn std::fmt::Display| MotionError {
        path: path.to_owned(),
        problem: problem.to_string(),
    };
    let bytes = std::fs::read(path).map_err(|e| failed(&e))?;
    let motion = Motion::from_bytes(&bytes).map_err(|e| failed(&e))?;
    let samples = motion.samples.iter().map(sample).collect();
    let info = DeviceInfo::phantom_premium_1_5();
    ReplayDevice::new(info, samples, motion.period_ns as f64 * 1e-9).ok_or_else(|| failed(&"cannot be played"))
}

fn sample(recorded: &MotionSample) -> Sample {
    let [i, j, k, w] = recorded.world_from_tool;
    Sample {
        tip_in_world: Vector3::from(recorded.tip_in_scene_m),
        // Kept as recorded: normalising again would change its last bits.
        world_from_tool: Unit::new_unchecked(Quaternion::new(w, i, j, k)),
        buttons: recorded.buttons,
        sequence: 0,
    }
}

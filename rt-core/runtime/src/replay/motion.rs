//! A motion that the host exported, as samples for the replay device.

use nalgebra::{Quaternion, Unit, Vector3};
use std::path::Path;
use stylet_hw::{DeviceInfo, ReplayDevice, Sample};
use stylet_shm_schema::motion::{Motion, MotionSample};

/// The device that plays the motion in `path`; errors say what to do.
pub fn device(path: &Path) -> Result<ReplayDevice, String> {
    let told = |why: &str| {
        format!(
            "{}: {why}. Make one with: host-ui export RECORDING.mcap --motion FILE",
            path.display()
        )
    };
    let bytes = std::fs::read(path).map_err(|e| told(&e.to_string()))?;
    let motion = Motion::from_bytes(&bytes).map_err(|e| told(&e.to_string()))?;
    let samples = motion.samples.iter().map(sample).collect();
    let info = DeviceInfo::phantom_premium_1_5();
    ReplayDevice::new(info, samples, motion.period_ns as f64 * 1e-9).ok_or_else(|| told("cannot be played"))
}

fn sample(recorded: &MotionSample) -> Sample {
    let [i, j, k, w] = recorded.world_from_tool;
    Sample {
        tip_in_world: Vector3::from(recorded.tip_in_scene_m),
        // Kept as recorded: normalising it again would change its last bits.
        world_from_tool: Unit::new_unchecked(Quaternion::new(w, i, j, k)),
        buttons: recorded.buttons,
        sequence: 0,
    }
}

//! A recorded motion of the hand: exported by the host from a recording, played by the core's replay device.
//!
//! Layout, little-endian: 8 bytes of magic, period in ns and number of samples as `u64`, then the samples as
//! [`MotionSample`]. The host makes it, so that the core need not read a foreign file.

use crate::check::{Invalid, MAX_COORDINATE_M};
use bytemuck::{Pod, Zeroable};

/// Ends in the version of the layout.
const MAGIC: &[u8; 8] = b"STYMOT\0\x01";
const HEADER: usize = 24;

/// Report of a device for one period.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MotionSample {
    /// Tip, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Quaternion i, j, k, w.
    pub world_from_tool: [f64; 4],
    /// Bits of the pressed buttons.
    pub buttons: u32,
    /// Zero.
    pub reserved: u32,
}

/// Samples taken one period apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Time from one sample to the next, ns.
    pub period_ns: u64,
    /// Samples in time order; at least one.
    pub samples: Vec<MotionSample>,
}

impl Motion {
    /// Encodes the whole file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.period_ns.to_le_bytes());
        bytes.extend((self.samples.len() as u64).to_le_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(&self.samples));
        bytes
    }

    /// Decodes and validates sizes, positions and orientations.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Invalid> {
        let (header, body) = bytes
            .split_at_checked(HEADER)
            .ok_or(Invalid("shorter than its header"))?;
        let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let (period_ns, count) = (word(8), word(16));
        if !header.starts_with(MAGIC) {
            return Err(Invalid("not a motion of this version"));
        }
        if !(10_000..=1_000_000_000).contains(&period_ns) {
            return Err(Invalid("period"));
        }
        if count == 0 || count.checked_mul(size_of::<MotionSample>() as u64) != Some(body.len() as u64) {
            return Err(Invalid("number of samples"));
        }
        let samples: Vec<MotionSample> = body
            .chunks_exact(size_of::<MotionSample>())
            .map(bytemuck::pod_read_unaligned)
            .collect();
        match samples.iter().all(is_sound) {
            true => Ok(Self { period_ns, samples }),
            false => Err(Invalid("position or orientation of a sample")),
        }
    }
}

fn is_sound(sample: &MotionSample) -> bool {
    let norm2 = sample.world_from_tool.iter().map(|c| c * c).sum::<f64>();
    // NaN compares false.
    sample.tip_in_scene_m.iter().all(|c| c.abs() <= MAX_COORDINATE_M) && (norm2 - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_survives_and_invalid_bytes_are_refused() {
        let sample = |i: i32| MotionSample {
            tip_in_scene_m: [0.1, -0.2, 1e-3 * f64::from(i)],
            world_from_tool: [0.0, 0.6, 0.0, 0.8],
            buttons: i as u32,
            reserved: 0,
        };
        let motion = Motion {
            period_ns: 1_000_000,
            samples: (0..5).map(sample).collect(),
        };
        let bytes = motion.to_bytes();
        assert_eq!(Motion::from_bytes(&bytes).unwrap(), motion);
        assert!(Motion::from_bytes(&bytes[..bytes.len() - 1]).is_err());
        assert!(Motion::from_bytes(&bytes[..10]).is_err());
        for (at, value) in [(0, 0), (8, 1), (16, 4), (16, 0)] {
            let mut bad = bytes.clone();
            bad[at] = value;
            bad[at + 1..at + 7].fill(0);
            assert!(Motion::from_bytes(&bad).is_err(), "byte {at}");
        }
        let mut bad = motion.clone();
        bad.samples[3].tip_in_scene_m[1] = f64::NAN;
        assert!(Motion::from_bytes(&bad.to_bytes()).is_err());
        bad = motion;
        bad.samples[2].world_from_tool[3] = 0.7;
        assert!(Motion::from_bytes(&bad.to_bytes()).is_err());
    }
}

//! Properties of tissues for sound and X-rays: brightness, attenuation, and reflection at
//! interfaces.

use crate::xray::{BONE_PER_M, SOFT_PER_M};
use stylet_anatomy::{Organ, Part};
use stylet_shm_schema::{StructureInfo, role};

/// Brightness outside of tissue: jelly around a gland that stands alone.
pub const OUTSIDE: f32 = 0.13;
/// Brightness of the gland: 14 dB below fat, and a whole number of a graphics card's steps.
const GLAND: f32 = 77.0 / 255.0;

/// Properties of one tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tissue {
    /// Brightness on the screen, 0 to 1; see [`brightness`].
    pub brightness: f32,
    /// Attenuation of sound, in dB per cm and MHz, one way.
    pub loss_db_per_cm_mhz: f32,
    /// Acoustic impedance, MRayl.
    pub impedance_mrayl: f32,
    /// Attenuation of X-rays, per m.
    pub xray_per_m: f32,
}

impl Tissue {
    /// Water or jelly around the probe and in the bladder: almost no echo and no attenuation.
    pub const COUPLING: Self = Self::new(0.0, 0.0, 1.52);
    /// Prostate and every soft tissue without its own row: 0.5 dB per cm and MHz, as scanners assume.
    pub const SOFT: Self = Self::new(GLAND, 0.5, 1.63);
    /// Gas, which hides everything behind it.
    pub const GAS: Self = Self::new(0.0, 25.0, 0.04).with_xray(0.0);
    const BONE: Self = Self::new(0.92, 10.0, 6.5).with_xray(BONE_PER_M);
    const FAT: Self = Self::new(0.54, 0.6, 1.40);

    /// Medium outside the body: jelly for the probe, air for X-rays.
    pub const OUTSIDE: Self = Self::COUPLING.with_xray(0.0);

    const fn with_xray(mut self, xray_per_m: f32) -> Self {
        self.xray_per_m = xray_per_m;
        self
    }

    /// Creates a tissue with the X-ray attenuation of soft tissue.
    pub const fn new(brightness: f32, loss_db_per_cm_mhz: f32, impedance_mrayl: f32) -> Self {
        Self {
            brightness,
            loss_db_per_cm_mhz,
            impedance_mrayl,
            xray_per_m: SOFT_PER_M,
        }
    }

    /// Returns the tissue of a structure, by its name.
    pub fn of(structure: &StructureInfo) -> Self {
        let name = structure.name.read().to_lowercase();
        let base = match Part::of_name(&name) {
            _ if name.contains("gas") || name.contains("air") => return Self::GAS,
            Some(Part::Content) => Self::COUPLING,
            _ if Organ::Bone.is_mentioned_in(&name) || structure.role & role::FIXED != 0 => Self::BONE,
            _ if Organ::Fat.is_mentioned_in(&name) => Self::FAT,
            _ => Self::SOFT,
        };
        Self {
            brightness: brightness(structure),
            ..base
        }
    }
}

/// Returns the brightness of a structure, 0 to 1, as seen in transrectal ultrasound: by its name,
/// otherwise by its role.
pub fn brightness(structure: &StructureInfo) -> f32 {
    by_name(&structure.name.read()).unwrap_or(match structure.role {
        bits if bits & role::TARGET != 0 => GLAND,
        bits if bits & role::FIXED != 0 => 0.92,
        bits if bits & role::SPARE != 0 => 0.24,
        _ => 0.54,
    })
}

fn by_name(name: &str) -> Option<f32> {
    let part = Part::of_name(name);
    let mentioned = |organ: Organ| organ.is_mentioned_in(name);
    match part {
        Some(Part::Content) => Some(0.02),
        _ if mentioned(Organ::Urethra) => Some(0.20),
        // Like the fat and fascia round it: a rim, not a line.
        Some(Part::Capsule) => Some(0.54),
        Some(Part::Wall) => Some(0.62),
        None => BY_ORGAN.iter().find(|(organ, _)| mentioned(*organ)).map(|(_, b)| *b),
    }
}

/// Brightness by the first organ that a name mentions.
const BY_ORGAN: [(Organ, f32); 5] = [
    (Organ::RectalWall, 0.50),
    (Organ::Bladder, 0.06),
    (Organ::Bone, 0.92),
    (Organ::Fat, 0.54),
    (Organ::Perineum, 0.48),
];

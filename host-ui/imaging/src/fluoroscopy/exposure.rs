//! Dose of a picture: air kerma by the tube's output and the inverse square law.

use super::CArm;

/// Distance at which the output is given, m: 40 inches.
const OUTPUT_AT_M: f64 = 1.016;
/// Distance of the patient entrance reference point from the isocentre towards the source (IEC
/// 60601-2-43), m.
const REFERENCE_M: f64 = 0.15;

/// One pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Voltage of the tube, kV.
    pub kv: f64,
    /// Charge of a pulse, mAs.
    pub mas: f64,
    /// Beam time of a pulse, s: its own length, or in fluoroscopy that to the next pulse.
    pub beam_s: f64,
}

impl Default for Exposure {
    /// Returns a single picture. 80 kV, 0.4 mAs: 50 mA for 8 ms.
    fn default() -> Self {
        Self {
            kv: 80.0,
            mas: 0.4,
            beam_s: 8e-3,
        }
    }
}

impl Exposure {
    /// Fluoroscopy of 8 pulses a second, each a quarter of a single picture. 80 kV, 0.1 mAs.
    pub const FLUOROSCOPY: Self = Self {
        kv: 80.0,
        mas: 0.1,
        beam_s: 0.125,
    };

    /// Returns the air kerma at the patient entrance reference point, Gy: `K = Y(kV) mAs (1.016 m /
    /// d)^2`. The output is `Y = 8.373 nGy/mAs kV^1.983`, the mean of some 40 radiographic units
    /// (imablog.net, 2015). The simulated tube is none of these: the number compares pictures, it
    /// does not give a patient's dose.
    pub fn air_kerma_gy(&self, arm: &CArm) -> f64 {
        8.373e-9 * self.kv.powf(1.983) * self.mas * (OUTPUT_AT_M / reference_m(arm)).powi(2)
    }

    /// Returns the air kerma times the area of the beam, Gy m², which is equal at any distance from
    /// the source.
    pub fn kerma_area_gy_m2(&self, arm: &CArm) -> f64 {
        let edge_m = arm.detector_m * reference_m(arm) / arm.source_to_detector_m;
        self.air_kerma_gy(arm) * edge_m * edge_m
    }
}

/// Returns the distance from the source to the reference point, m.
fn reference_m(arm: &CArm) -> f64 {
    (arm.source_to_isocentre_m - REFERENCE_M).max(0.1)
}

/// Dose of all pictures so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoseCounter {
    /// Number of pulses.
    pub pulses: u64,
    /// Beam time, s.
    pub beam_s: f64,
    /// Air kerma at the reference point, Gy.
    pub air_kerma_gy: f64,
    /// Air kerma times area, Gy m².
    pub kerma_area_gy_m2: f64,
}

impl DoseCounter {
    /// Adds one pulse.
    pub fn count(&mut self, exposure: &Exposure, arm: &CArm) {
        self.pulses += 1;
        self.beam_s += exposure.beam_s;
        self.air_kerma_gy += exposure.air_kerma_gy(arm);
        self.kerma_area_gy_m2 += exposure.kerma_area_gy_m2(arm);
    }
}

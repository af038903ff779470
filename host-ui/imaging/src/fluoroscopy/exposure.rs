//! What a picture costs: air kerma by the tube's output and the inverse square law.

use super::CArm;

/// Distance at which the output is given, m: 40 inches.
const OUTPUT_AT_M: f64 = 1.016;
/// Where the dose of a patient is counted lies so far from the isocentre towards the source (IEC 60601-2-43), m.
const REFERENCE_M: f64 = 0.15;

/// One pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Voltage of the tube, kV.
    pub kv: f64,
    /// Charge of a pulse, mAs.
    pub mas: f64,
    /// Time of the beam that a pulse stands for, s: its own length, or in fluoroscopy that to the next pulse.
    pub beam_s: f64,
}

impl Default for Exposure {
    /// A picture alone. 80 kV, 0.4 mAs: 50 mA for 8 ms.
    fn default() -> Self {
        Self {
            kv: 80.0,
            mas: 0.4,
            beam_s: 8e-3,
        }
    }
}

impl Exposure {
    /// Fluoroscopy of 8 pulses a second, each a quarter of a picture alone. 80 kV, 0.1 mAs.
    pub const FLUOROSCOPY: Self = Self {
        kv: 80.0,
        mas: 0.1,
        beam_s: 0.125,
    };

    /// Air kerma at the patient entrance reference point, Gy: `K = Y(kV) mAs (1.016 m / d)^2`, with the output
    /// `Y = 8.373 nGy/mAs kV^1.983` that was the mean of some 40 radiographic units (imablog.net, 2015). The tube that is
    /// simulated is none of these: the number says what pictures cost beside each other, not what a patient received.
    pub fn air_kerma_gy(&self, arm: &CArm) -> f64 {
        8.373e-9 * self.kv.powf(1.983) * self.mas * (OUTPUT_AT_M / reference_m(arm)).powi(2)
    }

    /// Air kerma times the area of the beam, Gy m²: the same at any distance from the source.
    pub fn kerma_area_gy_m2(&self, arm: &CArm) -> f64 {
        let edge_m = arm.detector_m * reference_m(arm) / arm.source_to_detector_m;
        self.air_kerma_gy(arm) * edge_m * edge_m
    }
}

/// From the source to where the dose of a patient is counted, m.
fn reference_m(arm: &CArm) -> f64 {
    (arm.source_to_isocentre_m - REFERENCE_M).max(0.1)
}

/// What has been spent on pictures so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoseCounter {
    /// Pulses.
    pub pulses: u64,
    /// Time of the beam, s.
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

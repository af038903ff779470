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
}

impl Default for Exposure {
    /// 80 kV, 0.4 mAs: 50 mA for 8 ms.
    fn default() -> Self {
        Self { kv: 80.0, mas: 0.4 }
    }
}

impl Exposure {
    /// Air kerma at the patient entrance reference point, Gy: `K = Y(kV) mAs (1.016 m / d)^2`, with the output
    /// `Y = 8.373 nGy/mAs kV^1.983` that was the mean of some 40 radiographic units (imablog.net, 2015). The tube that is
    /// simulated is none of these: the number says what pictures cost beside each other, not what a patient received.
    pub fn air_kerma_gy(&self, arm: &CArm) -> f64 {
        let distance_m = (arm.source_to_isocentre_m - REFERENCE_M).max(0.1);
        8.373e-9 * self.kv.powf(1.983) * self.mas * (OUTPUT_AT_M / distance_m).powi(2)
    }
}

/// What has been spent on pictures so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoseCounter {
    /// Pulses.
    pub pulses: u64,
    /// Air kerma at the reference point, Gy.
    pub air_kerma_gy: f64,
}

impl DoseCounter {
    /// Adds one pulse.
    pub fn count(&mut self, exposure: &Exposure, arm: &CArm) {
        self.pulses += 1;
        self.air_kerma_gy += exposure.air_kerma_gy(arm);
    }
}

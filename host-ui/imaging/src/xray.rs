//! Attenuation of materials at one effective energy.

/// Mass attenuation (cm²/g) at 60 and 80 keV, and density (g/cm³): NIST, Hubbell and Seltzer,
/// tables 3 and 4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attenuation {
    /// Mass attenuation at 60 and 80 keV, cm²/g.
    pub cm2_per_g: [f64; 2],
    /// Density, g/cm³.
    pub g_per_cm3: f64,
}

/// Effective energy of the beam, keV: a tube at 110 to 120 kV behind 3 mm of aluminium. With one
/// energy, beams do not harden.
const KEV: f64 = 70.0;

impl Attenuation {
    /// Soft tissue (ICRU-44).
    pub const SOFT: Self = Self::new(0.2048, 0.1823, 1.06);
    /// Cortical bone (ICRU-44).
    pub const BONE: Self = Self::new(0.3148, 0.2229, 1.92);
    /// Iron, for the steel of needles.
    pub const STEEL: Self = Self::new(1.205, 0.5952, 7.874);
    /// Titanium, the shell of a seed.
    pub const TITANIUM: Self = Self::new(0.7661, 0.4052, 4.54);
    /// Silver, the marker in a seed.
    pub const SILVER: Self = Self::new(5.766, 2.651, 10.5);

    const fn new(at_60: f64, at_80: f64, g_per_cm3: f64) -> Self {
        Self {
            cm2_per_g: [at_60, at_80],
            g_per_cm3,
        }
    }

    /// Returns the attenuation per m at 70 keV, log-linear between the energies of the table.
    pub fn per_m(&self) -> f64 {
        let [low, high] = self.cm2_per_g;
        let share = (KEV / 60.0).ln() / (80.0_f64 / 60.0).ln();
        low * (high / low).powf(share) * self.g_per_cm3 * 100.0
    }
}

/// [`Attenuation::SOFT`] at 70 keV, per m.
pub const SOFT_PER_M: f32 = 20.40;
/// [`Attenuation::BONE`] at 70 keV, per m.
pub const BONE_PER_M: f32 = 50.24;
/// [`Attenuation::STEEL`] at 70 keV, per m.
pub const STEEL_PER_M: f64 = 650.2;
/// [`Attenuation::TITANIUM`] at 70 keV, per m.
pub const TITANIUM_PER_M: f64 = 247.2;
/// [`Attenuation::SILVER`] at 70 keV, per m.
pub const SILVER_PER_M: f64 = 3992.0;

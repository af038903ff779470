//! Speeds that a device requests.

/// Slowest speed of a hand that the core accepts.
pub const SLOWEST_M_PER_S: f64 = 1e-4;

/// Requested speed of the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// Along the needle, positive inwards.
    pub along_m_per_s: f64,
    /// Across the template, as seen from the perineum: to the right, and up.
    pub across_m_per_s: [f64; 2],
}

impl Wish {
    /// Request to stay in place.
    pub const REST: Self = Self {
        along_m_per_s: 0.0,
        across_m_per_s: [0.0; 2],
    };

    /// Returns the same direction at a share of the speed.
    pub fn slower(self, by: f64) -> Self {
        Self {
            along_m_per_s: self.along_m_per_s * by,
            across_m_per_s: self.across_m_per_s.map(|v| v * by),
        }
    }
}

/// Requested speed of the ultrasound probe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeWish {
    /// Along its axis, positive into the patient.
    pub along_m_per_s: f64,
    /// About its axis, positive to the patient's left.
    pub turn_rad_per_s: f64,
}

impl ProbeWish {
    /// Returns the same direction at a share of the speed.
    pub fn slower(self, by: f64) -> Self {
        Self {
            along_m_per_s: self.along_m_per_s * by,
            turn_rad_per_s: self.turn_rad_per_s * by,
        }
    }
}

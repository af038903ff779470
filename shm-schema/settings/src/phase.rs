//! Phase of needle and tissue: simulation, records and hosts know it by one number.

use num_enum::TryFromPrimitive;
use serde::{Deserialize, Serialize};

/// Phase of needle and tissue (paper eq. 6), by stable number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, TryFromPrimitive)]
#[repr(u32)]
pub enum Phase {
    /// The tip has not met the membrane.
    #[default]
    Outside = 0,
    /// The membrane is pushed in and holds: the tissue follows the tip.
    Contraction = 1,
    /// The membrane is punctured, and the tip cuts.
    Penetration = 2,
    /// The tip comes out.
    Retraction = 3,
    /// The needle is at rest in the tissue.
    Hold = 4,
}

impl Phase {
    /// Returns the phase of a number; `None` if this build does not know it.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::try_from(number).ok()
    }

    /// Returns the name shown to users.
    pub fn name(self) -> &'static str {
        match self {
            Self::Outside => "outside",
            Self::Contraction => "membrane contraction",
            Self::Penetration => "penetration",
            Self::Retraction => "retraction",
            Self::Hold => "hold",
        }
    }
}

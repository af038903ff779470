//! Attenuation of materials at one effective energy, 70 keV: a tube at 110 to 120 kV behind 3 mm of aluminium. With one
//! energy, beams do not harden. Values are log-linear between those of NIST at 60 and 80 keV (Hubbell and Seltzer,
//! tables 3 and 4), which a test holds.

/// Soft tissue (ICRU-44), per m.
pub const SOFT_PER_M: f32 = 20.40;
/// Cortical bone (ICRU-44), per m.
pub const BONE_PER_M: f32 = 50.24;
/// Iron, for the steel of needles, per m.
pub const STEEL_PER_M: f64 = 650.2;
/// Titanium, the shell of a seed, per m.
pub const TITANIUM_PER_M: f64 = 247.2;
/// Silver, the marker in a seed, per m.
pub const SILVER_PER_M: f64 = 3992.0;

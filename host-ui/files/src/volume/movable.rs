//! Whether the core can move a body of these structures.

use super::Tissue;
use crate::error::ContentError;
use stylet_anatomy::Material;

/// Refuses structures that the core would refuse: all of them fixed, or with shear limits under
/// which cells fold over.
pub fn movable(structures: &[Tissue]) -> Result<(), ContentError> {
    let free: Vec<&Material> = structures.iter().map(|t| &t.material).filter(|m| !m.fixed).collect();
    if free.is_empty() {
        return Err("every structure is fixed, so nothing can move; leave one of them free".into());
    }
    let limits = || free.iter().filter_map(|material| material.limits);
    let [x, y, z] = [0, 1, 2].map(|a| limits().map(|of_axis| of_axis[a][2].tan()).fold(0.0, f64::max));
    // Eq. 1 in three dimensions, as the core checks it.
    if x * y + y * z + z * x + 2.0 * x * y * z > 1.0 {
        return Err("under its shear_deg cells fold over; at most 26.5 degrees are possible along all axes".into());
    }
    Ok(())
}

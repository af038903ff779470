//! Detection of folded tissue near a place: the smallest volume that three links of an element span.
//!
//! A linear answer knows no limit: twice the force, twice the displacement, until a cell is turned inside out. It is
//! still an answer, but not of tissue, so its user must be warned.

use super::Deformed;
use super::corners::{REACH, least_corner_of};

/// Returns the smallest volume that three links of an element span, one along each axis, over that at rest: over all
/// corners between elements up to four from `element`. At rest it is 1; at 0 and below a cell is folded. 1 where no
/// three links meet. Does not allocate.
pub fn least_corner(body: &Deformed, element: u32) -> f64 {
    let low = body.lattice.cell(element).map(|c| c as i64 - REACH as i64);
    least_corner_of(|step| {
        let there = body.lattice.element_at([0, 1, 2].map(|a| low[a] + step[a] as i64))?;
        Some(body.displacement(there).map(|u| u as f32))
    })
}

#[cfg(test)]
mod tests;

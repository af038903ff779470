//! Prediction of the element that a moving tip comes into next.

use super::{Deformed, MaterialPoint};

/// Places looked at ahead of a held element, and from outside the body.
const STEPS: usize = 24;
const STEPS_OUTSIDE: usize = 40;
/// A tip slower than this part of an element in each tick comes into every element on its way, if only for a moment:
/// there the places are so close together.
const SLOW: f64 = 0.25;
const CLOSE: f64 = 0.1;

/// Returns the first element other than `held` on the way of a tip that advances by `step_m` in each tick. Where
/// nothing is held the body is taken to be at rest.
///
/// Bounded: it tries a few places, and walks a few elements from each.
pub fn element_ahead(body: &Deformed, held: Option<u32>, tip_m: [f64; 3], step_m: [f64; 3]) -> Option<u32> {
    let length = step_m.iter().map(|c| c * c).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let spacing_m = body.lattice.spacing_m;
    let is_slow = length < SLOW * spacing_m;
    let stride = if is_slow { CLOSE * spacing_m / length } else { 1.0 };
    let place_m = |n: usize| [0, 1, 2].map(|a| tip_m[a] + n as f64 * stride * step_m[a]);
    let Some(held) = held else {
        return (0..=STEPS_OUTSIDE).map(place_m).find_map(|place_m| {
            let [i, j, k] = place_m.map(|c| (c / spacing_m).floor());
            let is_cell = [i, j, k].iter().all(|&c| (0.0..f64::from(u32::MAX)).contains(&c));
            let cell = is_cell.then_some([i as usize, j as usize, k as usize])?;
            body.lattice.element_of_cell(cell[0], cell[1], cell[2])
        });
    };
    (0..=STEPS)
        .map_while(|n| MaterialPoint::locate_from(body, place_m(n), held))
        .map(|point| point.element)
        .find(|&element| element != held)
}

#[cfg(test)]
mod tests;

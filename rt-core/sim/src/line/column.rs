//! Column of seeds in the track of a needle: they lie one behind the other, and none passes another.
//!
//! Derivation in `docs/physics/seeds.md`, *Seeds in a track*. Places are those of the deeper end of each seed, along
//! the line in the tissue at rest.

use super::ready::HandLine;
use super::stations::NEEDLE_RADIUS_M;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use stylet_settings::{SEED_LENGTH_M, SEED_RADIUS_M};

/// Logarithm of a rod as long and as wide as a seed that is moved along itself in an incompressible medium: `ln p -
/// 0.207 + 0.980 / p - 0.133 / p²` with the ratio p of length to width (Tirado and Garcia de la Torre 1979).
const ROD: f64 = 1.690;
/// Gap below which two seeds touch, m.
const SAME_M: f64 = 1e-9;

/// Hold of the tissue on a seed in the track of a needle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeedHold {
    /// Displacement of the tissue at which a seed begins to slide in the track, m.
    pub slides_m: f64,
    /// The same beyond that, at which one at the end of the track cuts on, m.
    pub cuts_m: f64,
    /// End of the track along the line, m.
    pub track_m: f64,
}

impl HandLine {
    /// Returns the hold of the tissue at the tip on a seed: friction by its surface, and the ring that its blunt end
    /// cuts.
    pub fn seed_hold(&self) -> SeedHold {
        let (model, tip) = (&self.model, &self.state.tip);
        let c = &model.compliance;
        let station = (tip.material_m.max(0.0) / c.spacing_m) as usize;
        let wedge_n = c.wedge_n.get(station).copied().unwrap_or(0.0);
        let shear_pa = wedge_n / (PI * NEEDLE_RADIUS_M * NEEDLE_RADIUS_M);
        if shear_pa <= 0.0 {
            return SeedHold::default();
        }
        let m_per_n = ROD / (TAU * shear_pa * SEED_LENGTH_M);
        let narrower = SEED_RADIUS_M / NEEDLE_RADIUS_M;
        let friction_n = model.friction_n_per_m[station] * narrower * SEED_LENGTH_M;
        let cutting_n = model
            .layer_at(tip.material_m)
            .map_or(0.0, |layer| layer.cutting_force_n);
        SeedHold {
            slides_m: friction_n * m_per_n,
            cuts_m: PI * narrower * cutting_n * m_per_n,
            track_m: tip.track_m,
        }
    }
}

/// Brings a new seed into the column while the stylet holds its front at `front_m`: the seeds ahead give way with the
/// tissue, and slide on where that is not enough. `ahead_m` are their fronts, the nearest first. Returns the place of
/// the new seed once the stylet is gone.
pub fn push(ahead_m: &mut [f64], front_m: f64, hold: &SeedHold) -> f64 {
    let overlap_m = |nearest_m: f64| front_m + SEED_LENGTH_M - nearest_m;
    let mut column = 1;
    // Each turn slides the column to the next seed or to the end of the track, or as far as it has to go.
    for _ in 0..2 * ahead_m.len() {
        let deepest_m = ahead_m[column - 1];
        let next_m = ahead_m.get(column).map(|next_m| next_m - SEED_LENGTH_M);
        let to_next_m = next_m.map_or(f64::INFINITY, |next_m| next_m - deepest_m);
        if to_next_m <= SAME_M {
            column += 1;
            continue;
        }
        let to_end_m = hold.track_m - deepest_m;
        let (cuts_m, room_m) = if to_end_m > SAME_M {
            (0.0, to_next_m.min(to_end_m))
        } else {
            (hold.cuts_m / column as f64, to_next_m)
        };
        let missing_m = overlap_m(ahead_m[0]) - hold.slides_m - cuts_m;
        if missing_m <= 0.0 {
            break;
        }
        let by_m = missing_m.min(room_m);
        ahead_m[..column].iter_mut().for_each(|place_m| *place_m += by_m);
        if by_m >= missing_m {
            break;
        }
    }
    ahead_m
        .first()
        .map_or(front_m, |nearest_m| front_m.min(nearest_m - SEED_LENGTH_M))
}

#[cfg(test)]
mod tests;

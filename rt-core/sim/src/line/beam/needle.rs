//! The needle without tissue: a beam held by a hand that gives way a little, and led by the hole of a template.

use serde::{Deserialize, Serialize};

/// A needle in one tick, with all forces on it but those of the tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BentNeedle {
    /// E I, N m^2.
    pub bending_stiffness_n_m2: f64,
    /// Distance from hand to tip.
    pub length_m: f64,
    /// Compliance of the hand across the needle, m/N, and against rotation, rad/(N m).
    pub grip: [f64; 2],
    /// Tip along the line from the entry, in the world.
    pub tip_m: f64,
    /// Position of the hand across the line.
    pub hand_m: [f64; 2],
    /// Slope that the hand gives the needle.
    pub hand_slope: [f64; 2],
    /// The template, along the line, and the force of its hole on the needle.
    pub hole_m: f64,
    /// Force of the hole on the needle.
    pub hole_n: [f64; 2],
    /// Force on the tip across the line.
    pub tip_n: [f64; 2],
    /// Middle of the first station across, along the line.
    pub first_m: f64,
    /// Distance of stations across.
    pub spacing_m: f64,
}

impl BentNeedle {
    /// Returns the place along the line where the hand holds it.
    pub fn hand_along_m(&self) -> f64 {
        self.tip_m - self.length_m
    }

    /// Returns the middle of station `n`, along the line.
    pub fn station_m(&self, n: usize) -> f64 {
        self.first_m + n as f64 * self.spacing_m
    }

    /// Returns the deflection at one place by a newton at another, m/N.
    pub(super) fn flexibility(&self, a_m: f64, b_m: f64) -> f64 {
        let from_hand = |place_m: f64| (place_m - self.hand_along_m()).max(0.0);
        let (x, y) = (from_hand(a_m.min(b_m)), from_hand(a_m.max(b_m)));
        x * x * (3.0 * y - x) / (6.0 * self.bending_stiffness_n_m2) + self.grip[0] + self.grip[1] * x * y
    }

    /// Across the line, as the hand alone has it.
    pub fn straight_m(&self, side: usize, at_m: f64) -> f64 {
        self.hand_m[side] + self.hand_slope[side] * (at_m - self.hand_along_m())
    }

    /// Across the line, by hand, hole and bevel.
    pub(super) fn without_tissue_m(&self, side: usize, at_m: f64) -> f64 {
        self.straight_m(side, at_m)
            + self.flexibility(at_m, self.tip_m) * self.tip_n[side]
            + self.flexibility(at_m, self.hole_m) * self.hole_n[side]
    }

    /// Across the line; `forces_n` are those of the stations on the tissue.
    pub fn across_m(&self, side: usize, at_m: f64, forces_n: &[f64]) -> f64 {
        let each = forces_n.iter().enumerate().filter(|(_, f)| **f != 0.0);
        let by_tissue: f64 = each.map(|(n, f)| self.flexibility(at_m, self.station_m(n)) * f).sum();
        self.without_tissue_m(side, at_m) - by_tissue
    }

    /// Returns the deflection of a place of the shaft from a rigid needle in the same hand, along both directions
    /// across.
    pub fn deflection_m(&self, at_m: f64, forces_n: [&[f64]; 2]) -> [f64; 2] {
        [0, 1].map(|side| self.across_m(side, at_m, forces_n[side]) - self.straight_m(side, at_m))
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let pairs = [self.grip, self.hand_m, self.hand_slope, self.hole_n, self.tip_n];
        let own = [
            self.bending_stiffness_n_m2,
            self.length_m,
            self.tip_m,
            self.hole_m,
            self.first_m,
            self.spacing_m,
        ];
        pairs.iter().flatten().chain(&own).all(|v| v.is_finite())
    }
}

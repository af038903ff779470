//! The TG-43U1 formulae for one source (Rivard et al., Med. Phys. 31, 633, 2004; eq. 1, 4, 11).
//!
//! `D = S_K Λ G_L(r,θ)/G_L(r0,θ0) g_L(r) F(r,θ)` with an axis, `D = S_K Λ G_L(r,θ0)/G_L(r0,θ0)
//! g_L(r) φ_an(r)` without. Between the entries of a table ln g is linear in r, φ_an linear in r, F
//! bilinear in r and θ. Beyond them, g keeps its first value inwards and continues the line through
//! its last two entries in ln g outwards; φ_an and F keep their end values (Rivard et al., Med.
//! Phys. 34, 2187, 2007). Inside the capsule there is no tissue: the dose there is that of the
//! nearest point on the capsule's surface.

use super::curve::{Curve, Table};

/// r0 of TG-43.
const REFERENCE_RADIUS_M: f64 = 0.01;

/// Formalism, by what is known of the direction of a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formalism {
    /// Averaged over all directions: φ_an(r).
    OneD,
    /// F(r, θ) about the axis of the source.
    TwoD,
}

/// The capsule, a cylinder about the axis of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Radius, in m.
    pub radius_m: f64,
    /// Half its length, in m.
    pub half_length_m: f64,
}

/// Tables of TG-43; distances in m, angles in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct Tables {
    /// Λ in Gy/s for 1 U.
    pub dose_rate_constant_gy_per_s: f64,
    /// Active length; 0 for a point source.
    pub active_length_m: f64,
    /// Outer size; no dose is computed inside.
    pub capsule: Capsule,
    /// ln g over r.
    pub ln_radial: Curve,
    /// Anisotropy factor over the distance.
    pub anisotropy_1d: Option<Curve>,
    /// Anisotropy function, 0 to 90 deg (symmetric) or 0 to 180 deg.
    pub anisotropy_2d: Option<Table>,
}

impl Tables {
    /// Returns the dose rate (Gy/s) of 1 U at a point `across_m` from the axis and `along_m` from
    /// the middle of the source.
    ///
    /// The factor of a missing table is 1.
    pub fn rate_gy_per_s(&self, formalism: Formalism, across_m: f64, along_m: f64) -> f64 {
        let (across, along) = self.capsule.outside(across_m.abs(), along_m);
        let r = across.hypot(along);
        let (geometry, anisotropy) = match formalism {
            Formalism::OneD => (
                self.geometry(r, 0.0),
                self.anisotropy_1d.as_ref().map_or(1.0, |phi| phi.held(r)),
            ),
            Formalism::TwoD => (
                self.geometry(across, along),
                self.anisotropy_2d
                    .as_ref()
                    .map_or(1.0, |f| f.held(r, polar_deg(f, across, along))),
            ),
        };
        self.dose_rate_constant_gy_per_s * geometry / self.geometry(REFERENCE_RADIUS_M, 0.0)
            * self.ln_radial.extended(r).exp()
            * anisotropy
    }

    /// Returns the mean dose rate over all directions relative to that at 90 degrees: φ_an by eq. 8 of
    /// TG-43U1, by the midpoint rule in steps of 0.05 degrees.
    pub fn mean_over_directions(&self, r_m: f64) -> f64 {
        const STEPS: u32 = 3600;
        let step = std::f64::consts::PI / f64::from(STEPS);
        let rate = |angle: f64| self.rate_gy_per_s(Formalism::TwoD, r_m * angle.sin(), r_m * angle.cos());
        let angles = (0..STEPS).map(|i| (f64::from(i) + 0.5) * step);
        let whole: f64 = angles.map(|angle| rate(angle) * angle.sin() * step).sum();
        whole / 2.0 / rate(std::f64::consts::FRAC_PI_2)
    }

    /// Returns the distances (m) that both g and F have, the least and the largest.
    pub fn radii_m(&self) -> [f64; 2] {
        let ends = |at: &[f64]| Some([*at.first()?, *at.last()?]);
        let of_g = ends(&self.ln_radial.at).unwrap_or_default();
        let of_f = self
            .anisotropy_2d
            .as_ref()
            .and_then(|f| ends(&f.rows_at))
            .unwrap_or(of_g);
        [of_g[0].max(of_f[0]), of_g[1].min(of_f[1])]
    }

    /// Returns G_L in 1/m²: `β / (L across)`, with β the angle under which the active line is seen.
    fn geometry(&self, across_m: f64, along_m: f64) -> f64 {
        let length = self.active_length_m;
        let square = across_m * across_m + along_m * along_m - length * length / 4.0;
        let ratio = length * across_m / square;
        // Towards the axis beyond the ends, and for a point: the limit 1/(r² - L²/4) and the first terms after it.
        if square > 0.0 && ratio < 1e-3 {
            return (1.0 - ratio * ratio / 3.0) / square;
        }
        (length * across_m).atan2(square) / (length * across_m)
    }
}

impl Capsule {
    /// Returns whether a point lies inside.
    pub fn holds(&self, across_m: f64, along_m: f64) -> bool {
        self.outside(across_m, along_m) != (across_m, along_m)
    }

    /// Returns the point itself, or the nearest one on the surface if it lies inside.
    fn outside(&self, across_m: f64, along_m: f64) -> (f64, f64) {
        let to_side = self.radius_m - across_m;
        let to_end = self.half_length_m - along_m.abs();
        if to_side <= 0.0 || to_end <= 0.0 {
            (across_m, along_m)
        } else if to_side <= to_end {
            (self.radius_m, along_m)
        } else {
            (across_m, self.half_length_m.copysign(along_m))
        }
    }
}

fn polar_deg(f: &Table, across_m: f64, along_m: f64) -> f64 {
    let symmetric = f.columns_at.last().is_some_and(|&last| last <= 90.0);
    let along = if symmetric { along_m.abs() } else { along_m };
    across_m.atan2(along).to_degrees()
}

//! The gland between and beyond the clicked planes: a closed body.
//!
//! Between planes the centre and the squares of the radii are interpolated. Those of an ellipsoid
//! are a straight line and a parabola, which the interpolation reproduces exactly. Beyond the
//! outermost planes the parabola gives the end of the gland.

use super::contour::{Contour, Transverse};
use super::outline::{DIRECTIONS, Outline};
use crate::plan::PlanError;
use crate::plan::anatomy::Body;

/// Number of planes with an outline that a body needs.
pub const PLANES: usize = 3;
/// Distance between rings of corners, m.
const RING_M: f64 = 1e-3;
/// Number of rings at each end beyond the outermost plane.
const END_RINGS: usize = 8;
/// Length limits of an end: at least this, m, and at most this multiple of the distance of the last
/// two planes; a longer one would contain another plane.
const SHORTEST_M: f64 = 0.5e-3;
const LONGEST: f64 = 2.0;

/// Error of clicks that have an outline in too few planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the gland needs an outline in {PLANES} planes or more, three points each; there are {0}")]
pub struct ContourError(usize);

/// Centre and squares of the radii of a plane, or their derivatives along the axis.
#[derive(Clone, Debug)]
struct Values(Vec<f64>);

impl Values {
    fn of(outline: &Outline) -> Self {
        let squares = outline.radii_m.iter().map(|r| r * r);
        Self(outline.middle_m.iter().copied().chain(squares).collect())
    }

    fn combined(terms: &[(f64, &Self)]) -> Self {
        let length = terms.first().map_or(0, |(_, values)| values.0.len());
        let sum = |n: usize| terms.iter().map(|(factor, values)| factor * values.0[n]).sum();
        Self((0..length).map(sum).collect())
    }

    /// Returns the mean square of the radii.
    fn mean_square(&self) -> f64 {
        self.0[2..].iter().sum::<f64>() / DIRECTIONS as f64
    }

    /// Returns the outline. Squares that rounding or an overshooting cubic made negative become
    /// zero.
    fn outline(&self) -> Outline {
        Outline {
            middle_m: [self.0[0], self.0[1]].into(),
            radii_m: self.0[2..].iter().map(|square| square.max(0.0).sqrt()).collect(),
        }
    }
}

/// End of the gland.
#[derive(Clone, Debug)]
struct End {
    /// Place of its outermost plane, and distance from there to the pole.
    at_m: f64,
    length_m: f64,
    values: Values,
    /// Drift of the centre from the plane to the pole.
    drift_m: [f64; 2],
    /// Curvature: `(1 - u) (1 + curved u)` is the share of the squares of the radii at the share
    /// `u` of the length.
    curved: f64,
}

impl End {
    /// Creates an end. `outer` is the outermost plane, `inner` the next one; `change` is the
    /// derivative along the axis at the outer one, outwards, and `bend` half the second derivative.
    fn of(outer: (f64, &Values), inner: (f64, &Values), change: &Values, bend: &Values) -> Self {
        let apart_m = (outer.0 - inner.0).abs();
        let (square, slope, bend) = (outer.1.mean_square(), change.mean_square(), bend.mean_square());
        // The nearest zero of square + slope d + bend d^2.
        let root = slope * slope - 4.0 * bend * square;
        let zero_m = (root >= 0.0).then(|| 2.0 * square / (-slope + root.sqrt()));
        let length_m = zero_m.filter(|d| *d > 0.0 && d.is_finite()).unwrap_or(0.5 * apart_m);
        let length_m = length_m.clamp(SHORTEST_M, (LONGEST * apart_m).max(SHORTEST_M));
        let drift = |n: usize| (outer.1.0[n] - inner.1.0[n]) * length_m / apart_m;
        Self {
            at_m: outer.0,
            length_m,
            values: outer.1.clone(),
            drift_m: [drift(0), drift(1)],
            curved: (1.0 + slope * length_m / square).clamp(0.0, 2.0),
        }
    }

    fn outline(&self, share: f64) -> Outline {
        let mut values = self.values.clone();
        let squares = (1.0 - share) * (1.0 + self.curved * share);
        values.0[2..].iter_mut().for_each(|square| *square *= squares);
        (0..2).for_each(|n| values.0[n] += share * self.drift_m[n]);
        values.outline()
    }
}

/// Gland as outlines at every place along the axis.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Places along the axis, m, with the values there and their derivatives.
    planes: Vec<(f64, Values, Values)>,
    /// The lower and the upper end.
    ends: [End; 2],
}

impl Solid {
    /// Creates the body through these clicks.
    pub fn of(contour: &Contour) -> Result<Self, ContourError> {
        let outlines = contour.outlines();
        let count = outlines.len();
        if count < PLANES {
            return Err(ContourError(count));
        }
        let at: Vec<(f64, Values)> = outlines.iter().map(|(at_m, o)| (*at_m, Values::of(o))).collect();
        // The parabola through three planes: its slope at a place, and half its second derivative.
        let parabola = |first: usize, place_m: f64| {
            let [(a, va), (b, vb), (c, vc)] = [&at[first], &at[first + 1], &at[first + 2]];
            let pairs = [
                ((a - b) * (a - c), b + c),
                ((b - a) * (b - c), a + c),
                ((c - a) * (c - b), a + b),
            ];
            let slopes = pairs.map(|(product, sum)| (2.0 * place_m - sum) / product);
            let bends = pairs.map(|(product, _)| 1.0 / product);
            let combined = |f: [f64; 3]| Values::combined(&[(f[0], va), (f[1], vb), (f[2], vc)]);
            (combined(slopes), combined(bends))
        };
        let change = |n: usize| parabola(n.saturating_sub(1).min(count - 3), at[n].0).0;
        let (upwards, upper_bend) = parabola(count - 3, at[count - 1].0);
        let (lower_change, lower_bend) = parabola(0, at[0].0);
        let downwards = Values::combined(&[(-1.0, &lower_change)]);
        let place = |n: usize| (at[n].0, &at[n].1);
        let ends = [
            End::of(place(0), place(1), &downwards, &lower_bend),
            End::of(place(count - 1), place(count - 2), &upwards, &upper_bend),
        ];
        let changes: Vec<Values> = (0..count).map(change).collect();
        let planes = at.into_iter().zip(changes).map(|((at_m, v), c)| (at_m, v, c)).collect();
        Ok(Self { planes, ends })
    }

    /// Returns the places of both poles along the axis, m.
    pub fn poles_m(&self) -> [f64; 2] {
        let [low, high] = &self.ends;
        [low.at_m - low.length_m, high.at_m + high.length_m]
    }

    /// Returns the outline at a place along the axis; `None` beyond the poles.
    pub fn at(&self, at_m: f64) -> Option<Outline> {
        let [low, high] = &self.ends;
        let beyond = |end: &End| (at_m - end.at_m).abs() / end.length_m;
        if at_m < low.at_m {
            return (beyond(low) < 1.0).then(|| low.outline(beyond(low)));
        }
        if at_m > high.at_m {
            return (beyond(high) < 1.0).then(|| high.outline(beyond(high)));
        }
        let after = self.planes.partition_point(|plane| plane.0 <= at_m);
        let after = after.clamp(1, self.planes.len() - 1);
        let [(a, va, ca), (b, vb, cb)] = [&self.planes[after - 1], &self.planes[after]];
        let h = b - a;
        let t = (at_m - a) / h;
        // Hermite's cubic.
        let (t2, t3) = (t * t, t * t * t);
        let terms = [
            (2.0 * t3 - 3.0 * t2 + 1.0, va),
            ((t3 - 2.0 * t2 + t) * h, ca),
            (3.0 * t2 - 2.0 * t3, vb),
            ((t3 - t2) * h, cb),
        ];
        Some(Values::combined(&terms).outline())
    }

    /// Returns the closed body, scene frame.
    pub fn body(&self, frame: &Transverse, name: &str) -> Result<Body, PlanError> {
        let [low, high] = &self.ends;
        // Denser towards the poles, where the outline shrinks fastest.
        let share = |n: usize| 1.0 - (1.0 - n as f64 / END_RINGS as f64).powi(2);
        let span_m = high.at_m - low.at_m;
        let between = (span_m / RING_M).ceil().max(1.0) as usize;
        let lower = (1..END_RINGS).rev().map(|n| low.at_m - low.length_m * share(n));
        let middle = (0..=between).map(|n| low.at_m + span_m * n as f64 / between as f64);
        let upper = (1..END_RINGS).map(|n| high.at_m + high.length_m * share(n));
        let mut corners_m: Vec<[f64; 3]> = Vec::new();
        let mut rings = 0;
        for at_m in lower.chain(middle).chain(upper) {
            let Some(outline) = self.at(at_m) else { continue };
            corners_m.extend(outline.points_m().map(|p| <[f64; 3]>::from(frame.place_m(p, at_m))));
            rings += 1;
        }
        let pole = |end: &End, at_m: f64| <[f64; 3]>::from(frame.place_m(end.outline(1.0).middle_m, at_m));
        let [lowest_m, highest_m] = self.poles_m();
        let (first, last) = (corners_m.len(), corners_m.len() + 1);
        corners_m.extend([pole(low, lowest_m), pole(high, highest_m)]);
        let at = |ring: usize, n: usize| ring * DIRECTIONS + n % DIRECTIONS;
        let mut faces = Vec::new();
        for n in 0..DIRECTIONS {
            faces.push([first, at(0, n + 1), at(0, n)]);
            for ring in 1..rings {
                let [a, b, c, d] = [at(ring - 1, n), at(ring - 1, n + 1), at(ring, n + 1), at(ring, n)];
                faces.extend([[a, b, c], [a, c, d]]);
            }
            faces.push([last, at(rings - 1, n), at(rings - 1, n + 1)]);
        }
        Body::new(name, &corners_m, &faces)
    }
}

/// Returns the proposal for a plane without an outline of its own: that of the body. With too few
/// planes, interpolates between two and holds the nearest beyond them; `None` without clicks or
/// beyond the body.
pub fn proposed_at(contour: &Contour, at_m: f64) -> Option<Outline> {
    if let Ok(solid) = Solid::of(contour) {
        return solid.at(at_m);
    }
    let outlines = contour.outlines();
    let [(a, first), (b, second)] = [outlines.first()?, outlines.last()?];
    let share = if b > a {
        ((at_m - a) / (b - a)).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let [first, second] = [Values::of(first), Values::of(second)];
    Some(Values::combined(&[(1.0 - share, &first), (share, &second)]).outline())
}

#[cfg(test)]
mod tests;

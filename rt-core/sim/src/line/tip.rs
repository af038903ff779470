//! The tip: its place in the material, and what stops it.

use super::model::{LineLayer, LineModel};
use super::rows::dot;
use super::state::{LineState, TipState};

/// Smallest share of a dent that a membrane leaves.
const LEAST_KEPT: f64 = 0.02;
/// Distance below which places are the same.
const SAME_M: f64 = 1e-9;
/// Tolerance of a place by the present loads; the solution that follows changes them.
const PLACE_M: f64 = 1e-9;
/// Largest factor by which a step through compressed tissue in front counts more than its length.
const MOST_PRESSED: f64 = 10.0;
/// Share of the way between two close places by which the gap closes at least: where the shaft sticks, the tip carries
/// most of the tissue along.
const LEAST_CLOSED: f64 = 0.05;
const LEAST_CLOSED_BACK: f64 = 0.25;
const MOST_CLOSED: f64 = 3.0;
/// Share of the gap that remains on the way back when the way to the second place was right.
const LEFT_BACK: f64 = 0.5;
/// Share of the way between two places, on both sides, in which the next is not looked for.
const LEAST_SHARE: f64 = 0.1;
/// Stations around the tip that a pass can reach.
const WINDOW: usize = 64;

/// Tissue in front of the tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Front {
    /// Force at which the tip advances.
    pub limit_n: f64,
    /// Place up to which it may advance with that.
    pub to_m: f64,
    /// Layer whose membrane holds it.
    pub membrane: Option<usize>,
}

impl LineModel {
    pub(super) fn front(&self, tip: &TipState) -> Front {
        let place_m = tip.material_m;
        let is_closed = |&(n, l): &(usize, &LineLayer)| {
            l.puncture_force_n > 0.0 && tip.opened >> n & 1 == 0 && l.from_m >= place_m - SAME_M
        };
        let closed = self.layers.iter().enumerate().find(is_closed);
        if let Some((n, layer)) = closed.filter(|(_, l)| l.from_m <= place_m + SAME_M) {
            return Front {
                limit_n: layer.puncture_force_n,
                to_m: place_m,
                membrane: Some(n),
            };
        }
        let membrane_m = closed.map_or(f64::INFINITY, |(_, l)| l.from_m);
        let is_in_track = place_m < tip.track_m - SAME_M;
        let here = self.layer_at(place_m + SAME_M);
        let cutting_n = here.filter(|_| !is_in_track).map_or(0.0, |layer| layer.cutting_force_n);
        let station = (place_m / self.compliance.spacing_m) as usize;
        let wedge_n = here
            .and(self.compliance.wedge_n.get(station))
            .map_or(0.0, |wedge_n| *wedge_n);
        // The next place at which the force may be another.
        let places = self
            .layers
            .iter()
            .map(|l| l.from_m)
            .chain([0.0, self.length_m(), tip.track_m]);
        let next_m = places.filter(|&m| m > place_m + SAME_M).fold(membrane_m, f64::min);
        Front {
            limit_n: cutting_n + wedge_n,
            to_m: next_m,
            membrane: None,
        }
    }

    /// Returns the share that a membrane leaves of the dent that a force makes under it, from 0 to 1; `None` where it
    /// gives way by force alone. `own` is the displacement of the tissue by the tip without it, m/N.
    pub(super) fn kept_of_dent(&self, layer: usize, own: f64) -> Option<f64> {
        let layer = self.layers.get(layer)?;
        let wanted = layer.puncture_depth_m / layer.puncture_force_n;
        let whole = self.compliance.common_m_per_n();
        (wanted.is_finite() && own > whole).then(|| ((wanted - whole) / (own - whole)).clamp(LEAST_KEPT, 1.0))
    }

    /// Computes the first station and the weights of the tip's load at its place; they add up to 1, or to 0 outside.
    pub(super) fn tip_weights(&self, place_m: f64, weights: &mut [f64; WINDOW]) -> std::ops::Range<usize> {
        let (ds, m) = (self.compliance.spacing_m, self.compliance.stations);
        if !(0.0..=self.length_m()).contains(&place_m) {
            return 0..0;
        }
        let half_m = 0.5 * self.compliance.tip_length_m.max(ds);
        let (low, high) = (
            (place_m - half_m).max(0.0) / ds,
            ((place_m + half_m) / ds).min(m as f64),
        );
        let (first, end) = (low as usize, (high.ceil() as usize).min(m));
        let whole = high - low;
        for (weight, n) in weights.iter_mut().zip(first..end) {
            *weight = (high.min((n + 1) as f64) - low.max(n as f64)).max(0.0) / whole;
        }
        first..end.min(first + WINDOW)
    }
}

/// Displacement of the material around the tip under the present loads of the shaft; the tip's own part moves with it.
struct Around<'a> {
    model: &'a LineModel,
    shaft_n: &'a [f64],
    first: usize,
    count: usize,
    u_m: [f64; WINDOW],
    /// Force of the tip, times what a tick of memory adds to the displacement.
    tip_n: f64,
    from_m: f64,
    gain: f64,
}

impl<'a> Around<'a> {
    /// Makes the stretch so far before and behind the tip.
    fn new(model: &'a LineModel, state: &'a LineState, reach_m: f64) -> Self {
        let c = &model.compliance;
        let half_m = 0.5 * c.tip_length_m.max(c.spacing_m) + reach_m;
        let place_m = state.tip.material_m.clamp(0.0, model.length_m());
        let first = ((place_m - half_m).max(0.0) / c.spacing_m) as usize;
        let end = (((place_m + half_m) / c.spacing_m).ceil() as usize + 1).min(c.stations);
        let mut around = Around {
            model,
            shaft_n: &state.shaft_n[..state.in_contact],
            first,
            count: end.saturating_sub(first).min(WINDOW),
            u_m: [0.0; WINDOW],
            tip_n: state.memory.gain * state.tip.force_n,
            from_m: state.tip.material_m.max(0.0),
            gain: state.memory.gain,
        };
        for (u, n) in around.u_m.iter_mut().zip(first..first + around.count) {
            let shaft = &c.rows.row(c.stations + n)[..state.in_contact];
            *u = state.memory.gain * dot(shaft, &state.shaft_n[..state.in_contact])
                + state.memory.offset_m[c.stations + n];
        }
        around
    }

    /// Returns where a tip at this place of the material is in the world, less `tip_m`.
    fn beyond_m(&self, place_m: f64, tip_m: f64) -> f64 {
        let mut weights = [0.0; WINDOW];
        let range = self.model.tip_weights(place_m, &mut weights);
        let c = &self.model.compliance;
        let mut u_m = 0.0;
        // On the way in the shaft follows with its own friction.
        let last = ((place_m / c.spacing_m) as usize).min(c.stations - 1);
        let friction = self.gain * self.model.friction_n_per_m[last] * (place_m - self.from_m).max(0.0);
        for (n, weight) in range.clone().zip(&weights) {
            let at = n.saturating_sub(self.first).min(self.count.saturating_sub(1));
            let row = &c.rows.row(c.stations + n)[c.stations + range.start..];
            let own: f64 = row.iter().zip(&weights[..range.len()]).map(|(r, w)| r * w).sum();
            u_m += weight * (self.u_m[at] + self.tip_n * own + friction * c.rows.row(c.stations + n)[last]);
        }
        place_m + u_m + self.near_m(place_m, c.tip_missing_m_per_n(range, &weights), friction) - tip_m
    }

    /// Returns how far a tip at this place is moved by itself and the shaft behind it beyond what the rows say.
    fn near_m(&self, place_m: f64, missing: f64, friction: f64) -> f64 {
        let (c, shaft_n) = (&self.model.compliance, self.shaft_n);
        let shaft = c.near.stations(place_m, c.spacing_m, shaft_n.len());
        let of_shaft_m: f64 = shaft
            .map(|n| shaft_n[n] * c.near_m_per_n(missing, place_m, n, self.from_m))
            .sum();
        let of_new_m = if friction > 0.0 {
            friction * missing * c.near.mean(self.from_m - place_m, 0.0)
        } else {
            0.0
        };
        missing * self.tip_n + self.gain * of_shaft_m + of_new_m
    }
}

/// Tried place of the tip, and how far the needle is beyond it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub material_m: f64,
    pub gap_m: f64,
}

/// Places that were tried in one tick for a tip that goes through one front.
pub(super) struct Tried {
    /// Track before the tick.
    track_m: f64,
    /// Last place that was not far enough, and the nearest that was too far.
    near: Option<Place>,
    far: Option<Place>,
}

impl Tried {
    pub(super) fn none(tip: &TipState) -> Self {
        Tried {
            track_m: tip.track_m,
            near: None,
            far: None,
        }
    }

    /// Returns how far a tip has moved too far in this tick: on the way in it then presses less than it takes to advance,
    /// on the way out it presses. `None` where it has not.
    pub(super) fn past_m(&self, state: &LineState, front: &Front, gap_m: f64) -> Option<f64> {
        let near = self.near.filter(|_| front.membrane.is_none())?;
        let wanted_n = if near.gap_m > 0.0 { front.limit_n } else { 0.0 };
        let past_n = state.tip.force_n - wanted_n;
        (past_n * near.gap_m < 0.0).then_some(gap_m + state.memory.gain * state.tip_own * past_n)
    }

    /// Takes a place that was tried; returns where the gap closes by the others. `None` where these do not tell.
    fn next_m(&mut self, now: Place) -> Option<f64> {
        if let Some(near) = self.near.filter(|near| near.gap_m * now.gap_m < 0.0) {
            self.far = Some(now);
            return Some(between_m(near, now));
        }
        let before = self.near.replace(now);
        match self.far {
            Some(far) => Some(between_m(now, far)),
            None => before.and_then(|before| onward_m(before, now)),
        }
    }
}

fn between_m(near: Place, far: Place) -> f64 {
    let share = near.gap_m / (near.gap_m - far.gap_m);
    near.material_m + share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) * (far.material_m - near.material_m)
}

/// Returns where the gap closes if it keeps changing as it did from the place before to this one; `None` where these do
/// not tell.
fn onward_m(before: Place, now: Place) -> Option<f64> {
    let closed = (before.gap_m - now.gap_m) / (now.material_m - before.material_m);
    // A tip that is drawn back too far presses, and what it presses was not put in.
    let (least, left) = if now.gap_m > 0.0 {
        (LEAST_CLOSED, 1.0)
    } else {
        (LEAST_CLOSED_BACK, LEFT_BACK)
    };
    let is_plain = (least..MOST_CLOSED).contains(&closed) && now.gap_m.abs() < left * before.gap_m.abs();
    is_plain.then(|| now.material_m + now.gap_m / closed)
}

/// Moves the tip through the material to its place in the world, but not past `to_m`; returns whether it moved.
pub(super) fn follow(
    model: &LineModel,
    state: &mut LineState,
    tip_m: f64,
    to_m: f64,
    now: Place,
    tried: &mut Tried,
) -> bool {
    let place_m = match tried.next_m(now).filter(|m| (0.0..=to_m).contains(m)) {
        Some(place_m) => place_m,
        None => nearest_m(model, state, tip_m, to_m, now),
    };
    state.tip.material_m = place_m;
    state.tip.track_m = tried.track_m.max(place_m.min(model.length_m()));
    if place_m >= to_m {
        // Beyond that it is another force that holds the tip.
        *tried = Tried::none(&state.tip);
    }
    place_m != now.material_m
}

/// Returns the nearest place that is where the world has the tip, by the present loads.
fn nearest_m(model: &LineModel, state: &LineState, tip_m: f64, to_m: f64, now: Place) -> f64 {
    let (from_m, gap_m) = (now.material_m, now.gap_m);
    // One pass goes no further than some stations; the next continues.
    let reach_m = (MOST_PRESSED * gap_m.abs()).min(8.0 * model.compliance.spacing_m);
    let around = Around::new(model, state, reach_m);
    let furthest_m = if gap_m > 0.0 {
        (from_m + reach_m).min(to_m)
    } else {
        // Beyond the surface there is no material to go back through.
        (from_m - reach_m).max(0.0)
    };
    root(&around, tip_m, from_m, gap_m, furthest_m)
}

/// Returns the place between `from_m` and `furthest_m` that is at `tip_m` in the world, the nearest found; or
/// `furthest_m`.
fn root(around: &Around, tip_m: f64, from_m: f64, gap_m: f64, furthest_m: f64) -> f64 {
    let sign = gap_m.signum();
    let short = |place_m: f64| -sign * around.beyond_m(place_m, tip_m);
    let span_m = (furthest_m - from_m).abs();
    let (mut near, mut near_short) = (0.0, short(from_m));
    if near_short <= 0.0 {
        return from_m;
    }
    let mut far = near_short.min(span_m);
    let mut far_short = short(from_m + sign * far);
    while far_short > 0.0 && far < span_m {
        (near, near_short) = (far, far_short);
        far = (2.0 * far).min(span_m);
        far_short = short(from_m + sign * far);
    }
    if far_short > 0.0 {
        return furthest_m;
    }
    for _ in 0..24 {
        if far - near <= PLACE_M || far_short == 0.0 {
            break;
        }
        // Regula falsi, kept away from both ends.
        let part = (near_short / (near_short - far_short)).clamp(0.0, 1.0);
        let middle = near + part * (far - near);
        let value = short(from_m + sign * middle);
        if value.abs() <= PLACE_M {
            return from_m + sign * middle;
        }
        if value > 0.0 {
            (near, near_short) = (middle, value);
            far_short *= 0.5;
        } else {
            (far, far_short) = (middle, value);
            near_short *= 0.5;
        }
    }
    from_m + sign * 0.5 * (near + far)
}

//! The forces of one tick by sets: which stations stick, which have reached their friction, and the forces of those
//! that stick.
//!
//! Sweeps over the stations carry a change from neighbour to neighbour. Here the places of all stations say which of
//! them stick, conjugate gradients on the compliance of that set give their forces, and these say again which stick: as
//! a rule the set of the last tick is the right one. What ends it is what ends the sweeps: no station is off its place
//! by more than the tolerance. Where the sets go round in a circle, the sweeps take over from what was reached.

use super::super::model::MAX_STATIONS;
use super::super::rows::Rows;
use super::Spring;
use crate::simd::{LANES, Vector, in_vectors};
use gradients::{ForceSet, add, answer, hold, places, product};
use stylet_settings::MAX_LEFT_NEEDLES;

mod gradients;

/// Number of sets that are tried before the sweeps take over.
const MOST_SETS: u32 = 10;
/// Products with the compliance for each set.
const MOST_PRODUCTS: u32 = 60;
/// Part of the tolerance to which the forces of a set are found.
const WITHIN: f64 = 0.3;

/// Blocks of the stations of one line.
pub(in crate::line) const LINE_BLOCKS: usize = MAX_STATIONS / LANES;
/// Numbers in the largest problem: all needles that stay in, and the one that moves.
const MOST: usize = (MAX_LEFT_NEEDLES + 1) * (MAX_STATIONS + 1) + LANES;

/// A number for each station. In the last block that is in use, those past the last station are zero.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(in crate::line) struct Each<const B: usize>([[f64; LANES]; B]);

impl<const B: usize> Each<B> {
    const ZEROS: Self = Each([[0.0; LANES]; B]);

    #[inline(always)]
    pub fn set(&mut self, count: usize, numbers: impl Iterator<Item = f64>) {
        let all = self.0.as_flattened_mut();
        let count = count.min(all.len());
        all[..count].iter_mut().zip(numbers).for_each(|(to, from)| *to = from);
        all[count..count.next_multiple_of(LANES)].fill(0.0);
    }

    #[inline(always)]
    pub fn numbers(&self) -> &[f64] {
        self.0.as_flattened()
    }
}

/// The tip, as one more station.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::line) struct Tip {
    /// Displacement for each newton, without the gain.
    pub own_m_per_n: f64,
    /// Displacement at which it is at the material's place, and its largest force.
    pub stuck_m: f64,
    pub limit_n: f64,
    pub force_n: f64,
    pub u_m: f64,
    /// Set while the tip sticks, as for the stations below.
    pub sticks: f64,
    pub bounded_n: f64,
    pub change_n: f64,
}

/// Work space of a tick, for all of its solutions.
#[derive(Clone, Debug)]
pub(in crate::line) struct Scratch<const B: usize> {
    /// Stations in contact.
    pub count: usize,
    /// Displacement for each newton, over that of the compliance.
    pub gain: f64,
    pub tolerance_m: f64,
    /// Displacement with which each station stays where it sticks, and the least and the most force it has.
    pub stuck_m: Each<B>,
    pub low_n: Each<B>,
    pub high_n: Each<B>,
    /// Displacement of each station by the tip's force, m/N.
    pub column: Each<B>,
    /// Share of that which is a dent, and what dents take from each other where a membrane holds the tip ([`Spring`]);
    /// 0 for none.
    pub dent: Each<B>,
    pub taken_n_per_m: f64,
    /// Forces, and the displacements that they make.
    pub force_n: Each<B>,
    pub u_m: Each<B>,
    pub tip: Tip,
    /// Products with the compliance.
    pub products: u32,
    /// Largest distance of a station from its place.
    pub residual_m: f64,
    /// Number of stations whose own compliance is known from the solution before in the same tick; 0 at its beginning.
    pub owned: usize,
    own_m_per_n: Each<B>,
    n_per_own_m: Each<B>,
    /// 1 for those that stick.
    sticks: Each<B>,
    /// Force of those that do not, and how much more that is than they have.
    bounded_n: Each<B>,
    change_n: Each<B>,
    left_m: Each<B>,
    /// About the forces that take away what is left.
    near_n: Each<B>,
    along_n: Each<B>,
    moved_m: Each<B>,
}

impl<const B: usize> Scratch<B> {
    pub fn new() -> Self {
        Scratch {
            count: 0,
            gain: 1.0,
            tolerance_m: 0.0,
            stuck_m: Each::ZEROS,
            low_n: Each::ZEROS,
            high_n: Each::ZEROS,
            column: Each::ZEROS,
            dent: Each::ZEROS,
            taken_n_per_m: 0.0,
            force_n: Each::ZEROS,
            u_m: Each::ZEROS,
            tip: Tip::default(),
            products: 0,
            residual_m: 0.0,
            owned: 0,
            own_m_per_n: Each::ZEROS,
            n_per_own_m: Each::ZEROS,
            sticks: Each::ZEROS,
            bounded_n: Each::ZEROS,
            change_n: Each::ZEROS,
            left_m: Each::ZEROS,
            near_n: Each::ZEROS,
            along_n: Each::ZEROS,
            moved_m: Each::ZEROS,
        }
    }

    /// Begins a tick that knows nothing of the ticks before.
    pub fn begin(&mut self) {
        (self.owned, self.taken_n_per_m) = (0, 0.0);
    }

    /// Sets the membrane that holds the tip, if one does; `column` is set, and of it `whole` is no dent.
    pub fn hold_by(&mut self, spring: Option<Spring>, whole: impl Iterator<Item = f64>) {
        let taken_n_per_m = spring.map_or(0.0, |spring| spring.n_per_m);
        if taken_n_per_m != 0.0 {
            self.dent.set(
                self.count,
                self.column
                    .numbers()
                    .iter()
                    .zip(whole)
                    .map(|(of_tip, whole)| of_tip - whole),
            );
        }
        if taken_n_per_m != 0.0 || self.taken_n_per_m != 0.0 {
            self.owned = 0;
        }
        self.taken_n_per_m = taken_n_per_m;
    }

    #[inline(always)]
    fn blocks(&self) -> usize {
        self.count.div_ceil(LANES).min(B)
    }
}

in_vectors! {
/// Finds the forces from those of the last solution; returns whether they are within the tolerance. `inverse` is that
/// of the compliance of the first so many stations: of needles that stay in, most of whose stations stick in every set.
fn find<V: Vector<f64>, const B: usize>(rows: &Rows, inverse: Option<&Rows>, scratch: &mut Scratch<B>) -> bool {
    let (count, gain) = (scratch.count, scratch.gain);
    if scratch.owned != count {
        let (taken, dent) = (scratch.taken_n_per_m, scratch.dent.numbers());
        let taken_m = |n: usize| if taken == 0.0 { 0.0 } else { taken * dent[n] * dent[n] };
        let own = |n: usize| gain * (rows.row(n).get(n).copied().unwrap_or(1.0) - taken_m(n));
        scratch.own_m_per_n.set(count, (0..count).map(own));
        scratch.n_per_own_m.set(count, scratch.own_m_per_n.numbers().iter().map(|own| 1.0 / own));
        scratch.owned = count;
    }
    for _ in 0..MOST_SETS {
        choose(scratch);
        let is_found = scratch.residual_m <= scratch.tolerance_m;
        to_limits::<V, B>(rows, scratch);
        if is_found {
            return true;
        }
        hold::<V, B>(rows, inverse, scratch);
    }
    choose(scratch);
    to_limits::<V, B>(rows, scratch);
    false
}
}

in_vectors! {
/// Computes the displacement of the first `count` stations for these forces.
fn displacement<V: Vector<f64>, const B: usize>(rows: &Rows, force_n: &[f64], scratch: &mut Scratch<B>) {
    let (mut places, mut at) = ([0; MOST], 0);
    for (n, force) in force_n.iter().enumerate().take(scratch.count.min(MOST)) {
        places[at] = n as u16;
        at += usize::from(*force != 0.0);
    }
    product::<V, B>(rows, scratch.blocks(), &places[..at], force_n, &mut scratch.u_m);
}
}

/// Chooses the stations that stick, by their places; returns the largest distance of one from its place.
#[inline(always)]
fn choose<const B: usize>(scratch: &mut Scratch<B>) {
    let mut off = [0.0_f64; LANES];
    for b in 0..scratch.blocks() {
        #[expect(clippy::needless_range_loop, reason = "one index over several arrays")]
        for l in 0..LANES {
            let force = scratch.force_n.0[b][l];
            let (low, high) = (scratch.low_n.0[b][l], scratch.high_n.0[b][l]);
            let free = force + (scratch.stuck_m.0[b][l] - scratch.u_m.0[b][l]) * scratch.n_per_own_m.0[b][l];
            let bounded = if free > high { high } else { free };
            let bounded = if bounded < low { low } else { bounded };
            let change = bounded - force;
            let by = (change * scratch.own_m_per_n.0[b][l]).abs();
            off[l] = if by > off[l] { by } else { off[l] };
            let sticks = low < free && free < high;
            scratch.sticks.0[b][l] = if sticks { 1.0 } else { 0.0 };
            scratch.bounded_n.0[b][l] = if sticks { force } else { bounded };
            scratch.change_n.0[b][l] = if sticks { 0.0 } else { change };
        }
    }
    scratch.residual_m = off.iter().fold(0.0, |most: f64, by| most.max(*by));
    let tip = &mut scratch.tip;
    let own = scratch.gain * tip.own_m_per_n;
    (tip.sticks, tip.bounded_n, tip.change_n) = (0.0, tip.force_n, 0.0);
    if own > 0.0 {
        let free = tip.force_n + (tip.stuck_m - tip.u_m) / own;
        let bounded = free.max(0.0).min(tip.limit_n);
        let change = bounded - tip.force_n;
        scratch.residual_m = scratch.residual_m.max((change * own).abs());
        if free > 0.0 && free < tip.limit_n {
            tip.sticks = 1.0;
        } else {
            (tip.bounded_n, tip.change_n) = (bounded, change);
        }
    }
}

/// Gives those that do not stick the force they have then, and adds what that moves.
#[inline(always)]
fn to_limits<V: Vector<f64>, const B: usize>(rows: &Rows, scratch: &mut Scratch<B>) {
    let mut at = [0; MOST];
    let count = places(&scratch.change_n, scratch.count, &mut at);
    if count == 0 && scratch.tip.change_n == 0.0 {
        return;
    }
    // Not a sum, which might miss the limit by a rounding.
    for b in 0..scratch.blocks() {
        scratch.force_n.0[b] = scratch.bounded_n.0[b];
    }
    scratch.tip.force_n = scratch.tip.bounded_n;
    let change_n = scratch.tip.change_n;
    let tip = answer::<V, B>(rows, scratch, &at[..count], ForceSet::Changes, change_n);
    for b in 0..scratch.blocks() {
        add::<V>(&mut scratch.u_m.0[b], 1.0, &scratch.moved_m.0[b]);
    }
    scratch.tip.u_m += tip;
    scratch.products += 1;
}

//! The forces of one tick by sets: which stations stick, which have reached their friction, and the forces of those that stick.
//!
//! Sweeps over the stations carry a change from neighbour to neighbour. Here the places of all stations say which of them stick,
//! conjugate gradients on the compliance of that set give their forces, and these say again which stick: as a rule the set of the
//! last tick is the right one. What ends it is what ends the sweeps: no station is off its place by more than the tolerance. Where
//! the sets go round in a circle, the sweeps take over from what was reached.

use super::super::model::MAX_STATIONS;
use super::super::rows::Rows;
use crate::simd::{LANES, Vector, in_vectors};
use stylet_shm_schema::MAX_LEFT_NEEDLES;

/// Sets that are tried before the sweeps take over.
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
    /// How far it moves for each newton, without the gain.
    pub own_m_per_n: f64,
    /// Displacement with which it is where the material has it, and the most force it has.
    pub stuck_m: f64,
    pub limit_n: f64,
    pub force_n: f64,
    pub u_m: f64,
    /// As for the stations, below.
    pub sticks: f64,
    pub bounded_n: f64,
    pub change_n: f64,
}

/// What a tick works in, for all of its solutions.
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
    /// How each station moves with the tip's force, m/N.
    pub column: Each<B>,
    /// Forces, and the displacements that they make.
    pub force_n: Each<B>,
    pub u_m: Each<B>,
    pub tip: Tip,
    /// Products with the compliance.
    pub products: u32,
    /// How far a station is off its place at most.
    pub residual_m: f64,
    own_m_per_n: Each<B>,
    n_per_own_m: Each<B>,
    /// 1 for those that stick.
    sticks: Each<B>,
    /// Force of those that do not, and how much more that is than they have.
    bounded_n: Each<B>,
    change_n: Each<B>,
    left_m: Each<B>,
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
            force_n: Each::ZEROS,
            u_m: Each::ZEROS,
            tip: Tip::default(),
            products: 0,
            residual_m: 0.0,
            own_m_per_n: Each::ZEROS,
            n_per_own_m: Each::ZEROS,
            sticks: Each::ZEROS,
            bounded_n: Each::ZEROS,
            change_n: Each::ZEROS,
            left_m: Each::ZEROS,
            along_n: Each::ZEROS,
            moved_m: Each::ZEROS,
        }
    }

    #[inline(always)]
    fn blocks(&self) -> usize {
        self.count.div_ceil(LANES).min(B)
    }
}

in_vectors! {
/// Finds the forces from those of the last solution; returns whether they are within the tolerance.
fn find<V: Vector<f64>, const B: usize>(rows: &Rows, scratch: &mut Scratch<B>) -> bool {
    let (count, gain) = (scratch.count, scratch.gain);
    scratch.own_m_per_n.set(count, (0..count).map(|n| gain * rows.row(n).get(n).copied().unwrap_or(1.0)));
    scratch.n_per_own_m.set(count, scratch.own_m_per_n.numbers().iter().map(|own| 1.0 / own));
    for _ in 0..MOST_SETS {
        choose(scratch);
        let is_found = scratch.residual_m <= scratch.tolerance_m;
        to_limits::<V, B>(rows, scratch);
        if is_found {
            return true;
        }
        hold::<V, B>(rows, scratch);
    }
    choose(scratch);
    to_limits::<V, B>(rows, scratch);
    false
}
}

in_vectors! {
/// Displacement of the first `count` stations for these forces.
fn displacement<V: Vector<f64>, const B: usize>(rows: &Rows, force_n: &[f64], scratch: &mut Scratch<B>) {
    let (mut places, mut at) = ([0; MOST], 0);
    for (n, force) in force_n.iter().enumerate().take(scratch.count.min(MOST)) {
        places[at] = n as u16;
        at += usize::from(*force != 0.0);
    }
    product::<V, B>(rows, scratch.blocks(), &places[..at], force_n, &mut scratch.u_m);
}
}

/// Which stations stick, by where they are; and how far one is off at most.
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

/// The stations whose number is not zero.
#[inline(always)]
fn places<const B: usize>(numbers: &Each<B>, count: usize, places: &mut [u16; MOST]) -> usize {
    let mut at = 0;
    for (n, number) in numbers.numbers().iter().enumerate().take(count) {
        places[at] = n as u16;
        at += usize::from(*number != 0.0);
    }
    at
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
    let tip = answer::<V, B>(rows, scratch, &at[..count], Of::Changes, change_n);
    for b in 0..scratch.blocks() {
        add::<V>(&mut scratch.u_m.0[b], 1.0, &scratch.moved_m.0[b]);
    }
    scratch.tip.u_m += tip;
    scratch.products += 1;
}

/// Conjugate gradients for the forces with which those that stick do not move.
#[inline(always)]
fn hold<V: Vector<f64>, const B: usize>(rows: &Rows, scratch: &mut Scratch<B>) {
    let blocks = scratch.blocks();
    let mut at = [0; MOST];
    let count = places(&scratch.sticks, scratch.count, &mut at);
    let mut sum = V::splat(0.0);
    for b in 0..blocks {
        let gap = V::load(&scratch.stuck_m.0[b]).sub(V::load(&scratch.u_m.0[b]));
        let gap = gap.mul(V::load(&scratch.sticks.0[b]));
        gap.store(&mut scratch.left_m.0[b]);
        gap.store(&mut scratch.along_n.0[b]);
        sum = sum.add(gap.mul(gap));
    }
    let tip_sticks = scratch.tip.sticks;
    let mut tip_left = tip_sticks * (scratch.tip.stuck_m - scratch.tip.u_m);
    let mut tip_along = tip_left;
    let mut square = total(sum) + tip_left * tip_left;
    let enough = WITHIN * scratch.tolerance_m * WITHIN * scratch.tolerance_m;
    for _ in 0..MOST_PRODUCTS {
        if square <= enough {
            break;
        }
        let tip_moved = answer::<V, B>(rows, scratch, &at[..count], Of::Along, tip_along);
        let mut sum = V::splat(0.0);
        for b in 0..blocks {
            sum = sum.add(V::load(&scratch.along_n.0[b]).mul(V::load(&scratch.moved_m.0[b])));
        }
        let length = square / (total(sum) + tip_along * tip_moved);
        if !(length.is_finite() && length > 0.0) {
            break;
        }
        let mut sum = V::splat(0.0);
        for b in 0..blocks {
            add::<V>(&mut scratch.force_n.0[b], length, &scratch.along_n.0[b]);
            add::<V>(&mut scratch.u_m.0[b], length, &scratch.moved_m.0[b]);
            let by = V::load(&scratch.moved_m.0[b]).mul(V::load(&scratch.sticks.0[b]));
            let gap = V::load(&scratch.left_m.0[b]).sub(V::splat(length).mul(by));
            gap.store(&mut scratch.left_m.0[b]);
            sum = sum.add(gap.mul(gap));
        }
        scratch.tip.force_n += length * tip_along;
        scratch.tip.u_m += length * tip_moved;
        tip_left -= tip_sticks * length * tip_moved;
        let before = square;
        square = total(sum) + tip_left * tip_left;
        let keep = square / before;
        for b in 0..blocks {
            let next = V::load(&scratch.left_m.0[b]).add(V::splat(keep).mul(V::load(&scratch.along_n.0[b])));
            next.store(&mut scratch.along_n.0[b]);
        }
        tip_along = tip_left + keep * tip_along;
        scratch.products += 1;
    }
}

/// Which forces [`answer`] is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Of {
    Changes,
    Along,
}

/// Displacement `moved_m` for forces of some stations, by number, and of the tip; returns that of the tip.
#[inline(always)]
fn answer<V: Vector<f64>, const B: usize>(
    rows: &Rows,
    scratch: &mut Scratch<B>,
    places: &[u16],
    of: Of,
    tip_n: f64,
) -> f64 {
    let blocks = scratch.blocks();
    let force_n = match of {
        Of::Changes => &scratch.change_n,
        Of::Along => &scratch.along_n,
    };
    product::<V, B>(rows, blocks, places, force_n.numbers(), &mut scratch.moved_m);
    let mut sum = V::splat(0.0);
    for b in 0..blocks {
        let column = V::load(&scratch.column.0[b]);
        let u = V::load(&scratch.moved_m.0[b]).add(V::splat(tip_n).mul(column));
        u.mul(V::splat(scratch.gain)).store(&mut scratch.moved_m.0[b]);
        sum = sum.add(column.mul(V::load(&force_n.0[b])));
    }
    scratch.gain * (total(sum) + scratch.tip.own_m_per_n * tip_n)
}

/// Sum of the rows of some stations times their numbers, in the first so many blocks.
#[inline(always)]
fn product<V: Vector<f64>, const B: usize>(
    rows: &Rows,
    blocks: usize,
    places: &[u16],
    numbers: &[f64],
    sums: &mut Each<B>,
) {
    let mut b = 0;
    // As many blocks at once as there are registers for: no sum waits for the one before it.
    while b + 5 <= blocks {
        part::<V, B, 5>(rows, places, numbers, b, sums);
        b += 5;
    }
    match blocks - b {
        4 => part::<V, B, 4>(rows, places, numbers, b, sums),
        3 => part::<V, B, 3>(rows, places, numbers, b, sums),
        2 => part::<V, B, 2>(rows, places, numbers, b, sums),
        1 => part::<V, B, 1>(rows, places, numbers, b, sums),
        _ => {}
    }
}

#[inline(always)]
fn part<V: Vector<f64>, const B: usize, const N: usize>(
    rows: &Rows,
    places: &[u16],
    numbers: &[f64],
    from: usize,
    sums: &mut Each<B>,
) {
    let mut sum = [V::splat(0.0); N];
    for &place in places {
        let row = rows.blocks(place as usize);
        let (Some(row), Some(&number)) = (row.get(from..from + N), numbers.get(place as usize)) else {
            continue;
        };
        let number = V::splat(number);
        for n in 0..N {
            sum[n] = sum[n].add(number.mul(V::load(&row[n])));
        }
    }
    for (sum, to) in sum.into_iter().zip(&mut sums.0[from..from + N]) {
        sum.store(to);
    }
}

#[inline(always)]
fn add<V: Vector<f64>>(to: &mut [f64; LANES], length: f64, along: &[f64; LANES]) {
    V::load(to).add(V::splat(length).mul(V::load(along))).store(to);
}

#[inline(always)]
fn total<V: Vector<f64>>(sums: V) -> f64 {
    let mut each = [0.0; LANES];
    sums.store(&mut each);
    let [a, b, c, d, e, f, g, h] = each;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

//! Forces of the stations that stick, by conjugate gradients on their compliance.

use super::{Each, MOST, MOST_PRODUCTS, Scratch, WITHIN};
use crate::line::rows::Rows;
use crate::simd::{LANES, Vector};

/// Lists the stations whose number is not zero.
#[inline(always)]
pub(super) fn places<const B: usize>(numbers: &Each<B>, count: usize, places: &mut [u16; MOST]) -> usize {
    let mut at = 0;
    for (n, number) in numbers.numbers().iter().enumerate().take(count) {
        places[at] = n as u16;
        at += usize::from(*number != 0.0);
    }
    at
}

/// Finds, by conjugate gradients, the forces with which the sticking stations do not move.
#[inline(always)]
pub(super) fn hold<V: Vector<f64>, const B: usize>(rows: &Rows, inverse: Option<&Rows>, scratch: &mut Scratch<B>) {
    let blocks = scratch.blocks();
    let mut at = [0; MOST];
    let count = places(&scratch.sticks, scratch.count, &mut at);
    let at = &at[..count];
    let mut sum = V::splat(0.0);
    for b in 0..blocks {
        let gap = V::load(&scratch.stuck_m.0[b]).sub(V::load(&scratch.u_m.0[b]));
        let gap = gap.mul(V::load(&scratch.sticks.0[b]));
        gap.store(&mut scratch.left_m.0[b]);
        sum = sum.add(gap.mul(gap));
    }
    let tip_sticks = scratch.tip.sticks;
    let mut tip_left = tip_sticks * (scratch.tip.stuck_m - scratch.tip.u_m);
    let mut square = total(sum) + tip_left * tip_left;
    // Of the tip, displacement counts as force where nothing else is known of the compliance.
    let tip_near = match inverse {
        Some(_) if tip_sticks > 0.0 => 1.0 / (scratch.gain * scratch.tip.own_m_per_n),
        _ => 1.0,
    };
    near::<V, B>(inverse, at, scratch);
    scratch.along_n.0[..blocks].copy_from_slice(&scratch.near_n.0[..blocks]);
    let mut tip_along = tip_near * tip_left;
    let mut weight = product_left::<V, B>(inverse, scratch, square, tip_near * tip_left * tip_left);
    let enough = WITHIN * scratch.tolerance_m * WITHIN * scratch.tolerance_m;
    for _ in 0..MOST_PRODUCTS {
        if square <= enough {
            break;
        }
        let tip_moved = answer::<V, B>(rows, scratch, at, ForceSet::Along, tip_along);
        let mut sum = V::splat(0.0);
        for b in 0..blocks {
            sum = sum.add(V::load(&scratch.along_n.0[b]).mul(V::load(&scratch.moved_m.0[b])));
        }
        let length = weight / (total(sum) + tip_along * tip_moved);
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
        square = total(sum) + tip_left * tip_left;
        near::<V, B>(inverse, at, scratch);
        let before = weight;
        weight = product_left::<V, B>(inverse, scratch, square, tip_near * tip_left * tip_left);
        let keep = weight / before;
        for b in 0..blocks {
            let next = V::load(&scratch.near_n.0[b]).add(V::splat(keep).mul(V::load(&scratch.along_n.0[b])));
            next.store(&mut scratch.along_n.0[b]);
        }
        tip_along = tip_near * tip_left + keep * tip_along;
        scratch.products += 1;
    }
}

/// Approximates the forces that take away the residual: by the inverse of a compliance in which more stations may
/// stick, and beyond it as if each station stood alone. Without an inverse it returns the residual itself.
#[inline(always)]
fn near<V: Vector<f64>, const B: usize>(inverse: Option<&Rows>, places: &[u16], scratch: &mut Scratch<B>) {
    let blocks = scratch.blocks();
    let Some(inverse) = inverse else {
        scratch.near_n.0[..blocks].copy_from_slice(&scratch.left_m.0[..blocks]);
        return;
    };
    let known = inverse.size().min(scratch.count);
    let known_blocks = known.div_ceil(LANES);
    let of_known = places.partition_point(|place| usize::from(*place) < known);
    let (left, near) = (&scratch.left_m, &mut scratch.near_n);
    product::<V, B>(inverse, known_blocks, &places[..of_known], left.numbers(), near);
    // The last block of the inverse may be shared.
    for n in known..known_blocks * LANES {
        near.0.as_flattened_mut()[n] = left.numbers()[n] * scratch.n_per_own_m.numbers()[n];
    }
    for b in known_blocks..blocks {
        let alone = V::load(&left.0[b]).mul(V::load(&scratch.n_per_own_m.0[b]));
        alone.store(&mut near.0[b]);
    }
    for b in 0..known_blocks {
        let masked = V::load(&near.0[b]).mul(V::load(&scratch.sticks.0[b]));
        masked.store(&mut near.0[b]);
    }
}

/// Returns the product of the residual with the forces near it, and the tip's share; the square of the residual where
/// they are the same.
#[inline(always)]
fn product_left<V: Vector<f64>, const B: usize>(
    inverse: Option<&Rows>,
    scratch: &Scratch<B>,
    square: f64,
    of_tip: f64,
) -> f64 {
    if inverse.is_none() {
        return square;
    }
    let mut sum = V::splat(0.0);
    for b in 0..scratch.blocks() {
        sum = sum.add(V::load(&scratch.left_m.0[b]).mul(V::load(&scratch.near_n.0[b])));
    }
    total(sum) + of_tip
}

/// Forces that [`answer`] is asked for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum ForceSet {
    Changes,
    Along,
}

/// Computes the displacement `moved_m` for forces of some stations, by number, and of the tip; returns that of the tip.
#[inline(always)]
pub(super) fn answer<V: Vector<f64>, const B: usize>(
    rows: &Rows,
    scratch: &mut Scratch<B>,
    places: &[u16],
    of: ForceSet,
    tip_n: f64,
) -> f64 {
    let blocks = scratch.blocks();
    let force_n = match of {
        ForceSet::Changes => &scratch.change_n,
        ForceSet::Along => &scratch.along_n,
    };
    product::<V, B>(rows, blocks, places, force_n.numbers(), &mut scratch.moved_m);
    if scratch.taken_n_per_m != 0.0 {
        take::<V, B>(
            &scratch.dent,
            scratch.taken_n_per_m,
            blocks,
            force_n,
            &mut scratch.moved_m,
        );
    }
    let mut sum = V::splat(0.0);
    for b in 0..blocks {
        let column = V::load(&scratch.column.0[b]);
        let u = V::load(&scratch.moved_m.0[b]).add(V::splat(tip_n).mul(column));
        u.mul(V::splat(scratch.gain)).store(&mut scratch.moved_m.0[b]);
        sum = sum.add(column.mul(V::load(&force_n.0[b])));
    }
    scratch.gain * (total(sum) + scratch.tip.own_m_per_n * tip_n)
}

/// Takes what the spring of a membrane takes from displacements by these forces.
#[inline(always)]
fn take<V: Vector<f64>, const B: usize>(
    dent: &Each<B>,
    taken_n_per_m: f64,
    blocks: usize,
    force_n: &Each<B>,
    moved_m: &mut Each<B>,
) {
    let mut sum = V::splat(0.0);
    for b in 0..blocks {
        sum = sum.add(V::load(&dent.0[b]).mul(V::load(&force_n.0[b])));
    }
    let by = -taken_n_per_m * total(sum);
    for b in 0..blocks {
        add::<V>(&mut moved_m.0[b], by, &dent.0[b]);
    }
}

/// Computes the sum of the rows of some stations times their numbers, in the first so many blocks.
#[inline(always)]
pub(super) fn product<V: Vector<f64>, const B: usize>(
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
pub(super) fn add<V: Vector<f64>>(to: &mut [f64; LANES], length: f64, along: &[f64; LANES]) {
    V::load(to).add(V::splat(length).mul(V::load(along))).store(to);
}

#[inline(always)]
fn total<V: Vector<f64>>(sums: V) -> f64 {
    let mut each = [0.0; LANES];
    sums.store(&mut each);
    let [a, b, c, d, e, f, g, h] = each;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

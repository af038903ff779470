//! Displacement of points and pads by forces on the points of the wall, and of the points by what else moves the pads.

use super::columns::ReadyProbe;
use crate::simd::{Simd, vectorised};

/// Computes the displacement of the points by forces on them, m.
pub(super) fn wall(probe: &ReadyProbe, pressed_n: &[f64], pushed: &[[f64; 3]], moved_m: &mut [[f64; 3]]) {
    let simd = Simd::detect();
    moved_m.fill([0.0; 3]);
    for (n, (force_n, pushed)) in pressed_n.iter().zip(pushed).enumerate() {
        if *force_n > 0.0 {
            add_three(
                simd,
                moved_m.as_flattened_mut(),
                pushed.map(|c| force_n * c),
                probe.between(n),
            );
        }
    }
}

vectorised! {
    fn add_three(sum: &mut [f64], factors: [f64; 3], rows: [&[f32]; 3]) {
        let [x, y, z] = rows;
        for (sum, ((x, y), z)) in sum.iter_mut().zip(x.iter().zip(y).zip(z)) {
            *sum += factors[0] * f64::from(*x) + factors[1] * f64::from(*y) + factors[2] * f64::from(*z);
        }
    }
}

/// Computes the loads of these forces on the pads, which load the body, N.
pub(super) fn pads(probe: &ReadyProbe, pressed_n: &[f64], pushed: &[[f64; 3]], loads_n: &mut [f64]) {
    loads_n.fill(0.0);
    if probe.wall.is_loaded_at_points {
        for (load_n, (force_n, pushed)) in loads_n.chunks_exact_mut(3).zip(pressed_n.iter().zip(pushed)) {
            if *force_n > 0.0 {
                load_n.copy_from_slice(&pushed.map(|along| force_n * along));
            }
        }
        return;
    }
    for (n, (force_n, pushed)) in pressed_n.iter().zip(pushed).enumerate() {
        if *force_n > 0.0 {
            for (shares, along) in probe.shares(n).zip(pushed) {
                for (load_n, share) in loads_n.iter_mut().zip(shares) {
                    *load_n += force_n * along * f64::from(*share);
                }
            }
        }
    }
}

/// Computes the displacement of the points by others, who displace the pads by `beside_m`: all of the wall by its mean,
/// and each point by what exceeds that. A value that is not finite displaces none.
pub(super) fn beside(probe: &ReadyProbe, beside_m: &[f64], pads_m: &mut [f64], points_m: &mut [[f64; 3]]) {
    let is_moved = beside_m.iter().any(|m| *m != 0.0) && beside_m.iter().all(|m| m.is_finite());
    if !is_moved || beside_m.len() != pads_m.len() {
        return points_m.fill([0.0; 3]);
    }
    if probe.wall.is_loaded_at_points {
        return points_m.as_flattened_mut().copy_from_slice(beside_m);
    }
    let simd = Simd::detect();
    let pads = (beside_m.len() / 3) as f64;
    let mut mean_m = [0.0; 3];
    for pad in beside_m.chunks_exact(3) {
        for (mean, moved) in mean_m.iter_mut().zip(pad) {
            *mean += moved / pads;
        }
    }
    for (to, from) in pads_m.chunks_exact_mut(3).zip(beside_m.chunks_exact(3)) {
        for c in 0..3 {
            to[c] = from[c] - mean_m[c];
        }
    }
    for (n, point_m) in points_m.iter_mut().enumerate() {
        for ((along_m, shares), mean) in point_m.iter_mut().zip(probe.shares(n)).zip(mean_m) {
            *along_m = mean + dot(simd, shares, pads_m);
        }
    }
}

vectorised! {
/// Returns the dot product, in eight sums side by side.
fn dot(shares: &[f32], values: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (shares.as_chunks::<8>(), values.as_chunks::<8>());
    for (a, b) in a8.0.iter().zip(b8.0) {
        for n in 0..8 {
            sums[n] += f64::from(a[n]) * b[n];
        }
    }
    let rest: f64 = a8.1.iter().zip(b8.1).map(|(a, b)| f64::from(*a) * b).sum();
    sums.iter().sum::<f64>() + rest
}
}

//! Sums and products over all nodes of a window.

use super::energy::Nodes;
use super::grid::ROW;
use super::solve::Pair;
use crate::simd::{Simd, vectorised};

vectorised! {
fn differ(pair: &mut Pair, part: f32, direction: &Nodes, now: &Nodes, before: &Nodes) {
    for c in 0..3 {
        let n = pair.step[c].len();
        let (step, change) = (&mut pair.step[c][..n], &mut pair.change[c][..n]);
        let (direction, now, before) = (&direction[c][..n], &now[c][..n], &before[c][..n]);
        for i in 0..n {
            step[i] = part * direction[i];
            change[i] = now[i] - before[i];
        }
    }
}
}

vectorised! {
fn mask(nodes: &mut Nodes, free: &[f32]) {
    for axis in nodes {
        for (value, free) in axis.iter_mut().zip(free) {
            *value *= free;
        }
    }
}
}

vectorised! {
fn add(to: &mut Nodes, factor: f32, by: &Nodes) {
    for (to, by) in to.iter_mut().zip(by) {
        for (to, by) in to.iter_mut().zip(by) {
            *to += factor * by;
        }
    }
}
}

vectorised! {
/// Adds; returns the product of the sum with `with`.
fn add_dot(to: &mut Nodes, factor: f32, by: &Nodes, with: &Nodes) -> f32 {
    let mut sum = [0.0_f32; ROW];
    for ((to, by), with) in to.iter_mut().zip(by).zip(with) {
        let rows = to.as_chunks_mut::<ROW>().0.iter_mut();
        for ((to, by), with) in rows.zip(by.as_chunks::<ROW>().0).zip(with.as_chunks::<ROW>().0) {
            for l in 0..ROW {
                to[l] += factor * by[l];
                sum[l] += to[l] * with[l];
            }
        }
    }
    sum.iter().sum()
}
}

vectorised! {
/// Adds; returns the square of the sum's length.
fn add_square(to: &mut Nodes, factor: f32, by: &Nodes) -> f32 {
    let mut sum = [0.0_f32; ROW];
    for (to, by) in to.iter_mut().zip(by) {
        for (to, by) in to.as_chunks_mut::<ROW>().0.iter_mut().zip(by.as_chunks::<ROW>().0) {
            for l in 0..ROW {
                to[l] += factor * by[l];
                sum[l] += to[l] * to[l];
            }
        }
    }
    sum.iter().sum()
}
}

vectorised! {
/// Keeps the free part, less a load; returns its product with `with`.
fn less_load(of: &mut Nodes, free: &[f32], load: &Nodes, with: &Nodes) -> f32 {
    let mut sum = [0.0_f32; ROW];
    for ((of, load), with) in of.iter_mut().zip(load).zip(with) {
        let rows = of.as_chunks_mut::<ROW>().0.iter_mut().zip(free.as_chunks::<ROW>().0);
        let others = load.as_chunks::<ROW>().0.iter().zip(with.as_chunks::<ROW>().0);
        for ((of, free), (load, with)) in rows.zip(others) {
            for l in 0..ROW {
                of[l] = of[l] * free[l] - load[l];
                sum[l] += of[l] * with[l];
            }
        }
    }
    sum.iter().sum()
}
}

vectorised! {
/// Returns the largest of all numbers.
fn farthest(of: &Nodes) -> f32 {
    let mut most = [f32::MIN_POSITIVE; ROW];
    for of in of {
        for of in of.as_chunks::<ROW>().0 {
            for l in 0..ROW {
                most[l] = most[l].max(of[l].abs());
            }
        }
    }
    most.into_iter().fold(0.0, f32::max)
}
}

vectorised! {
fn dot(a: &Nodes, b: &Nodes) -> f32 {
    let mut sum = [0.0_f32; ROW];
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a.as_chunks::<ROW>().0.iter().zip(b.as_chunks::<ROW>().0) {
            for l in 0..ROW {
                sum[l] += a[l] * b[l];
            }
        }
    }
    sum.iter().sum()
}
}

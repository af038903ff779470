//! Between two levels: forces down, corrections up, by trilinear interpolation and its transpose.

use super::grid::Grid;
use super::real::Real;
use super::sweep::Field;
use crate::simd::{Simd, vectorised};

/// Returns the weight of the two or one coarse lines (or planes) that a fine one lies between.
#[inline(always)]
fn parents(fine: usize) -> ([usize; 2], usize) {
    ([fine / 2, fine.div_ceil(2)], fine % 2 + 1)
}

vectorised! {
/// Computes `coarse = transpose(interpolation) fine`. `line` has room for a line of fine nodes and two more.
fn restrict<T>(fine: &Grid, coarse: &Grid, values: &Field<T>, line: &mut [T], into: &mut Field<T>) {
    for k in 0..coarse.nodes[2] {
        for j in 0..coarse.nodes[1] {
            let [first, end] = coarse.node_rows[j + coarse.nodes[1] * k].map(|i| i as usize);
            if first == end {
                continue;
            }
            for (values, into) in values.iter().zip(into.iter_mut()) {
                // One empty place before and behind, so that every coarse node has both fine neighbours.
                let line = &mut line[..2 * (end - first) + 1];
                line.fill(T::ZERO);
                gather(fine, values, [j, k], 2 * first, line);
                let row = coarse.index([first, j, k]);
                for (value, three) in into[row..row + (end - first)]
                    .iter_mut()
                    .zip(line.windows(3).step_by(2))
                {
                    *value = three[1] + T::of(0.5) * (three[0] + three[2]);
                }
            }
        }
    }
}
}

/// Adds the nine fine lines around a coarse one; `line[1]` is the fine node `start`.
#[inline(always)]
fn gather<T: Real>(fine: &Grid, values: &[T], [j, k]: [usize; 2], start: usize, line: &mut [T]) {
    let near = |coarse: usize, nodes: usize| (2 * coarse).saturating_sub(1)..(2 * coarse + 2).min(nodes);
    for fk in near(k, fine.nodes[2]) {
        for fj in near(j, fine.nodes[1]) {
            let [first, end] = fine.node_rows[fj + fine.nodes[1] * fk].map(|i| i as usize);
            let (first, end) = (first.max(start.saturating_sub(1)), end.min(start + line.len() - 1));
            if first >= end {
                continue;
            }
            let weight = T::of(1.0 / ((1 + fk % 2) * (1 + fj % 2)) as f64);
            let row = fine.index([0, fj, fk]);
            let into = &mut line[first + 1 - start..end + 1 - start];
            for (sum, &value) in into.iter_mut().zip(&values[row + first..row + end]) {
                *sum += weight * value;
            }
        }
    }
}

vectorised! {
/// Computes `fine += interpolation coarse` at free nodes. `line` has room for a line of coarse nodes and one more.
fn prolong<T>(
    coarse: &Grid,
    fine: &Grid,
    values: &Field<T>,
    inverse_diagonal: &[T],
    line: &mut [T],
    into: &mut Field<T>,
) {
    for k in 0..fine.nodes[2] {
        let (planes, plane_count) = parents(k);
        for j in 0..fine.nodes[1] {
            let (rows, row_count) = parents(j);
            let [first, end] = fine.node_rows[j + fine.nodes[1] * k].map(|i| i as usize);
            if first == end {
                continue;
            }
            let (low, high) = (first / 2, end / 2 + 1);
            let weight = T::of(1.0 / (plane_count * row_count) as f64);
            let line = &mut line[..high - low];
            for (values, into) in values.iter().zip(into.iter_mut()) {
                line.fill(T::ZERO);
                for &ck in &planes[..plane_count] {
                    for &cj in &rows[..row_count] {
                        let at = coarse.index([low, cj, ck]);
                        for (sum, &value) in line.iter_mut().zip(&values[at..at + (high - low)]) {
                            *sum += weight * value;
                        }
                    }
                }
                let row = fine.index([0, j, k]);
                let (into, inverse) = (
                    &mut into[row + first..row + end],
                    &inverse_diagonal[row + first..row + end],
                );
                spread(line, inverse, into);
            }
        }
    }
}
}

/// Adds each coarse value to its node, the mean of two to the node between. `into` starts at an even node.
#[inline(always)]
fn spread<T: Real>(line: &[T], inverse: &[T], into: &mut [T]) {
    let half = T::of(0.5);
    let pairs = into.as_chunks_mut::<2>().0.iter_mut().zip(inverse.as_chunks::<2>().0);
    for ((into, inverse), two) in pairs.zip(line.windows(2)) {
        let [at, between] = [two[0], half * (two[0] + two[1])];
        into[0] += if inverse[0] == T::ZERO { T::ZERO } else { at };
        into[1] += if inverse[1] == T::ZERO { T::ZERO } else { between };
    }
}

//! Needles that stay in: against the dense problem of all stations, and against what no needle may do.

use super::*;
use crate::line::cross::Cross;
use crate::line::rows::Rows;
use crate::line::{Compliance, Line};
use nalgebra::{DMatrix, DVector};

mod behaviour;
mod body;
mod moved;

const STATIONS: usize = 24;
const SPACING_M: f64 = 1.364e-3;
const DT_S: f64 = 1e-3;
const WHOLE: f64 = 1.0 / 1434.0;

/// Returns the compliance of a made-up body: it moves as a whole, and around a load.
fn kernel(a: [f64; 3], b: [f64; 3], whole: f64) -> f64 {
    let square: f64 = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum();
    whole + (-square.sqrt() / 5e-3).exp() / 270.0
}

fn place(line: &Line, row: usize) -> [f64; 3] {
    line.point_m(((row % STATIONS) as f64 + 0.5) * SPACING_M, [0.0; 2])
}

fn cosine(a: &Line, b: &Line) -> f64 {
    (0..3).map(|c| a.axes[0][c] * b.axes[0][c]).sum()
}

/// Makes a line that knows `others`. Shaft and tip have the same places; a station of the shaft gives way by itself as
/// well.
fn line(generation: u64, entry_m: [f64; 3], others: &[&HandLine], whole: f64) -> Box<HandLine> {
    let line = Line::new(entry_m, [0.0, 0.0, 1.0]).expect("a direction");
    let entry = |i: usize, j: usize| {
        let own = if i == j && i < STATIONS { 0.014 } else { 0.0 };
        kernel(place(&line, i), place(&line, j), whole) + own
    };
    let mut compliance = Compliance::from_rows(STATIONS, SPACING_M, 4e-3, entry);
    compliance.whole_m_per_n = whole;
    let rows = [2 * STATIONS; 2];
    let beside = others.iter().map(|other| {
        let with = other.line();
        let entry = |i: usize, j: usize| cosine(&line, with) * kernel(place(&line, i), place(with, j), whole);
        Cross::from_rows(other.generation, cosine(&line, with) * whole, rows, entry)
    });
    let beside = beside.collect();
    Box::new(HandLine::made_up(generation, line, compliance, beside))
}

/// Moves a needle from its place to a depth, alone or beside others; returns the force on the hand at the end, N.
fn go(line: &mut HandLine, left: Option<&mut LeftNeedles>, from_m: f64, to_m: f64, step_m: f64) -> f64 {
    let steps = ((to_m - from_m).abs() / step_m).round().max(1.0) as usize;
    let mut left = left;
    let mut force_n = 0.0;
    for n in 1..=steps {
        let tip_m = from_m + (to_m - from_m) * n as f64 / steps as f64;
        force_n = match &mut left {
            Some(left) => left.step_beside(line, tip_m, DT_S),
            None => line.step(tip_m, DT_S),
        }
        .force_on_hand_n;
    }
    force_n
}

/// Inserts the first needle to 25 mm and leaves it; the second knows it.
fn one_left(apart_m: f64, whole: f64) -> (Box<LeftNeedles>, Box<HandLine>) {
    let mut first = line(1, [0.0; 3], &[], whole);
    let second = line(2, [apart_m, 0.0, 0.0], &[&first], whole);
    go(&mut first, None, -1e-3, 25e-3, 1e-4);
    let mut left = LeftNeedles::with_room();
    left.leave(first).expect("room");
    assert!(left.beside(Some(&second)));
    (left, second)
}

#[test]
fn distant_needles_do_not_move_each_other() {
    let (mut left, mut second) = one_left(1.0, 0.0);
    let before = left.forces_n().to_vec();
    let mut alone = line(3, [1.0, 0.0, 0.0], &[], 0.0);
    // Solved farther than what is asked: gradients over more elements end elsewhere within the tolerance.
    for line in [&mut second, &mut alone] {
        line.model.settings.tolerance_m = 1e-13;
    }
    let beside_n = go(&mut second, Some(&mut left), -1e-3, 22e-3, 1e-4);
    let alone_n = go(&mut alone, None, -1e-3, 22e-3, 1e-4);
    assert!((beside_n - alone_n).abs() < 1e-9, "{beside_n} {alone_n}");
    let off = before.iter().zip(left.forces_n()).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9);
    // Nearer they do.
    let (mut left, mut second) = one_left(8e-3, 0.0);
    let near_n = go(&mut second, Some(&mut left), -1e-3, 22e-3, 1e-4);
    assert!((near_n - alone_n).abs() > 1e-3, "{near_n} {alone_n}");
}

/// All stations of both in one matrix, what sticks solved for at once by elimination, and what slips at its limit.
#[test]
fn two_needles_are_what_the_dense_problem_of_all_stations_gives() {
    let (mut worst, mut mixed) = (0.0_f64, 0);
    for (apart_m, depths_m) in [
        (8e-3, [25e-3, 24.2e-3]),
        (4e-3, [18e-3, 18.6e-3]),
        (15e-3, [28e-3, 20e-3]),
    ] {
        let (mut left, mut second) = one_left(apart_m, WHOLE);
        go(&mut second, Some(&mut left), -1e-3, depths_m[0], 1e-4);
        go(&mut second, Some(&mut left), depths_m[0], depths_m[1], 1e-4);
        // One more tick, from known anchors.
        for back_m in [2e-3, 3e-3, 3.5e-3, 4e-3, 4.5e-3, 5e-3] {
            let (mut left, mut second) = (left.clone(), second.clone());
            let anchors: Vec<f64> = second.state.anchor_m[..second.state.in_contact].to_vec();
            let rests: Vec<f64> = left.rest_m[..left.count].to_vec();
            let tip_m = depths_m[1] - back_m;
            left.step_beside(&mut second, tip_m, DT_S);
            let (m, k) = (second.state.in_contact, left.count);
            let lines = [*second.line(), *left.needles[0].line.line()];
            // Rows: shaft of the second, its tip, shaft and tip of the first, each with its share at places of the
            // body.
            let own = |line: usize, n: usize| vec![(place(&lines[line], n), 1.0, Some((line, n)))];
            let tip = |line: usize, state: &crate::line::LineState| {
                let weights = state.tip_range.clone().zip(state.tip_weights);
                weights
                    .map(|(n, w)| (place(&lines[line], n), w, None))
                    .collect::<Vec<_>>()
            };
            let mut rows: Vec<_> = (0..m).map(|n| own(0, n)).collect();
            rows.push(tip(0, &second.state));
            rows.extend((0..k - 1).map(|n| own(1, n)));
            rows.push(tip(1, &left.needles[0].line.state));
            let entry = |i: usize, j: usize| {
                let pairs = rows[i].iter().flat_map(|a| rows[j].iter().map(move |b| (a, b)));
                pairs
                    .map(|((p, w, a), (q, v, b))| {
                        let same = if a.is_some() && a == b { 0.014 } else { 0.0 };
                        w * v * (kernel(*p, *q, WHOLE) + same)
                    })
                    .sum::<f64>()
            };
            let dense = DMatrix::from_fn(m + 1 + k, m + 1 + k, entry);
            let found = DVector::from_iterator(
                m + 1 + k,
                second.state.shaft_n[..m]
                    .iter()
                    .chain([&second.state.tip.force_n])
                    .chain(&left.force_n[..k])
                    .copied(),
            );
            let mut wanted_m: Vec<f64> = anchors[..m].iter().map(|anchor| tip_m - anchor).collect();
            wanted_m.push(tip_m - second.state.tip.material_m);
            wanted_m.extend(&rests);
            let mut limits: Vec<[f64; 2]> = (0..m)
                .map(|n| limit_n(&second.model, second.state.tip.material_m, n))
                .map(|high| [-high, high])
                .collect();
            limits.push([0.0, second.model.front(&second.state.tip).limit_n]);
            limits.extend((0..k).map(|n| [left.low_n[n], left.high_n[n]]));
            let is_free = |n: &usize| found[*n] > limits[*n][0] + 1e-9 && found[*n] < limits[*n][1] - 1e-9;
            let free: Vec<usize> = (0..found.len()).filter(is_free).collect();
            let (some, all) = (free.len(), found.len());
            if some < 6 {
                continue;
            }
            mixed += usize::from(some < all);
            let matrix = DMatrix::from_fn(some, some, |i, j| dense[(free[i], free[j])]);
            let right = DVector::from_fn(some, |i, _| {
                let slips = (0..all).filter(|n| !free.contains(n));
                wanted_m[free[i]] - slips.map(|n| dense[(free[i], n)] * found[n]).sum::<f64>()
            });
            let solved = matrix.lu().solve(&right).expect("regular");
            let largest_n = found.iter().fold(0.0_f64, |l, f| l.max(f.abs()));
            for (n, f) in free.iter().zip(solved.iter()) {
                worst = worst.max((f - found[*n]).abs() / largest_n);
            }
            // What slips does so against its limit, and no other way.
            let u = &dense * &found;
            for n in (0..all).filter(|n| !free.contains(n) && limits[*n][0] < limits[*n][1]) {
                let beyond_m = wanted_m[n] - u[n];
                let is_at_top = found[n] >= limits[n][1] - 1e-9;
                assert!(
                    if is_at_top { beyond_m > -1e-7 } else { beyond_m < 1e-7 },
                    "{n} of {m}+{k}: {beyond_m}"
                );
            }
        }
    }
    assert!(mixed >= 3, "{mixed} ticks in which some slip and some stick");
    println!("{mixed} ticks against the dense solution: {worst:.1e} of the largest force");
    assert!(worst < 1e-6, "{worst}");
}

/// A needle that is left, or taken up again, holds what it held.
#[test]
fn leaving_a_needle_and_taking_it_up_again_changes_no_force() {
    let mut needle = line(1, [0.0; 3], &[], WHOLE);
    go(&mut needle, None, -1e-3, 25e-3, 1e-4);
    let before_n = go(&mut needle, None, 25e-3, 24.6e-3, 1e-4);
    let twin_n = go(&mut needle.clone(), None, 24.6e-3, 24.9e-3, 1e-4);
    let shaft_n = needle.state.shaft_n.clone();
    let mut left = LeftNeedles::with_room();
    left.leave(needle).expect("room");
    for _ in 0..50 {
        left.step_alone(DT_S);
    }
    assert!((left.needles()[0].held_m() - 24.6e-3).abs() < 1e-7);
    let mut again = left.take(1).expect("that one");
    assert!(left.is_empty());
    let after_n = again.step(24.6e-3, DT_S).force_on_hand_n;
    assert!((after_n - before_n).abs() < 1e-5, "{before_n} {after_n}");
    for (a, b) in shaft_n.iter().zip(&again.state.shaft_n) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    let moved_n = go(&mut again, None, 24.6e-3, 24.9e-3, 1e-4);
    assert!((moved_n - twin_n).abs() < 1e-4, "{moved_n} {twin_n}");
}

#[test]
fn rows_of_a_pair_are_the_same_from_either_side() {
    let first = line(1, [0.0; 3], &[], WHOLE);
    let second = line(2, [6e-3, 0.0, 0.0], &[&first], WHOLE);
    let mut both = [LeftNeedles::with_room(), LeftNeedles::with_room()];
    for (left, (a, b)) in both.iter_mut().zip([(&first, &second), (&second, &first)]) {
        let mut a = a.clone();
        go(&mut a, None, -1e-3, 20e-3, 1e-4);
        left.leave(a).expect("room");
        assert!(left.beside(Some(b)));
    }
    let [one, two] = both;
    assert_eq!((one.stride, one.count), (two.stride, two.count));
    let rows = Rows::new(2 * STATIONS, |i, j| {
        one.from_moving[i * one.stride + j.min(one.count - 1)]
    });
    for i in 0..STATIONS {
        for j in 0..one.count - 1 {
            assert_eq!(
                one.from_moving[i * one.stride + j],
                one.to_moving[j * 2 * MAX_STATIONS + i]
            );
            assert_eq!(rows.row(i)[j], two.from_moving[i * two.stride + j], "{i} {j}");
        }
    }
    // One that knows none of them cannot come beside them.
    let mut one = one;
    assert!(!one.beside(Some(&line(9, [0.01, 0.0, 0.0], &[], WHOLE))));
    assert_eq!(one.moving(), 0);
}

//! One slip state against closed forms and against what no needle may do.

use std::sync::OnceLock;
use std::time::Instant;
use stylet_random::Random;

use super::*;
use crate::line::columns::{ColumnQueue, TOLERANCE, tests::paper};
use crate::line::near::NearTip;
use crate::line::{Compliance, LineLayer, LineSettings, NEEDLE_RADIUS_M, PronyTerm};
use stylet_heap as heap;

mod balance;
mod behaviour;
mod bits;
mod creep;
mod membrane;
mod outside;
mod twin;

const DT_S: f64 = 1e-3;
/// A gland whose tip is as wide as its patch: a membrane that is pushed 8 mm at most, cutting, friction.
const GLAND: LineLayer = LineLayer {
    from_m: 0.0,
    puncture_force_n: 5.6,
    puncture_depth_m: 8e-3,
    cutting_force_n: 1.5,
    shaft_friction_n_per_m: 80.0,
};

/// Returns a made-up gland: it moves as a whole, and near the load.
fn made_up(stations: usize, spacing_m: f64, layers: &[LineLayer], settings: LineSettings) -> LineModel {
    let entry = |i: usize, j: usize| {
        let distance_m = (i % stations).abs_diff(j % stations) as f64 * spacing_m;
        let own = if i == j && i < stations {
            0.014 * 1.364e-3 / spacing_m
        } else {
            0.0
        };
        1.0 / 1434.0 + (-distance_m / 5e-3).exp() / 270.0 + own
    };
    let compliance = Compliance::from_rows(stations, spacing_m, 4e-3, entry);
    LineModel::new(compliance, layers, settings).expect("valid")
}

/// Returns the paper's gland, solved, with the tip of a needle in it: a station for each element, or two.
fn solved(halves: bool) -> &'static LineModel {
    static WHOLE: OnceLock<LineModel> = OnceLock::new();
    static HALVES: OnceLock<LineModel> = OnceLock::new();
    let build = || {
        let (model, stations) = paper(if halves { 0.5 } else { 1.0 });
        let mut queue = ColumnQueue::new(&model, &stations, false, TOLERANCE);
        queue.prepare(&model, usize::MAX);
        let compliance = Compliance::of_columns(&model, &stations, queue.columns()).expect("all");
        let gland = LineLayer {
            cutting_force_n: 2.0 * NEEDLE_RADIUS_M * 164.0,
            ..GLAND
        };
        LineModel::new(compliance, &[gland], LineSettings::default()).expect("valid")
    };
    if halves {
        HALVES.get_or_init(build)
    } else {
        WHOLE.get_or_init(build)
    }
}

fn at(tip_m: f64) -> LineInput {
    LineInput { tip_m, dt_s: DT_S }
}

/// Moves the tip from place to place in steps of at most `step_m`; returns the output at each place.
fn go(model: &LineModel, state: &mut LineState, places_m: &[f64], step_m: f64) -> Vec<LineOutput> {
    let mut tip_m = -1e-3;
    let mut outputs = Vec::new();
    for &place_m in places_m {
        let mut output = step(model, state, &at(tip_m));
        while tip_m != place_m {
            tip_m += (place_m - tip_m).clamp(-step_m, step_m);
            output = step(model, state, &at(tip_m));
        }
        outputs.push(output);
    }
    outputs
}

#[test]
fn one_station_sticks_slips_and_takes_the_area_of_its_loop() {
    let (own, limit_n) = (1e-3, 0.8);
    let layer = LineLayer {
        shaft_friction_n_per_m: 80.0,
        ..LineLayer::default()
    };
    let model = LineModel::new(Compliance::diagonal(1, 0.01, own), &[layer], LineSettings::default()).expect("valid");
    let mut state = LineState::new(&model);
    let (middle_m, half_m, step_m) = (0.03, 5e-3, 1e-5);
    go(&model, &mut state, &[middle_m - half_m], step_m);
    let mut area_j = 0.0;
    let mut before = step(&model, &mut state, &at(middle_m - half_m));
    let steps = (2.0 * half_m / step_m).round() as i64;
    let there = (1..=steps).map(|n| middle_m - half_m + n as f64 * step_m);
    let back = (1..=steps).map(|n| middle_m + half_m - n as f64 * step_m);
    let mut last_m = middle_m - half_m;
    // Pulled out there: the loop begins with its limit reached backwards.
    for round in 0..2 {
        for tip_m in there.clone().chain(back.clone()) {
            let now = step(&model, &mut state, &at(tip_m));
            if round == 1 {
                area_j += -0.5 * (now.force_on_hand_n + before.force_on_hand_n) * (tip_m - last_m);
            }
            (before, last_m) = (now, tip_m);
            // Stick, as steep as the tissue is, or slip.
            let stuck_n = (tip_m - state.anchor_m[0]) / own;
            assert!((now.shaft_n - stuck_n).abs() < 1e-6 && now.shaft_n.abs() <= limit_n);
        }
    }
    let wanted_j = 4.0 * limit_n * (half_m - limit_n * own);
    println!("area {area_j:.9e}, {wanted_j:.9e}: {:.1e}", area_j / wanted_j - 1.0);
    assert!((area_j / wanted_j - 1.0).abs() < 1e-6);
}

#[test]
fn what_the_hand_feels_is_what_the_foundation_holds() {
    let model = solved(false);
    let mut state = LineState::new(model);
    for output in go(
        model,
        &mut state,
        &[4e-3, 12e-3, 25e-3, 40e-3, 30e-3, 33e-3, 10e-3],
        1e-4,
    ) {
        let sum = state.loads_n().iter().sum::<f64>() + state.whole_n();
        let foundation: f64 = state
            .loads_n()
            .iter()
            .zip(&model.compliance().foundation)
            .map(|(f, c)| f * c)
            .sum::<f64>()
            - state.whole_n();
        // The loads are those at the last place only.
        if output == state.last {
            println!(
                "hand {:.5} N, loads {sum:.5} N, foundation {foundation:.5} N",
                output.force_on_hand_n
            );
            assert!((output.force_on_hand_n + sum).abs() < 1e-9);
            assert!((foundation + sum).abs() < 0.01 * sum.abs());
        }
    }
    let mut state = LineState::new(model);
    let mut worst = 0.0_f64;
    for place_m in [4e-3, 12e-3, 25e-3, 40e-3] {
        let output = go(model, &mut state, &[place_m], 1e-4)[0];
        let foundation: f64 = state
            .loads_n()
            .iter()
            .zip(&model.compliance().foundation)
            .map(|(f, c)| f * c)
            .sum::<f64>()
            - state.whole_n();
        worst = worst.max((foundation / output.force_on_hand_n - 1.0).abs());
        println!(
            "hand {:.4} N at {place_m} m, foundation {foundation:.4} N",
            output.force_on_hand_n
        );
    }
    println!("worst {:.3} %", 100.0 * worst);
    assert!(worst < 0.01);
}

const PLACES_M: [f64; 8] = [12e-3, 20e-3, 28e-3, 36e-3, 40e-3, 30e-3, 22e-3, 14e-3];

/// Returns the largest difference of places (m) and of forces, over the largest force.
fn difference(a: &[LineOutput], b: &[LineOutput]) -> (f64, f64) {
    let largest = a.iter().map(|o| o.force_on_hand_n.abs()).fold(0.0, f64::max);
    difference_of(a, b, largest)
}

fn difference_of(a: &[LineOutput], b: &[LineOutput], largest: f64) -> (f64, f64) {
    let place = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.tip_material_m - b.tip_material_m).abs());
    let force = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.force_on_hand_n - b.force_on_hand_n).abs());
    let places: Vec<f64> = place.collect();
    println!(
        "  seeds, mm: {:.4?}",
        places.iter().map(|p| 1e3 * p).collect::<Vec<_>>()
    );
    (
        places.into_iter().fold(0.0, f64::max),
        force.fold(0.0, f64::max) / largest,
    )
}

fn figures(outputs: &[LineOutput]) -> String {
    let one = |o: &LineOutput| format!("{:.2} mm {:.2} N", 1e3 * o.tip_material_m, o.force_on_hand_n);
    outputs.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Seeds dropped at eight places, on the way in and out, from 0.5 to 123 mm/s.
#[test]
fn speed_does_not_decide_where_seeds_go() {
    let model = solved(false);
    let run = |speed: f64| go(model, &mut LineState::new(model), &PLACES_M, speed * DT_S);
    let slowest = run(0.5e-3);
    println!("0.5 mm/s: {}", figures(&slowest));
    let mut worst = (0.0_f64, 0.0_f64);
    for speed in [1.9e-3, 10e-3, 50e-3, 123e-3] {
        let (place_m, force) = difference(&slowest, &run(speed));
        println!(
            "{} mm/s: seeds {:.4} mm, force {:.3} %",
            1e3 * speed,
            1e3 * place_m,
            100.0 * force
        );
        worst = (worst.0.max(place_m), worst.1.max(force));
    }
    // The force of the last station, which the tip moves the most, depends on the step: ADR 26.
    assert!(worst.0 < 0.11e-3 && worst.1 < 0.02);
}

#[test]
fn half_the_tick_and_half_the_spacing_change_little() {
    let model = solved(false);
    let run = |model: &LineModel, step_m: f64| go(model, &mut LineState::new(model), &PLACES_M, step_m);
    let ours = run(model, 0.1e-3);
    let (place_m, force) = difference(&ours, &run(model, 0.05e-3));
    println!("tick: seeds {:.4} mm, force {:.3} %", 1e3 * place_m, 100.0 * force);
    let by_tick = (place_m, force);
    let halves = run(solved(true), 0.1e-3);
    // The tip has just leapt there from the surface, in the tick in which the membrane gave way: ADR 26.
    let largest = ours[4].force_on_hand_n.abs();
    let near = difference_of(&ours[..1], &halves[..1], largest);
    println!(
        "spacing, beside the surface: seeds {:.4} mm, force {:.3} %",
        1e3 * near.0,
        100.0 * near.1
    );
    assert!(near.0 < 0.16e-3 && near.1 < 0.02);
    let (place_m, force) = difference_of(&ours[1..], &halves[1..], largest);
    println!("ours   {}\nhalves {}", figures(&ours), figures(&halves));
    println!("spacing: seeds {:.4} mm, force {:.3} %", 1e3 * place_m, 100.0 * force);
    assert!(by_tick.0 < 0.1e-3 && by_tick.1 < 0.02);
    // The bar of ADR 10 is 0.1 mm, and is missed by 0.15 mm on the way in: the end of the shaft is half a station or
    // more.
    assert!(place_m < 0.26e-3 && force < 0.02);
}

/// The work of the hand is the sum of the force *after* each tick times the motion in it, as the implicit step has it.
/// The excess is what a hand could have had at most out of any stretch of ticks beyond what was stored at its begin.
#[test]
fn ten_thousand_random_cycles_make_no_energy() {
    let layers = [
        LineLayer {
            puncture_force_n: 1.2,
            ..GLAND
        },
        LineLayer {
            from_m: 17e-3,
            puncture_force_n: 2.0,
            cutting_force_n: 0.8,
            shaft_friction_n_per_m: 40.0,
            ..GLAND
        },
    ];
    let model = made_up(30, 1.364e-3, &layers, LineSettings::default());
    let worst_j = random_cycles(&model, 10_000, LineState::stored_j);
    assert!(worst_j < 1e-6, "{worst_j}");
}

/// Returns made-up tissue that a tip narrower than its patch dents deeper, with a wedge that opens the cut.
fn narrow() -> LineModel {
    let layers = [0.0, 17e-3].map(|from_m| LineLayer {
        from_m,
        puncture_force_n: 4.0,
        cutting_force_n: 0.25,
        ..GLAND
    });
    let mut model = made_up(30, 1.364e-3, &layers, LineSettings::default());
    model.compliance.whole_m_per_n = 1.0 / 1434.0;
    model.compliance.tip_missing_m_per_n.fill(11e-3);
    model.compliance.near = NearTip::new(0.635e-3, 2.5e-3, 0.49);
    model.compliance.wedge_n.fill(0.02);
    model
}

/// As above for a [`narrow`] tip: it meets the inner membrane with its dent, and the membrane is a spring.
#[test]
fn a_narrow_tip_that_cuts_makes_no_energy() {
    let model = narrow();
    let worst_j = random_cycles(&model, 10_000, LineState::elastic_j);
    assert!(worst_j < 1e-6, "{worst_j}");
}

/// Wherever the tip is, shaft and tip have one compliance that stores energy.
#[test]
fn a_narrow_tip_and_its_shaft_are_positive_definite_at_every_place() {
    for model in [solved(false), solved(true)] {
        let (m, mut state, mut least) = (model.compliance.stations, LineState::new(model), f64::INFINITY);
        for place in 1..8 * m {
            state.tip.material_m = 0.125 * place as f64 * model.compliance.spacing_m;
            lay(model, &mut state);
            let count = state.in_contact;
            let shaft = nalgebra::DMatrix::from_fn(count, count, |i, j| model.compliance.at(i, j));
            let column = nalgebra::DVector::from_column_slice(&state.tip_column[..count]);
            let solved = shaft.cholesky().expect("positive definite").solve(&column);
            least = f64::min(least, 1.0 - column.dot(&solved) / state.tip_own);
        }
        println!(
            "{:.3} of what the tip moves itself is left where the shaft sticks",
            least
        );
        assert!(least > 0.15, "{least}");
    }
}

/// Returns the most that a hand moving to and fro at random can have gained in any stretch of ticks beyond what was
/// stored, J.
fn random_cycles(model: &LineModel, cycles: u32, stored: impl Fn(&LineState, &LineModel) -> f64) -> f64 {
    let mut state = LineState::new(model);
    let (mut stored_j, mut force_n) = (0.0, 0.0);
    let (mut excess_j, mut worst_j, mut sampled_j, mut worst_sampled_j) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let (mut work_j, mut ticks, mut punctures) = (0.0, 0_u64, 0);
    random_hand(cycles, |is_new, tip_m, by_m| {
        if is_new {
            state = LineState::new(model);
            (stored_j, force_n, excess_j, sampled_j) = (0.0, 0.0, 0.0, 0.0);
        }
        let output = step(model, &mut state, &at(tip_m));
        punctures += u32::from(output.punctured.is_some());
        let now_j = stored(&state, model);
        let hand_j = -output.force_on_hand_n * by_m;
        work_j += hand_j;
        excess_j = (excess_j + (now_j - stored_j) - hand_j).max(0.0);
        sampled_j = (sampled_j + (now_j - stored_j) + force_n * by_m).max(0.0);
        worst_j = worst_j.max(excess_j);
        worst_sampled_j = worst_sampled_j.max(sampled_j);
        (stored_j, force_n) = (now_j, output.force_on_hand_n);
        ticks += 1;
    });
    println!(
        "{ticks} ticks, {punctures} punctures, {work_j:.1} J of work; excess {:.3e} uJ; force of the tick before: {:.1} uJ",
        1e6 * worst_j,
        1e6 * worst_sampled_j
    );
    worst_j
}

/// Moves a hand to and fro; gives `tick` whether the tissue is new, where the tip is, and by how much it has moved.
fn random_hand(cycles: u32, mut tick: impl FnMut(bool, f64, f64)) {
    let mut random = Random(11);
    let (mut tip_m, mut is_new) = (-1e-3, true);
    for cycle in 0..cycles {
        if cycle % 50 == 0 {
            (tip_m, is_new) = (-1e-3, true);
        }
        // Some cycles are large, some hardly leave the place.
        let size = if cycle % 3 == 0 { 2e-3 } else { 45e-3 };
        let target_m = if cycle % 3 == 0 {
            tip_m + size * (random.unit() - 0.5)
        } else {
            size * random.unit() - 2e-3
        };
        let speed = 2e-3 * random.unit().powi(3) + 1e-5 + size / 200.0;
        for end_m in [target_m, tip_m + 0.3 * (target_m - tip_m) * random.unit()] {
            while tip_m != end_m {
                let by_m = (end_m - tip_m).clamp(-speed, speed);
                tip_m += by_m;
                tick(std::mem::take(&mut is_new), tip_m, by_m);
                if by_m == 0.0 {
                    break;
                }
            }
        }
    }
}

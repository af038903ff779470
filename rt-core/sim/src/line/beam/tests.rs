//! Beams with closed forms.

use super::*;
use stylet_random::Random;

const EI: f64 = 0.016;

fn model(stations: usize, spacing_m: f64, each_m_per_n: f64, template_m: Option<f64>) -> BeamModel {
    let rows = || Rows::new(stations, |i, j| if i == j { each_m_per_n } else { 0.0 });
    BeamModel {
        bending_stiffness_n_m2: EI,
        length_m: 0.2,
        grip: [0.0; 2],
        template_m,
        gap_m: 0.0,
        spacing_m,
        whole_m_per_n: 0.0,
        across: [rows(), rows()],
    }
}

/// Returns soft tissue in which forces on one station move the others.
fn gland(gap_m: f64) -> BeamModel {
    let rows = || {
        Rows::new(20, |i, j| {
            let distance = i.abs_diff(j) as f64;
            1.0 / 1434.0 + 3e-3 / (1.0 + distance * distance) + if i == j { 3e-3 } else { 0.0 }
        })
    };
    BeamModel {
        grip: [1e-3, 2.0],
        gap_m,
        whole_m_per_n: 1.0 / 1434.0,
        across: [rows(), rows()],
        ..model(20, 4e-3, 1.0, Some(-0.02))
    }
}

/// Returns the input of a tip at that depth, in tissue that does not follow it.
fn at(tip_m: f64) -> BeamInput {
    BeamInput {
        tip_m,
        material_m: tip_m,
        ..BeamInput::default()
    }
}

struct Run {
    model: BeamModel,
    state: BeamState,
    scratch: BeamScratch,
}

impl Run {
    fn new(model: BeamModel) -> Self {
        Run {
            state: BeamState::default(),
            scratch: BeamScratch::new(&model),
            model,
        }
    }

    fn step(&mut self, input: &BeamInput) -> BeamOutput {
        step(&self.model, &mut self.state, &mut self.scratch, input)
    }
}

#[test]
fn a_cantilever_bends_by_the_cube_of_its_length() {
    let input = BeamInput {
        tip_force_n: [0.1, -0.2],
        ..at(-0.05)
    };
    let output = Run::new(model(1, 1e-3, 1.0, None)).step(&input);
    for (side, force) in input.tip_force_n.into_iter().enumerate() {
        // Independent: M / EI integrated twice, in 20,000 steps.
        let (mut slope, mut deflection, steps) = (0.0, 0.0, 20_000);
        let dx = 0.2 / f64::from(steps);
        for n in 0..steps {
            let bend = force * (0.2 - (f64::from(n) + 0.5) * dx) / EI;
            deflection += (slope + 0.5 * bend * dx) * dx;
            slope += bend * dx;
        }
        println!("{} {deflection}", output.tip_m[side]);
        assert!((output.tip_m[side] / deflection - 1.0).abs() < 1e-6);
        assert!((output.force_on_hand_n[side] - force).abs() < 1e-12);
    }
}

/// Hetenyi: at the end of a long beam on springs, `v = 2 P beta / k`; at x from it, `v = 2 P beta / k e^(-beta x)
/// cos(beta x)`. The stations are as far apart as in the loops.
#[test]
fn a_beam_on_an_elastic_foundation_decays_as_hetenyi_says() {
    let (stiffness_pa, spacing_m, force_n) = (44e3, 4e-3, 0.5);
    let count = 32;
    let mut run = Run::new(model(count, spacing_m, 1.0 / (stiffness_pa * spacing_m), None));
    let tip_m = count as f64 * spacing_m;
    run.step(&at(tip_m));
    let output = run.step(&BeamInput {
        tip_force_n: [force_n, 0.0],
        ..at(tip_m)
    });
    let beta = (stiffness_pa / (4.0 * EI)).powf(0.25);
    let wanted = 2.0 * force_n * beta / stiffness_pa;
    println!(
        "decay length {:.1} mm; tip {:.4e}, {wanted:.4e}: {:.2} %",
        1e3 / beta,
        output.tip_m[0],
        100.0 * (output.tip_m[0] / wanted - 1.0)
    );
    assert!((output.tip_m[0] / wanted - 1.0).abs() < 0.01);
    for n in (count - 16..count).step_by(2) {
        let x = tip_m - (n as f64 + 0.5) * spacing_m;
        let there = wanted * (-beta * x).exp() * (beta * x).cos();
        let here = run.state.forces_n(0)[n] / (stiffness_pa * spacing_m);
        assert!((here - there).abs() < 0.01 * wanted, "{x}: {here} {there}");
        let shape = output.needle.across_m(0, tip_m - x, run.state.forces_n(0));
        assert!(
            (shape - here).abs() < 1e-9 * wanted.max(1.0),
            "{x}: the needle is where it is held"
        );
    }
    let held: f64 = run.state.forces_n(0).iter().sum();
    assert!((output.force_on_hand_n[0] - (force_n - held)).abs() < 1e-9);
}

/// A cantilever with a pin at half its length: by the force method the pin takes 2.5 times the force at the end.
#[test]
fn the_hole_of_the_template_does_not_move() {
    let input = BeamInput {
        hand_m: [1e-3, 0.0],
        hand_slope: [0.01, 0.0],
        tip_force_n: [0.1, 0.1],
        ..at(-0.05)
    };
    let output = Run::new(model(1, 1e-3, 1.0, Some(-0.15))).step(&input);
    for side in 0..2 {
        assert!(output.needle.across_m(side, -0.15, &[]).abs() < 1e-15);
    }
    // Free deflection less that of the pin's force at half the length.
    let free = 0.1 * 0.2_f64.powi(3) / (3.0 * EI);
    let reaction = 2.5 * 0.1;
    let by_reaction = reaction * 0.1_f64.powi(2) * (3.0 * 0.2 - 0.1) / (6.0 * EI);
    assert!((output.tip_m[1] - (free - by_reaction)).abs() < 1e-12);
    assert!((output.force_on_hand_n[1] - (0.1 - reaction)).abs() < 1e-12);
}

#[test]
fn a_hole_with_play_leads_only_a_needle_that_lies_at_its_rim() {
    let gap_m = 2e-4;
    let mut run = Run::new(BeamModel {
        gap_m,
        ..model(1, 1e-3, 1.0, Some(-0.15))
    });
    for n in 0..=20 {
        let beside_m = 5e-5 * f64::from(n);
        let output = run.step(&BeamInput {
            hand_m: [beside_m, -beside_m],
            ..at(-0.05)
        });
        let lies = [0, 1].map(|side| output.needle.across_m(side, -0.15, &[]));
        let off_m = lies[0].hypot(lies[1]);
        let free_m = beside_m * 2.0_f64.sqrt();
        assert!((off_m - free_m.min(gap_m)).abs() < 1e-12, "{free_m} {off_m}");
        assert_eq!(output.needle.hole_n == [0.0; 2], free_m <= gap_m);
        assert!(
            output.needle.hole_n[0] <= 0.0 && output.needle.hole_n[1] >= 0.0,
            "it pushes back"
        );
    }
}

/// A bevel bends the needle, the tissue holds it in its track, and a needle that was drawn back cuts a new track.
#[test]
fn a_bevel_steers_and_the_tissue_holds_the_needle_in_its_track() {
    let mut run = Run::new(gland(1e-4));
    let bevel = |tip_m: f64, force_n: f64| BeamInput {
        tip_force_n: [force_n, 0.0],
        ..at(tip_m)
    };
    let mut first = BeamOutput::default();
    for n in 0..=600 {
        first = run.step(&bevel(1e-4 * f64::from(n), 0.15));
    }
    println!("{:.3} mm at 60 mm", 1e3 * first.tip_m[0]);
    assert!(first.tip_m[0] > 1e-4 && first.tip_m[0] < 0.02 && first.tip_m[1].abs() < 1e-9);
    let held = run.step(&at(0.06));
    assert!(
        held.tip_m[0] > 0.3 * first.tip_m[0],
        "bent by its track alone: {held:?}"
    );
    for n in (300..=600).rev() {
        run.step(&at(1e-4 * f64::from(n)));
    }
    let mut other = BeamOutput::default();
    for n in 300..=600 {
        other = run.step(&bevel(1e-4 * f64::from(n), -0.15));
    }
    assert!(other.tip_m[0] < first.tip_m[0] - 1e-4, "to the other side: {other:?}");
    assert!(run.step(&at(f64::NAN)).is_refused);
}

/// Nothing in it knows time: steps as of 0.5 to 123 mm/s leave the tip at one place.
#[test]
fn how_far_a_bevel_steers_does_not_depend_on_speed() {
    let tip_after = |step_m: f64| {
        let mut run = Run::new(gland(1e-4));
        let (mut tip_m, mut last) = (-5e-3, BeamOutput::default());
        while tip_m < 0.07 {
            tip_m = f64::min(tip_m + step_m, 0.07);
            let input = BeamInput {
                tip_force_n: [0.15, 0.1],
                ..at(tip_m)
            };
            last = run.step(&input);
        }
        last.tip_m
    };
    let slow = tip_after(0.5e-6);
    for speed in [1.9e-6, 10e-6, 50e-6, 123e-6] {
        let fast = tip_after(speed);
        let off_m = (fast[0] - slow[0]).hypot(fast[1] - slow[1]);
        println!(
            "{} mm/s: {:.4} mm off {:.3} mm",
            1e6 * speed,
            1e3 * off_m,
            1e3 * slow[0].hypot(slow[1])
        );
        assert!(off_m < 0.05e-3);
    }
}

/// Moves hand, its slope and depth to and fro at random, while the bevel's force comes and goes. The work of hand and
/// bevel is at least what is stored, up to `1 uJ`.
fn worst_excess_j(model: BeamModel, depth_by_m: f64, ticks: u32) -> f64 {
    let mut run = Run::new(model);
    let mut random = Random(5);
    // Tip of a rigid needle across, slope, depth, bevel: at rest first.
    let (mut place, mut goal) = ([0.0; 7], [0.0; 7]);
    let input = |p: &[f64; 7]| BeamInput {
        hand_m: [p[0] - 0.2 * p[2], p[1] - 0.2 * p[3]],
        hand_slope: [p[2], p[3]],
        tip_force_n: [p[5], p[6]],
        ..at(0.05 + p[4])
    };
    let mut before = run.step(&input(&place));
    let (mut excess_j, mut worst_j) = (0.0_f64, 0.0_f64);
    for tick in 0..ticks {
        if tick % 400 == 0 {
            let size = [2e-3, 2e-3, 0.02, 0.02, depth_by_m, 0.2, 0.2];
            goal = std::array::from_fn(|n| size[n] * random.signed());
        }
        let from = place;
        place = std::array::from_fn(|n| place[n] + 0.01 * (goal[n] - place[n]));
        let now = run.step(&input(&place));
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        let mut work_j = -mean(before.axial_n, now.axial_n) * (place[4] - from[4]);
        for side in 0..2 {
            work_j -= mean(before.force_on_hand_n[side], now.force_on_hand_n[side]) * (place[side] - from[side]);
            work_j -= mean(before.moment_nm[side], now.moment_nm[side]) * (place[2 + side] - from[2 + side]);
            let tip_n = mean(from[5 + side], place[5 + side]);
            let whole_m = |sum: f64, tip: f64| run.model.whole_m_per_n * (sum - tip);
            let sum = |o: &BeamOutput| o.needle.hole_n[side] + o.needle.tip_n[side] - o.force_on_hand_n[side];
            let moved = now.tip_m[side] - before.tip_m[side];
            let body = whole_m(sum(&now), place[5 + side]) - whole_m(sum(&before), from[5 + side]);
            work_j += tip_n * (moved - body);
        }
        excess_j = (excess_j + now.stored_j - before.stored_j - work_j).max(0.0);
        worst_j = worst_j.max(excess_j);
        before = now;
    }
    worst_j
}

#[test]
fn a_bent_needle_makes_no_energy() {
    for gap_m in [0.0, 2e-4] {
        let across = worst_excess_j(gland(gap_m), 0.0, 200_000);
        let deep = worst_excess_j(gland(gap_m), 0.02, 200_000);
        println!(
            "play {gap_m} m: {:.4} uJ across, {:.4} uJ with depth",
            1e6 * across,
            1e6 * deep
        );
        assert!(across < 1e-6 && deep < 1e-6);
    }
}

//! Beams with closed forms.

use super::*;

const EI: f64 = 0.016;

fn model(stations: usize, spacing_m: f64, each_m_per_n: f64, template_m: Option<f64>) -> BeamModel {
    let rows = || Rows::new(stations, |i, j| if i == j { each_m_per_n } else { 0.0 });
    BeamModel {
        bending_stiffness_n_m2: EI,
        length_m: 0.2,
        template_m,
        spacing_m,
        across: [rows(), rows()],
    }
}

#[test]
fn a_cantilever_bends_by_the_cube_of_its_length() {
    let model = model(1, 1e-3, 1.0, None);
    let input = BeamInput {
        tip_m: -0.05,
        tip_force_n: [0.1, -0.2],
        ..BeamInput::default()
    };
    let output = step(&model, &mut BeamState::new(&model), &input);
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

/// Hetenyi: at the end of a long beam on springs, `v = 2 P beta / k`; at x from it, `v = 2 P beta / k e^(-beta x) cos(beta x)`.
#[test]
fn a_beam_on_an_elastic_foundation_decays_as_hetenyi_says() {
    let (stiffness_pa, spacing_m, force_n) = (44e3, 1e-3, 0.5);
    let count = 150;
    let model = model(count, spacing_m, 1.0 / (stiffness_pa * spacing_m), None);
    let mut state = BeamState::new(&model);
    let tip_m = count as f64 * spacing_m;
    step(
        &model,
        &mut state,
        &BeamInput {
            tip_m,
            ..BeamInput::default()
        },
    );
    let pushed = BeamInput {
        tip_m,
        tip_force_n: [force_n, 0.0],
        ..BeamInput::default()
    };
    let output = step(&model, &mut state, &pushed);
    let beta = (stiffness_pa / (4.0 * EI)).powf(0.25);
    let wanted = 2.0 * force_n * beta / stiffness_pa;
    println!(
        "decay length {:.1} mm; tip {:.4e}, {wanted:.4e}",
        1e3 / beta,
        output.tip_m[0]
    );
    assert!((output.tip_m[0] / wanted - 1.0).abs() < 0.01);
    for n in (count - 60..count).step_by(7) {
        let x = tip_m - (n as f64 + 0.5) * spacing_m;
        let there = wanted * (-beta * x).exp() * (beta * x).cos();
        let here = state.forces_n(0)[n] / (stiffness_pa * spacing_m);
        assert!((here - there).abs() < 0.01 * wanted, "{x}: {here} {there}");
    }
    let held: f64 = state.forces_n(0).iter().sum();
    assert!((output.force_on_hand_n[0] - (force_n - held)).abs() < 1e-9);
}

/// A cantilever with a pin at half its length: by the force method the pin takes 2.5 times the force at the end.
#[test]
fn the_hole_of_the_template_does_not_move() {
    let model = model(1, 1e-3, 1.0, Some(-0.15));
    let input = BeamInput {
        tip_m: -0.05,
        hand_m: [1e-3, 0.0],
        hand_slope: [0.01, 0.0],
        tip_force_n: [0.1, 0.1],
    };
    let beam = Beam::new(&model, input.tip_m);
    assert!(beam.alone(-0.15, input.tip_m, &input, 0).abs() < 1e-15);
    let output = step(&model, &mut BeamState::new(&model), &input);
    // Free deflection less that of the pin's force at half the length.
    let free = 0.1 * 0.2_f64.powi(3) / (3.0 * EI);
    let reaction = 2.5 * 0.1;
    let by_reaction = reaction * 0.1_f64.powi(2) * (3.0 * 0.2 - 0.1) / (6.0 * EI);
    assert!((output.tip_m[1] - (free - by_reaction)).abs() < 1e-12);
    assert!((output.force_on_hand_n[1] - (0.1 - reaction)).abs() < 1e-12);
}

/// A bevel bends the needle; what the tissue then holds is less than the needle alone would bend by, and the track is kept.
#[test]
fn a_bevel_steers_and_the_track_is_followed_again() {
    let model = model(40, 1.5e-3, 1.0 / (40e3 * 1.5e-3), Some(-0.02));
    let mut state = BeamState::new(&model);
    let at = |tip_m: f64| BeamInput {
        tip_m,
        tip_force_n: [0.15, 0.0],
        ..BeamInput::default()
    };
    let mut first = 0.0;
    for n in 0..=60 {
        first = step(&model, &mut state, &at(1e-3 * f64::from(n))).tip_m[0];
    }
    assert!(first > 1e-4 && first < 0.02, "{first}");
    let track = state.track_m.clone();
    for n in (0..=60).rev().chain(0..=60) {
        let output = step(&model, &mut state, &at(1e-3 * f64::from(n)));
        assert!(output.tip_m[0].is_finite());
    }
    assert_eq!(track, state.track_m, "no new track is cut");
    let bad = BeamInput {
        tip_m: f64::NAN,
        ..BeamInput::default()
    };
    assert!(step(&model, &mut state, &bad).is_refused);
}

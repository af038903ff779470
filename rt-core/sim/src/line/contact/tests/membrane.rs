//! A membrane as a spring between the tip and the body as a whole.

use super::*;

/// Returns a gland that also moves as a whole, which a membrane passes its load on to.
fn on_foundation(layers: &[LineLayer]) -> LineModel {
    let mut model = made_up(30, 1.364e-3, layers, LineSettings::default());
    model.compliance.whole_m_per_n = 1.0 / 1434.0;
    model
}

/// Soft tissue carries 1.6 N under the tip before the depth is reached: the capsule, of 5.6 N, was not felt.
#[test]
fn a_membrane_resists_in_proportion_up_to_its_force() {
    for model in [
        made_up(30, 1.364e-3, &[GLAND], LineSettings::default()),
        on_foundation(&[GLAND]),
    ] {
        let mut state = LineState::new(&model);
        let mut depth_m = 0.0;
        let last_held_n = loop {
            depth_m += 2e-5;
            let before_n = state.last.tip_n;
            let output = step(&model, &mut state, &at(depth_m));
            if output.punctured.is_some() {
                assert!(
                    -output.force_on_hand_n < 0.5 * before_n,
                    "{output:?} after {before_n} N"
                );
                break before_n;
            }
            let wanted_n = GLAND.puncture_force_n * depth_m / GLAND.puncture_depth_m;
            assert!(
                (output.tip_n - wanted_n).abs() < 1e-6 * wanted_n,
                "{} N at {depth_m} m",
                output.tip_n
            );
            // Load of the patch and what goes to the whole add up to what the hand feels.
            let sum_n = state.loads_n().iter().sum::<f64>() + state.whole_n();
            assert!((sum_n + output.force_on_hand_n).abs() < 1e-9);
            assert!(state.whole_n() > 0.0 && state.whole_n() < output.tip_n);
        };
        assert!((last_held_n - GLAND.puncture_force_n).abs() < 0.02, "{last_held_n} N");
        assert!((depth_m - GLAND.puncture_depth_m).abs() < 3e-5, "{depth_m} m");
        assert_eq!((state.whole_n(), state.tip().held_by), (0.0, 0));
    }
}

/// A spring that is stretched where the tip meets it would throw the hand back at once.
#[test]
fn a_membrane_met_in_the_middle_of_a_cut_is_relaxed_there() {
    let inner = LineLayer {
        from_m: 20e-3,
        puncture_force_n: 4.0,
        puncture_depth_m: 6e-3,
        ..GLAND
    };
    let model = on_foundation(&[GLAND, inner]);
    let mut state = LineState::new(&model);
    let (mut last_n, mut met, mut opened) = (0.0, None, None);
    for n in 1..=4000 {
        let tip_m = 1e-5 * f64::from(n);
        let output = step(&model, &mut state, &at(tip_m));
        let change_n = (output.force_on_hand_n - last_n).abs();
        assert!(
            change_n < 0.05 || output.punctured.is_some(),
            "{change_n} N in a tick at {tip_m} m: {output:?}"
        );
        if output.held_by == Some(1) {
            met.get_or_insert(tip_m);
        }
        if output.punctured == Some(1) {
            opened = Some((tip_m, -last_n));
        }
        last_n = output.force_on_hand_n;
    }
    let (met_m, (opened_m, held_n)) = (met.expect("met"), opened.expect("opened"));
    println!(
        "met at {:.2} mm, opened at {:.2} mm, {held_n:.2} N on the hand",
        met_m * 1e3,
        opened_m * 1e3
    );
    assert!((2e-3..7e-3).contains(&(opened_m - met_m)) && held_n > inner.puncture_force_n);
}

/// A tip that stopped within a nanometre before the surface was held by the membrane there and laid no load on it: it
/// went through the body without a force. Encoders bring a needle there where the plan's entry lies on one of their
/// steps.
#[test]
fn a_tip_just_before_the_surface_is_held_as_at_it() {
    let model = on_foundation(&[GLAND]);
    let forces = |stop_m: f64| {
        let mut state = LineState::new(&model);
        let places = (0..=400).map(|n| if n == 100 { stop_m } else { 1e-4 * f64::from(n - 100) });
        let outputs: Vec<_> = places.map(|place_m| step(&model, &mut state, &at(place_m))).collect();
        assert!(outputs.iter().any(|o| o.punctured.is_some()), "stopped at {stop_m} m");
        outputs
    };
    let wanted = forces(0.0);
    for stop_m in [-1e-12, -1e-10, -0.9e-9, -1.1e-9, -1e-8, 1e-12, 1e-9] {
        for (ours, wanted) in forces(stop_m).iter().zip(&wanted) {
            let apart_n = (ours.force_on_hand_n - wanted.force_on_hand_n).abs();
            assert!(apart_n < 1e-4, "stopped at {stop_m} m: {ours:?}, wanted {wanted:?}");
        }
    }
}

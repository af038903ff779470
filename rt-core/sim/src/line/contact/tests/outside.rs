//! Tissue that the probe moves past the needle: to the needle it is as if the hand went the other way.

use super::*;

/// Returns a needle behind its membrane, in a body that does not move whole; with a second membrane on the way that is
/// about to be met.
fn needle_in(settings: LineSettings) -> (LineModel, LineState) {
    let inner = LineLayer { from_m: 8e-3, ..GLAND };
    let model = made_up(30, 1.364e-3, &[GLAND, inner], settings);
    let mut state = LineState::new(&model);
    go(&model, &mut state, &[14e-3, 13.5e-3], 2e-5);
    (model, state)
}

/// Moves all of the line so far within so many ticks, the hand at rest.
fn moved(model: &LineModel, state: &mut LineState, tip_m: f64, by_m: f64, ticks: u32) -> LineOutput {
    state.outside.set(&vec![by_m; 2 * model.compliance.stations], ticks);
    let mut output = step(model, state, &at(tip_m));
    for _ in 1..ticks {
        output = step(model, state, &at(tip_m));
    }
    output
}

#[test]
fn moving_tissue_pulls_like_the_opposite_hand_motion() {
    let (model, state) = needle_in(LineSettings::default());
    for by_m in [0.1e-3, 1e-3, -0.1e-3, -1e-3] {
        let (mut by_tissue, mut by_hand) = (state.clone(), state.clone());
        let ticks = 50;
        let pulled = moved(&model, &mut by_tissue, 13.5e-3, by_m, ticks);
        let mut went = LineOutput::default();
        for n in 1..=ticks {
            went = step(
                &model,
                &mut by_hand,
                &at(13.5e-3 - by_m * f64::from(n) / f64::from(ticks)),
            );
        }
        let change_n = pulled.force_on_hand_n - state.last.force_on_hand_n;
        assert!(change_n * by_m > 0.0, "{change_n} N where tissue moves by {by_m} m");
        assert!(
            (pulled.force_on_hand_n - went.force_on_hand_n).abs() < 1e-6,
            "{pulled:?} {went:?}"
        );
        assert!((by_tissue.tip.material_m - by_hand.tip.material_m).abs() < 1e-8);
        // Forces of needle and hand have stored the same; what moved the tissue has its own account.
        assert!((by_tissue.elastic_j(&model) - by_hand.elastic_j(&model)).abs() < 1e-9);
    }
}

#[test]
fn a_membrane_is_not_stretched_by_what_moves_all_of_the_tissue() {
    let (model, state) = needle_in(LineSettings::default());
    // Moved first, or not: the inner membrane then resists alike.
    let (mut at_rest, mut shifted) = (state.clone(), state);
    let by_m = 0.4e-3;
    moved(&model, &mut shifted, 13.5e-3, by_m, 50);
    for n in 0..400 {
        let place_m = 13.5e-3 + 1e-5 * f64::from(n);
        let [a, b] =
            [(&mut at_rest, place_m - by_m), (&mut shifted, place_m)].map(|(state, m)| step(&model, state, &at(m)));
        // Both slip the same way before they meet it.
        assert!(
            n < 100 || (a.force_on_hand_n - b.force_on_hand_n).abs() < 1e-6,
            "{n}: {a:?} {b:?}"
        );
        assert!(n < 399 || a.held_by == Some(1), "{a:?}");
    }
    // Pushed on against it, then the tissue moves on under both.
    let before = shifted.last;
    let after = moved(&model, &mut shifted, 13.5e-3 + 399e-5 + 0.2e-3, by_m + 0.2e-3, 1);
    assert!(
        (after.force_on_hand_n - before.force_on_hand_n).abs() < 1e-6,
        "{before:?} {after:?}"
    );
}

#[test]
fn motion_that_has_ended_leaves_no_bit() {
    let creep = [
        PronyTerm {
            strength: 0.6,
            time_s: 0.5,
        },
        PronyTerm::default(),
    ];
    for prony in [[PronyTerm::default(); 2], creep] {
        let (model, _) = needle_in(LineSettings {
            prony,
            ..LineSettings::default()
        });
        // Outside of the tissue, so that no friction remembers it.
        let (mut moved_once, mut never) = (LineState::new(&model), LineState::new(&model));
        moved(&model, &mut moved_once, -5e-3, 1e-3, 5);
        assert!(moved_once.outside.is_on());
        moved(&model, &mut moved_once, -5e-3, 0.0, 7);
        assert!(!moved_once.outside.is_on());
        for n in 0..200 {
            let [a, b] = [&mut moved_once, &mut never].map(|state| step(&model, state, &at(5e-5 * f64::from(n))));
            assert_eq!(a.force_on_hand_n.to_bits(), b.force_on_hand_n.to_bits());
        }
    }
}

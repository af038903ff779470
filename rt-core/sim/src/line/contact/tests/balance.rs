//! The balance of energy tick by tick, in tissue that creeps and is folded before the tip.

use super::bits::exact;
use super::creep::{creeping, stored_j};
use super::*;

/// Returns the displacement of the material at `place_m` after the last tick.
fn field_m(model: &LineModel, state: &LineState, place_m: f64) -> f64 {
    let mut weights = [0.0; 64];
    let (m, whole_m) = (
        model.compliance.stations,
        model.compliance.common_m_per_n() * state.whole_n,
    );
    let places = model.tip_weights(place_m.max(0.0), &mut weights).zip(weights);
    let moved_m = places.map(|(n, w)| w * dot(&model.compliance.rows.row(m + n)[..2 * m], &state.loads_n));
    moved_m.sum::<f64>() + whole_m
}

/// In a tick the hand gains at most what folded tissue pays: the tip that cuts goes backwards in the world where the
/// tissue before it is folded. `f (s_k - s_k-1) >= E_k - E_k-1 + F (way of the tip through the tissue as it was)`.
#[test]
fn no_tick_gains_more_than_the_way_through_folded_tissue() {
    for settings in [LineSettings::default(), creeping()] {
        let model = exact(settings);
        let (mut state, mut before) = (LineState::new(&model), LineState::new(&model));
        let (mut stored, mut least_stretch, mut most_j, mut paid_j) = (0.0, 1.0_f64, 0.0_f64, 0.0_f64);
        random_hand(2_000, |is_new, tip_m, by_m| {
            if is_new {
                (state, stored) = (LineState::new(&model), 0.0);
                before.copy_from(&state);
            }
            let output = step(&model, &mut state, &at(tip_m));
            let now = stored_j(&state, &model);
            let gain_j = (now - stored) + output.force_on_hand_n * by_m;
            let [from_m, to_m] = [&before, &state].map(|s| s.tip.material_m);
            let is_in = !before.tip_range.is_empty() && !state.tip_range.is_empty();
            let way_m = to_m + field_m(&model, &before, to_m) - from_m - field_m(&model, &before, from_m);
            let folded_j = if is_in { (-output.tip_n * way_m).max(0.0) } else { 0.0 };
            paid_j = paid_j.max(folded_j);
            most_j = most_j.max(gain_j - folded_j);
            least_stretch = least_stretch.min(output.least_stretch);
            stored = now;
            before.copy_from(&state);
        });
        println!(
            "least stretch {least_stretch:.2}; folded tissue paid up to {:.3} uJ; a tick gained {:.4} uJ beyond that",
            1e6 * paid_j,
            1e6 * most_j
        );
        assert!(most_j < 1e-8, "{most_j} J");
    }
}

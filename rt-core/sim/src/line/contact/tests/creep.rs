//! Tissue that creeps, on a line with membranes.

use super::bits::exact;
use super::*;

const CREEP: [PronyTerm; 2] = [
    PronyTerm {
        strength: 0.6,
        time_s: 0.05,
    },
    PronyTerm {
        strength: 1.0,
        time_s: 0.5,
    },
];

pub fn creeping() -> LineSettings {
    LineSettings {
        prony: CREEP,
        ..LineSettings::default()
    }
}

/// Returns the energy of the tissue under its own loads and the membrane's spring, of that spring, and of the chain.
pub fn stored_j(state: &LineState, model: &LineModel) -> f64 {
    let (m, rows, common) = (
        model.compliance.stations,
        &model.compliance.rows,
        model.compliance.common_m_per_n(),
    );
    let spring_n = whole_n(model, state);
    let mut f = vec![0.0; 2 * m];
    f[..m].copy_from_slice(&state.shaft_n);
    for (n, weight) in state.tip_range.clone().zip(state.tip_weights) {
        f[m + n] = weight * (state.tip.force_n - spring_n);
    }
    let own: f64 = f
        .iter()
        .enumerate()
        .map(|(n, force)| force * dot(rows.row(n), &f))
        .sum();
    let load_n: f64 = f.iter().sum();
    let whole = common * spring_n * (spring_n + 2.0 * load_n);
    let spring = if state.membrane_n_per_m > 0.0 {
        spring_n * spring_n / state.membrane_n_per_m
    } else {
        0.0
    };
    0.5 * (own + whole + spring) + state.memory.stored_j(rows, common, &model.settings.prony)
}

/// Membranes that are no stiffer than what they hold, as in the cycles without creep.
#[test]
fn random_cycles_in_creeping_tissue_make_no_energy() {
    let layers = [
        LineLayer {
            puncture_force_n: 1.2,
            cutting_force_n: 1.5,
            shaft_friction_n_per_m: 80.0,
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
    let model = made_up(30, 1.364e-3, &layers, creeping());
    let worst_j = random_cycles(&model, 10_000, stored_j);
    assert!(worst_j < 1e-6, "{worst_j}");
}

/// A stiff membrane passes load on to the body as a whole, which creeps as well. A tip that met a surface that had
/// crept was held there with the dent of a surface at rest, and the cycles made 99 uJ.
#[test]
fn stiff_membranes_in_tissue_that_creeps_make_no_energy() {
    for settings in [LineSettings::default(), creeping()] {
        let worst_j = random_cycles(&exact(settings), 2_000, stored_j);
        assert!(worst_j < 1e-6, "{worst_j}");
    }
}

/// With what the past leaves, the spring of a membrane and the tissue under it carry the tip between them.
#[test]
fn loads_handed_on_move_the_tissue_to_where_the_needle_has_it() {
    let model = exact(creeping());
    let mut state = LineState::new(&model);
    let rows = &model.compliance.rows;
    for n in 0..3000 {
        let depth_m = 0.03 * (1.0 - (n as f64 / 477.0).cos()) - 1e-3;
        step(&model, &mut state, &at(depth_m));
        for j in 0..state.in_contact {
            let by_loads_m = dot(rows.row(j), &state.loads_n) + model.compliance.common_m_per_n() * state.whole_n;
            assert!(
                (by_loads_m - state.u_m[j]).abs() < 1e-9,
                "{n} {j}: {by_loads_m} {}",
                state.u_m[j]
            );
        }
        let m = model.compliance.stations;
        let tip = |k: usize| dot(rows.row(m + k), &state.loads_n) + model.compliance.common_m_per_n() * state.whole_n;
        let by_loads_m: f64 = state
            .tip_range
            .clone()
            .zip(state.tip_weights)
            .map(|(k, w)| w * tip(k))
            .sum();
        if !state.tip_range.is_empty() {
            assert!(
                (by_loads_m - state.tip_u_m).abs() < 1e-9,
                "{n}: {by_loads_m} {}",
                state.tip_u_m
            );
        }
    }
}

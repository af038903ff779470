//! Features that are off change no bit of a line's output.

use super::*;

/// Digest made with the forces by sets, the surface where it is by then, stations that a membrane relieves, and nothing
/// left to cut in a track; a change of the contact itself changes it.
const BITS: u64 = 0xceb5_7d7d_0d4f_4811;

/// Returns the same as [`made_up`] without functions that round otherwise on another machine.
pub fn exact(settings: LineSettings) -> LineModel {
    let (stations, spacing_m) = (30, 1.364e-3);
    let entry = |i: usize, j: usize| {
        let distance_m = (i % stations).abs_diff(j % stations) as f64 * spacing_m;
        let own = if i == j && i < stations { 0.014 } else { 0.0 };
        1.0 / 1434.0 + 1.0 / (270.0 * (1.0 + (distance_m / 5e-3) * (distance_m / 5e-3))) + own
    };
    let mut compliance = Compliance::from_rows(stations, spacing_m, 4e-3, entry);
    compliance.whole_m_per_n = 1.0 / 1434.0;
    let gland = LineLayer {
        puncture_force_n: 5.6,
        cutting_force_n: 1.5,
        shaft_friction_n_per_m: 80.0,
        ..GLAND
    };
    let layers = [
        gland,
        LineLayer {
            from_m: 17e-3,
            puncture_force_n: 2.0,
            cutting_force_n: 0.8,
            shaft_friction_n_per_m: 40.0,
            ..GLAND
        },
    ];
    LineModel::new(compliance, &layers, settings).expect("valid")
}

#[test]
fn rate_terms_that_are_off_leave_every_bit_as_it_was() {
    let model = exact(LineSettings::default());
    let mut state = LineState::new(&model);
    let mut random = Random(23);
    let (mut tip_m, mut hash, mut trace) = (-1e-3, 0xcbf2_9ce4_8422_2325_u64, Vec::new());
    for cycle in 0..300 {
        if cycle % 50 == 0 {
            state.reset();
            tip_m = -1e-3;
        }
        let end_m = 45e-3 * random.unit() - 2e-3;
        let speed = 2e-4 * random.unit() + 1e-5;
        while tip_m != end_m {
            tip_m += f64::clamp(end_m - tip_m, -speed, speed);
            let output = step(&model, &mut state, &at(tip_m));
            let own = [
                output.force_on_hand_n,
                output.tip_material_m,
                state.whole_n(),
                state.elastic_j(&model),
            ];
            for value in own.iter().chain(state.loads_n()) {
                hash = (hash ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3);
            }
            if tip_m == end_m && cycle % 5 == 0 {
                trace.push([&[f64::from(cycle), tip_m][..], &own].concat());
            }
        }
    }
    let columns = [
        "cycle",
        "tip_m",
        "force_on_hand_n",
        "tip_material_m",
        "whole_n",
        "elastic_j",
    ];
    let path = "rt-core/sim/src/line/contact/tests/bits.csv";
    assert_eq!(stylet_test_kit::trace::first_difference(path, &columns, &trace), None);
    assert_eq!(hash, BITS, "less than the trace shows: {hash:#x}");
}

/// Each tick used to make a scratch of 17 KB of zeros. What another line has left in one is never read.
#[test]
fn a_scratch_that_another_line_has_used_changes_no_bit() {
    let settings = LineSettings::default();
    let membrane = LineLayer {
        puncture_force_n: 3.0,
        ..GLAND
    };
    let models = [
        exact(settings),
        made_up(
            40,
            1e-3,
            &[
                GLAND,
                LineLayer {
                    from_m: 20e-3,
                    ..membrane
                },
            ],
            settings,
        ),
    ];
    let mut shared = Scratch::new();
    let mut states = models
        .each_ref()
        .map(|model| [LineState::new(model), LineState::new(model)]);
    let (mut random, mut tips_m, mut ends_m) = (Random(5), [-1e-3; 2], [-1e-3; 2]);
    for tick in 0..40_000 {
        let n = tick % 2;
        if tips_m[n] == ends_m[n] {
            ends_m[n] = 45e-3 * random.unit() - 2e-3;
        }
        tips_m[n] += f64::clamp(ends_m[n] - tips_m[n], -1.5e-4, 1.5e-4);
        let [alone, together] = &mut states[n];
        let input = at(tips_m[n]);
        let expected = step(&models[n], alone, &input);
        assert_eq!(
            step_in(&models[n], together, &input, &mut shared),
            expected,
            "tick {tick}"
        );
    }
    for [alone, together] in &states {
        assert_eq!(alone, together);
    }
}

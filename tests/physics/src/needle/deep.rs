//! A needle in tissue that is pushed aside, reversed, weighed and slowed: whole-loop cases that write their own rows.

use super::*;
use crate::rig::hand_envelope;
use crate::rows::{Row, keep};

/// Two steps of the encoders: an oscillation that they can resolve.
const SEEN_M: f64 = 6e-5;

/// Returns the widest swing of the tip along x within a quarter of a second, about its mean path.
fn to_and_fro_m(places: &[f64]) -> f64 {
    let swing = |part: &[f64]| {
        let (low, high) = part
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        high - low - (part[part.len() - 1] - part[0]).abs()
    };
    places.chunks(250).map(swing).fold(0.0, f64::max)
}

/// 45 mm deep, a hand of the envelope pushes 4 mm aside, and later back to the path.
#[test]
fn no_hand_sings_that_pushes_a_deep_needle_aside() {
    let mut theatre = Theatre::of(TissueKind::ChainMail);
    let (mut singing, mut widest_m, mut most_n, mut count) = (0, 0.0_f64, 0.0_f64, 0);
    for late_ticks in [0, 3] {
        for hand in hand_envelope() {
            let mut world = theatre.world.take().expect("given back");
            world.tissue.return_to_rest();
            let faults = LinkFaults {
                late_ticks,
                ..LinkFaults::default()
            };
            let line = (theatre.start, theatre.line.clone());
            let mut session = Session::on_line(world, line, (Hand::steady(), faults), ForceParameters::default());
            let deep = theatre.start + Vector3::z() * 50e-3;
            session.go_to(deep, 0.05);
            session.run(1.5);
            session.set_hand(hand);
            session.go_to(deep + Vector3::x() * 4e-3, 0.1);
            let mut places = Vec::new();
            for tick in 0..3000 {
                let output = session.step();
                most_n = most_n.max(output.terms.guide_n.norm());
                if tick >= 2000 {
                    places.push(session.true_tip_in_world().x);
                }
            }
            session.go_to(deep, 0.1);
            session.run(1.0);
            places.extend((0..500).map(|_| {
                session.step();
                session.true_tip_in_world().x
            }));
            let swing_m = to_and_fro_m(&places);
            widest_m = widest_m.max(swing_m);
            singing += usize::from(swing_m > SEEN_M);
            count += 1;
            theatre.world = Some(session.into_world());
        }
    }
    keep(&Row {
        number: 36,
        case: "4 mm aside and back, 45 mm deep, 27 hands, 0 and 3 ticks late",
        model: "needle line",
        should: "none oscillates",
        happened: format!(
            "{singing} of {count}; widest swing {:.3} mm, guide up to {most_n:.2} N",
            widest_m * 1e3
        ),
        met: singing == 0,
        warning: "",
    });
    assert!(most_n > 0.1, "the needle was not pushed aside: {most_n} N");
}

/// With eq. 6 ChainMail had 37 % more displacement at 3 mm after 6 mm than on the way there.
#[test]
fn an_unfinished_puncture_is_reversible() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut at = |turn_m: Option<f64>| {
            let mut needle = theatre.begin();
            if let Some(turn_m) = turn_m {
                needle.go_to(turn_m, 0.02);
            }
            let ticks = needle.go_to(3e-3, 0.02);
            let found = (
                needle.displacement_m(),
                rest_n(&ticks),
                ticks[ticks.len() - 1].true_tip_m,
            );
            theatre.end(needle);
            found
        };
        let (direct, after) = (at(None), at(Some(6e-3)));
        // The hand itself ends elsewhere when it comes from the other side: by the distance that the tissue moved with
        // it.
        let surface_m = theatre.start.z + 5e-3;
        let share = |found: (f64, f64, f64)| found.0 / (found.2 - surface_m);
        let more = 100.0 * (share(after) / share(direct) - 1.0);
        keep(&Row {
            number: 37,
            case: "to 3 mm; to 6 mm and back to 3 mm",
            model: kind.name(),
            should: "displacement per millimetre of needle equal to 5 %",
            happened: format!(
                "{:.2} mm with the tip at {:.2} mm, {:.2} mm at {:.2} mm: {more:+.1} %; {:.2} and {:.2} N",
                direct.0 * 1e3,
                (direct.2 - surface_m) * 1e3,
                after.0 * 1e3,
                (after.2 - surface_m) * 1e3,
                direct.1,
                after.1
            ),
            met: more.abs() <= 5.0,
            warning: "",
        });
    }
}

/// Slip is solved in the force loop: the rate of the tissue affects the picture, not the force.
#[test]
fn the_rate_of_the_tissue_loop_is_not_felt() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut at = |tissue_every: u64| {
            let mut needle = theatre.begin_with(ForceParameters::default(), tissue_every);
            let forces: Vec<f64> = needle
                .go_to(45e-3, 0.05)
                .iter()
                .map(|t| t.output.wrench.force_n.z)
                .collect();
            let moved_m = needle.displacement_m();
            theatre.end(needle);
            (forces, moved_m)
        };
        let [usual, twice, half] = [HAPTIC_TICKS_PER_TISSUE_TICK, 2, 2 * HAPTIC_TICKS_PER_TISSUE_TICK].map(&mut at);
        let apart_n = |other: &[f64]| {
            usual
                .0
                .iter()
                .zip(other)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max)
        };
        let (most_n, most_m) = (
            apart_n(&twice.0).max(apart_n(&half.0)),
            (twice.1 - usual.1).abs().max((half.1 - usual.1).abs()),
        );
        keep(&Row {
            number: 38,
            case: "tissue at 500, 200 and 100 Hz, 0 to 45 mm",
            model: kind.name(),
            should: "the same force to 0.02 N and displacement to 0.1 mm",
            happened: format!("force {most_n:.4} N apart, displacement {:.3} mm", most_m * 1e3),
            met: most_n < 0.02 && most_m < 0.1e-3,
            warning: "",
        });
    }
}

/// F_G with 0.2 kg, the mass of a handle: in a real workshop the supporting spring pays for lifting the handle, so it
/// is no energy debt.
#[test]
fn a_handle_that_is_carried_may_be_lifted() {
    let weighed = ForceParameters {
        compensated_mass_kg: 0.2,
        ..ForceParameters::default()
    };
    let mut theatre = Theatre::of(TissueKind::ChainMail);
    let mut forces_n = Vec::new();
    let mut words = Vec::new();
    let (mut met, mut weight_n) = (true, 0.0);
    for force in [ForceParameters::default(), weighed] {
        let mut needle = theatre.begin_with(force, HAPTIC_TICKS_PER_TISSUE_TICK);
        let mut owed_j = 0.0_f64;
        let mut go = |needle: &mut Insertion, depth_m: f64| {
            let ticks = needle.go_to(depth_m, 0.05);
            owed_j = owed_j.max(-needle.session.chain().gate.passivity().energy_j());
            let in_debt = needle.session.chain().gate.counts().passivity;
            (
                ticks[ticks.len() - 1].output.wrench.force_n.z,
                ticks[ticks.len() - 1].work_j,
                in_debt,
            )
        };
        let (_, begun_j, _) = go(&mut needle, -10e-3);
        // Gravity points along -z: away from the tissue is down.
        go(&mut needle, -60e-3);
        let (free_n, ended_j, free_debt) = go(&mut needle, -10e-3);
        let (deep_n, _, _) = go(&mut needle, 45e-3);
        go(&mut needle, 20e-3);
        let (again_n, _, debt) = go(&mut needle, 45e-3);
        theatre.end(needle);
        words.push(format!(
            "{:.1} kg: free {free_n:.2} N, {:.2} mJ given in a closed lift; 45 mm deep {deep_n:.2} and {again_n:.2} N; {free_debt} and {debt} ticks of debt, {:.1} mJ owed",
            force.compensated_mass_kg,
            (ended_j - begun_j) * 1e3,
            owed_j * 1e3
        ));
        weight_n = 0.9 * 9.81 * force.compensated_mass_kg;
        met &= (free_n - weight_n).abs() < 0.05 && (ended_j - begun_j) < 1e-3 && free_debt == 0;
        forces_n.push(again_n - weight_n);
    }
    met &= (forces_n[0] - forces_n[1]).abs() < 0.1;
    keep(&Row {
        number: 39,
        case: "F_G off and on: handle lowered and lifted by 50 mm, free and in tissue",
        model: "needle line",
        should: "F_G is felt, is no debt, and changes nothing else",
        happened: words.join("; "),
        met,
        warning: "",
    });
    assert!(weight_n > 1.0);
}

/// Follows its path to a micrometre at any force.
const GUIDED: Hand = Hand {
    mass_kg: 0.5,
    damping_n_s_per_m: 1e4,
    stiffness_n_per_m: 1e6,
    effort: None,
};

/// Tissue, membrane and friction together, in the whole loop: the hand receives the energy that it supplied, minus that
/// of cutting and slip.
#[test]
fn a_closed_insertion_gives_the_hand_no_more_than_it_took() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let (mut words, mut most_j) = (Vec::new(), f64::MIN);
        for (depth_m, inwards, outwards) in [
            (6e-3, 0.05, 0.05),
            (45e-3, 0.01, 0.123),
            (45e-3, 0.123, 0.01),
            (45e-3, 0.05, 0.05),
        ] {
            let mut needle = theatre.begin();
            needle.session.set_hand(GUIDED);
            let begun_j = needle.go_to(-4e-3, 0.05).last().expect("ticks").work_j;
            let mut given_j = 0.0;
            for (goal_m, speed) in [(depth_m, inwards), (-4e-3, outwards)] {
                for tick in needle.go_to(goal_m, speed) {
                    given_j = tick.work_j - begun_j;
                    most_j = most_j.max(given_j);
                }
            }
            words.push(format!("{:.0} mm {:+.1} mJ", depth_m * 1e3, given_j * 1e3));
            theatre.end(needle);
        }
        keep(&Row {
            number: 44,
            case: "closed insertions: 6 and 45 mm deep, in and out at 10 to 123 mm/s; the hand does not yield",
            model: kind.name(),
            should: "at most 0.1 mJ more to the hand than it gave",
            happened: format!("{}; never more than {:+.3} mJ", words.join("; "), most_j * 1e3),
            met: most_j <= 1e-4,
            warning: "",
        });
    }
}

//! ChainMail carried by the columns of its line's coarser body: what is left out where nothing changed, and what it costs.

use super::*;
use std::time::Instant;
use stylet_sim::line::BodyAnswer;

/// Ticks of the force loop: in to 30 mm at 50 mm/s, and then at rest.
const IN: usize = 1_000;
const TICKS: usize = 2_500;

#[derive(Clone, Copy, PartialEq)]
enum Way {
    AsItIs,
    /// Added up in every tick.
    Always,
    /// No columns.
    Never,
}

/// Time of each tick of the force loop with one of the tissue loop's, and displacements after it.
fn session(stage: &mut Stage, way: Way) -> (Vec<(usize, f64)>, Vec<[u64; 3]>) {
    let run = NeedleRun {
        drops_m: vec![needle().entry_m + Vector3::z() * 0.04],
        ..needle()
    };
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    let active = activate(&set, &stage.device).expect("valid");
    let mut lines = stage.lines(&run, false, &stop).expect("a line");
    if way == Way::Never {
        lines[0].body.answer = BodyAnswer::Carrying(Vec::new());
    }
    let mut rig = stage.rig(&run, &active).expect("a body");
    rig.take_lines(lines);
    rig.engage();
    rig.move_hand(&stylet_shm_schema::HandMove {
        tip_m: run.drops_m[0].into(),
        direction: run.direction.into(),
        speed_m_per_s: run.insert_m_per_s,
        acceleration_m_per_s2: run.acceleration_m_per_s2,
    });
    let (mut times_us, mut places) = (Vec::new(), Vec::new());
    for n in 0..TICKS {
        if way == Way::Always {
            rig.forget_carry();
        }
        let begun = Instant::now();
        if rig.tick() {
            times_us.push((n, begun.elapsed().as_nanos() as f64 / 1e3));
            let body = rig.deformed();
            places.extend([0, 5_000, 9_000].map(|e| body.position_m(e).map(f64::to_bits)));
        }
    }
    stage.world = Some(rig.into_world());
    (times_us, places)
}

#[test]
fn what_is_left_out_of_a_tick_in_which_nothing_changed_changes_no_bit() {
    let mut stage = stage();
    let (_, as_it_is) = session(&mut stage, Way::AsItIs);
    let (_, always) = session(&mut stage, Way::Always);
    assert!(as_it_is == always);
    assert!(as_it_is[0] != as_it_is[as_it_is.len() - 3]);
}

/// `cargo test --release -p stylet-runtime --lib carrying -- --ignored --nocapture`; the least of some rounds, each tick by itself.
#[test]
#[ignore = "times"]
fn times_of_a_tick_that_carries() {
    let mut stage = stage();
    let ways = [
        ("never", Way::Never),
        ("always", Way::Always),
        ("as it is", Way::AsItIs),
    ];
    let mut least: Vec<Vec<(usize, f64)>> = vec![Vec::new(); ways.len()];
    for _ in 0..6 {
        for ((_, way), least) in ways.iter().zip(&mut least) {
            let (times, _) = session(&mut stage, *way);
            if least.is_empty() {
                *least = times;
            } else {
                least.iter_mut().zip(times).for_each(|(a, b)| a.1 = a.1.min(b.1));
            }
        }
    }
    for ((name, _), least) in ways.iter().zip(&least) {
        for (phase, part) in [("going in", 300..IN), ("at rest", 1_700..TICKS)] {
            let mut us: Vec<f64> = least
                .iter()
                .filter(|(n, _)| part.contains(n))
                .map(|(_, us)| *us)
                .collect();
            us.sort_by(f64::total_cmp);
            let at = |q: f64| us[((us.len() - 1) as f64 * q).round() as usize];
            println!(
                "{name}, {phase}: p50 {:.1}, p99 {:.1}, max {:.1} us",
                at(0.5),
                at(0.99),
                at(1.0)
            );
        }
    }
}

//! ChainMail carried by the columns of its line's coarser body: work skipped when nothing changed, and its cost.

use super::*;
use std::time::Instant;
use stylet_sim::line::BodyAnswer;

/// A body, a needle into it, and the force-loop ticks until it is in at 50 mm/s. Then it rests.
struct Theatre {
    stage: Stage,
    run: NeedleRehearsal,
    going: usize,
}

impl Theatre {
    fn paper() -> Self {
        let run = NeedleRehearsal {
            drops_m: vec![(Vector3::from(needle().entry_m) + Vector3::z() * 0.04).into()],
            ..needle()
        };
        Theatre {
            stage: stage(),
            run,
            going: 1_000,
        }
    }

    /// A needle from before the skin to the same depth in the gland.
    fn pelvis() -> Self {
        let paper = Self::paper();
        let source = SceneSource::Builtin("pelvis".to_owned());
        let scene = source.build().expect("built in");
        let before_m = paper.run.entry_m[2] - (scene.lattice.bounds_m().0[2] - 0.01);
        let stage = Stage::build(&source, TissueKind::ChainMail, DeviceInfo::phantom_premium_1_5());
        Theatre {
            stage: stage.expect("built in"),
            run: NeedleRehearsal {
                entry_m: (Vector3::from(paper.run.entry_m) - Vector3::z() * before_m).into(),
                ..paper.run
            },
            going: paper.going + (before_m / 0.05 * 1e3) as usize,
        }
    }
}

const RESTING: usize = 1_500;

#[derive(Clone, Copy, PartialEq)]
enum Way {
    AsItIs,
    /// Summed in every tick.
    Always,
    /// No columns.
    Never,
}

/// Returns the time of each force-loop tick with one tissue tick, and the displacements after it.
fn session(theatre: &mut Theatre, way: Way) -> (Vec<(usize, f64)>, Vec<[u64; 3]>) {
    let Theatre { stage, run, going } = theatre;
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    let active = activate(&set, &stage.device).expect("valid");
    let mut lines = stage.lines(run, false, &stop).expect("a line");
    if way == Way::Never {
        lines[0].body.answer = BodyAnswer::Carrying(Vec::new());
    }
    let mut rig = stage.rig(run, &active).expect("a body");
    rig.take_lines(lines);
    rig.engage();
    rig.move_hand(&stylet_shm_schema::HandMove {
        tip_m: run.drops_m[0],
        direction: run.direction,
        speed_m_per_s: run.insert_m_per_s,
        acceleration_m_per_s2: run.acceleration_m_per_s2,
    });
    let (mut times_us, mut places) = (Vec::new(), Vec::new());
    for n in 0..*going + RESTING {
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
    let mut theatre = Theatre::paper();
    let (_, as_it_is) = session(&mut theatre, Way::AsItIs);
    let (_, always) = session(&mut theatre, Way::Always);
    assert!(as_it_is == always);
    assert!(as_it_is[0] != as_it_is[as_it_is.len() - 3]);
}

/// `cargo test --profile quick -p stylet-runtime --lib carrying -- --ignored --nocapture`; the minimum over some rounds
/// for each tick.
#[test]
#[ignore = "times"]
fn times_of_a_tick_that_carries() {
    for (scene, theatre) in [("paper", Theatre::paper()), ("pelvis", Theatre::pelvis())] {
        times(scene, theatre);
    }
}

fn times(scene: &str, mut theatre: Theatre) {
    let ways = [
        ("never", Way::Never),
        ("always", Way::Always),
        ("as it is", Way::AsItIs),
    ];
    let mut least: Vec<Vec<(usize, f64)>> = vec![Vec::new(); ways.len()];
    for _ in 0..6 {
        for ((_, way), least) in ways.iter().zip(&mut least) {
            let (times, _) = session(&mut theatre, *way);
            if least.is_empty() {
                *least = times;
            } else {
                least.iter_mut().zip(times).for_each(|(a, b)| a.1 = a.1.min(b.1));
            }
        }
    }
    for ((name, _), least) in ways.iter().zip(&least) {
        for (phase, part) in [
            ("going in", theatre.going - 700..theatre.going),
            ("at rest", theatre.going + 700..theatre.going + RESTING),
        ] {
            let mut us: Vec<f64> = least
                .iter()
                .filter(|(n, _)| part.contains(n))
                .map(|(_, us)| *us)
                .collect();
            us.sort_by(f64::total_cmp);
            let at = |q: f64| us[((us.len() - 1) as f64 * q).round() as usize];
            println!(
                "{scene}, {name}, {phase}: p50 {:.1}, p99 {:.1}, max {:.1} us",
                at(0.5),
                at(0.99),
                at(1.0)
            );
        }
    }
}

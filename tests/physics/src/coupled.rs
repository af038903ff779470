//! Coupled mode: the force from 200 Hz answers against the tissue solved at every tick, over one insertion.

use nalgebra::Vector3;
use stylet_benches::session::{Session, axis_start};
use stylet_hw::{Hand, LinkFaults};
use stylet_runtime::rt::world::World;
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;
use stylet_sim::scene::TissueKind;

/// Follows its path to a micrometre at any force, so that two sessions have the same motion.
const GUIDED: Hand = Hand {
    mass_kg: 0.5,
    damping_n_s_per_m: 1e4,
    stiffness_n_per_m: 1e6,
    effort: None,
};

fn world(fem: bool) -> World {
    let kind = if fem { TissueKind::Fem } else { TissueKind::ChainMail };
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    World::new(scene, kind, limits, 1).expect("the paper's gland can be solved")
}

/// Returns the forces of the tissue along the path by tick: as used by the haptic loop, and as answered by the body
/// just now.
fn forces(fem: bool, tissue_every: u64, seconds: f64) -> Vec<(f64, f64, f64)> {
    let world = world(fem);
    let (start, stiffness) = (axis_start(&world), 700.0);
    let coupled = ForceParameters {
        coupling: 1.0,
        ..ForceParameters::default()
    };
    let hand = (GUIDED, LinkFaults::default());
    let mut session = Session::over_link(Box::new(world), start, hand, coupled, tissue_every);
    session.go_to(start + Vector3::z() * 0.04, 0.048);
    let ticks = (seconds * 1e3) as usize;
    (0..ticks)
        .map(|_| {
            let output = session.step();
            let local = session.response().local;
            let answer = local.force_n.unwrap_or(local.displacement_m * -stiffness);
            (output.terms.tissue_n.z, answer.z, output.wrench.force_n.z)
        })
        .collect()
}

fn compare(name: &str, fem: bool, seconds: f64) {
    let carried = forces(fem, 5, seconds);
    let solved = forces(fem, 1, seconds);
    let errors: Vec<f64> = carried.iter().zip(&solved).map(|(a, b)| a.0 - b.1).collect();
    let stairs: Vec<f64> = carried.iter().zip(&solved).map(|(a, b)| a.1 - b.1).collect();
    let rms = |e: &[f64]| (e.iter().map(|x| x * x).sum::<f64>() / e.len() as f64).sqrt();
    let max = |e: &[f64]| e.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let largest = solved.iter().map(|s| s.1.abs()).fold(0.0, f64::max);
    let steps = |of: fn(&(f64, f64, f64)) -> f64| {
        carried
            .windows(2)
            .map(|w| (of(&w[1]) - of(&w[0])).abs())
            .fold(0.0, f64::max)
    };
    let (law_step, device_step) = (steps(|f| f.0), steps(|f| f.2));
    println!(
        "{name}: up to {largest:.2} N; carried on: RMS {:.4} N, max {:.4} N; held: RMS {:.4} N, max {:.4} N; \
         largest step {law_step:.4} N in the law, {device_step:.4} N at the device",
        rms(&errors),
        max(&errors),
        rms(&stairs),
        max(&stairs)
    );
    assert!(largest > 2.0, "{name}: the tissue answers with {largest} N");
    assert!(rms(&errors) < rms(&stairs), "{name}: no better than holding the answer");
    assert!(
        device_step <= 0.5 + 1e-9,
        "{name}: a step of {device_step} N at the device"
    );
}

#[test]
fn chainmail_answers_carried_on_are_near_those_of_every_tick() {
    compare("ChainMail", false, 1.2);
}

#[test]
fn fem_answers_carried_on_are_near_those_of_every_tick() {
    compare("FEM", true, 0.6);
}

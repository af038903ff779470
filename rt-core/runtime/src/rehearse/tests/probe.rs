//! The ultrasound probe in both loops: it moves the gland, the needle and the seeds, and releases them.

use super::*;
use crate::rt::exchange::{HapticOrder, TissueOrder};
use crate::rt::pose::TipPose;
use crate::rt::second::{SecondLoop, SecondMemory, gate_of, wire};
use crate::rt::tissue::TissueLoop;
use crate::rt::wiring::{Capacities, Wiring};
use std::time::Instant;
use stylet_hw::{HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_sim::probe::{BodyProbe, ProbePose};
use stylet_sim::scene::Role;

const BEYOND_M: f64 = 35e-3;
/// Depth at which the wall on either side pushes the probe equally.
const BALANCED_M: f64 = 7e-3;

struct Theatre {
    stage: Stage,
    run: NeedleRehearsal,
    probe: BodyProbe,
}

impl Theatre {
    fn new(tissue: TissueKind) -> Self {
        let source = SceneSource::Builtin("pelvis".to_owned());
        let scene = source.build().expect("built in");
        let stage = Stage::build(&source, tissue, DeviceInfo::phantom_premium_1_5()).expect("built in");
        let begun = Instant::now();
        let body = stage.lines.as_ref().expect("it has lines");
        // Folder of answers that `rt-core probe` has saved, for a measurement.
        let kept = std::env::var_os("PROBE_KEPT");
        let kept = kept.and_then(|folder| body.kept_probe(Default::default(), folder.as_ref()).expect("sound"));
        let probe = kept.unwrap_or_else(|| body.prepare_probe(Default::default(), &mut |_| true).expect("a rectum"));
        println!(
            "probe for {} ready after {:.1?}, {:?} bytes",
            tissue.name(),
            begun.elapsed(),
            probe.ready().bytes()
        );
        let (low, high) = scene.target_bounds_m();
        let (outside, _) = scene.lattice.bounds_m();
        let middle = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
        let entry_m = [middle[0] + 8e-3, middle[1] - 5e-3, outside[2] - 10e-3];
        let run = NeedleRehearsal {
            entry_m,
            drops_m: vec![[entry_m[0], entry_m[1], middle[2] + 10e-3]],
            ..needle()
        };
        Theatre { stage, run, probe }
    }

    fn rig(&mut self, with_needle: bool) -> Rig {
        let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
        let active = activate(&set, &self.stage.device).expect("valid");
        let lines = if with_needle {
            self.stage.lines(&self.run, false, &stop).expect("a line")
        } else {
            Vec::new()
        };
        let mut rig = self.stage.rig(&self.run, &active).expect("a body");
        rig.take_lines(lines);
        rig.engage();
        rig
    }

    /// Moves the hand to the first drop.
    fn insert(&self, rig: &mut Rig) {
        rig.move_hand(&stylet_shm_schema::HandMove {
            tip_m: self.run.drops_m[0],
            direction: self.run.direction,
            speed_m_per_s: self.run.insert_m_per_s,
            acceleration_m_per_s2: self.run.acceleration_m_per_s2,
        });
    }

    fn pose(&self, pressed_m: f64, beyond_m: f64) -> ProbePose {
        let body = self.stage.lines.as_ref().expect("it has lines");
        let ready = self.probe.ready();
        ready
            .wall
            .pose_below_target(&body.scene, &ready.shape, pressed_m, beyond_m)
    }
}

/// Mean displacement of the target, and every element's, m.
fn moved(rig: &Rig, theatre: &Theatre) -> (Vector3<f64>, Vec<[f64; 3]>) {
    let body = rig.deformed();
    let of: Vec<[f64; 3]> = (0..body.lattice.element_count() as u32)
        .map(|e| {
            let (at, rest) = (body.position_m(e), body.lattice.rest_m(e));
            [0, 1, 2].map(|c| at[c] - rest[c])
        })
        .collect();
    (theatre.stage.target.mean_m(body), of)
}

#[test]
fn a_probe_presses_the_gland_and_lets_it_go() {
    let mut theatre = Theatre::new(TissueKind::ChainMail);
    let mut rig = theatre.rig(false);
    let rest = moved(&rig, &theatre).1;
    rig.take_probe(Box::new(theatre.probe.clone()));
    let press = |rig: &mut Rig, pressed_m: f64, beyond_m: f64, ticks: usize| {
        rig.tissue().move_probe(theatre.pose(pressed_m, beyond_m));
        let mut left = ticks;
        while left > 0 {
            left -= usize::from(rig.tick());
        }
    };
    for n in 0..=40 {
        press(&mut rig, 0.0, BEYOND_M - 0.12 + 3e-3 * f64::from(n), 1);
    }
    for n in 1..=40 {
        press(&mut rig, 0.25e-3 * f64::from(n), BEYOND_M, 1);
    }
    let response = *rig.tissue().probe_response().expect("a probe");
    let (gland, _) = moved(&rig, &theatre);
    println!(
        "pressed 10 mm: {:.2?} N, target moved {:.2?} mm",
        response.wrench.force_n(),
        (gland * 1e3).as_slice()
    );
    assert!(response.wrench.force_n()[1] < -1.0 && gland.y > 1e-3);
    press(&mut rig, 0.0, BEYOND_M - 0.2, 1);
    assert_eq!(rig.tissue().probe_response().expect("a probe").contacts, 0);
    press(&mut rig, 0.0, BEYOND_M - 0.2, 100);
    let (_, after) = moved(&rig, &theatre);
    let farthest = rest
        .iter()
        .zip(&after)
        .flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
    assert!(farthest.fold(0.0, f64::max) <= 1e-9);
    theatre.stage.world = Some(rig.into_world());
}

/// Tissue of the gland that the probe moves past a needle held still pulls the needle in the same direction.
#[test]
fn a_needle_in_the_gland_feels_the_probe() {
    let mut theatre = Theatre::new(TissueKind::ChainMail);
    let mut rig = theatre.rig(true);
    rig.take_probe(Box::new(theatre.probe.clone()));
    theatre.insert(&mut rig);
    let press = |rig: &mut Rig, from_m: [f64; 2], to_m: [f64; 2], ticks: u32| {
        for n in 1..=ticks {
            let part = f64::from(n) / f64::from(ticks);
            let [pressed_m, beyond_m] = [0, 1].map(|c| from_m[c] + part * (to_m[c] - from_m[c]));
            rig.tissue().move_probe(theatre.pose(pressed_m, beyond_m));
            while !rig.tick() {}
        }
    };
    press(
        &mut rig,
        [BALANCED_M, BEYOND_M - 0.2],
        [BALANCED_M, BEYOND_M - 0.2],
        700,
    );
    let alone_n = rig.state().force_on_hand_n[2];
    assert!(
        rig.response().line != 0 && alone_n < -0.1,
        "in tissue on its line: {alone_n}"
    );
    press(&mut rig, [BALANCED_M, BEYOND_M - 0.2], [BALANCED_M, BEYOND_M], 200);
    let lies_n = rig.state().force_on_hand_n[2];
    press(&mut rig, [BALANCED_M, BEYOND_M], [12e-3, BEYOND_M], 50);
    let pressed_n = rig.state().force_on_hand_n[2];
    let mut rows_m = [0.0; 64];
    let generation = rig.response().line;
    let rows = rig
        .tissue()
        .pressed()
        .expect("a probe")
        .displace_line(generation, &mut rows_m);
    // In front of the gland the tissue moves the other way, and hardly holds the needle.
    let scene = stylet_sim::scene::Scene::builtin("pelvis").expect("built in");
    let line = stylet_sim::line::Line::into_body(&scene.lattice, theatre.run.entry_m, theatre.run.direction);
    let line = line.expect("into the body");
    let in_gland = rows_m[..(rows / 2).min(20)].iter().enumerate().filter(|(n, _)| {
        let element = scene
            .lattice
            .element_at_rest(line.point_m((*n as f64 + 0.5) * 4e-3, [0.0; 2]));
        element.is_some_and(|e| scene.structures[usize::from(scene.lattice.structure(e))].role == Role::Target)
    });
    let shaft: Vec<f64> = in_gland.map(|(_, m)| *m).collect();
    let mean_m = shaft.iter().sum::<f64>() / shaft.len() as f64;
    println!(
        "{alone_n:.3} N alone, {lies_n:.3} N beside the probe, {pressed_n:.3} N pressed; the shaft's tissue moves by {:.3} mm",
        1e3 * mean_m
    );
    assert!((pressed_n - lies_n) * mean_m > 0.0 && (pressed_n - lies_n).abs() > 0.01);
    theatre.stage.world = Some(rig.into_world());
}

/// The second device's own loop, five ticks for each tissue tick, on the ports of a run.
#[test]
fn the_second_hand_presses_the_gland_and_feels_it() {
    let mut theatre = Theatre::new(TissueKind::ChainMail);
    let start = theatre.pose(BALANCED_M, BEYOND_M - 0.12);
    let info = DeviceInfo {
        simulated: true,
        ..theatre.stage.device
    };
    let device = SimulatedPhantom::new(SimulatedPhantomConfig {
        info,
        hand: Hand::steady(),
        start_tip_in_world: start.tip_m.into(),
        start_direction: start.axis.into(),
        ..SimulatedPhantomConfig::default()
    });
    let memory = SecondMemory::new(&info, gate_of(&Default::default(), &info), false);
    let (ports, tissue_ports, mut control) = wire(Capacities::STEPPED, None);
    let mut wiring = Wiring::new(Capacities::STEPPED, None, None);
    wiring.tissue.second = Some(tissue_ports);
    let world = theatre.stage.world.take().expect("a body");
    let mut tissue = TissueLoop::new(0, wiring.tissue, world, 5e-3);
    let mut second = SecondLoop::new(0, Box::new(device), ports, &memory, 1e-3);
    let probe = Box::new(theatre.probe.clone());
    // A probe of another scene is ignored.
    for (generation, probe) in [(1, probe.clone()), (2, probe)] {
        let room = crate::rt::probe_tape::ProbeTape::new(&probe);
        let order = TissueOrder::Probe {
            generation,
            probe,
            room,
        };
        assert!(wiring.control.tissue_orders.push(order).is_ok());
    }
    let mut now_ns = 1_000_000_000;
    let mut go = |to: ProbePose, ticks: usize| {
        let goal = HandGoal {
            tip_in_world: to.tip_m.into(),
            direction: to.axis.into(),
            speed_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
        };
        for order in [
            HapticOrder::Engage,
            HapticOrder::Hand {
                goal,
                up: None,
                promise: None,
            },
        ] {
            assert!(control.orders.push((0, order)).is_ok());
        }
        let mut wrench = stylet_hw::Wrench::zero();
        for n in 0..ticks {
            now_ns += 1_000_000;
            wrench = second.tick(now_ns, now_ns, 0).wrench;
            while control.records.pop().is_ok() || control.notices.pop().is_ok() {}
            if n % 5 == 4 {
                tissue.tick(now_ns);
                while wiring.control.tissue_notices.pop().is_ok() {}
            }
        }
        let gland = theatre.stage.target.mean_m(tissue.body());
        println!(
            "force {:.2?} N, target {:.2?} mm",
            wrench.force_n.as_slice(),
            (gland * 1e3).as_slice()
        );
        (wrench.force_n, gland)
    };
    let (lies_n, lies_m) = go(theatre.pose(BALANCED_M, BEYOND_M), 3000);
    let (pressed_n, pressed_m) = go(theatre.pose(BALANCED_M + 5e-3, BEYOND_M), 4000);
    assert!(
        pressed_n.y < lies_n.y - 0.5 && pressed_n.y < -0.5,
        "{pressed_n} {lies_n}"
    );
    assert!(pressed_m.y > lies_m.y + 1e-3);
    // The patient moves away from the probe, which follows.
    let by_m = Vector3::new(0.0, 2e-3, 0.0);
    wiring.haptic.pose.write(TipPose {
        body_moved_m: by_m,
        ..TipPose::default()
    });
    let after = theatre.pose(BALANCED_M + 5e-3, BEYOND_M);
    let after = ProbePose::new((Vector3::from(after.tip_m) + by_m).into(), after.axis).expect("a pose");
    let (moved_n, moved_m) = go(after, 2000);
    assert!((moved_n - pressed_n).norm() < 0.15, "{moved_n} {pressed_n}");
    assert!((moved_m - pressed_m).norm() < 0.15e-3, "{moved_m} {pressed_m}");
    let (out_n, out_m) = go(theatre.pose(BALANCED_M, BEYOND_M - 0.2), 4000);
    assert_eq!((out_n, out_m), (Vector3::zeros(), Vector3::zeros()));
}

/// `cargo test --profile quick -p stylet-runtime --lib tests::probe -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn times_of_a_tick_with_probe_and_needle() {
    let tissues = [TissueKind::ChainMail, TissueKind::Fem];
    for tissue in tissues
        .into_iter()
        .filter(|t| *t == TissueKind::ChainMail || std::env::var("PROBE_FEM").is_ok())
    {
        let mut theatre = Theatre::new(tissue);
        let mut least: [Vec<f64>; 2] = Default::default();
        for _ in 0..4 {
            for (with_probe, least) in [false, true].into_iter().zip(&mut least) {
                let times = session(&mut theatre, with_probe);
                if least.is_empty() {
                    *least = times;
                } else {
                    least.iter_mut().zip(times).for_each(|(a, b)| *a = a.min(b));
                }
            }
        }
        for (name, mut us) in ["needle alone", "needle and probe"].into_iter().zip(least) {
            us.sort_by(f64::total_cmp);
            let at = |q: f64| us[((us.len() - 1) as f64 * q).round() as usize];
            println!(
                "{}, {name}: p50 {:.0}, p99 {:.0}, p99.9 {:.0}, max {:.0} us of {} ticks",
                tissue.name(),
                at(0.5),
                at(0.99),
                at(0.999),
                at(1.0),
                us.len()
            );
        }
    }
}

/// Inserts a needle through the skin at 50 mm/s while the probe is pressed in and out by 10 mm at 20 mm/s.
fn session(theatre: &mut Theatre, with_probe: bool) -> Vec<f64> {
    let mut rig = theatre.rig(true);
    if with_probe {
        rig.take_probe(Box::new(theatre.probe.clone()));
    }
    theatre.insert(&mut rig);
    let mut times = Vec::new();
    // Poses are computed beforehand: each searches the whole scene.
    let poses: Vec<ProbePose> = (0..200)
        .map(|tick| {
            let phase = f64::from(tick) / 100.0;
            theatre.pose(10e-3 * if phase < 1.0 { phase } else { 2.0 - phase }, BEYOND_M)
        })
        .collect();
    let mut tick = 0;
    for n in 0..4000_u32 {
        rig.tissue().move_probe(poses[tick % poses.len()]);
        let begun = Instant::now();
        if rig.tick() {
            tick += 1;
            // The first brings the probe in.
            if n > 100 {
                times.push(begun.elapsed().as_nanos() as f64 / 1e3);
            }
        }
    }
    if with_probe && times.len() > 10 {
        let (gland, _) = moved(&rig, theatre);
        println!(
            "target {:.2?} mm, tip force {:.2} N",
            (gland * 1e3).as_slice(),
            rig.state().peak_force_n
        );
    }
    theatre.stage.world = Some(rig.into_world());
    times
}

#[test]
fn tissue_without_forces_has_no_probe() {
    let source = SceneSource::Builtin("pelvis".to_owned());
    assert!(
        LineBody::of_source(&source, TissueKind::Paper)
            .expect("valid")
            .is_none()
    );
    let paper = LineBody::of_source(&SceneSource::Builtin("paper".to_owned()), TissueKind::ChainMail);
    let refused = paper
        .expect("valid")
        .expect("has lines")
        .prepare_probe(Default::default(), &mut |_| true);
    assert!(refused.expect_err("no rectum").to_string().contains("no rectum"));
}

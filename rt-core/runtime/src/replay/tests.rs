//! An insertion on a needle line, recorded and repeated: by both loops, stepped, in a small elastic body.

use super::file::Flight;
use super::lines::{LineProgress, solve_again};
use super::repeat::{self, RepeatError};
use crate::lines::LineBody;
use crate::rt::exchange::{HapticOrder, TissueOrder, TissueStep};
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use crate::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use stylet_hw::{Device, DeviceInfo, HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::TissueParameters;
use stylet_sim::line::{LineSource, NeedleBending, PronyTerm, ReadyLine};
use stylet_sim::needle::NeedleParameters;
use stylet_sim::scene::{Labels, SceneSource, TissueKind};

mod left;
mod motion;
mod probe;
mod reset;

/// The loops with their tapes, and the archive of the control thread.
struct Recorded {
    loops: SteppedLoops,
    entry_m: Vector3<f64>,
    line: ReadyLine,
    kept: Vec<LineSource>,
    figures: DeviceInfo,
    force: ForceParameters,
    heap_calls: u64,
}

fn block() -> SceneSource {
    SceneSource::of_labels(
        "block",
        &Labels {
            dims: [6, 6, 10],
            spacing_m: 2e-3,
            cells: vec![1; 6 * 6 * 10],
            structures: Vec::new(),
        },
    )
}

impl Recorded {
    fn new(tissue: TissueKind, force: &ForceParameters) -> Self {
        Self::of(block(), tissue, force, 0.0)
    }

    /// Records a needle inserted that far above the centre.
    fn of(source: SceneSource, tissue: TissueKind, force: &ForceParameters, above_m: f64) -> Self {
        let scene = source.build().expect("valid");
        let (low, high) = scene.lattice.bounds_m();
        let entry_m = Vector3::new((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0 + above_m, low[2]);
        let body = LineBody::of_source(&source, tissue).expect("valid").expect("has lines");
        let line = body.prepare(
            1,
            entry_m.into(),
            [0.0, 0.0, 1.0],
            force.bending.is_on(),
            &[],
            &mut || true,
        );
        let limits = TissueParameters::default().validate().expect("valid");
        let world = Box::new(World::new(scene, tissue, limits, 1).expect("valid"));
        let device = SimulatedPhantom::new(SimulatedPhantomConfig {
            start_tip_in_world: entry_m - Vector3::z() * 0.008,
            ..SimulatedPhantomConfig::default()
        });
        let figures = device.info();
        let parameters = (NeedleParameters::default(), ForceParameters::default());
        let memory = HapticMemory::new(&device.info(), parameters, 0);
        let tapes = (
            Some(Box::new(HapticTape::new(&memory))),
            Some(Box::new(TissueTape::new(&world, Arc::new(source)))),
        );
        let each = HAPTIC_TICKS_PER_TISSUE_TICK;
        Self {
            loops: SteppedLoops::with_tapes(world, Box::new(device), &memory, each, tapes),
            entry_m,
            line: line.expect("through the block"),
            kept: Vec::new(),
            figures,
            force: *force,
            heap_calls: 0,
        }
    }

    fn haptic(&mut self, order: HapticOrder) {
        self.loops.control.haptic_orders.push((0, order)).expect("room");
    }

    /// Gives both loops the line under that number.
    fn give_line(&mut self, generation: u64) {
        let (mut hand, mut body) = (self.line.hand.clone(), self.line.body.clone());
        (hand.generation, body.generation) = (generation, generation);
        self.kept.push(hand.source());
        let control = &mut self.loops.control;
        control.lines.push(hand).expect("room");
        control.tissue_orders.push(TissueOrder::Line(body)).expect("room");
    }

    fn go(&mut self, depth_m: f64) {
        let goal = HandGoal {
            tip_in_world: self.entry_m + Vector3::z() * depth_m,
            direction: Vector3::z(),
            speed_m_per_s: 0.02,
            acceleration_m_per_s2: 1.0,
        };
        self.haptic(HapticOrder::Hand {
            goal,
            up: None,
            promise: None,
        });
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(1e3 * seconds) as u64 {
            let before = stylet_heap::calls_of_this_thread();
            self.loops.step();
            self.heap_calls += stylet_heap::calls_of_this_thread() - before;
            let control = &mut self.loops.control;
            while control.haptic_notices.pop().is_ok() || control.tissue_notices.pop().is_ok() {}
            while control.old_hand_lines.pop().is_ok() || control.old_body_lines.pop().is_ok() {}
        }
    }

    /// Two lines, one after the other, with changes of parameters, a seed and turns between. Ends with the needle in
    /// tissue.
    fn insert(&mut self) {
        self.haptic(HapticOrder::Engage);
        self.give_line(1);
        self.run(0.1);
        self.go(5e-3);
        self.run(1.9);
        self.haptic(HapticOrder::Parameters {
            generation: 2,
            needle: NeedleParameters::default(),
            force: ForceParameters {
                // So small a body would be pushed along as a whole.
                membrane_gain: 0.05,
                cutting_gain: 0.1,
                shaft_gain: 0.2,
                ..self.force
            },
        });
        self.run(0.2);
        self.go(12e-3);
        self.run(1.8);
        let drop = TissueOrder::Step(0, TissueStep::DropSeed { strand_pitch_m: None });
        self.loops.control.tissue_orders.push(drop).expect("room");
        self.go(9e-3);
        self.run(3.0);
        self.go(-8e-3);
        self.run(1.5);
        self.give_line(2);
        self.run(0.1);
        self.go(10e-3);
        self.run(1.2);
        self.go(7e-3);
        self.run(0.8);
    }

    /// Takes both tapes and returns blank ones.
    fn flight(&mut self) -> Flight {
        self.haptic(HapticOrder::HandOverTape);
        let order = TissueOrder::HandOverTape;
        self.loops.control.tissue_orders.push(order).expect("room");
        self.run(0.005);
        let (haptic_tapes, tissue_tapes) = &mut self.loops.tapes;
        let haptic = haptic_tapes.taken.pop().expect("handed over");
        let tissue = tissue_tapes.taken.pop().expect("handed over");
        let flight = Flight {
            version: String::new(),
            session_id: 0,
            reason: String::new(),
            device_name: String::new(),
            device: self.figures,
            haptic_period_s: 1e-3,
            tissue_period_s: 5e-3,
            second_device: None,
            second: None,
            lines: self.kept.clone(),
            haptic: haptic.flight(),
            tissue: tissue.flight(),
        };
        haptic_tapes.back.push(haptic).expect("room");
        tissue_tapes.back.push(tissue).expect("room");
        flight
    }
}

fn through_a_file(flight: &Flight) -> Flight {
    // Tests of one process run in parallel; no other memory depends on the number.
    static FILES: AtomicU64 = AtomicU64::new(0);
    let number = FILES.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("stylet-line-{}-{number}.flight", std::process::id()));
    flight.write(&path).expect("written");
    let bytes = std::fs::metadata(&path).expect("there").len();
    println!("file of {bytes} bytes");
    let again = Flight::read(&path).expect("read");
    let mut old = std::fs::read(&path).expect("there");
    old[7] = 4;
    std::fs::write(&path, old).expect("written");
    let refusal = Flight::read(&path).map(|_| ()).expect_err("of another layout");
    std::fs::remove_file(&path).expect("there");
    assert!(refusal.to_string().contains("layout 4"), "{refusal}");
    again
}

fn assert_identical(flight: &Flight) {
    let haptic = flight.haptic.as_ref().expect("recorded");
    let found = repeat::haptic(flight, haptic).expect("can be run");
    assert!(found.is_identical(), "forces: {found:?}");
    let tissue = flight.tissue.as_ref().expect("recorded");
    let mut last = None;
    let lines = solve_again(flight, tissue, None, &mut |p| last = Some(p)).expect("solved");
    let wanted = if flight.lines.iter().all(|line| line.bends()) {
        30
    } else {
        20
    };
    assert_eq!(
        last.map(|p: LineProgress| p.of),
        Some(wanted),
        "shaft and tip of 10 stations, and 5 across along each direction"
    );
    let found = repeat::tissue(flight, tissue, lines).expect("can be run");
    assert!(found.is_identical() && found.positions > 0, "tissue: {found:?}");
}

/// The recorder left lines out: forces on one were not repeated, and no recording held an elastic body.
#[test]
fn a_recorded_insertion_on_a_needle_line_repeats_in_every_bit() {
    repeats_in_every_bit(TissueKind::Fem, &ForceParameters::default());
}

/// A recording begins with the load history of creeping tissue.
#[test]
fn a_recorded_insertion_into_tissue_that_creeps_repeats_in_every_bit() {
    let creep = [(0.6, 0.5), (1.0, 5.0)].map(|(strength, time_s)| PronyTerm { strength, time_s });
    let force = ForceParameters {
        creep,
        ..ForceParameters::default()
    };
    repeats_in_every_bit(TissueKind::Fem, &force);
}

/// A recording includes forces and track across the line, and loads across the line reach the tissue.
#[test]
fn a_recorded_insertion_of_a_needle_that_bends_repeats_in_every_bit() {
    let force = ForceParameters {
        bending: NeedleBending {
            bending_stiffness_n_m2: 0.016,
            bevel: 0.3,
            template_gap_m: 1e-4,
            template_distance_m: 0.02,
        },
        ..ForceParameters::default()
    };
    for kind in [TissueKind::Fem, TissueKind::ChainMail] {
        let flight = repeats_in_every_bit(kind, &force);
        let haptic = flight.haptic.expect("recorded");
        let deflection = haptic
            .ticks
            .iter()
            .map(|e| Vector3::from(e.record.tip_deflection_m).norm());
        assert!(deflection.fold(0.0, f64::max) > 1e-5, "it bends");
        let tissue = flight.tissue.expect("recorded");
        assert!(
            tissue
                .ticks
                .iter()
                .any(|tick| tick.loads.across_n()[0].iter().any(|f| *f != 0.0))
        );
    }
}

/// ChainMail's line moves the body as a whole, which its own state did not include.
#[test]
fn a_recorded_insertion_in_chainmail_repeats_in_every_bit() {
    repeats_in_every_bit(TissueKind::ChainMail, &ForceParameters::default());
}

fn repeats_in_every_bit(kind: TissueKind, force: &ForceParameters) -> Flight {
    let mut run = Recorded::new(kind, force);
    run.insert();
    let flight = through_a_file(&run.flight());
    assert_eq!(run.heap_calls, 0, "heap calls of the loops");
    let haptic = flight.haptic.as_ref().expect("recorded");
    let peak_n = haptic
        .ticks
        .iter()
        .map(|e| e.record.force_on_hand_n[2].abs())
        .fold(0.0, f64::max);
    println!(
        "{} ticks, {} on a line, peak {peak_n} N, lines {:?}",
        haptic.ticks.len(),
        haptic.ticks_on_line(),
        haptic.lines
    );
    assert!(haptic.ticks_on_line() > 3000 && peak_n > 0.1);
    assert!(
        haptic.memory.line == 1 && haptic.memory.on_line,
        "it begins with the needle on a line"
    );
    assert!(
        haptic.line_state.as_ref().is_some_and(|s| s.is_in_contact()),
        "and in tissue"
    );
    assert_eq!(haptic.lines.iter().map(|l| l.1).collect::<Vec<_>>(), [2]);
    let tissue = flight.tissue.as_ref().expect("recorded");
    assert!(tissue.memory.state.loads.is_any() && tissue.memory.state.in_by_line && tissue.middle.is_some());
    assert!(
        tissue.memory.body.iter().any(|&byte| byte != 0),
        "tissue that is not at rest"
    );
    assert_eq!(tissue.line_numbers().collect::<Vec<_>>(), [1, 2]);
    assert_identical(&flight);
    what_was_changed_is_found(&flight);

    // The tapes came back, and the needle stays in tissue.
    run.go(3e-3);
    run.run(1.0);
    let next = run.flight();
    assert_eq!(
        next.haptic
            .as_ref()
            .expect("recorded")
            .line_numbers()
            .collect::<Vec<_>>(),
        [2]
    );
    assert_identical(&next);
    flight
}

fn what_was_changed_is_found(flight: &Flight) {
    let mut other = flight.clone();
    let tissue = other.tissue.as_mut().expect("recorded");
    let mut ticks = tissue.ticks.iter_mut().rev();
    ticks.find(|tick| tick.loads.is_any()).expect("on a line").loads.loads_n[0] += 0.1;
    let tissue = other.tissue.as_ref().expect("recorded");
    let lines = solve_again(&other, tissue, None, &mut |_| {}).expect("solved");
    let found = repeat::tissue(&other, tissue, lines).expect("can be run");
    assert!(found.different_positions > 0, "{found:?}");

    let haptic = other.haptic.as_mut().expect("recorded");
    haptic.line_state = None;
    let found = repeat::haptic(&other, other.haptic.as_ref().expect("recorded")).expect("can be run");
    assert!(found.first_different == Some(0) && !found.is_identical(), "{found:?}");

    other.lines.remove(1);
    let haptic = flight.haptic.as_ref().expect("recorded");
    let refused = repeat::haptic(&other, haptic).expect_err("without its line");
    assert!(matches!(refused, RepeatError::NoLine(2)), "{refused}");
}

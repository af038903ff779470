//! A recording of stepped loops in the scene `paper`, written to a file and repeated from its bytes.

use super::*;
use nalgebra::Vector3;
use std::sync::Arc;
use stylet_hw::{Device, HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_runtime::lines::LineBody;
use stylet_runtime::rt::exchange::{HapticOrder, TissueOrder, TissueStep};
use stylet_runtime::rt::haptic_tape::{HapticMemory, HapticTape};
use stylet_runtime::rt::tissue_tape::TissueTape;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use stylet_shm_schema::ParameterSet;
use stylet_sim::active::activate;
use stylet_sim::scene::{SceneSource, TissueKind};

/// Records an insertion with a seed; the needle is on its line if the tissue has lines.
fn recorded(tissue: TissueKind) -> Vec<u8> {
    let source = SceneSource::Builtin("paper".to_owned());
    let scene = source.build().expect("built in");
    let (low, high) = scene.lattice.bounds_m();
    let entry = Vector3::new((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, low[2] - 0.01);
    let device = SimulatedPhantom::new(SimulatedPhantomConfig {
        start_tip_in_world: entry,
        ..SimulatedPhantomConfig::default()
    });
    let info = device.info();
    let active = activate(&ParameterSet::default(), &info).expect("defaults");
    let line = LineBody::of_source(&source, tissue).expect("valid");
    let line = line.map(|body| body.prepare(1, entry.into(), [0.0, 0.0, 1.0], false, &[], &mut || true));
    let world = Box::new(World::new(scene, tissue, active.limits, 1).expect("valid"));
    let memory = HapticMemory::new(&info, (active.needle, active.force), 0);
    let tapes = (
        Some(Box::new(HapticTape::new(&memory))),
        Some(Box::new(TissueTape::new(&world, Arc::new(source)))),
    );
    let each = HAPTIC_TICKS_PER_TISSUE_TICK;
    let mut loops = SteppedLoops::with_tapes(world, Box::new(device), &memory, each, tapes);
    let mut kept = Vec::new();
    if let Some(line) = line.transpose().expect("through the body") {
        kept.push(line.hand.source());
        loops.control.lines.push(line.hand).expect("room");
        loops
            .control
            .tissue_orders
            .push(TissueOrder::Line(line.body))
            .expect("room");
    }
    loops
        .control
        .haptic_orders
        .push((0, HapticOrder::Engage))
        .expect("room");
    for (share, drops) in [(0.7, true), (0.3, false)] {
        let goal = HandGoal {
            tip_in_world: Vector3::new(entry.x, entry.y, low[2] + share * (high[2] - low[2])),
            direction: Vector3::z(),
            speed_m_per_s: 0.05,
            acceleration_m_per_s2: 2.0,
        };
        let order = HapticOrder::Hand {
            goal,
            up: None,
            promise: None,
        };
        loops.control.haptic_orders.push((0, order)).expect("room");
        for _ in 0..2500 {
            loops.step();
            loops.answers();
        }
        let step = TissueStep::DropSeed { strand_pitch_m: None };
        if drops {
            loops
                .control
                .tissue_orders
                .push(TissueOrder::Step(0, step))
                .expect("room");
        }
    }
    loops
        .control
        .haptic_orders
        .push((0, HapticOrder::HandOverTape))
        .expect("room");
    loops
        .control
        .tissue_orders
        .push(TissueOrder::HandOverTape)
        .expect("room");
    for _ in 0..5 {
        loops.step();
    }
    let flight = Flight {
        version: String::new(),
        session_id: 0,
        reason: String::new(),
        device_name: String::new(),
        device: info,
        haptic_period_s: 1e-3,
        tissue_period_s: 5e-3,
        lines: kept,
        haptic: loops.tapes.0.taken.pop().expect("handed over").flight(),
        tissue: loops.tapes.1.taken.pop().expect("handed over").flight(),
        second_device: None,
        second: None,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("recorded.flight");
    flight.write(&path).expect("written");
    std::fs::read(path).expect("there")
}

#[test]
fn a_recording_repeats_in_every_bit_natively() {
    for tissue in [TissueKind::ChainMail, TissueKind::Paper] {
        let bytes = recorded(tissue);
        let found = repeat(&bytes, || {}).expect("a recording");
        assert!(found.is_same(), "{tissue:?}:\n{found}");
        assert!(found.loops[0].ticks > 4000, "{found}");
    }
}

#[test]
fn bytes_that_are_no_recording_are_refused() {
    let why = repeat(b"STYFLT", || {}).expect_err("too short").to_string();
    assert!(why.contains("the recording: not a flight recording"), "{why}");
}

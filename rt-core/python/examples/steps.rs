//! Ten thousand steps of 1 ms without Python, over the device that plays recorded motions: what
//! `tests/test_insertion.py` compares `Insertion.step` with, bit by bit, and the time that they take.
//!
//! Prints a line for each step: depth, mm, and the bits of the force, N. The last line has the time of all, s.

use nalgebra::{UnitQuaternion, Vector3};
use std::error::Error;
use std::time::Instant;
use stylet_hw::{DeviceInfo, ReplayDevice, Sample};
use stylet_runtime::lines::LineBody;
use stylet_runtime::rt::exchange::{HapticOrder, TissueOrder};
use stylet_runtime::rt::haptic_tape::HapticMemory;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use stylet_shm_schema::ParameterSet;
use stylet_sim::active::activate;
use stylet_sim::scene::{SceneSource, TissueKind};

const ENTRY_M: [f64; 3] = [72.979 * 1e-3, 44.715 * 1e-3, 86.401 * 1e-3];
/// Way to the entry before the first step: 10 mm in 250 ticks.
const RUN_UP: (f64, u32) = (0.01, 250);
const STEPS: u32 = 10_000;

/// In for 5 s at 10 mm/s, and out again.
fn depth_mm(step: u32) -> f64 {
    0.01 * f64::from(step.min(STEPS - step))
}

fn main() -> Result<(), Box<dyn Error>> {
    let source = SceneSource::Builtin("paper".to_owned());
    let info = DeviceInfo::phantom_premium_1_5();
    let active = activate(&ParameterSet::default(), &info)?;
    let tissue = TissueKind::ChainMail;
    let mut world = World::new(source.build()?, tissue, active.limits.clone(), 1)?;
    world.migration = active.migration;
    let body = LineBody::of_source(&source, tissue)?.ok_or("chainmail has lines")?;
    let line = body.prepare(
        1,
        ENTRY_M,
        [0.0, 0.0, 1.0],
        active.force.bending.is_on(),
        &[],
        &mut || true,
    )?;

    let entry = Vector3::from(ENTRY_M);
    let start = entry - Vector3::z() * RUN_UP.0;
    let run_up = (1..=RUN_UP.1).map(|tick| match tick == RUN_UP.1 {
        true => entry,
        false => start + (entry - start) * (f64::from(tick) / f64::from(RUN_UP.1)),
    });
    let steps = (1..=STEPS).map(|step| entry + Vector3::z() * (depth_mm(step) * 1e-3));
    let sample = |tip_in_world| Sample {
        tip_in_world,
        world_from_tool: UnitQuaternion::identity(),
        buttons: 0,
        sequence: 0,
    };
    let samples = run_up.chain(steps).map(sample).collect();
    let device = ReplayDevice::new(info, samples, 1e-3).ok_or("the samples can be played")?;
    let memory = HapticMemory::new(&info, (active.needle, active.force), 0);
    let mut loops = SteppedLoops::new(Box::new(world), Box::new(device), &memory, HAPTIC_TICKS_PER_TISSUE_TICK);
    let _ = loops.control.haptic_orders.push((0, HapticOrder::Engage));
    let _ = loops.control.lines.push(line.hand);
    let _ = loops.control.tissue_orders.push(TissueOrder::Line(line.body));

    let mut forces_n = Vec::new();
    for _ in 0..RUN_UP.1 {
        loops.step();
    }
    let begun = Instant::now();
    for _ in 0..STEPS {
        loops.step();
        forces_n.push(loops.haptic.memory.state.force_on_hand_n);
    }
    let seconds = begun.elapsed().as_secs_f64();
    for (step, force) in (1..).zip(forces_n) {
        let [x, y, z] = force.map(f64::to_bits);
        println!("{},{x:016x},{y:016x},{z:016x}", depth_mm(step));
    }
    println!("{seconds}");
    Ok(())
}

//! A needle that a script moves: both loops of a run, stepped, over a device that no hand holds.

use nalgebra::{Unit, UnitQuaternion, Vector3};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use stylet_hw::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use stylet_runtime::lines::{LineBody, NoLine};
use stylet_runtime::rehearse::RehearseError;
use stylet_runtime::rt::exchange::{HapticOrder, TissueOrder, TissueStep};
use stylet_runtime::rt::haptic_tape::HapticMemory;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use stylet_shm_schema::{Fault, HapticState, NeedleAxis, RefusalCode};
use stylet_sim::active::Active;
use stylet_sim::line::ReadyLine;
use stylet_sim::scene::{SceneSource, TissueKind};

/// Distance before the entry at which the tip begins, as in a rehearsal.
const RUN_UP_M: f64 = 0.01;
/// Ticks of the way to the entry: longer than the gate takes to let the whole force in.
const RUN_UP_TICKS: u32 = 250;
/// Lines that are kept for needles on the same axis.
const MOST_LINES: usize = 16;

/// A device at the place where the script put it.
struct Scripted(Arc<Mutex<Sample>>);

impl Device for Scripted {
    fn info(&self) -> DeviceInfo {
        info()
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        Ok(*self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        wrench.is_finite().then_some(()).ok_or(DeviceFault::NonFiniteWrench)
    }
}

/// Returns limits of the device: those of the programs' simulated one.
pub fn info() -> DeviceInfo {
    DeviceInfo {
        name: "script",
        simulated: true,
        ..DeviceInfo::phantom_premium_1_5()
    }
}

/// A body that needles go into, one after another.
pub struct Body {
    world: Option<Box<World>>,
    /// Body for lines, if the needles have lines.
    lines: Option<LineBody>,
    ready: Vec<(NeedleAxis, bool, ReadyLine)>,
}

impl Body {
    /// `linear` is as of [`stylet_runtime::rehearse::Stage::seeds_and_forces_alone`].
    pub fn build(
        source: &SceneSource,
        tissue: TissueKind,
        active: &Active,
        linear: bool,
    ) -> Result<Self, RehearseError> {
        let mut world = World::new(source.build()?, tissue, active.limits.clone(), 1)?;
        world.looks_near_tip = !linear;
        Ok(Self {
            lines: LineBody::of_source(source, tissue)?,
            world: Some(Box::new(world)),
            ready: Vec::new(),
        })
    }

    /// Takes the body back from a needle that is not needed any more.
    pub fn take_back(&mut self, needle: Needle) {
        self.world = Some(needle.loops.tissue.into_world());
    }

    /// Returns a needle at the entry, outside the body at rest, with the force on.
    pub fn needle(&mut self, axis: NeedleAxis, active: &Active, stop: &AtomicBool) -> Result<Needle, RehearseError> {
        let line = self.line(axis, active.force.bending.is_on(), stop)?;
        let mut world = self.world.take().ok_or(RehearseError::BodyLost)?;
        world.tissue.return_to_rest();
        world.set_limits(active.limits.clone());
        world.migration = active.migration;
        Ok(Needle::new(world, line, axis, active))
    }

    fn line(&mut self, axis: NeedleAxis, bends: bool, stop: &AtomicBool) -> Result<Option<ReadyLine>, NoLine> {
        let Some(body) = &self.lines else {
            return Ok(None);
        };
        if let Some((.., line)) = self.ready.iter().find(|(of, bent, _)| *of == axis && *bent == bends) {
            return Ok(Some(line.clone()));
        }
        // SYNC: nothing but the flag is carried.
        let mut goes_on = || !stop.load(Ordering::Relaxed);
        let line = body.prepare(1, axis.entry_m, axis.direction, bends, &[], &mut goes_on)?;
        if self.ready.len() == MOST_LINES {
            self.ready.remove(0);
        }
        self.ready.push((axis, bends, line.clone()));
        Ok(Some(line))
    }
}

/// Place and direction of the needle, and how far it is turned about itself.
#[derive(Clone, Copy)]
pub struct Pose {
    pub tip_m: Vector3<f64>,
    pub direction: Unit<Vector3<f64>>,
    pub roll_rad: f64,
}

impl Pose {
    fn world_from_tool(&self) -> UnitQuaternion<f64> {
        let turned = UnitQuaternion::rotation_between_axis(&Vector3::z_axis(), &self.direction);
        let back = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        turned.unwrap_or_else(back) * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.roll_rad)
    }

    fn on_the_way_to(&self, to: &Pose, share: f64) -> Pose {
        let direction = self.direction.try_slerp(&to.direction, share, 1e-12);
        Pose {
            tip_m: self.tip_m + (to.tip_m - self.tip_m) * share,
            direction: direction.unwrap_or(to.direction),
            roll_rad: self.roll_rad + (to.roll_rad - self.roll_rad) * share,
        }
    }
}

/// A needle in its body.
pub struct Needle {
    loops: SteppedLoops,
    sample: Arc<Mutex<Sample>>,
    pub pose: Pose,
    pub entry_m: Vector3<f64>,
    pub direction: Unit<Vector3<f64>>,
    /// Membranes that have given way.
    pub punctures: u32,
    refusal: Option<RefusalCode>,
}

impl Needle {
    fn new(world: Box<World>, line: Option<ReadyLine>, axis: NeedleAxis, active: &Active) -> Self {
        let (entry_m, direction) = (Vector3::from(axis.entry_m), Unit::new_unchecked(axis.direction.into()));
        let pose = Pose {
            tip_m: entry_m - *direction * RUN_UP_M,
            direction,
            roll_rad: 0.0,
        };
        let sample = Arc::new(Mutex::new(Sample {
            tip_in_world: pose.tip_m,
            world_from_tool: pose.world_from_tool(),
            buttons: 0,
            sequence: 0,
        }));
        let memory = HapticMemory::new(&info(), (active.needle, active.force), 0);
        let device = Box::new(Scripted(Arc::clone(&sample)));
        let mut loops = SteppedLoops::new(world, device, &memory, HAPTIC_TICKS_PER_TISSUE_TICK);
        // The rings are empty.
        let _ = loops.control.haptic_orders.push((0, HapticOrder::Engage));
        if let Some(line) = line {
            let _ = loops.control.lines.push(line.hand);
            let _ = loops.control.tissue_orders.push(TissueOrder::Line(line.body));
        }
        let mut needle = Self {
            loops,
            sample,
            pose,
            entry_m,
            direction,
            punctures: 0,
            refusal: None,
        };
        // Outside the body no fault can come up.
        let _ = needle.go(needle.at_depth(0.0), RUN_UP_TICKS, |_| true);
        needle
    }

    /// Moves at constant speed to a pose within that many ticks of 1 ms; ends early at a fault, or where `goes_on`,
    /// called after each tick, returns false.
    pub fn go(&mut self, to: Pose, ticks: u32, mut goes_on: impl FnMut(&Self) -> bool) -> Result<(), Fault> {
        let from = self.pose;
        for tick in 1..=ticks {
            self.tick(match tick == ticks {
                true => to,
                false => from.on_the_way_to(&to, f64::from(tick) / f64::from(ticks)),
            });
            match Fault::from_number(self.state().fault) {
                Some(Fault::None) => {}
                fault => return Err(fault.unwrap_or(Fault::None)),
            }
            if !goes_on(self) {
                break;
            }
        }
        Ok(())
    }

    fn tick(&mut self, pose: Pose) {
        self.pose = pose;
        let mut sample = self.sample.lock().unwrap_or_else(PoisonError::into_inner);
        sample.tip_in_world = pose.tip_m;
        sample.world_from_tool = pose.world_from_tool();
        sample.sequence += 1;
        drop(sample);
        self.punctures += u32::from(self.loops.step().puncture);
        self.refusal = self.loops.answers().or(self.refusal);
    }

    /// Leaves a seed at the tip, which rests until the tissue loop has taken it.
    pub fn drop_seed(&mut self, strand_pitch_m: Option<f64>) -> Result<(), RefusalCode> {
        let step = TissueStep::DropSeed { strand_pitch_m };
        let _ = self.loops.control.tissue_orders.push(TissueOrder::Step(0, step));
        self.refusal = None;
        for _ in 0..HAPTIC_TICKS_PER_TISSUE_TICK {
            self.tick(self.pose);
        }
        self.refusal.take().map_or(Ok(()), Err)
    }

    /// Returns the pose at a depth on the axis, turned as now.
    pub fn at_depth(&self, depth_m: f64) -> Pose {
        Pose {
            tip_m: self.entry_m + *self.direction * depth_m,
            direction: self.direction,
            ..self.pose
        }
    }

    /// Depth of the tip from the entry along the axis, m, before it bends.
    pub fn depth_m(&self) -> f64 {
        (self.pose.tip_m - self.entry_m).dot(&self.direction)
    }

    pub fn state(&self) -> &HapticState {
        &self.loops.haptic.memory.state
    }

    pub fn seconds(&self) -> f64 {
        self.loops.seconds()
    }

    pub fn tissue(&self) -> &stylet_runtime::rt::tissue::TissueLoop {
        &self.loops.tissue
    }
}

//! The real loops under a simulated hand, on one thread and one clock: a session that can be repeated.

use nalgebra::Vector3;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stylet_hw::{
    BadLink, Device, DeviceFault, DeviceInfo, Hand, HandGoal, LinkFaults, Sample, SimulatedPhantom,
    SimulatedPhantomConfig, Wrench,
};
use stylet_runtime::rt::exchange::{HapticOrder, TissueOrder};
use stylet_runtime::rt::haptic_tape::HapticMemory;
use stylet_runtime::rt::response::TissueResponse;
use stylet_runtime::rt::world::World;
use stylet_runtime::stepped::{HAPTIC_TICKS_PER_TISSUE_TICK, SteppedLoops};
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{ChainOutput, ChainState};
use stylet_sim::line::ReadyLine;
use stylet_sim::needle::{LayerKind, NeedleParameters};
use stylet_sim::tissue::MaterialPoint;

/// A simulated Phantom that the force loop owns and the measurement looks into.
#[derive(Clone)]
struct SharedPhantom(Arc<Mutex<SimulatedPhantom>>);

impl SharedPhantom {
    fn new(hand: Hand, start_tip_in_world: Vector3<f64>) -> Self {
        Self(Arc::new(Mutex::new(SimulatedPhantom::new(SimulatedPhantomConfig {
            hand,
            start_tip_in_world,
            ..SimulatedPhantomConfig::default()
        }))))
    }

    fn phantom(&self) -> MutexGuard<'_, SimulatedPhantom> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Device for SharedPhantom {
    fn info(&self) -> DeviceInfo {
        self.phantom().info()
    }

    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault> {
        self.phantom().read(dt_s)
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.phantom().write(wrench)
    }

    fn set_hand_goal(&mut self, goal: &HandGoal) {
        self.phantom().set_hand_goal(goal);
    }

    fn stop_hand(&mut self) {
        self.phantom().stop_hand();
    }
}

/// Outcome of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    pub output: ChainOutput,
    pub true_tip_m: f64,
    pub true_speed_m_per_s: f64,
    /// Work of the device on the hand since the start.
    pub work_j: f64,
}

/// An insertion along z. Ticks of the force loop are 1 ms apart.
pub struct Session {
    loops: SteppedLoops,
    device: SharedPhantom,
    /// Direction in which the hand holds the needle.
    direction: Vector3<f64>,
}

impl Session {
    /// Makes a session, engaged, the tip at `start`, the needle along +z; the tissue answers every `tissue_every`th
    /// tick.
    pub fn new(world: World, start: Vector3<f64>, hand: Hand, tissue_every: u64) -> Self {
        let hand = (hand, LinkFaults::default());
        Self::over_link(Box::new(world), start, hand, ForceParameters::default(), tissue_every)
    }

    /// Makes a session as [`new`](Self::new), with other parameters of the force and over a link with faults.
    pub fn over_link(
        world: Box<World>,
        start: Vector3<f64>,
        (hand, faults): (Hand, LinkFaults),
        force: ForceParameters,
        tissue_every: u64,
    ) -> Self {
        let device = SharedPhantom::new(hand, start);
        let mut memory = HapticMemory::new(&device.info(), (NeedleParameters::default(), force), 0);
        memory.chain.gate.engage();
        let link = Box::new(BadLink::new(device.clone(), faults));
        Self {
            loops: SteppedLoops::new(world, link, &memory, tissue_every),
            device,
            direction: Vector3::z(),
        }
    }

    /// Makes a session as [`new`](Self::new), on a needle line and over a link with faults.
    pub fn on_line(
        world: Box<World>,
        place: (Vector3<f64>, ReadyLine),
        hand: (Hand, LinkFaults),
        force: ForceParameters,
    ) -> Self {
        Self::on_line_every(world, place, hand, force, HAPTIC_TICKS_PER_TISSUE_TICK)
    }

    /// Returns the same, where the tissue answers every `tissue_every`th tick.
    pub fn on_line_every(
        world: Box<World>,
        (start, line): (Vector3<f64>, ReadyLine),
        hand: (Hand, LinkFaults),
        force: ForceParameters,
        tissue_every: u64,
    ) -> Self {
        let mut session = Self::over_link(world, start, hand, force, tissue_every);
        // Both rings are empty.
        let _ = session.loops.control.lines.push(line.hand);
        let _ = session.loops.control.tissue_orders.push(TissueOrder::Line(line.body));
        session
    }

    /// Turns the needle that way with the hand's next goal.
    pub fn aim(&mut self, direction: Vector3<f64>) {
        self.direction = direction.normalize();
    }

    /// Replaces the hand.
    pub fn set_hand(&mut self, hand: Hand) {
        self.device.phantom().set_hand(hand);
    }

    /// Advances by one tick; returns its effect on the hand along z.
    pub fn tick(&mut self) -> Tick {
        let output = self.step();
        let phantom = self.device.phantom();
        Tick {
            output,
            true_tip_m: phantom.true_tip_in_world().z,
            true_speed_m_per_s: phantom.true_velocity_m_per_s().norm(),
            work_j: phantom.work_j(),
        }
    }

    /// Returns the body, for another session.
    pub fn into_world(self) -> Box<World> {
        self.loops.tissue.into_world()
    }

    /// Orders the hand to bring the tip there.
    pub fn go_to(&mut self, tip: Vector3<f64>, speed_m_per_s: f64) {
        let goal = HandGoal {
            tip_in_world: tip,
            direction: self.direction,
            speed_m_per_s,
            acceleration_m_per_s2: 20.0 * speed_m_per_s.max(0.05),
        };
        let order = HapticOrder::Hand {
            goal,
            up: None,
            promise: None,
        };
        let _ = self.loops.control.haptic_orders.push((0, order));
    }

    /// Advances the force loop by one tick, and the tissue loop where a tick is due.
    ///
    /// # Panics
    /// When a fault turned the force off: what is measured then is no insertion.
    pub fn step(&mut self) -> ChainOutput {
        let output = self.step_in_any_state();
        assert_eq!(self.fault(), 0, "the force loop raised a fault");
        output
    }

    /// Returns the same, faults included.
    pub fn step_in_any_state(&mut self) -> ChainOutput {
        let output = self.loops.step();
        let control = &mut self.loops.control;
        for notices in [&mut control.haptic_notices, &mut control.tissue_notices] {
            while notices.pop().is_ok() {}
        }
        output
    }

    /// Returns the number of the fault that turned the force off; 0 for none.
    pub fn fault(&self) -> u32 {
        self.loops.haptic.memory.state.fault
    }

    /// Returns the largest residual so far, over what the tip's patch needs.
    pub fn worst_residual(&self) -> f64 {
        self.loops.tissue.response().worst_residual
    }

    /// Returns the largest force of the device, N.
    pub fn device_limit_n(&self) -> f64 {
        self.device.info().peak_force_n
    }

    /// Skips the next ticks of the tissue loop.
    pub fn miss_tissue_ticks(&mut self, ticks: u32) {
        self.loops.miss_tissue_ticks(ticks);
    }

    /// Runs for so long.
    pub fn run(&mut self, seconds: f64) -> Vec<ChainOutput> {
        (0..(seconds * 1e3).round() as u64).map(|_| self.step()).collect()
    }

    /// Returns the state of the force chain.
    pub fn chain(&self) -> &ChainState {
        &self.loops.haptic.memory.chain
    }

    /// Returns the newest answer of the tissue.
    pub fn response(&self) -> &TissueResponse {
        self.loops.tissue.response()
    }

    /// Returns the deformed body.
    pub fn world(&self) -> &World {
        self.loops.tissue.world()
    }

    /// Returns the place of the tip, without the error of the encoders, m.
    pub fn true_tip_in_world(&self) -> Vector3<f64> {
        *self.device.phantom().true_tip_in_world()
    }
}

/// Returns the place 5 mm before the tissue, on the axis of the gland.
pub fn axis_start(world: &World) -> Vector3<f64> {
    let lattice = &world.scene.lattice;
    let elements = 0..lattice.element_count() as u32;
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for element in elements.filter(|&e| world.layer(&MaterialPoint::centre(e)) == LayerKind::Gland) {
        sum += Vector3::from(lattice.rest_m(element));
        count += 1.0;
    }
    let mut start = sum / count;
    let on_axis = |e: &u32| {
        let at = lattice.rest_m(*e);
        (0..2).all(|a| (at[a] - start[a]).abs() <= lattice.spacing_m)
    };
    let first_m = (0..lattice.element_count() as u32)
        .filter(on_axis)
        .map(|e| lattice.rest_m(e)[2]);
    start.z = first_m.fold(f64::INFINITY, f64::min) - 0.5 * lattice.spacing_m - 5e-3;
    start
}

/// Returns the displacement of the gland as a whole along z.
pub fn gland_shift_m(world: &World) -> f64 {
    let body = world.tissue.deformed();
    let gland = (0..body.lattice.element_count() as u32)
        .filter(|&e| world.layer(&MaterialPoint::centre(e)) == LayerKind::Gland);
    let (sum, count) = gland.fold((0.0, 0.0), |(sum, count), e| {
        (sum + body.displacement(e)[2], count + 1.0)
    });
    sum / count * body.lattice.spacing_m
}

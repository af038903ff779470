//! Hand, device, force chain and tissue loop on one thread and one clock: a session that can be repeated.

use nalgebra::Vector3;
use std::sync::Arc;
use stylet_hw::{Device, DeviceInfo, Hand, HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_runtime::rt::exchange::{TipPose, TissueResponse};
use stylet_runtime::rt::recorder::recorder;
use stylet_runtime::rt::tissue::{TissueLoop, TissuePorts};
use stylet_runtime::rt::tissue_tape::TissueTape;
use stylet_runtime::rt::world::World;
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{self, ChainOutput, ChainParameters, ChainState};
use stylet_sim::needle::{LayerKind, NeedleParameters};
use stylet_sim::scene::SceneSource;

/// Haptic ticks are 1 ms; the tissue answers every `tissue_every`th.
pub struct Desk {
    pub device: SimulatedPhantom,
    pub parameters: ChainParameters,
    pub chain: ChainState,
    pub tissue: TissueLoop,
    pub tick: u64,
    info: DeviceInfo,
    tissue_every: u64,
    contact: u64,
    pose: TipPose,
    pose_in: triple_buffer::Input<TipPose>,
    response_out: triple_buffer::Output<TissueResponse>,
}

pub const DT_S: f64 = 1e-3;

impl Desk {
    /// Engaged, the tip at `start`, the needle along +z.
    pub fn new(world: World, start: Vector3<f64>, hand: Hand, tissue_every: u64) -> Self {
        let device = SimulatedPhantom::new(SimulatedPhantomConfig {
            hand,
            start_tip_in_world: start,
            ..SimulatedPhantomConfig::default()
        });
        let info = device.info();
        let (pose_in, pose) = triple_buffer::triple_buffer(&TipPose::default());
        let (response, response_out) = triple_buffer::triple_buffer(&TissueResponse::default());
        let source = Arc::new(SceneSource::Builtin(world.scene.name.clone()));
        let (flight, _) = recorder(Box::new(TissueTape::new(&world, source)));
        let ports = TissuePorts {
            pose,
            response,
            orders: rtrb::RingBuffer::new(1).1,
            notices: rtrb::RingBuffer::new(1).0,
            old_worlds: rtrb::RingBuffer::new(1).0,
            slots: rtrb::RingBuffer::new(1).1,
            filled: rtrb::RingBuffer::new(1).0,
            flight,
        };
        let mut chain = ChainState::new(&info);
        chain.gate.engage();
        Self {
            device,
            parameters: ChainParameters {
                needle: NeedleParameters::default(),
                force: ForceParameters::default(),
            },
            chain,
            tissue: TissueLoop::new(1, ports, Box::new(world), tissue_every as f64 * DT_S),
            tick: 0,
            info,
            tissue_every,
            contact: 0,
            pose: TipPose::default(),
            pose_in,
            response_out,
        }
    }

    pub fn go_to(&mut self, tip: Vector3<f64>, speed_m_per_s: f64) {
        self.device.set_hand_goal(&HandGoal {
            tip_in_world: tip,
            direction: Vector3::z(),
            speed_m_per_s,
            acceleration_m_per_s2: 20.0 * speed_m_per_s.max(0.05),
        });
    }

    /// One tick of the chain, as the haptic loop makes it; and of the tissue, when it is due.
    pub fn step(&mut self) -> ChainOutput {
        self.tick += 1;
        let sample = self.device.read(DT_S).expect("the simulated device answers");
        let tissue = *self.response_out.read();
        let touching = tissue.contact > self.pose.released_contact;
        let touch = touching.then(|| tissue.touch());
        self.contact = if touching { tissue.contact } else { self.contact };
        let output = chain::step(
            &self.parameters,
            &self.info,
            &mut self.chain,
            &sample,
            touch.as_ref(),
            DT_S,
        );
        self.device.write(&output.wrench).expect("the gate gives numbers");
        if output.left {
            self.pose.released_contact = self.contact;
        }
        self.pose = TipPose {
            time_ns: self.tick * 1_000_000,
            tip_in_scene: sample.tip_in_world,
            direction: sample.direction_in_world(),
            speed_along_m_per_s: output.speed_along_m_per_s,
            phase: output.phase,
            punctured: self.chain.needle.punctured,
            held_travel_m: self.chain.held_travel_m,
            released_contact: self.pose.released_contact,
            innermost_layer: self.chain.path.innermost(),
            seen_layer: self.chain.path.seen(),
        };
        self.pose_in.write(self.pose);
        if self.tick.is_multiple_of(self.tissue_every) {
            self.tissue.tick(self.tick * 1_000_000);
        }
        output
    }

    pub fn run(&mut self, seconds: f64) -> Vec<ChainOutput> {
        (0..(seconds / DT_S).round() as u64).map(|_| self.step()).collect()
    }
}

/// 5 mm before the tissue, on the axis of the gland.
pub fn axis_start(world: &World) -> Vector3<f64> {
    let lattice = &world.scene.lattice;
    let elements = 0..lattice.element_count() as u32;
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for element in elements.filter(|&e| world.layer(e) == LayerKind::Gland) {
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

/// How far the gland as a whole has moved along z.
pub fn gland_shift_m(world: &World) -> f64 {
    let body = world.tissue.deformed();
    let gland = (0..body.lattice.element_count() as u32).filter(|&e| world.layer(e) == LayerKind::Gland);
    let (sum, count) = gland.fold((0.0, 0.0), |(sum, count), e| {
        (sum + body.displacement(e)[2], count + 1.0)
    });
    sum / count * body.lattice.spacing_m
}

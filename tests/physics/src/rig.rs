//! A hand, a device, a link and the force chain, without processes or tissue: membranes are planes across the way.

use nalgebra::Vector3;
use stylet_benches::session::Tick;
use stylet_hw::{BadLink, Device, DeviceInfo, Hand, HandGoal, LinkFaults, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_sim::force::chain::{self, ChainParameters, ChainState, Touch};
use stylet_sim::force::{ForceParameters, LocalResponse, PassivityParameters};
use stylet_sim::needle::{LayerKind, NeedleParameters};

/// A session along +z.
#[derive(Clone)]
pub struct Rig {
    pub device: BadLink<SimulatedPhantom>,
    pub parameters: ChainParameters,
    pub chain: ChainState,
    pub tick: u64,
    pub period_s: f64,
    info: DeviceInfo,
    /// Beginning of each layer, outermost first.
    layers: Vec<(f64, LayerKind)>,
    /// Innermost layer met, and the number it was given.
    met: Option<(usize, u64)>,
    numbers: u64,
}

impl Rig {
    /// Makes a rig, engaged, 5 mm before the first layer.
    pub fn new(hand: Hand, faults: LinkFaults, layers: &[(f64, LayerKind)], period_s: f64) -> Self {
        let config = SimulatedPhantomConfig {
            hand,
            ..SimulatedPhantomConfig::default()
        };
        Self::over(config, faults, layers, period_s)
    }

    /// Returns a steady hand, a good link, and encoders of this step.
    pub fn with_position_step(step_m: f64, layers: &[(f64, LayerKind)]) -> Self {
        let mut config = SimulatedPhantomConfig::default();
        config.info.position_step_m = step_m;
        Self::over(config, LinkFaults::default(), layers, 1e-3)
    }

    fn over(config: SimulatedPhantomConfig, faults: LinkFaults, layers: &[(f64, LayerKind)], period_s: f64) -> Self {
        let phantom = SimulatedPhantom::new(SimulatedPhantomConfig {
            start_tip_in_world: Vector3::z() * -5e-3,
            ..config
        });
        let info = phantom.info();
        let mut chain = ChainState::new(&info);
        chain.gate.engage();
        Self {
            device: BadLink::new(phantom, faults),
            parameters: ChainParameters {
                needle: NeedleParameters::default(),
                force: ForceParameters::default(),
            },
            chain,
            tick: 0,
            period_s,
            info,
            layers: layers.to_vec(),
            met: None,
            numbers: 0,
        }
    }

    /// Watches the energy without control, so that a shake softens nothing.
    pub fn uncontrolled(mut self) -> Self {
        self.parameters.force.gate.passivity = PassivityParameters::OFF;
        self
    }

    pub fn go_to(&mut self, z_m: f64, speed_m_per_s: f64) {
        self.device.set_hand_goal(&HandGoal {
            tip_in_world: Vector3::z() * z_m,
            direction: Vector3::z(),
            speed_m_per_s,
            acceleration_m_per_s2: 10.0 * speed_m_per_s.max(0.05),
        });
    }

    pub fn step(&mut self) -> Tick {
        let sample = self.device.read(self.period_s).expect("the simulated device answers");
        self.follow_layers(sample.tip_in_world.z);
        let touch = self.touch();
        let output = chain::step(
            &self.parameters,
            &self.info,
            &mut self.chain,
            &sample,
            touch.as_ref(),
            self.period_s,
        );
        if output.left {
            self.met = None;
        }
        self.device.write(&output.wrench).expect("the gate gives numbers");
        self.tick += 1;
        Tick {
            output,
            true_tip_m: self.device.device.true_tip_in_world().z,
            true_speed_m_per_s: self.device.device.true_velocity_m_per_s().norm(),
            work_j: self.device.device.work_j(),
        }
    }

    pub fn run(&mut self, seconds: f64) -> Vec<Tick> {
        let ticks = (seconds / self.period_s).round() as usize;
        (0..ticks).map(|_| self.step()).collect()
    }

    /// Stands for the tissue loop: the tip is in the innermost layer that begins before it.
    fn follow_layers(&mut self, z_m: f64) {
        let inside = self.layers.iter().rposition(|(begin_m, _)| z_m > *begin_m);
        let met = self.met.map(|(index, _)| index);
        // The chain meets again what it has left.
        if let Some((_, number)) = self.met
            && self.chain.path.innermost() < number
            && self.chain.path.seen() >= number
        {
            self.met = self
                .chain
                .path
                .sections()
                .len()
                .checked_sub(1)
                .map(|last| (last, self.chain.path.innermost()));
        }
        if let Some(index) = inside
            && met.is_none_or(|m| m < index && self.chain.needle.punctured)
        {
            self.numbers += 1;
            self.met = Some((met.map_or(0, |m| m + 1).min(index), self.numbers));
        }
    }

    fn touch(&self) -> Option<Touch> {
        let (index, layer_number) = self.met?;
        let (begin_m, layer) = *self.layers.get(index)?;
        Some(Touch {
            contact_in_world: Vector3::z() * self.layers.first()?.0,
            path_direction: Vector3::z(),
            layer,
            layer_number,
            layer_in_world: Vector3::z() * begin_m,
            local: LocalResponse::default(),
        })
    }
}

/// Returns every hand of the envelope: corners, and the geometric middle of each axis.
pub fn hand_envelope() -> impl Iterator<Item = Hand> {
    let masses = [0.1, 0.32, 1.0];
    let dampings = [2.0, 6.3, 20.0];
    let stiffnesses = [50.0, 220.0, 1000.0];
    masses.into_iter().flat_map(move |mass_kg| {
        dampings.into_iter().flat_map(move |damping_n_s_per_m| {
            stiffnesses.into_iter().map(move |stiffness_n_per_m| Hand {
                mass_kg,
                damping_n_s_per_m,
                stiffness_n_per_m,
                effort: None,
            })
        })
    })
}

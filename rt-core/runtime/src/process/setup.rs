//! What a run needs before its threads start: scene, device, shared memory, locked memory, and both loops.

use super::{Options, RunError, SecondOptions};
use crate::bridge::ports::Ports;
use crate::bridge::{ScenePicture, SecondSetup};
use crate::device;
use crate::rt::arm::{self, Ask, CoresAwake};
use crate::rt::clock::{self, TISSUE_PERIOD_NS, TISSUE_PHASE, Wait};
use crate::rt::haptic::HapticLoop;
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::second::{self, SecondBridgePorts, SecondLoop, SecondMemory, SecondTape, gate_of};
use crate::rt::timing::Probes;
use crate::rt::tissue::TissueLoop;
use crate::rt::tissue_tape::TissueTape;
use crate::rt::wiring::{BridgePorts, Capacities, Wiring};
use crate::rt::world::World;
use std::sync::Arc;
use stylet_hw::{Device, DeviceInfo};
use stylet_shm_schema::service::{self, Node, SlicePublisher, StateBoard};
use stylet_shm_schema::{ParameterSet, SecondRecord, SecondState, flags};
use stylet_sim::active::{Active, activate};
use stylet_sim::scene::{Scene, SceneSource};

/// Scene, device and their figures.
pub(super) struct Setup {
    pub session_id: u64,
    pub info: DeviceInfo,
    pub second_info: Option<DeviceInfo>,
    pub picture: ScenePicture,
    pub source: Arc<SceneSource>,
    pub body: Body,
}

/// What the loops will own.
pub(super) struct Body {
    device: Box<dyn Device>,
    second: Option<Box<dyn Device>>,
    active: Active,
    world: Box<World>,
}

/// Both loops and the bridge's ends of their rings.
pub(super) struct Loops {
    pub haptic: HapticLoop,
    pub tissue: TissueLoop,
    pub bridge: BridgePorts,
    pub second: Option<SecondLoops>,
}

/// The second device's loop and the bridge's ends of its rings.
pub(super) struct SecondLoops {
    own: SecondLoop,
    info: DeviceInfo,
    bridge: SecondBridgePorts,
}

impl SecondLoops {
    /// What its thread needs, and what the bridge needs.
    pub fn join((loops, shared): (Self, SecondShared)) -> ((SecondLoop, StateBoard<SecondState>), SecondSetup) {
        let setup = SecondSetup {
            device: loops.info,
            ports: loops.bridge,
            records: shared.records,
        };
        ((loops.own, shared.board), setup)
    }
}

/// The second device's place in shared memory.
pub(super) struct SecondShared {
    board: StateBoard<SecondState>,
    records: SlicePublisher<SecondRecord, u64>,
}

/// The process's place in shared memory.
pub(super) struct SharedMemory {
    pub node: Node,
    pub ports: Ports,
    pub board: StateBoard,
    pub second: Option<SecondShared>,
}

/// What the kernel granted the whole process.
pub(super) struct KernelGrants {
    /// Why memory is not locked; `None` when it is.
    pub unlocked: Option<String>,
    /// In force while it is kept.
    pub awake: Option<CoresAwake>,
}

impl Setup {
    pub fn new(options: &Options) -> Result<Self, RunError> {
        let scene = Scene::builtin(&options.scene).map_err(|e| RunError::Scene(e.to_string()))?;
        let scene = scene.with_tissue(options.tissue);
        let force_loop = Ask {
            priority: (!options.no_rt).then_some(options.haptic_priority),
            core: options.haptic_core,
        };
        // The driver's servo thread goes to the core of the tissue loop, which can wait for it longer than the force loop.
        let device = device::open(
            &options.device,
            &options.libraries,
            device::needle_start(&scene),
            force_loop,
            options.tissue_core,
        )?;
        let second = options
            .second
            .as_ref()
            .map(|second| open_second(options, second, &scene));
        let second = second.transpose()?;
        let info = device.info();
        let active = activate(&ParameterSet::default(), &info)?;
        let session_id = clock::now_ns() ^ (u64::from(std::process::id()) << 40);
        Ok(Self {
            session_id,
            info,
            second_info: second.as_ref().map(|second| second.info()),
            picture: ScenePicture::first(&scene, session_id),
            source: Arc::new(SceneSource::Builtin(options.scene.clone())),
            body: Body {
                device,
                second,
                world: Box::new(World::new(scene, active.limits.clone(), 1)?),
                active,
            },
        })
    }

    pub fn open_shared_memory(&self, options: &Options) -> Result<SharedMemory, RunError> {
        options.instance.sweep_dead();
        let node = options.instance.node()?;
        let (snapshot_len, words) = (self.picture.snapshot_size().total(), self.picture.word_count());
        let ports = Ports::new(&node, snapshot_len, words)?;
        let board = StateBoard::create(&node, self.session_id)?;
        let second = self.second_info.map(|_| self.open_second_memory(&node)).transpose()?;
        options.instance.secure_room()?;
        Ok(SharedMemory {
            node,
            ports,
            board,
            second,
        })
    }

    fn open_second_memory(&self, node: &Node) -> Result<SecondShared, RunError> {
        Ok(SecondShared {
            board: StateBoard::create(node, self.session_id)?,
            records: service::second_records::publisher(node, service::MAX_BATCH)?,
        })
    }
}

/// The device of the other hand, which may not be that of the needle.
fn open_second(options: &Options, second: &SecondOptions, scene: &Scene) -> Result<Box<dyn Device>, RunError> {
    if second.device.excludes(&options.device) {
        return Err(RunError::OneDeviceForBoth);
    }
    let its_loop = Ask {
        priority: (!options.no_rt).then_some(second.priority),
        core: second.core,
    };
    let start = device::second_start(scene);
    device::open(&second.device, &options.libraries, start, its_loop, options.tissue_core)
        .map_err(RunError::SecondDevice)
}

impl Body {
    /// `source` is what the scene was built from.
    pub fn into_loops(
        self,
        options: &Options,
        session_id: u64,
        source: &Arc<SceneSource>,
        probes: Option<Probes>,
    ) -> Loops {
        let info = self.device.info();
        let real_time = if options.no_rt { 0 } else { flags::REAL_TIME };
        let lines = match options.tissue.has_lines() {
            true => flags::LINE_NEEDED,
            false => 0,
        };
        let memory = HapticMemory::new(&info, (self.active.needle, self.active.force), real_time | lines);
        let haptic_tape = Box::new(HapticTape::new(&memory));
        let tissue_tape = Box::new(TissueTape::new(&self.world, Arc::clone(source)));
        let mut wiring = Wiring::new(Capacities::RUN, Some(haptic_tape), Some(tissue_tape));
        let seconds = |ns: u64| ns as f64 / 1e9;
        let second = self.second.zip(options.second.as_ref()).map(|(device, second)| {
            let info = device.info();
            let memory = SecondMemory::new(&info, gate_of(&self.active.force.gate, &info), !options.no_rt);
            let tape = Box::new(SecondTape::new(&memory));
            let (ports, tissue, bridge) = second::wire(Capacities::RUN, Some(tape));
            wiring.tissue.second = Some(tissue);
            let mut own = SecondLoop::new(session_id, device, ports, &memory, seconds(second.period_ns));
            own.wait = Wait::at_period(second.period_ns);
            SecondLoops { own, info, bridge }
        });
        let period_s = seconds(options.haptic_period_ns);
        let mut haptic = HapticLoop::new(session_id, self.device, wiring.haptic, &memory, period_s);
        haptic.wait = options.wait;
        let period_s = seconds(TISSUE_PERIOD_NS);
        let mut tissue = TissueLoop::new(session_id, wiring.tissue, self.world, period_s);
        let mut second = second;
        tissue.phase_ns = clock::phase_ns(TISSUE_PHASE, options.haptic_period_ns);
        if let Some(probes) = probes {
            if let Some(second) = &mut second {
                second.own.probe = probes.second.map(Box::new);
            }
            haptic.probe = Some(Box::new(probes.haptic));
            tissue.probe = Some(Box::new(probes.tissue));
        }
        Loops {
            haptic,
            tissue,
            bridge: wiring.bridge,
            second,
        }
    }
}

/// Locks the memory of the process and keeps its cores out of deep sleep; only `--no-rt` runs without locked memory.
pub(super) fn lock_memory(options: &Options) -> Result<KernelGrants, RunError> {
    let unlocked = match arm::lock_memory() {
        Ok(()) => None,
        Err(why) if options.no_rt => Some(why.to_string()),
        Err(why) => return Err(why.into()),
    };
    let awake = (!options.no_rt).then(arm::keep_cores_awake).flatten();
    Ok(KernelGrants { unlocked, awake })
}

//! Prepares a run before its threads start: scene, device, shared memory, locked memory, and both loops.

use super::{Options, RunError, SecondOptions};
use crate::control::{Bridge, ScenePicture, Wall, snapshot_len};
use crate::device;
use crate::rt::arm::{self, Ask, CoresAwake};
use crate::rt::clock::{self, TISSUE_PERIOD_NS, TISSUE_PHASE, Wait};
use crate::rt::haptic::HapticLoop;
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::second::{self, SecondControlPorts, SecondLoop, SecondMemory, SecondTape, gate_of};
use crate::rt::timing::Probes;
use crate::rt::tissue::TissueLoop;
use crate::rt::tissue_tape::TissueTape;
use crate::rt::wiring::{Capacities, ControlPorts, TapePorts, Wiring};
use crate::rt::world::World;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_hw::{Device, DeviceInfo};
use stylet_shm_schema::{HapticState, Owned, ParameterSet, SecondState, flags};
use stylet_sim::active::{Active, activate};
use stylet_sim::scene::{Scene, SceneSource};
use stylet_wall::board::Writer;
use stylet_wall::packet::Start;

/// Scene and devices of a run, before its memory is locked.
pub(super) struct Setup {
    pub session_id: u64,
    pub info: DeviceInfo,
    pub second_info: Option<DeviceInfo>,
    pub picture: ScenePicture,
    pub source: Arc<SceneSource>,
    pub bodies: Bodies,
}

/// What the loops will own.
pub(super) struct Bodies {
    device: Box<dyn Device>,
    second: Option<Box<dyn Device>>,
    active: Active,
    world: Box<World>,
}

/// All loops, and the control thread's ends of their rings.
pub(super) struct Loops {
    pub haptic: HapticLoop,
    pub tissue: TissueLoop,
    pub second: Option<(SecondLoop, SecondControlPorts)>,
    pub control: ControlPorts,
    pub tapes: TapePorts,
}

/// Boards that the loops of both devices write.
pub(super) type Boards = (Writer<HapticState>, Option<Writer<SecondState>>);

/// Grants of the kernel to the whole process.
pub(super) struct KernelGrants {
    /// Why memory is not locked; `None` when it is.
    pub unlocked: Option<String>,
    /// In force while it is held.
    pub awake: Option<CoresAwake>,
}

impl Setup {
    pub fn new(options: &Options) -> Result<Self, RunError> {
        let scene = Scene::builtin(&options.scene)?;
        let force_loop = Ask {
            priority: (!options.no_rt).then_some(options.haptic_priority),
            core: options.haptic_core,
        };
        // The driver's servo thread shares the tissue loop's core: the tissue loop can wait longer than the force loop.
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
        let world = Box::new(World::new(scene, options.tissue, active.limits.clone(), 1)?);
        let picture = ScenePicture::first(&world.scene, session_id);
        Ok(Self {
            session_id,
            info,
            second_info: second.as_ref().map(|second| second.info()),
            picture,
            source: Arc::new(SceneSource::Builtin(options.scene.clone())),
            bodies: Bodies {
                device,
                second,
                world,
                active,
            },
        })
    }

    /// Makes the boards and starts the bridge.
    pub fn show(&mut self, owned: Owned, is_watched: &Arc<AtomicBool>) -> Result<(Bridge, Boards), RunError> {
        let (state, memory) = Writer::new("stylet-state", 0).map_err(RunError::Board)?;
        let second = self.second_info.map(|_| Writer::new("stylet-second-state", 0));
        let (second_state, second_memory) = second.transpose().map_err(RunError::Board)?.unzip();
        let snapshot_len = snapshot_len(&self.bodies.world.scene);
        let start = Start {
            session_id: self.session_id,
            snapshot_len: snapshot_len as u64,
            word_count: self.picture.word_count() as u64,
            has_second: u64::from(self.second_info.is_some()),
        };
        let mut wall = Bridge::new(owned, start, (memory, second_memory), Arc::clone(is_watched))?;
        self.bodies.world.shown = Some(wall.make_board(snapshot_len).map_err(RunError::Board)?);
        Ok((wall, (state, second_state)))
    }
}

/// Opens the other hand's device, which may not be the needle's.
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

impl Bodies {
    /// `source` is the source of the scene.
    pub fn into_loops(
        self,
        options: &Options,
        session_id: u64,
        source: &Arc<SceneSource>,
        mut probes: Option<Probes>,
        is_watched: &Arc<AtomicBool>,
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
        wiring.tissue.is_watched = Arc::clone(is_watched);
        let seconds = |ns: u64| ns as f64 / 1e9;
        let second = self.second.zip(options.second.as_ref()).map(|(device, second)| {
            let info = device.info();
            let memory = SecondMemory::new(&info, gate_of(&self.active.force.gate, &info), !options.no_rt);
            let tape = Box::new(SecondTape::new(&memory));
            let (ports, tissue, control) = second::wire(Capacities::RUN, Some(tape));
            wiring.tissue.second = Some(tissue);
            let mut own = SecondLoop::new(session_id, device, ports, &memory, seconds(second.period_ns));
            own.device.wait = Wait::at_period(second.period_ns);
            own.device.probe = probes.as_mut().and_then(|probes| probes.second.take()).map(Box::new);
            (own, control)
        });
        let period_s = seconds(options.haptic_period_ns);
        let mut haptic = HapticLoop::new(session_id, self.device, wiring.haptic, &memory, period_s);
        haptic.device.wait = options.wait;
        let period_s = seconds(TISSUE_PERIOD_NS);
        let mut tissue = TissueLoop::new(session_id, wiring.tissue, self.world, period_s);
        tissue.phase_ns = clock::phase_ns(TISSUE_PHASE, options.haptic_period_ns);
        if let Some(probes) = probes {
            haptic.device.probe = Some(Box::new(probes.haptic));
            tissue.probe = Some(Box::new(probes.tissue));
        }
        Loops {
            haptic,
            tissue,
            control: wiring.control,
            tapes: wiring.tapes,
            second,
        }
    }
}

/// Locks the memory of the process and keeps its cores out of deep sleep. Only `--no-rt` permits unlocked memory.
pub(super) fn lock_memory(options: &Options) -> Result<KernelGrants, RunError> {
    let unlocked = match arm::lock_memory() {
        Ok(()) => None,
        Err(why) if options.no_rt => Some(why.to_string()),
        Err(why) => return Err(why.into()),
    };
    let awake = (!options.no_rt).then(arm::keep_cores_awake).flatten();
    Ok(KernelGrants { unlocked, awake })
}

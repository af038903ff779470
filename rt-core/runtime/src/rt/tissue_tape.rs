//! The tissue loop's flight recording, written each tick.

use crate::rt::contact::Contact;
use crate::rt::exchange::TissueStep;
use crate::rt::layers_met::LayersMet;
use crate::rt::left_loads::{LeftLoads, NeedleLoads};
use crate::rt::line_loads::LineLoads;
use crate::rt::pose::TipPose;
use crate::rt::probe_tape::{ProbeEntry, ProbeTape};
use crate::rt::recorder::{Last, Tape};
use crate::rt::response::TissueResponse;
use crate::rt::seed::Seed;
use crate::rt::world::World;
use bytemuck::bytes_of;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_shm_schema::MAX_SEEDS;
use stylet_sim::limits::Limits;
use stylet_sim::line::MAX_LEFT;
use stylet_sim::migration::Migration;
use stylet_sim::probe::{ProbeMemory, ProbePose};
use stylet_sim::scene::{SceneSource, TissueKind};
use stylet_sim::tissue::Held;

/// Ticks between two checkpoints: 5 s at 200 Hz. Two are kept, so that a tape reaches back at least 5 s.
const CHECKPOINT_EVERY: u64 = 1000;
/// Ticks on a tape.
pub const TAPE_TICKS: usize = 2 * CHECKPOINT_EVERY as usize;
const ORDERS: usize = 1024;
/// Largest body that is recorded: copying a larger one would take too much of a tick.
pub const MAX_BODY_BYTES: usize = 8 << 20;

/// A recorded order to the tissue loop. A new scene begins a new tape instead.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TapedOrder {
    /// A step, as ordered.
    Step(TissueStep),
    /// Another line of the needle.
    Line {
        /// Number of the line.
        generation: u64,
    },
    /// Another ultrasound probe.
    Probe {
        /// Edge of the elements that it was solved in, m.
        edge_m: f64,
    },
}

/// State of the tissue loop between ticks, apart from that of the body, and what lies in it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueState {
    /// The present contact.
    pub contact: Option<Contact>,
    /// Contacts so far.
    pub contacts: u64,
    /// The needle is in tissue along the line that `response` names.
    pub in_by_line: bool,
    /// Forces on the line in the last tick.
    pub loads: LineLoads,
    /// Pose of the second hand's probe.
    pub probe_pose: Option<ProbePose>,
    /// Its displacement of the line was shown to the force loop.
    pub is_outside_shown: bool,
    /// Layers on the path of the needle.
    pub layers: LayersMet,
    /// The tip has been outside since the last contact.
    pub clear: bool,
    /// The element that the tip holds.
    pub held: Option<Held>,
    /// Pose that the last tick used.
    pub pose: TipPose,
    /// Response of the last tick.
    pub response: TissueResponse,
}

impl Default for TissueState {
    fn default() -> Self {
        Self {
            contact: None,
            contacts: 0,
            in_by_line: false,
            loads: LineLoads::default(),
            probe_pose: None,
            is_outside_shown: false,
            layers: LayersMet::default(),
            clear: true,
            held: None,
            pose: TipPose::default(),
            response: TissueResponse::default(),
        }
    }
}

/// All state of the tissue loop between ticks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TissueMemory {
    /// Apart from the body.
    pub state: TissueState,
    /// Seeds in the tissue.
    pub seeds: Vec<Seed>,
    /// Seeds that the last reset removed, until another is dropped.
    pub removed: Vec<Seed>,
    /// Needles that stay in: the loads behind each one's share of the body.
    pub left: Vec<NeedleLoads>,
    /// The probe.
    pub probe: ProbeMemory,
    /// Limits in use.
    pub limits: Limits,
    /// Migration of seeds.
    pub migration: Migration,
    /// State saved by the tissue model.
    pub body: Vec<u8>,
}

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueEntry {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// Pose that the tick used.
    pub pose: TipPose,
    /// Forces on a needle line that the tick used.
    pub loads: LineLoads,
    /// The element that the tick held.
    pub held: Option<Held>,
    /// Largest violation of a limit after the step, in elements.
    pub residual: f64,
    /// Response of the tick.
    pub response: TissueResponse,
}

/// Room for the loads of needles that stay in; allocated when the first is left, for as many ticks as a tape has.
pub struct LeftTape(Last<(u64, LeftLoads)>);

impl LeftTape {
    /// Returns a blank tape.
    pub fn new() -> Box<Self> {
        Box::new(Self(Last::new(&(0, LeftLoads::default()), TAPE_TICKS)))
    }
}

/// The last ticks of the tissue loop in one scene. Numbers count from the first tick on the tape.
pub struct TissueTape {
    scene_generation: u64,
    scene: Arc<SceneSource>,
    /// The last ticks.
    pub ticks: Last<TissueEntry>,
    /// Orders, each with the number of the tick that applied it.
    pub orders: Last<(u64, TapedOrder)>,
    /// Loads of needles that stay in; allocated when the first is left.
    left: Option<Box<LeftTape>>,
    /// Poses of the probe; allocated once there is one.
    probe: Option<Box<ProbeTape>>,
    /// Written alternately, each with the tick that follows it.
    checkpoints: [(u64, TissueMemory); 2],
    /// Number of checkpoints, and the tick from which the next is due.
    points: usize,
    next_due: u64,
    tissue: Option<TissueKind>,
    end: TissueMemory,
    /// The body is too large to be recorded, or its model cannot be saved, or built again.
    not_kept: bool,
}

impl TissueTape {
    /// Returns a tape for the body of `world`, built from `scene`.
    pub fn new(world: &World, scene: Arc<SceneSource>) -> Self {
        let body_len = world.tissue.memory_len();
        let tissue = world.spec.built_in;
        let not_kept = body_len == 0 || body_len > MAX_BODY_BYTES || tissue.is_none();
        let memory = || TissueMemory {
            state: TissueState::default(),
            seeds: Vec::with_capacity(MAX_SEEDS),
            removed: Vec::with_capacity(MAX_SEEDS),
            left: Vec::with_capacity(MAX_LEFT),
            probe: ProbeMemory::default(),
            limits: world.limits.clone(),
            migration: world.migration,
            body: vec![0; if not_kept { 0 } else { body_len }],
        };
        let blank = TissueEntry {
            woke_ns: 0,
            pose: TipPose::default(),
            loads: LineLoads::default(),
            held: None,
            residual: 0.0,
            response: TissueResponse::default(),
        };
        Self {
            scene_generation: world.generation,
            scene,
            ticks: Last::new(&blank, if not_kept { 1 } else { TAPE_TICKS }),
            orders: Last::new(&(0, TapedOrder::Step(TissueStep::Reset)), ORDERS),
            left: None,
            probe: None,
            checkpoints: [(0, memory()), (0, memory())],
            points: 0,
            next_due: 0,
            tissue,
            end: memory(),
            not_kept,
        }
    }

    /// Returns where to copy the state before the next tick, if a checkpoint is due and `is_all_saved`, which
    /// [`TissueModel`](stylet_sim::tissue::TissueModel) reports.
    pub fn checkpoint_due(&mut self, is_all_saved: bool) -> Option<&mut TissueMemory> {
        let tick = self.ticks.next();
        if self.not_kept || !is_all_saved || tick < self.next_due {
            return None;
        }
        let [even, odd] = &mut self.checkpoints;
        let slot = if self.points.is_multiple_of(2) { even } else { odd };
        self.points += 1;
        self.next_due = tick + CHECKPOINT_EVERY;
        slot.0 = tick;
        Some(&mut slot.1)
    }

    /// Takes room for the loads of needles that stay in.
    pub fn take_left_room(&mut self, room: &mut Option<Box<LeftTape>>) {
        if self.left.is_none() {
            self.left = room.take();
        }
    }

    /// Records the loads of needles that stay in on the body in the current tick, if they have changed.
    pub fn left_loads(&mut self, loads: &LeftLoads) {
        let tick = self.ticks.next();
        if let Some(left) = &mut self.left
            && left
                .0
                .newest()
                .is_none_or(|(_, newest)| bytes_of(newest) != bytes_of(loads))
        {
            left.0.push((tick, *loads));
        }
    }

    /// Takes room for the probe.
    pub fn take_probe_room(&mut self, room: &mut Option<Box<ProbeTape>>) {
        if let Some(mut room) = room.take() {
            let [even, odd, end] = &mut room.memories;
            let [before, after] = &mut self.checkpoints;
            std::mem::swap(even, &mut before.1.probe);
            std::mem::swap(odd, &mut after.1.probe);
            std::mem::swap(end, &mut self.end.probe);
            self.probe = Some(room);
        }
    }

    /// Records the probe's pose in the current tick, and its force on the hand.
    pub fn probe(&mut self, entry: ProbeEntry) {
        let tick = self.ticks.next();
        if let Some(room) = &mut self.probe {
            room.entries.push((tick, entry));
        }
    }

    /// Records an order of the current tick.
    pub fn order(&mut self, order: TapedOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// Returns where to copy the state after the last tick, before the tape is handed over.
    pub fn end(&mut self) -> Option<&mut TissueMemory> {
        (!self.not_kept).then_some(&mut self.end)
    }

    /// Returns the repeatable stretch from the older checkpoint.
    pub fn flight(&self) -> Option<TissueFlight> {
        let next = self.ticks.next();
        if self.not_kept || next == 0 {
            return None;
        }
        let (probe, left) = (self.probe.as_ref(), self.left.as_ref());
        let complete = self
            .orders
            .complete_from()
            .max(left.map_or(0, |left| left.0.complete_from()));
        let complete = complete.max(probe.map_or(0, |probe| probe.entries.complete_from()));
        let possible = self.ticks.first().max(complete)..next;
        let written = self.checkpoints.iter().take(self.points);
        let mut points: Vec<&(u64, TissueMemory)> = written.filter(|(tick, _)| possible.contains(tick)).collect();
        points.sort_by_key(|(tick, _)| *tick);
        let (first, memory) = points.first()?;
        // Loads from before the stretch persist in it.
        let before = left.and_then(|left| left.0.since(0).take_while(|(tick, _)| tick < first).last());
        let before = before.map(|(_, loads)| (0, *loads));
        let left = left.map(|left| left.0.counted_from(*first)).unwrap_or_default();
        Some(TissueFlight {
            scene: (*self.scene).clone(),
            tissue: self.tissue?,
            memory: memory.clone(),
            middle: points.get(1).map(|(tick, memory)| (tick - first, memory.clone())),
            end: self.end.clone(),
            ticks: self.ticks.since(*first).copied().collect(),
            orders: self.orders.counted_from(*first),
            probe: probe
                .map(|probe| probe.entries.counted_from(*first))
                .unwrap_or_default(),
            left: before.into_iter().chain(left).collect(),
        })
    }
}

impl Tape for TissueTape {
    fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
        if let Some(left) = &mut self.left {
            left.0.clear();
        }
        if let Some(probe) = &mut self.probe {
            probe.entries.clear();
        }
        self.points = 0;
        self.next_due = 0;
    }

    fn is_for(&self, scene_generation: u64) -> bool {
        self.scene_generation == scene_generation
    }
}

/// A repeatable stretch of the tissue loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TissueFlight {
    /// Source of the scene.
    pub scene: SceneSource,
    /// Its tissue model.
    pub tissue: TissueKind,
    /// Before the first of `ticks`.
    pub memory: TissueMemory,
    /// A later checkpoint, with the index of the tick that follows it.
    pub middle: Option<(u64, TissueMemory)>,
    /// After the last of `ticks`.
    pub end: TissueMemory,
    /// The ticks.
    pub ticks: Vec<TissueEntry>,
    /// Orders, each with the index of the tick that applied it.
    pub orders: Vec<(u64, TapedOrder)>,
    /// Loads of needles that stay in, each with the index of the first tick that used them.
    pub left: Vec<(u64, LeftLoads)>,
    /// Poses of the probe, with the index of each tick.
    pub probe: Vec<(u64, ProbeEntry)>,
}

impl TissueFlight {
    /// Numbers of the loop's lines, in order.
    pub fn line_numbers(&self) -> impl Iterator<Item = u64> {
        let before = self.memory.state.response.line;
        let first = (before != 0).then_some(before);
        let taken = self.orders.iter().filter_map(|(_, order)| match order {
            TapedOrder::Line { generation } => Some(*generation),
            _ => None,
        });
        let left = self.memory.left.iter().map(|left| left.generation);
        first.into_iter().chain(left).chain(taken)
    }

    /// Edge of the elements that its probe was solved in, m; `None` if the loop had no probe.
    pub fn probe_edge_m(&self) -> Option<f64> {
        let taken = self.orders.iter().find_map(|(_, order)| match order {
            TapedOrder::Probe { edge_m } => Some(*edge_m),
            _ => None,
        });
        let before = &self.memory.probe;
        before.is_there.then_some(before.edge_m).or(taken)
    }

    /// True if a needle on that line loaded tissue, so that its columns matter.
    pub fn is_pushed_by(&self, generation: u64) -> bool {
        let left = self.left.iter().flat_map(|(_, left)| left.needles());
        if left
            .chain(&self.memory.left)
            .any(|left| left.generation == generation && left.is_any())
        {
            return true;
        }
        let all = self.ticks.iter().map(|tick| &tick.loads);
        all.chain([&self.memory.state.loads])
            .any(|loads| loads.generation == generation && loads.is_any())
    }
}

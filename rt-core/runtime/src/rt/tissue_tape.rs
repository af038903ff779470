//! What the tissue loop writes to its flight recording, each tick.

use crate::rt::contact::Contact;
use crate::rt::layers_met::LayersMet;
use crate::rt::pose::TipPose;
use crate::rt::recorder::{Last, Tape, complete_from};
use crate::rt::response::TissueResponse;
use crate::rt::seed::Seed;
use crate::rt::world::World;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_shm_schema::MAX_SEEDS;
use stylet_sim::limits::Limits;
use stylet_sim::scene::SceneSource;
use stylet_sim::tissue::Held;

/// Ticks between two checkpoints: 5 s at 200 Hz. Two are kept, so that a tape reaches back at least 5 s.
const CHECKPOINT_EVERY: u64 = 1000;
const ORDERS: usize = 1024;
/// Larger bodies are not recorded: a copy of one would take too much of a tick.
pub const MAX_BODY_BYTES: usize = 8 << 20;

/// An order to the tissue loop, as far as it can be written down. A new scene begins a new tape instead.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TapedOrder {
    /// See [`TissueOrder::Limits`](crate::rt::exchange::TissueOrder).
    Limits(Limits),
    /// See [`TissueOrder::DropSeed`](crate::rt::exchange::TissueOrder).
    DropSeed,
    /// See [`TissueOrder::UndoSeed`](crate::rt::exchange::TissueOrder).
    UndoSeed,
    /// See [`TissueOrder::Reset`](crate::rt::exchange::TissueOrder).
    Reset,
}

/// Everything that one tick of the tissue loop leaves to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TissueMemory {
    /// Seeds in the tissue.
    pub seeds: Vec<Seed>,
    /// The present contact.
    pub contact: Option<Contact>,
    /// Contacts so far.
    pub contacts: u64,
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
    /// Limits in use.
    pub limits: Limits,
    /// As the tissue model saves it.
    pub body: Vec<u8>,
}

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueEntry {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// Pose that the tick used.
    pub pose: TipPose,
    /// The element that the tick held.
    pub held: Option<Held>,
    /// Largest violation of a limit after the step, in elements.
    pub residual: f64,
    /// Response of the tick.
    pub response: TissueResponse,
}

/// The last ticks of the tissue loop in one scene. Numbers count from the first tick on the tape.
pub struct TissueTape {
    scene_generation: u64,
    scene: Arc<SceneSource>,
    /// The last ticks.
    pub ticks: Last<TissueEntry>,
    /// Orders, each with the number of the tick that took it up.
    pub orders: Last<(u64, TapedOrder)>,
    /// Written in turn, each with the tick that it comes before.
    checkpoints: [(u64, TissueMemory); 2],
    end: TissueMemory,
    /// The body is too large to be recorded, or its model cannot be saved.
    not_kept: bool,
}

impl TissueTape {
    /// For the body of `world`, built from `scene`.
    pub fn new(world: &World, scene: Arc<SceneSource>) -> Self {
        let body_len = world.tissue.memory_len();
        let not_kept = body_len == 0 || body_len > MAX_BODY_BYTES;
        let memory = || TissueMemory {
            seeds: Vec::with_capacity(MAX_SEEDS),
            contact: None,
            contacts: 0,
            layers: LayersMet::default(),
            clear: true,
            held: None,
            pose: TipPose::default(),
            response: TissueResponse::default(),
            limits: world.limits.clone(),
            body: vec![0; if not_kept { 0 } else { body_len }],
        };
        let blank = TissueEntry {
            woke_ns: 0,
            pose: TipPose::default(),
            held: None,
            residual: 0.0,
            response: TissueResponse::default(),
        };
        Self {
            scene_generation: world.generation,
            scene,
            ticks: Last::new(&blank, if not_kept { 1 } else { 2 * CHECKPOINT_EVERY as usize }),
            orders: Last::new(&(0, TapedOrder::Reset), ORDERS),
            checkpoints: [(0, memory()), (0, memory())],
            end: memory(),
            not_kept,
        }
    }

    /// Where to copy all that the tick that begins now starts from, when it is time to.
    pub fn checkpoint_due(&mut self) -> Option<&mut TissueMemory> {
        let tick = self.ticks.next();
        if self.not_kept || !tick.is_multiple_of(CHECKPOINT_EVERY) {
            return None;
        }
        let [even, odd] = &mut self.checkpoints;
        let slot = if (tick / CHECKPOINT_EVERY).is_multiple_of(2) {
            even
        } else {
            odd
        };
        slot.0 = tick;
        Some(&mut slot.1)
    }

    /// Keeps an order of the tick that runs.
    pub fn order(&mut self, order: TapedOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// Where to copy what the last tick left, before the tape is handed over.
    pub fn end(&mut self) -> Option<&mut TissueMemory> {
        (!self.not_kept).then_some(&mut self.end)
    }

    /// The stretch from the older checkpoint that can be repeated.
    pub fn flight(&self) -> Option<TissueFlight> {
        let next = self.ticks.next();
        if self.not_kept || next == 0 {
            return None;
        }
        // The newest was written before the tick that is a multiple of the distance, the older one a distance before.
        let newest = (next - 1) / CHECKPOINT_EVERY * CHECKPOINT_EVERY;
        let mut points: Vec<&(u64, TissueMemory)> =
            self.checkpoints.iter().filter(|(tick, _)| *tick <= newest).collect();
        points.sort_by_key(|(tick, _)| *tick);
        points.dedup_by_key(|(tick, _)| *tick);
        points.retain(|(tick, _)| *tick >= complete_from(&self.orders));
        let (first, memory) = points.first()?;
        let orders = self.orders.since(0).filter(|(tick, _)| tick >= first);
        Some(TissueFlight {
            scene: (*self.scene).clone(),
            memory: memory.clone(),
            middle: points.get(1).map(|(tick, memory)| (tick - first, memory.clone())),
            end: self.end.clone(),
            ticks: self.ticks.since(*first).copied().collect(),
            orders: orders.map(|(tick, order)| (tick - first, order.clone())).collect(),
        })
    }
}

impl Tape for TissueTape {
    fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
    }

    fn is_for(&self, scene_generation: u64) -> bool {
        self.scene_generation == scene_generation
    }
}

/// A stretch of the tissue loop that can be repeated.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TissueFlight {
    /// What the scene was built from.
    pub scene: SceneSource,
    /// Before the first of `ticks`.
    pub memory: TissueMemory,
    /// A later checkpoint, with the index of the tick that it comes before.
    pub middle: Option<(u64, TissueMemory)>,
    /// After the last of `ticks`.
    pub end: TissueMemory,
    /// The ticks.
    pub ticks: Vec<TissueEntry>,
    /// Each with the index of the tick that took it up.
    pub orders: Vec<(u64, TapedOrder)>,
}

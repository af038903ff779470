//! The tissue tick, 200 Hz: newest pose → contact → held element → constraints → seeds → response → work ahead → snapshot.

use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid};
use crate::rt::exchange::*;
use crate::rt::layers_met::LayersMet;
use crate::rt::recorder::Recorder;
use crate::rt::timing::Probe;
use crate::rt::tissue_tape::{TapedOrder, TissueTape};
use crate::rt::world::World;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_shm_schema::{MAX_SEEDS, RefusalCode, SeedPose, SnapshotHeader, Vertex};
use stylet_sim::force::LocalResponse;
use stylet_sim::needle::LayerKind;
use stylet_sim::tissue::{Held, MaterialPoint, StepReport, element_ahead};

/// The needle must move inwards at least this fast to meet a membrane.
const CONTACT_SPEED_M_PER_S: f64 = 1e-3;
/// A seed is 4.5 mm long; its tail shows where its axis points.
const SEED_LENGTH_M: f64 = 4.5e-3;

/// Ends of the rings that this loop owns.
pub struct TissuePorts {
    pub pose: triple_buffer::Output<TipPose>,
    pub response: triple_buffer::Input<TissueResponse>,
    pub orders: rtrb::Consumer<TissueOrder>,
    pub notices: rtrb::Producer<Notice>,
    pub old_worlds: rtrb::Producer<Box<World>>,
    pub slots: rtrb::Consumer<SnapshotSlot>,
    pub filled: rtrb::Producer<SnapshotReturn>,
    pub flight: Recorder<TissueTape>,
}

mod flight;

/// A seed left in the tissue.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Seed {
    tip: MaterialPoint,
    tail: Option<MaterialPoint>,
    axis: [f64; 3],
    dropped_at_m: [f64; 3],
}

/// The contact that lasts.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Contact {
    number: u64,
    place: Vector3<f64>,
    direction: Vector3<f64>,
}

/// Everything that the tissue thread owns.
pub struct TissueLoop {
    pub session_id: u64,
    pub ports: TissuePorts,
    world: Box<World>,
    seeds: Vec<Seed>,
    contact: Option<Contact>,
    contacts: u64,
    layers: LayersMet,
    /// The tip has been outside since the last contact.
    clear: bool,
    held: Option<Held>,
    pose: TipPose,
    report: Option<StepReport>,
    response: TissueResponse,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    period_s: f64,
}

/// What [`Probe`] tells apart in this tick.
pub const TISSUE_STAGES: &[&str] = &[
    "orders and pose",
    "contact and hold",
    "constraints",
    "response",
    "ahead",
    "snapshot",
];

impl TissueLoop {
    pub fn new(session_id: u64, ports: TissuePorts, world: Box<World>, period_s: f64) -> Self {
        Self {
            session_id,
            ports,
            world,
            seeds: Vec::with_capacity(MAX_SEEDS),
            contact: None,
            contacts: 0,
            layers: LayersMet::default(),
            clear: true,
            held: None,
            pose: TipPose::default(),
            report: None,
            response: TissueResponse::default(),
            probe: None,
            period_s,
        }
    }

    /// Ends a stage of the tick, in a measurement.
    fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// What the haptic loop was last told.
    pub fn response(&self) -> &TissueResponse {
        &self.response
    }

    /// The scene that it works on.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Where the seeds are now, in the order of the drops.
    pub fn seeds(&self) -> impl Iterator<Item = SeedPose> {
        self.seeds.iter().map(|seed| self.pose_of(seed))
    }

    /// How far any element was from rest after the last tick.
    pub fn displacement_m(&self) -> f64 {
        let elements = self.report.map_or(0.0, |r| r.max_displacement);
        f64::from(elements) * self.world.scene.lattice.spacing_m
    }

    /// Gives the scene back, as it is.
    pub fn into_world(self) -> Box<World> {
        self.world
    }

    /// Runs on the ideal grid until `stop`.
    pub fn run(&mut self, _armed: &Armed, stop: &AtomicBool) {
        let mut grid = Grid::from(clock::now_ns(), (self.period_s * 1e9) as u64);
        let mut missed = 0;
        // SYNC: pairs with the bridge's release store; nothing but the flag is carried.
        while !stop.load(Ordering::Acquire) {
            let slept = clock::wait_until(grid.due_ns, 0);
            let woke_ns = clock::now_ns();
            self.response.worst_wake_ns = self.response.worst_wake_ns.max(woke_ns - grid.due_ns);
            self.tick(woke_ns);
            if let Some(probe) = &mut self.probe {
                probe.finish(grid.due_ns, woke_ns, missed, slept);
            }
            missed = grid.advance(clock::now_ns());
            self.response.missed += u64::from(missed);
        }
        self.hand_over_tape();
    }

    /// One tick; in the order of the data.
    pub fn tick(&mut self, woke_ns: u64) {
        self.checkpoint();
        self.take_orders();
        let before = self.pose;
        self.pose = *self.ports.pose.read();
        self.mark();
        self.end_contact_if_released();
        self.begin_contact_if_met(&before);
        self.meet_next_layer(&before);
        let travel = self.pose.held_travel_m - before.held_travel_m;
        self.hold(travel);
        self.mark();
        let report = self.world.tissue.step(self.held, self.period_s);
        self.report = Some(report);
        self.mark();
        self.respond(woke_ns, &report);
        self.tape(woke_ns, report.residual);
        self.mark();
        self.look_ahead(travel);
        self.mark();
        if let Some(probe) = &mut self.probe {
            probe.output_for_pose(self.response.tick, self.pose.time_ns);
        }
        self.publish_snapshot(woke_ns, &report);
    }

    fn take_orders(&mut self) {
        while let Ok(order) = self.ports.orders.pop() {
            match order {
                TissueOrder::Limits(limits) => {
                    self.tape_order(TapedOrder::Limits(limits.clone()));
                    self.world.set_limits(limits);
                }
                TissueOrder::DropSeed { ticket } => {
                    self.tape_order(TapedOrder::DropSeed);
                    self.drop_seed(ticket);
                }
                TissueOrder::UndoSeed { ticket } => {
                    self.tape_order(TapedOrder::UndoSeed);
                    self.undo_seed(ticket);
                }
                TissueOrder::Reset => {
                    self.tape_order(TapedOrder::Reset);
                    self.reset();
                }
                TissueOrder::World { ticket, world, tape } => {
                    self.swap(ticket, world);
                    self.ports.flight.replace(tape);
                    self.checkpoint();
                }
                TissueOrder::HandOverTape => self.hand_over_tape(),
            }
        }
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the bridge is gone; there is nobody to tell.
        let _ = self.ports.notices.push(notice);
    }

    fn reset(&mut self) {
        self.world.tissue.return_to_rest();
        self.seeds.clear();
        self.let_go();
        self.response.worst_residual = 0.0;
        self.response.worst_work_ns = 0;
        self.response.worst_wake_ns = 0;
        self.response.missed = 0;
        self.response.seed_count = 0;
    }

    fn let_go(&mut self) {
        self.contact = None;
        self.layers.end();
        self.held = None;
        self.clear = false;
        self.response.contact = 0;
    }

    fn swap(&mut self, ticket: Ticket, world: Box<World>) {
        let old = std::mem::replace(&mut self.world, world);
        // The ring has room for every world that can be under way; else leak it rather than free it here.
        if let Err(rtrb::PushError::Full(old)) = self.ports.old_worlds.push(old) {
            std::mem::forget(old);
        }
        self.seeds.clear();
        self.response.seed_count = 0;
        self.let_go();
        let (generation, tick) = (self.world.generation, self.response.tick);
        self.notify(Notice::WorldSwapped {
            ticket,
            generation,
            tick,
        });
    }

    fn locate(&self, place: &Vector3<f64>, hint: Option<u32>) -> Option<MaterialPoint> {
        MaterialPoint::locate(&self.world.tissue.deformed(), (*place).into(), hint)
    }

    fn end_contact_if_released(&mut self) {
        if let Some(contact) = self.contact
            && self.pose.released_contact >= contact.number
        {
            self.let_go();
            let (tick, time_ns) = (self.response.tick, self.pose.time_ns);
            self.notify(Notice::LeftTissue { tick, time_ns });
        }
    }

    /// The membrane is met where the tip's way since the last tick enters the deformed body.
    fn begin_contact_if_met(&mut self, before: &TipPose) {
        if self.contact.is_some() || self.pose.time_ns == 0 {
            return;
        }
        let inside = self.locate(&self.pose.tip_in_scene, None);
        let Some(point) = inside else {
            self.clear = true;
            return;
        };
        if !self.clear || self.pose.speed_along_m_per_s < CONTACT_SPEED_M_PER_S {
            return;
        }
        let place = self.entry_between(before.tip_in_scene, self.pose.tip_in_scene, point.element, |_| true);
        self.contacts += 1;
        self.contact = Some(Contact {
            number: self.contacts,
            place,
            direction: self.pose.direction,
        });
        let layer = self.world.layer(point.element);
        let number = self.layers.begin(layer);
        self.take_hold_at(layer, number, place, point.element);
        let (tick, time_ns) = (self.response.tick, self.pose.time_ns);
        self.notify(Notice::Contact {
            tick,
            time_ns,
            position_m: place,
        });
    }

    /// The tip has come from one layer into another: a membrane of its own, and a new held element.
    fn meet_next_layer(&mut self, before: &TipPose) {
        let (Some(_), Some(held)) = (self.contact, self.held) else {
            return;
        };
        let Some(point) = self.locate(&self.pose.tip_in_scene, Some(held.element)) else {
            return;
        };
        let layer = self.world.layer(point.element);
        let inwards = self.pose.speed_along_m_per_s > CONTACT_SPEED_M_PER_S;
        if let Some(number) = self.layers.enter(layer, inwards, &self.pose) {
            let (from, to) = (before.tip_in_scene, self.pose.tip_in_scene);
            let place = self.entry_between(from, to, point.element, |e| self.world.layer(e) == layer);
            self.take_hold_at(layer, number, place, point.element);
        }
    }

    fn take_hold_at(&mut self, layer: LayerKind, number: u64, place: Vector3<f64>, element: u32) {
        self.response.layer = layer;
        self.response.layer_number = number;
        self.response.layer_in_scene = place;
        self.held = Some(Held {
            element,
            position_m: self.world.tissue.deformed().position_m(element),
            patch_m: self.world.scene.tissue.tip_patch_m(),
        });
    }

    /// Bisection between a place outside and one inside; the inner one where even the start is inside.
    fn entry_between(
        &self,
        mut outside: Vector3<f64>,
        mut inside: Vector3<f64>,
        hint: u32,
        is_inside: impl Fn(u32) -> bool,
    ) -> Vector3<f64> {
        for _ in 0..8 {
            let middle = (outside + inside) / 2.0;
            if self
                .locate(&middle, Some(hint))
                .is_some_and(|point| is_inside(point.element))
            {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// The held element is the one at the tip, found by walking from the last one; it takes the eq. 6 step.
    fn hold(&mut self, travel: Vector3<f64>) {
        let Some(held) = self.held else { return };
        let mut next = held;
        // Before puncture the membrane keeps its element; after it the tip passes from one to the next.
        if self.pose.punctured
            && let Some(at_tip) = self.locate(&self.pose.tip_in_scene, Some(held.element))
            && at_tip.element != held.element
        {
            let position_m = self.world.tissue.deformed().position_m(at_tip.element);
            next = Held {
                element: at_tip.element,
                position_m,
                patch_m: self.world.scene.tissue.tip_patch_m(),
            };
        }
        for (coordinate, by) in next.position_m.iter_mut().zip(travel.iter()) {
            *coordinate += by;
        }
        self.held = Some(next);
    }

    /// The answer is out: time left over goes to what is held next if the needle goes on as it does.
    fn look_ahead(&mut self, travel: Vector3<f64>) {
        if self.world.scene.tissue.prepares() {
            let next = self.next_held(travel);
            self.world.tissue.prepare(next);
        }
    }

    fn next_held(&self, travel: Vector3<f64>) -> Option<Held> {
        let speed_m_per_s = self.pose.speed_along_m_per_s;
        if speed_m_per_s.abs() < CONTACT_SPEED_M_PER_S {
            return None;
        }
        let step_m = self.pose.direction * speed_m_per_s * self.period_s;
        let (body, held) = (self.world.tissue.deformed(), self.held);
        let element = element_ahead(
            &body,
            held.map(|h| h.element),
            self.pose.tip_in_scene.into(),
            step_m.into(),
        )?;
        // At the first contact there is no way yet that tells how tissue follows.
        let by_m = if held.is_some() { travel } else { step_m };
        let now_m = Vector3::from(body.position_m(element));
        Some(Held {
            element,
            position_m: (now_m + by_m).into(),
            patch_m: self.world.scene.tissue.tip_patch_m(),
        })
    }

    fn drop_seed(&mut self, ticket: Ticket) {
        let tip_m = self.pose.tip_in_scene;
        let hint = self.held.map(|h| h.element);
        let found = self.locate(&tip_m, hint);
        let notice = match found {
            None => Notice::Refused {
                ticket,
                why: RefusalCode::TipOutsideTissue,
            },
            Some(_) if self.seeds.len() >= MAX_SEEDS => Notice::Refused {
                ticket,
                why: RefusalCode::NoSeedLeft,
            },
            Some(tip) => {
                let tail = self.locate(&(tip_m - self.pose.direction * SEED_LENGTH_M), Some(tip.element));
                // Room for MAX_SEEDS was reserved: this push does not allocate.
                self.seeds.push(Seed {
                    tip,
                    tail,
                    axis: self.pose.direction.into(),
                    dropped_at_m: tip_m.into(),
                });
                self.response.seed_count = self.seeds.len() as u32;
                let tick = self.response.tick;
                let index = self.seeds.len() as u32 - 1;
                self.notify(Notice::Seed {
                    tick,
                    time_ns: self.pose.time_ns,
                    index,
                    position_m: tip_m,
                });
                Notice::Done { ticket, tick }
            }
        };
        self.notify(notice);
    }

    fn undo_seed(&mut self, ticket: Ticket) {
        let tick = self.response.tick;
        let notice = match self.seeds.pop() {
            Some(_) => Notice::Done { ticket, tick },
            None => Notice::Refused {
                ticket,
                why: RefusalCode::NoSeedToUndo,
            },
        };
        self.response.seed_count = self.seeds.len() as u32;
        self.notify(notice);
    }

    fn respond(&mut self, woke_ns: u64, report: &StepReport) {
        let (contact, held) = (self.contact, self.held.is_some());
        let local = self.local_response(report);
        let may_be_felt = self.world.tissue.may_be_felt(report);
        let response = &mut self.response;
        response.tick += 1;
        response.time_ns = woke_ns;
        response.contact = contact.map_or(0, |c| c.number);
        if let Some(contact) = contact {
            response.contact_in_scene = contact.place;
            response.path_direction = contact.direction;
        }
        response.local = local;
        response.worst_residual = response.worst_residual.max(report.residual);
        // Limits tightened over tissue that nothing holds are met as it recovers; no force depends on it.
        response.unsolved = !may_be_felt && held;
        self.ports.response.write(*response);
    }

    /// What the haptic loop carries on at its own rate; no answer while nothing is held.
    fn local_response(&self, report: &StepReport) -> LocalResponse {
        let Some(held) = self.held else {
            return LocalResponse::default();
        };
        let rest_m = Vector3::from(self.world.scene.lattice.rest_m(held.element));
        let now_m = Vector3::from(self.world.tissue.deformed().position_m(held.element));
        LocalResponse {
            tick: self.response.tick + 1,
            travel_m: self.pose.held_travel_m,
            displacement_m: now_m - rest_m,
            force_n: report.tip_force_n.map(Vector3::from),
        }
    }

    fn publish_snapshot(&mut self, woke_ns: u64, report: &StepReport) {
        let work_ns = clock::now_ns().saturating_sub(woke_ns);
        self.response.worst_work_ns = self.response.worst_work_ns.max(work_ns);
        while let Ok(slot) = self.ports.slots.pop() {
            let filled = slot.scene_generation == self.world.generation
                && slot.vertex_count == self.world.scene.surface.vertex_elements.len()
                && slot.node_count == self.world.scene.nodes.elements.len();
            if filled {
                self.fill(&slot, woke_ns, work_ns, report);
            }
            let _ = self.ports.filled.push(SnapshotReturn {
                index: slot.index,
                filled,
            });
            if filled {
                return;
            }
        }
    }

    fn fill(&self, slot: &SnapshotSlot, woke_ns: u64, work_ns: u64, report: &StepReport) {
        let sent = slot.vertex_count + slot.node_count;
        // SAFETY: the bridge loaned `vertex_count + node_count` vertices at this address to us alone and keeps them mapped
        // until the slot is returned; they were zeroed, and Vertex is valid for every bit pattern.
        let vertices = unsafe { std::slice::from_raw_parts_mut(slot.vertices, sent) };
        let positions: &mut [[f32; 3]] = bytemuck::cast_slice_mut::<Vertex, [f32; 3]>(vertices);
        let body = self.world.tissue.deformed();
        let (surface, inside) = positions.split_at_mut(slot.vertex_count);
        body.write_surface(&self.world.scene.surface, surface);
        body.write_displacements(&self.world.scene.nodes.elements, inside);
        // SAFETY: as above, for the header.
        let header = unsafe { &mut *slot.header };
        let spacing_m = self.world.scene.lattice.spacing_m;
        *header = SnapshotHeader {
            session_id: self.session_id,
            scene_generation: self.world.generation,
            tissue_tick: self.response.tick,
            time_ns: woke_ns,
            tip_in_scene_m: self.pose.tip_in_scene.into(),
            needle_direction: self.pose.direction.into(),
            held_in_scene_m: self.held.map_or([0.0; 3], |h| h.position_m),
            residual: report.residual,
            max_displacement_m: f64::from(report.max_displacement) * spacing_m,
            work_ns,
            passes: report.passes,
            moved_elements: report.moved,
            held_element: self.held.map_or(u32::MAX, |h| h.element),
            phase: self.pose.phase.code(),
            vertex_count: slot.vertex_count as u32,
            node_count: slot.node_count as u32,
            reserved: 0,
            seed_count: self.seeds.len() as u32,
            seeds: [bytemuck::Zeroable::zeroed(); MAX_SEEDS],
        };
        for (slot, seed) in header.seeds.iter_mut().zip(&self.seeds) {
            *slot = self.pose_of(seed);
        }
    }

    fn pose_of(&self, seed: &Seed) -> SeedPose {
        let body = self.world.tissue.deformed();
        let position_m = seed.tip.position_m(&body);
        let along = seed
            .tail
            .map(|tail| Vector3::from(position_m) - Vector3::from(tail.position_m(&body)));
        let axis = along.and_then(|a| a.try_normalize(1e-9)).map_or(seed.axis, Into::into);
        SeedPose {
            position_m,
            axis,
            dropped_at_m: seed.dropped_at_m,
        }
    }
}

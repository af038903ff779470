//! The tissue tick, 200 Hz: newest pose → contact → held element → constraints → seeds → response → look-ahead →
//! snapshot.

use crate::rt::exchange::{Happened, Notice, Ticket, TissueOrder, TissueStep};
use crate::rt::left_loads::LeftLoads;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::response::TissueResponse;
use crate::rt::seed::{self, Seed};
use crate::rt::timing::Probe;
use crate::rt::tissue_tape::{LeftTape, TapedOrder, TissueState};
use crate::rt::wiring::TissuePorts;
use crate::rt::world::World;
use last_carry::LastCarry;
use nalgebra::Vector3;
use stylet_shm_schema::{DeadlineTotals, MAX_SEEDS, RefusalCode, SeedPose};
use stylet_sim::force::LocalResponse;
use stylet_sim::line::{BodyLine, MAX_LEFT};
use stylet_sim::probe::BodyProbe;
use stylet_sim::tissue::{Carried, Deformed, MaterialPoint, StepReport};

mod contact;
mod flight;
mod folds;
mod last_carry;
mod left;
mod line;
mod migration;
mod pressed;
#[cfg(not(target_family = "wasm"))]
mod run;
mod second;
mod seeds;
mod snapshot;

/// State of the tissue thread.
pub struct TissueLoop {
    session_id: u64,
    ports: TissuePorts,
    world: Box<World>,
    state: TissueState,
    seeds: Vec<Seed>,
    /// Seeds that the last reset removed, until another is dropped.
    removed: Vec<Seed>,
    /// Columns of the prepared line.
    line: Option<Box<BodyLine>>,
    /// Columns of needles that stay in, and all of their loads in this tick.
    left: Vec<left::LeftBody>,
    left_loads: LeftLoads,
    /// Room to record them, until the tape is there.
    left_room: Option<Box<LeftTape>>,
    last_carry: LastCarry,
    /// The ultrasound probe in this scene.
    pressed: Option<Box<BodyProbe>>,
    answered: second::Answered,
    /// Room to record it, until the tape is there.
    probe_room: Option<Box<ProbeTape>>,
    report: Option<StepReport>,
    shown: snapshot::Shown,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    period_s: f64,
    /// Wake-up time after whole periods of the clock.
    pub phase_ns: u64,
}

/// Stages of this tick, as [`Probe`] times them.
pub const TISSUE_STAGES: &[&str] = &[
    "orders and pose",
    "contact and hold",
    "constraints",
    "response",
    "ahead",
    "snapshot",
];

impl TissueLoop {
    /// A loop at rest; `period_s` is the time between two ticks.
    pub fn new(session_id: u64, ports: TissuePorts, world: Box<World>, period_s: f64) -> Self {
        Self {
            session_id,
            ports,
            world,
            state: TissueState::default(),
            seeds: Vec::with_capacity(MAX_SEEDS),
            removed: Vec::with_capacity(MAX_SEEDS),
            line: None,
            left: Vec::with_capacity(MAX_LEFT),
            left_loads: LeftLoads::default(),
            left_room: None,
            last_carry: LastCarry::new(),
            pressed: None,
            answered: second::Answered::default(),
            probe_room: None,
            report: None,
            shown: snapshot::Shown::default(),
            probe: None,
            period_s,
            phase_ns: 0,
        }
    }

    /// Ends a stage of the tick, in a measurement.
    fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// The last response to the force loop.
    pub fn response(&self) -> &TissueResponse {
        &self.state.response
    }

    /// The loop's scene.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Returns the present positions of the seeds, scene frame, in the order of the drops.
    pub fn seeds(&self) -> impl Iterator<Item = SeedPose> {
        seed::poses(&self.seeds, self.world.tissue.deformed())
    }

    /// Returns their positions once nothing moves the tissue, scene frame, in the order of the drops.
    pub fn seeds_at_rest(&self) -> impl Iterator<Item = SeedPose> {
        let at_rest = Deformed {
            scale: 0.0,
            carried: Carried::Not,
            ..self.world.tissue.deformed()
        };
        seed::poses(&self.seeds, at_rest)
    }

    /// Largest displacement of an element after the last tick, m.
    pub fn displacement_m(&self) -> f64 {
        let elements = self.report.map_or(0.0, |r| r.max_displacement);
        f64::from(elements) * self.world.scene.body.spacing_m
    }

    /// Ends the loop and returns its scene, as deformed.
    pub fn into_world(self) -> Box<World> {
        self.world
    }

    /// Runs one tick, in the order of the data.
    pub fn tick(&mut self, woke_ns: u64) {
        self.checkpoint();
        self.follow_left();
        self.take_orders();
        let before = self.state.pose;
        self.state.pose = *self.ports.pose.read();
        self.follow_second();
        self.follow_probe();
        self.mark();
        let travel = self.state.pose.held_travel_m - before.held_travel_m;
        let on_line = self.step_on_line();
        if on_line.is_none() {
            self.leave_line();
            self.end_contact_if_released();
            self.begin_contact_if_met(&before);
            self.meet_next_layer(&before);
            self.hold(travel);
        }
        self.mark();
        let report = on_line.unwrap_or_else(|| self.step_off_line());
        self.report = Some(report);
        self.mark();
        self.migrate();
        self.respond(woke_ns, &report);
        self.answer_second(woke_ns);
        self.look_for_folds();
        self.tape(woke_ns, report.residual);
        self.mark();
        self.look_ahead(travel);
        self.mark();
        if let Some(probe) = &mut self.probe {
            probe.output_for_pose(self.state.response.tick, self.state.pose.time_ns);
        }
        self.publish_snapshot(woke_ns, &report);
    }

    fn take_orders(&mut self) {
        while let Ok(order) = self.ports.orders.pop() {
            match order {
                TissueOrder::Step(ticket, step) => {
                    self.tape_order(TapedOrder::Step(step.clone()));
                    let result = self.carry_out(step);
                    self.answer(ticket, result);
                }
                TissueOrder::World { ticket, world, tape } => {
                    self.swap(world);
                    self.answer(ticket, Ok(()));
                    self.ports.flight.replace(tape);
                    self.checkpoint();
                }
                TissueOrder::LeftRoom(room) => self.left_room = self.left_room.take().or(Some(room)),
                TissueOrder::Armed => self.state.response.since_armed = DeadlineTotals::default(),
                TissueOrder::HandOverTape => self.hand_over_tape(),
                TissueOrder::Probe {
                    generation,
                    probe,
                    room,
                } => self.take_probe(generation, probe, room),
                TissueOrder::Line(line) => {
                    self.tape_order(TapedOrder::Line {
                        generation: line.generation,
                    });
                    self.take_line(line);
                }
            }
        }
    }

    fn carry_out(&mut self, step: TissueStep) -> Result<(), RefusalCode> {
        match step {
            TissueStep::Parameters { limits, migration } => {
                self.world.set_limits(limits);
                self.world.migration = migration;
            }
            TissueStep::DropSeed { strand_pitch_m } => return self.drop_seed(strand_pitch_m),
            TissueStep::UndoSeed => return self.undo_seed(),
            TissueStep::Reset => self.reset(),
        }
        Ok(())
    }

    fn answer(&mut self, ticket: Ticket, result: Result<(), RefusalCode>) {
        self.notify(Notice::answer(ticket, self.state.response.tick, result));
    }

    fn happened(&mut self, what: Happened) {
        let (tick, time_ns) = (self.state.response.tick, self.state.pose.time_ns);
        self.notify(Notice::Event { tick, time_ns, what });
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the control thread has ended: its notices are not needed.
        let _ = self.ports.notices.push(notice);
    }

    fn reset(&mut self) {
        self.world.tissue.return_to_rest();
        self.last_carry.forget();
        self.reset_probe();
        self.remove_seeds();
        self.end_contact();
        self.state.response.worst_residual = 0.0;
        self.state.response.worst_work_ns = 0;
        self.state.response.worst_wake_ns = 0;
        self.state.response.missed = 0;
        self.state.response.seed_count = 0;
    }

    fn end_contact(&mut self) {
        self.state.contact = None;
        self.state.layers.end();
        self.state.held = None;
        self.state.clear = false;
        self.state.response.contact = 0;
    }

    fn swap(&mut self, world: Box<World>) {
        let old = std::mem::replace(&mut self.world, world);
        self.last_carry.forget();
        // The ring has room for every world on its way; if not, leak it rather than free it here.
        if let Err(rtrb::PushError::Full(old)) = self.ports.old_worlds.push(old) {
            std::mem::forget(old);
        }
        self.drop_line();
        self.drop_left();
        self.drop_probe();
        self.leave_line();
        self.seeds.clear();
        self.removed.clear();
        self.state.response.seed_count = 0;
        self.end_contact();
    }

    fn respond(&mut self, woke_ns: u64, report: &StepReport) {
        let (contact, held) = (self.state.contact, self.state.held.is_some());
        let local = self.local_response(report);
        let may_be_felt = self.world.tissue.may_be_felt(report);
        let response = &mut self.state.response;
        response.tick += 1;
        response.time_ns = woke_ns;
        response.contact = contact.map_or(0, |c| c.number);
        if let Some(contact) = contact {
            response.contact_in_scene = contact.place;
            response.path_direction = contact.direction;
        }
        response.local = local;
        if report.converged {
            response.solved_ns = self.state.pose.time_ns;
            response.solved_tip_in_scene = self.state.pose.tip_in_scene;
        }
        response.worst_residual = response.worst_residual.max(report.residual);
        // Limits tightened over free tissue are met as it recovers; no force depends on it.
        response.unsolved = !may_be_felt && held;
        self.ports.response.write(*response);
    }

    /// Displacement of the tissue that responds, m. A membrane holds one element. Behind it the tip passes from element
    /// to element, where the displacement of a single element would jump: it is interpolated between the elements.
    fn displacement_at_tip_m(&self, held: u32, report: &StepReport) -> Vector3<f64> {
        let body = self.world.tissue.deformed();
        // A body that computes forces answers with the displacement of its held element.
        let is_between = self.state.pose.punctured && report.tip_force_n.is_none();
        let at_tip = is_between
            .then(|| self.locate(&self.state.pose.tip_in_scene, Some(held)))
            .flatten();
        let point = at_tip.unwrap_or(MaterialPoint::centre(held));
        point.displacement_m(&body).into()
    }

    /// Returns the local response that the haptic loop extrapolates at its own rate; none while nothing is held.
    fn local_response(&self, report: &StepReport) -> LocalResponse {
        let Some(held) = self.state.held else {
            return LocalResponse::default();
        };
        LocalResponse {
            tick: self.state.response.tick + 1,
            travel_m: self.state.pose.held_travel_m,
            displacement_m: self.displacement_at_tip_m(held.element, report),
            force_n: report.tip_force_n.map(Vector3::from),
        }
    }
}

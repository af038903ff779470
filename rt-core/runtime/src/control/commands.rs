//! Carries out the requests of hosts: as orders to the loops or as background work.

use super::Control;
use super::second::Second;
use super::wall::{Asked, MOST_PACKETS};
use crate::rt::exchange::{HapticOrder, Moved, Ticket, TissueOrder, TissueStep, hand_order};
use crate::rt::tissue_tape::LeftTape;
use stylet_shm_schema::{
    Command, EventKind, ParameterChange, PlanInForce, PlannedNeedle, Refusal, RefusalCode, Request,
};
use stylet_sim::active::activate;
use stylet_sim::line::LeftNeedles;
use stylet_wall::kind::Kind;

/// Slots of the force loop's ring reserved for requests that end a motion or a force.
const KEPT_FOR_STOPS: usize = 16;

impl Control {
    /// Takes all waiting commands; returns true when a host asked to end the run.
    pub(super) fn take_commands(&mut self) -> bool {
        let ends = self.take_each_command();
        self.renew_motions();
        ends
    }

    fn take_each_command(&mut self) -> bool {
        for _ in 0..MOST_PACKETS {
            match self.link.wall.take_asked() {
                Some(Asked::Command(command)) if self.take_command(&command) => return true,
                Some(Asked::Command(_)) => {}
                Some(Asked::Volume(header, cells)) => self.take_volume(&header, &cells),
                None => break,
            }
        }
        false
    }

    fn take_command(&mut self, command: &Command) -> bool {
        let asker = (command.host_id, command.command_id);
        match Request::decode(command) {
            // Never answered: hosts send it many times a second.
            Ok(Request::KeepMoving { valid_s }) => self.movers.keep(command.host_id, valid_s),
            Ok(Request::Shutdown) => {
                self.link.reply(asker, Ok(0));
                return true;
            }
            Ok(request) => {
                let ticket = self.link.answers.ticket(asker);
                if let Err(refusal) = self.carry_out(ticket, request) {
                    self.link.session.refused += 1;
                    self.link.answer(ticket, Err(&refusal));
                }
            }
            Err(refusal) => self.link.refuse_invalid(asker, &refusal),
        }
        false
    }

    /// Carries out one request; later failures are answered later.
    fn carry_out(&mut self, ticket: Ticket, request: Request) -> Result<(), Refusal> {
        match request {
            Request::SetParameters(changes) => self.change_parameters(ticket, &changes),
            Request::SetPlan(plan) => {
                self.set_plan(plan.as_ref());
                self.link.answer(ticket, Ok(0));
                Ok(())
            }
            Request::MoveHand(hand) => {
                let promise = self.first_promise(ticket, Moved::Needle);
                self.order_haptic(ticket, hand_order(&hand, None, promise))
            }
            Request::ExpectNeedle(axis) => {
                self.lines.expect_next(axis.entry_m, axis.direction);
                self.link.answer(ticket, Ok(0));
                Ok(())
            }
            Request::LeaveNeedle => {
                self.make_room_for_left();
                self.order_haptic(ticket, HapticOrder::LeaveNeedle)
            }
            Request::TakeNeedle(number) => self.order_haptic(ticket, HapticOrder::TakeNeedle(number.into())),
            Request::DrawNeedle { number, speed_m_per_s } => {
                let promise = self.first_promise(ticket, Moved::DrawnNeedle);
                let order = HapticOrder::DrawNeedle {
                    number: number.into(),
                    speed_m_per_s,
                    promise,
                };
                self.order_haptic(ticket, order)
            }
            Request::Mark(mark) => {
                self.mark(ticket, &mark);
                Ok(())
            }
            Request::BeginExercise(exercise) => self.begin_exercise(ticket, exercise),
            Request::EndExercises => self.end_exercises(ticket),
            Request::MoveSecondHand(hand) => self.move_second_hand(ticket, &hand),
            Request::StopSecondHand => self.ask_second(ticket, HapticOrder::StopHand),
            Request::StopHand => self.order_both(ticket, HapticOrder::StopHand),
            Request::Engage => {
                let _ = self.loops.tissue_orders.push(TissueOrder::Armed);
                self.order_both(ticket, HapticOrder::Engage)
            }
            Request::Disengage => self.order_both(ticket, HapticOrder::Disengage),
            Request::DropSeed { strand_pitch_m } => self.order_tissue(ticket, TissueStep::DropSeed { strand_pitch_m }),
            Request::UndoSeed => self.order_tissue(ticket, TissueStep::UndoSeed),
            Request::Reset => self.reset(ticket),
            Request::LoadBuiltinScene(number) => {
                self.refuse_uncounted(ticket, |this| this.load_builtin(ticket, number))
            }
            Request::Rehearse(run) => self.refuse_uncounted(ticket, |this| {
                let (set, generation) = (this.parameters.in_force.set, this.scene.generation());
                this.rehearsals.begin(ticket, run, set, generation)
            }),
            Request::SaveFlight => self.save_flight(ticket),
            Request::Shutdown | Request::KeepMoving { .. } => Ok(()),
        }
    }

    /// Refuses because background work is busy; the session does not count it as a refused request.
    fn refuse_uncounted(
        &mut self,
        ticket: Ticket,
        begin: impl FnOnce(&mut Self) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        if let Err(refusal) = begin(self) {
            self.link.answer(ticket, Err(&refusal));
        }
        Ok(())
    }

    /// Orders the same from the loops of both hands; the needle's answers.
    fn order_both(&mut self, ticket: Ticket, order: HapticOrder) -> Result<(), Refusal> {
        self.order_second(0, order);
        self.order_haptic(ticket, order)
    }

    pub(super) fn order_haptic(&mut self, ticket: Ticket, order: HapticOrder) -> Result<(), Refusal> {
        let is_stop = matches!(order, HapticOrder::StopHand | HapticOrder::Disengage);
        if !is_stop && self.loops.haptic_orders.slots() <= KEPT_FOR_STOPS {
            return Err(RefusalCode::TooManyRequests.into());
        }
        let pushed = self.loops.haptic_orders.push((ticket, order));
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    fn order_tissue(&mut self, ticket: Ticket, step: TissueStep) -> Result<(), Refusal> {
        let pushed = self.loops.tissue_orders.push(TissueOrder::Step(ticket, step));
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    /// Orders a change from every loop, or from none. The request is answered once all have carried it out.
    fn order_all(&mut self, ticket: Ticket, order: HapticOrder, step: TissueStep) -> Result<(), Refusal> {
        let loops = &mut self.loops;
        let has_room = |second: &Second| second.orders.slots() > 0;
        // Only the loops take orders out, so the rings keep this room.
        let room = loops.haptic_orders.slots() > KEPT_FOR_STOPS
            && loops.tissue_orders.slots() > 0
            && self.second.as_ref().is_none_or(has_room);
        if !room {
            return Err(RefusalCode::TooManyRequests.into());
        }
        let of_second = self.second.as_ref().map_or(0, |second| second.shared(ticket));
        self.link.answers.await_loops(ticket, 2 + usize::from(of_second != 0));
        let _ = loops.haptic_orders.push((ticket, order));
        let _ = loops.tissue_orders.push(TissueOrder::Step(ticket, step));
        self.order_second(of_second, order);
        Ok(())
    }

    /// Validates the changes together, then orders them from every loop or from none.
    fn change_parameters(&mut self, ticket: Ticket, changes: &[ParameterChange]) -> Result<(), Refusal> {
        let set = self.parameters.with(changes);
        let active = activate(&set, &self.device).map_err(|problems| {
            let refusal = Refusal::from(problems);
            self.link.report_invalid(&refusal);
            refusal
        })?;
        let order = HapticOrder::Parameters {
            generation: self.parameters.next_generation(),
            needle: active.needle,
            force: active.force,
        };
        let step = TissueStep::Parameters {
            limits: active.limits,
            migration: active.migration,
        };
        self.order_all(ticket, order, step)?;
        self.parameters.ordered(ticket, set);
        self.lines.take_bending(active.force.bending.is_on());
        Ok(())
    }

    pub(super) fn announce_parameters(&mut self) {
        self.link.wall.keep(Kind::Parameters, &self.parameters.in_force);
    }

    fn set_plan(&mut self, plan: Option<&PlannedNeedle>) {
        let generation = self.plan.generation + 1;
        self.plan = PlanInForce::of(plan);
        self.plan.generation = if plan.is_some() { generation } else { 0 };
        self.plan.session_id = self.link.session.session_id;
        self.plan.scene_generation = self.scene.generation();
        self.link.wall.keep(Kind::Plan, &self.plan);
        self.lines
            .expect_planned(plan.map(|plan| (plan.entry_m, plan.direction)));
    }

    /// Allocates the loops' room for needles that stay in, when the first is left: neither loop allocates.
    fn make_room_for_left(&mut self) {
        if !std::mem::replace(&mut self.left_rooms.0, true) {
            let _ = self.loops.rooms.push(LeftNeedles::with_room());
        }
        let generation = self.scene.generation();
        if self.left_rooms.1.replace(generation) != Some(generation) {
            let _ = self.loops.tissue_orders.push(TissueOrder::LeftRoom(LeftTape::new()));
        }
    }

    fn reset(&mut self, ticket: Ticket) -> Result<(), Refusal> {
        self.order_all(ticket, HapticOrder::Reset, TissueStep::Reset)?;
        self.lines.forget_tracks();
        self.forget_exercises();
        self.link.event(self.link.event_now(EventKind::Reset));
        Ok(())
    }
}

//! Requests of hosts, carried out: an order for a loop, or work beside it.

use super::Bridge;
use super::link::EventDetails;
use super::parameters::order_from_both;
use super::requests::{hand_goal, needle_run, plan_in_force};
use crate::rt::exchange::{HapticOrder, Ticket, TissueOrder};
use crate::rt::second::SecondOrder;
use crate::rt::tissue_tape::LeftTape;
use stylet_shm_schema::service::MAX_HOSTS;
use stylet_shm_schema::{CommandKind, EventKind, ParameterChange, PlannedNeedle, Refusal, RefusalCode, Request};
use stylet_sim::active::activate;
use stylet_sim::line::LeftNeedles;

/// Commands of a host that are looked at in one pass. More are refused, so that a flood reaches neither loop.
const MAX_OF_A_HOST: u32 = 16;
/// Refusals for that reason that are answered in one pass, the others are counted: every host has all answers in its queue, and
/// those to one that floods would drive out those to the others.
const MAX_ANSWERED: u32 = 4;
/// Commands taken from the queues in one pass. Queues are read one after the other, so that a host that fills its own faster than
/// it is read would keep the core from those behind it; a refusal that is counted alone takes less time than a request.
const MAX_TAKEN: usize = 4096;

/// Commands of one pass.
#[derive(Default)]
struct Taken {
    /// By host.
    of_host: Vec<(u64, u32)>,
    answered: u32,
}

impl Taken {
    /// Counts a command; false where it is one too many.
    fn admits(&mut self, host_id: u64) -> bool {
        if let Some((_, count)) = self.of_host.iter_mut().find(|(id, _)| *id == host_id) {
            *count += 1;
            return *count <= MAX_OF_A_HOST;
        }
        let has_room = self.of_host.len() < MAX_HOSTS;
        if has_room {
            self.of_host.push((host_id, 1));
        }
        has_room
    }

    /// Counts a refusal for that reason; false where it is not answered.
    fn answers(&mut self) -> bool {
        self.answered += 1;
        self.answered <= MAX_ANSWERED
    }
}

impl Bridge {
    /// True when a host asked to end.
    pub(super) fn take_commands(&mut self) -> bool {
        let mut taken = Taken::default();
        for _ in 0..MAX_TAKEN {
            let Some(command) = self.link.ports.commands.receive() else {
                break;
            };
            let asker = (command.host_id, command.command_id);
            // A request that takes the force off is never too much.
            let is_free = [CommandKind::Disengage, CommandKind::Shutdown].map(|kind| kind as u32);
            if !taken.admits(command.host_id) && !is_free.contains(&command.kind) {
                match taken.answers() {
                    true => self.link.refuse(asker, &RefusalCode::TooManyRequests.into()),
                    false => self.link.session.refused += 1,
                }
                continue;
            }
            match Request::decode(&command) {
                Ok(Request::Shutdown) => {
                    self.link.reply(asker, Ok(0));
                    return true;
                }
                Ok(request) => {
                    let ticket = self.link.ticket(asker);
                    if let Err(refusal) = self.carry_out(ticket, request) {
                        self.link.session.refused += 1;
                        self.link.answer(ticket, Err(&refusal));
                    }
                }
                Err(errors) => self.link.refuse_invalid(asker, &errors.into()),
            }
        }
        false
    }

    /// What fails later is answered later.
    fn carry_out(&mut self, ticket: Ticket, request: Request) -> Result<(), Refusal> {
        match request {
            Request::SetParameters(changes) => self.change_parameters(ticket, &changes),
            Request::SetPlan(plan) => {
                self.set_plan(plan.as_ref());
                self.link.answer(ticket, Ok(0));
                Ok(())
            }
            Request::MoveHand(hand) => {
                let goal = hand_goal(&hand);
                self.order_haptic(HapticOrder::Hand { ticket, goal })
            }
            Request::ExpectNeedle(axis) => {
                self.lines.expect_next(axis.entry_m, axis.direction);
                self.link.answer(ticket, Ok(0));
                Ok(())
            }
            Request::LeaveNeedle => {
                self.make_room_for_left();
                self.order_haptic(HapticOrder::LeaveNeedle { ticket })
            }
            Request::TakeNeedle(number) => self.order_haptic(HapticOrder::TakeNeedle {
                ticket,
                number: u64::from(number),
            }),
            Request::DrawNeedle { number, speed_m_per_s } => self.order_haptic(HapticOrder::DrawNeedle {
                ticket,
                number: u64::from(number),
                speed_m_per_s,
            }),
            Request::Mark(mark) => {
                self.mark(ticket, &mark);
                Ok(())
            }
            Request::BeginExercise(exercise) => self.begin_exercise(ticket, exercise),
            Request::EndExercises => self.end_exercises(ticket),
            Request::MoveSecondHand(hand) => self.move_second_hand(ticket, &hand),
            Request::StopSecondHand => self.stop_second_hand(ticket),
            Request::StopHand => {
                self.order_second(SecondOrder::StopHand { ticket: 0 });
                self.order_haptic(HapticOrder::StopHand { ticket })
            }
            Request::Engage => {
                self.order_second(SecondOrder::Engage);
                let _ = self.loops.tissue_orders.push(TissueOrder::Armed);
                self.order_haptic(HapticOrder::Engage { ticket })
            }
            Request::Disengage => {
                self.order_second(SecondOrder::Disengage);
                self.order_haptic(HapticOrder::Disengage { ticket })
            }
            Request::DropSeed { strand_pitch_m } => self.order_tissue(TissueOrder::DropSeed { ticket, strand_pitch_m }),
            Request::UndoSeed => self.order_tissue(TissueOrder::UndoSeed { ticket }),
            Request::Reset => self.reset(ticket),
            Request::LoadBuiltinScene(number) => {
                self.refuse_uncounted(ticket, |this| this.load_builtin(ticket, number))
            }
            Request::Rehearse(run) => self.refuse_uncounted(ticket, |this| {
                let (set, generation) = (this.parameters.in_force.set, this.scene.generation());
                this.rehearsals.begin(ticket, needle_run(&run), set, generation)
            }),
            Request::SaveFlight => {
                let taken = self.flights.request(ticket);
                taken.then_some(()).ok_or(RefusalCode::TooManyRequests.into())
            }
            Request::Shutdown => Ok(()),
        }
    }

    /// Work beside the loops that is busy refuses without counting as a refused request of the session.
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

    pub(super) fn order_haptic(&mut self, order: HapticOrder) -> Result<(), Refusal> {
        let pushed = self.loops.haptic_orders.push(order);
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    fn order_tissue(&mut self, order: TissueOrder) -> Result<(), Refusal> {
        let pushed = self.loops.tissue_orders.push(order);
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    fn order_both(&mut self, orders: (HapticOrder, TissueOrder)) -> Result<(), Refusal> {
        let loops = &mut self.loops;
        let taken = order_from_both(&mut loops.haptic_orders, &mut loops.tissue_orders, orders);
        taken.then_some(()).ok_or(RefusalCode::TooManyRequests.into())
    }

    /// Verified as a whole, then ordered from both loops or from none.
    fn change_parameters(&mut self, ticket: Ticket, changes: &[ParameterChange]) -> Result<(), Refusal> {
        let set = self.parameters.with(changes);
        let active = activate(&set, &self.device).map_err(|problems| {
            let refusal = Refusal::from(problems);
            self.link.report_invalid(&refusal);
            refusal
        })?;
        let generation = self.parameters.next_generation();
        let bends = active.force.bending.is_on();
        let haptic = HapticOrder::Parameters {
            ticket,
            generation,
            needle: active.needle,
            force: active.force,
        };
        self.order_both((haptic, TissueOrder::Limits(active.limits)))?;
        if let Some(second) = &mut self.second {
            second.set_gate(generation, &active.force.gate);
        }
        // Both rings were emptied lately: there is room for one more.
        let _ = self.loops.tissue_orders.push(TissueOrder::Migration(active.migration));
        self.parameters.ordered(generation, set);
        self.lines.take_bending(bends);
        Ok(())
    }

    fn set_plan(&mut self, plan: Option<&PlannedNeedle>) {
        let generation = self.plan.generation + 1;
        self.plan = plan_in_force(plan);
        self.plan.generation = if plan.is_some() { generation } else { 0 };
        self.plan.session_id = self.link.session.session_id;
        self.plan.scene_generation = self.scene.generation();
        let _ = self.link.ports.plan.send(self.plan);
        self.lines
            .expect_planned(plan.map(|plan| (plan.entry_m, plan.direction)));
    }

    /// Neither loop allocates: what they keep needles in that stay is made here, with the first.
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
        self.order_both((HapticOrder::Reset { ticket }, TissueOrder::Reset))?;
        self.order_second(SecondOrder::Reset);
        self.lines.forget_tracks();
        self.forget_exercises();
        self.link.event(EventKind::Reset, EventDetails::now());
        Ok(())
    }
}

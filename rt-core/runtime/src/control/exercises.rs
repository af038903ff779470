//! Marks and instructor-injected faults, from the request to the broadcast event.

use super::Control;
use super::link::event_at;
use crate::rt::exchange::{HapticOrder, Ticket};
use stylet_shm_schema::{Event, EventKind, Exercise, ExercisesInForce, Mark, Refusal, RefusalCode, Text};

impl Control {
    pub(super) fn mark(&mut self, ticket: Ticket, mark: &Mark) {
        let before_ns = (mark.before_s * 1e9) as u64;
        // A host that marks has seen the loop's live state, which is newer than the records of the last pass.
        self.link.send_records(&mut self.loops.records);
        let newest = self.newest_tick().unwrap_or(0);
        let now_ns = self.link.wall.now_ns();
        let tick = newest.saturating_sub(before_ns / self.link.session.period_ns.max(1));
        self.link.event(Event {
            text: Text::new(&mark.text),
            ..event_at(EventKind::Mark, tick, now_ns.saturating_sub(before_ns))
        });
        self.link.answer(ticket, Ok(tick));
    }

    pub(super) fn begin_exercise(&mut self, ticket: Ticket, exercise: Exercise) -> Result<(), Refusal> {
        match exercise {
            Exercise::DeviceLost => self.order_haptic(ticket, HapticOrder::LoseDevice(true))?,
            Exercise::BodyMoved { by_m } => self.move_body(ticket, by_m)?,
            Exercise::StiffTissue { .. } if !self.tissue.has_lines() => {
                return Err(RefusalCode::TissueWithoutStiffness.into());
            }
            Exercise::StiffTissue { factor } => {
                self.lines.stiffen(factor);
                self.link.answer(ticket, Ok(0));
            }
        }
        self.link.session.exercises.put(exercise);
        self.link.event(Event {
            code: exercise.number(),
            value: exercise.value(),
            text: Text::new(&exercise.to_string()),
            ..self.link.event_now(EventKind::ExerciseBegun)
        });
        Ok(())
    }

    fn move_body(&mut self, ticket: Ticket, to_m: [f64; 3]) -> Result<(), Refusal> {
        self.order_haptic(ticket, HapticOrder::MoveBody(to_m))?;
        self.lines.move_body(to_m);
        Ok(())
    }

    pub(super) fn end_exercises(&mut self, ticket: Ticket) -> Result<(), Refusal> {
        // Both or neither: the answer follows the second.
        if self.loops.haptic_orders.slots() < 2 {
            return Err(RefusalCode::TooManyRequests.into());
        }
        self.move_body(0, [0.0; 3])?;
        self.order_haptic(ticket, HapticOrder::LoseDevice(false))?;
        self.forget_exercises();
        Ok(())
    }

    /// Drops all exercises; the loops have none left.
    pub(super) fn forget_exercises(&mut self) {
        self.lines.move_body([0.0; 3]);
        self.lines.stiffen(1.0);
        if std::mem::take(&mut self.link.session.exercises) != ExercisesInForce::default() {
            self.link.event(self.link.event_now(EventKind::ExercisesEnded));
        }
    }
}

//! The question before a run that would re-arm: after a fault only a person turns the force on
//! again.

use crate::action::Action;
use crate::shown::Shown;
use egui::{Key, Modal, Modifiers};
use stylet_shm_schema::Fault;

/// Starting point of the waiting run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// The remaining drops in the tissue.
    WhereItWas,
    /// A reset.
    Anew,
}

/// Draws the question while a run waits; Y and N answer it too, and Esc cancels it.
pub fn rearm_ui(ctx: &egui::Context, shown: &Shown, asks: Option<Begin>) -> Option<Action> {
    asks?;
    let fault = shown.stands_fault().unwrap_or(Fault::None);
    let pressed = |key| ctx.input_mut(|i| i.consume_key(Modifiers::NONE, key));
    let (agreed, refused) = (pressed(Key::Y), pressed(Key::N));
    let modal = Modal::new(egui::Id::unique("re-arm")).show(ctx, |ui| {
        ui.set_max_width(380.0);
        ui.heading("Re-arm and run?");
        ui.label(format!("A fault keeps the force off: {}.", fault.message()));
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            let agreed = ui.button("Re-arm and run (Y)").clicked();
            let refused = ui.button("Leave the force off (N)").clicked();
            (agreed, refused)
        })
        .inner
    });
    let (clicked, declined) = modal.inner;
    let is_left = refused || declined || modal.backdrop_response.clicked();
    (agreed || clicked || is_left).then_some(Action::Rearm((agreed || clicked) && !is_left))
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, RawInput};

    #[test]
    fn only_its_keys_answer_the_question() {
        let answer = |key: Option<Key>, asks: Option<Begin>| {
            let ctx = egui::Context::default();
            let event = |key| Event::Key {
                key,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers: Modifiers::NONE,
            };
            let input = RawInput {
                events: key.map(event).into_iter().collect(),
                ..RawInput::default()
            };
            let mut action = None;
            let _ = ctx.run_ui(input, |ui| action = rearm_ui(ui.ctx(), &Shown::empty("t"), asks));
            action
        };
        let asks = Some(Begin::Anew);
        assert_eq!(answer(Some(Key::Y), asks), Some(Action::Rearm(true)));
        assert_eq!(answer(Some(Key::N), asks), Some(Action::Rearm(false)));
        assert_eq!(answer(Some(Key::Enter), asks), None);
        assert_eq!(answer(Some(Key::Y), None), None);
    }
}

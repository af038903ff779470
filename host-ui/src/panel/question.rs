//! Questions before what cannot be undone: removing what is in the tissue, replacing a file, and a run that would
//! re-arm, because after a fault only a person turns the force on again.

use crate::action::Action;
use crate::shown::Shown;
use crate::words::counted;
use egui::{Key, Modal, Modifiers};
use std::path::PathBuf;
use stylet_base::format::printable;
use stylet_shm_schema::{Fault, Request};

const LOAD: &str = "Load the scene";
/// What is kept before an implant is removed.
const SAVED: &str = if crate::IN_PAGE {
    "The debrief is downloaded"
} else {
    "Plan and debrief are saved under out/"
};

/// Starting point of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// The remaining drops in the tissue.
    WhereItWas,
    /// A reset.
    Anew,
}

/// What waits for an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// A run while a fault stands.
    Rearm(Begin),
    /// An action that removes what is in the tissue, with its name.
    Remove(&'static str, Box<Action>),
    /// Saving the plan as a file that is there and is not this plan's.
    Replace(PathBuf),
}

impl Question {
    /// Returns the question before this action; `None` if nothing in the tissue is lost by it.
    pub fn before(action: &Action, shown: &Shown) -> Option<Self> {
        let name = match action {
            Action::Send(Request::Reset) => "Reset",
            Action::StartOver => "Start over",
            // The other runs continue with what is in the tissue.
            Action::RunAll if shown.continues_at.is_none() => "Reset and run",
            Action::LoadScene(_) | Action::LoadBuiltinScene(_) => LOAD,
            _ => return None,
        };
        let is_lost = in_tissue(shown).is_some() || name == LOAD && shown.is_in_tissue();
        is_lost.then(|| Self::Remove(name, Box::new(action.clone())))
    }
}

/// Returns what a reset or another scene removes, such as "83 seeds".
fn in_tissue(shown: &Shown) -> Option<String> {
    match (shown.seeds.len(), shown.left.len()) {
        (0, 0) => None,
        (seeds, 0) => Some(counted(seeds, "seed")),
        (0, left) => Some(format!("{} left in", counted(left, "needle"))),
        (seeds, left) => Some(format!(
            "{} and {} left in",
            counted(seeds, "seed"),
            counted(left, "needle")
        )),
    }
}

/// Returns whether and how a removal can be undone.
fn undone(action: &Action, shown: &Shown) -> &'static str {
    match (action, shown.left.is_empty()) {
        (Action::Send(Request::Reset), true) => "Ctrl+Z restores the seeds until the next one is dropped.",
        (Action::Send(Request::Reset), false) if !shown.seeds.is_empty() => {
            "Ctrl+Z restores the seeds until the next one is dropped, but not the needles."
        }
        _ => "This cannot be undone.",
    }
}

/// Draws the question; Y and N answer it too, and Esc cancels it.
pub fn question_ui(ctx: &egui::Context, shown: &Shown, question: Option<&Question>) -> Option<Action> {
    let (title, text, yes, no) = match question? {
        Question::Rearm(_) => {
            let fault = shown.stands_fault().unwrap_or(Fault::None);
            let text = format!("A fault keeps the force off: {}.", fault.message());
            (
                "Re-arm and run?".to_owned(),
                text,
                "Re-arm and run (Y)".to_owned(),
                "Leave the force off (N)",
            )
        }
        Question::Replace(path) => (
            "Replace the file?".to_owned(),
            format!(
                "{} already exists, and this plan was not saved there before.",
                printable(&path.display().to_string())
            ),
            "Replace (Y)".to_owned(),
            "Keep the file (N)",
        ),
        Question::Remove(name, action) => {
            let (text, no) = match in_tissue(shown) {
                None => (
                    "The needle is in the tissue: another scene ends the insertion.".to_owned(),
                    "Keep the scene (N)",
                ),
                Some(what) => {
                    let undone = undone(action, shown);
                    let text = format!("This removes {what} from the tissue. {undone} {SAVED} first.");
                    (text, "Keep the implant (N)")
                }
            };
            (format!("{name}?"), text, format!("{name} (Y)"), no)
        }
    };
    let pressed = |key| ctx.input_mut(|i| i.consume_key(Modifiers::NONE, key));
    let (agreed, refused) = (pressed(Key::Y), pressed(Key::N));
    let modal = Modal::new(egui::Id::unique("question")).show(ctx, |ui| {
        ui.set_max_width(380.0);
        ui.heading(title);
        ui.label(text);
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            let agreed = ui.button(yes).clicked();
            let refused = ui.button(no).clicked();
            (agreed, refused)
        })
        .inner
    });
    let (clicked, declined) = modal.inner;
    let is_left = refused || declined || modal.backdrop_response.clicked();
    (agreed || clicked || is_left).then_some(Action::Answer((agreed || clicked) && !is_left))
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, RawInput};

    #[test]
    fn only_its_keys_answer_the_question() {
        let answer = |key: Option<Key>, asks: Option<&Question>| {
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
            let _ = ctx.run_ui(input, |ui| action = question_ui(ui.ctx(), &Shown::empty("t"), asks));
            action
        };
        let question = Question::Rearm(Begin::Anew);
        let asks = Some(&question);
        assert_eq!(answer(Some(Key::Y), asks), Some(Action::Answer(true)));
        assert_eq!(answer(Some(Key::N), asks), Some(Action::Answer(false)));
        assert_eq!(answer(Some(Key::Enter), asks), None);
        assert_eq!(answer(Some(Key::Y), None), None);
    }
}

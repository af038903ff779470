//! Keys: their list, and those held or pressed in this frame.

use crate::action::{Action, ProbeAction, TraineeAction, Viewpoint};
use crate::view::free::BANNERS;
use egui::{Key, LayerId, Modifiers, Order};
use stylet_shm_schema::Request;

/// Every key with its function, for the overlay and the manual.
pub const KEYS: [(&str, &str); 26] = [
    ("W  or  Up", "advance the needle along its path while held"),
    (
        "S  or  Down",
        "retract the needle while held; Shift with both: four times slower",
    ),
    (
        "Alt with W, S, arrows",
        "move the second hand, if rt-core has --device-2",
    ),
    ("B", "brake of the probe's stepper, with --device-2"),
    ("Enter", "the main action of the current step"),
    ("Space", "drop a seed at the tip"),
    (
        "Ctrl+Z",
        "undo the last seed, a reset or a change of the plan; with Shift redo a change of the plan",
    ),
    (
        "Arrows, Enter",
        "in the template: choose a hole, add or show its needle",
    ),
    ("Shift+arrows, Del", "in the template: move the needle, remove it"),
    ("E,  D", "force on, or re-arm after a fault; force off"),
    ("P,  K", "parameters; mark this moment, inject faults"),
    (
        "1 to 5",
        "view: oblique, from the perineum, the side, above, along the needle",
    ),
    ("V,  R", "all views, 3D, slices, the probe, fluoroscopy; reset the view"),
    ("PgUp, PgDn, Home, End", "probe 5 mm in or out, 5° to the left or right"),
    ("X;  Ctrl with arrows", "X-ray while held; turn the C-arm"),
    ("F,  M", "slices follow the tip; measure between two clicks"),
    (
        "I,  G",
        "isodose lines and surfaces; image or simulated ultrasound in the slices",
    ),
    ("T", "light or dark"),
    ("Ctrl and +, -, 0", "larger, smaller, default text size"),
    ("F2 to F9", "follow the first to the eighth trainee of the list"),
    ("F12,  F1", "save the window as a picture; this help"),
    ("Esc", "close a dialog, return the keys to the needle"),
    ("Drag in 3D", "left button rotates, right button pans, wheel zooms"),
    (
        "Drag in a slice",
        "left button moves the cross, or the needle by its tip; right button pans",
    ),
    (
        "Drag in ultrasound",
        "in, out and a turn; in fluoroscopy turns the C-arm",
    ),
    ("Wheel in a slice", "through the slices; with Ctrl zooms"),
];

/// Requests of the keys in one frame.
#[derive(Debug, Default, PartialEq)]
pub struct Keys {
    /// Actions of the keys that were pressed.
    pub actions: Vec<Action>,
    /// Metres per second along the path, positive inwards; 0 when no key is held.
    pub drive_m_per_s: f64,
    /// Speed of the second hand in the scene frame; 0 when no key is held.
    pub second_m_per_s: [f64; 3],
}

const DRIVE_M_PER_S: f64 = 0.04;

/// Reads the keys; returns nothing while a widget has the focus, because typing a path must not
/// drop a seed.
pub fn read(ctx: &egui::Context) -> Keys {
    let mut keys = Keys::default();
    // A question waits for its answer: nothing but the force may change, and that only to off.
    if ctx.memory(|m| m.top_modal_layer().is_some()) {
        if ctx.input(|i| fresh_press(i, Modifiers::NONE, Key::D)) {
            keys.actions.push(Action::Send(Request::Disengage));
        }
        return keys;
    }
    if ctx.input_mut(|i| i.consume_key(Modifiers::NONE, Key::F1)) {
        keys.actions.push(Action::ToggleHelp);
    }
    let followers = [Key::F2, Key::F3, Key::F4, Key::F5, Key::F6, Key::F7, Key::F8, Key::F9];
    for (number, key) in followers.into_iter().enumerate() {
        if ctx.input_mut(|i| i.consume_key(Modifiers::NONE, key)) {
            keys.actions.push(Action::Trainee(TraineeAction::Follow(number)));
        }
    }
    // These two apply to everything but text fields.
    if !ctx.text_edit_focused() {
        ctx.input(|i| {
            if fresh_press(i, Modifiers::CTRL | Modifiers::SHIFT, Key::Z) {
                keys.actions.push(Action::Redo);
            } else if fresh_press(i, Modifiers::CTRL, Key::Z) {
                keys.actions.push(Action::Undo);
            }
        });
    }
    if ctx.memory(|m| m.focused().is_some()) || dialog_has_keys(ctx) {
        return keys;
    }
    let pressed = [
        (Modifiers::NONE, Key::Enter, Action::Next),
        (Modifiers::NONE, Key::V, Action::NextLayout),
        (Modifiers::NONE, Key::F, Action::ToggleFollowTip),
        (Modifiers::NONE, Key::M, Action::ToggleMeasure),
        (Modifiers::NONE, Key::I, Action::ToggleIsodose),
        (Modifiers::NONE, Key::G, Action::ToggleImage),
        (Modifiers::NONE, Key::T, Action::ToggleTheme),
        (Modifiers::NONE, Key::F12, Action::SavePicture),
        (Modifiers::NONE, Key::Num1, Action::LookFrom(Viewpoint::Oblique)),
        (Modifiers::NONE, Key::Num2, Action::LookFrom(Viewpoint::Perineum)),
        (Modifiers::NONE, Key::Num3, Action::LookFrom(Viewpoint::Side)),
        (Modifiers::NONE, Key::Num4, Action::LookFrom(Viewpoint::Above)),
        (Modifiers::NONE, Key::Num5, Action::LookFrom(Viewpoint::Needle)),
        (Modifiers::NONE, Key::Space, Action::DropSeed),
        (Modifiers::NONE, Key::E, Action::Send(Request::Engage)),
        (Modifiers::NONE, Key::D, Action::Send(Request::Disengage)),
        (Modifiers::NONE, Key::P, Action::OpenParameters),
        (Modifiers::NONE, Key::K, Action::ToggleInstructor),
        (Modifiers::NONE, Key::R, Action::ResetView),
        (Modifiers::NONE, Key::B, Action::Probe(ProbeAction::ToggleBrake)),
    ];
    let (others, mut is_others) = (egui::Id::unique("keys of the other hand"), false);
    ctx.data(|d| is_others = d.get_temp(others).unwrap_or(false));
    ctx.input_mut(|i| {
        for (modifiers, key, action) in pressed {
            // A key that repeats while held must not drop a row of seeds.
            if fresh_press(i, modifiers, key) {
                keys.actions.push(action);
            }
        }
        let held = |a, b| f64::from(u8::from(i.key_down(a) || i.key_down(b)));
        let slow = if i.modifiers.shift { 0.25 } else { 1.0 };
        // Releasing Alt before the other key must not begin to move the needle.
        let is_held = [Key::W, Key::S, Key::ArrowUp, Key::ArrowDown]
            .iter()
            .any(|key| i.key_down(*key));
        is_others = is_held && (is_others || i.modifiers.alt);
        if i.modifiers.alt {
            let axis = |more, less| {
                (f64::from(u8::from(i.key_down(more))) - f64::from(u8::from(i.key_down(less)))) * DRIVE_M_PER_S * slow
            };
            keys.second_m_per_s = [
                axis(Key::ArrowRight, Key::ArrowLeft),
                axis(Key::ArrowUp, Key::ArrowDown),
                axis(Key::W, Key::S),
            ];
        } else if !i.modifiers.command && !is_others {
            keys.drive_m_per_s = (held(Key::W, Key::ArrowUp) - held(Key::S, Key::ArrowDown)) * DRIVE_M_PER_S * slow;
        }
    });
    ctx.data_mut(|d| d.insert_temp(others, is_others));
    keys
}

/// Returns whether a dialog was clicked last and is still open: after its last field lost the focus, a letter that is
/// meant for it must not turn the force on. A click beside it, or Esc, returns the keys to the needle.
fn dialog_has_keys(ctx: &egui::Context) -> bool {
    let clicked = egui::Id::unique("layer that was clicked last");
    if let Some(at) = ctx.input(|i| i.pointer.any_pressed().then(|| i.pointer.interact_pos()).flatten()) {
        let layer = ctx.layer_id_at(at);
        ctx.data_mut(|d| d.insert_temp(clicked, layer));
    }
    let layer: Option<LayerId> = ctx.data(|d| d.get_temp(clicked)).flatten();
    let is_dialog = |layer: &LayerId| layer.order == Order::Middle && layer.id != egui::Id::unique(BANNERS);
    layer
        .filter(is_dialog)
        .is_some_and(|layer| ctx.memory(|m| m.areas().is_visible(&layer)))
}

fn fresh_press(input: &egui::InputState, modifiers: Modifiers, wanted: Key) -> bool {
    input.events.iter().any(|event| {
        matches!(event, egui::Event::Key { key, pressed: true, repeat: false, modifiers: held, .. }
            if *key == wanted && held.matches_logically(modifiers))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, RawInput};

    /// Returns a key that goes down or up.
    fn event(key: Key, pressed: bool) -> Event {
        Event::Key {
            key,
            physical_key: None,
            pressed,
            repeat: false,
            modifiers: Modifiers::NONE,
        }
    }

    fn read_after(ctx: &egui::Context, events: Vec<Event>) -> Keys {
        let mut keys = Keys::default();
        let input = RawInput {
            events,
            ..RawInput::default()
        };
        let _ = ctx.run_ui(input, |ui| keys = read(ui.ctx()));
        keys
    }

    /// Guards against letters typed after a value in *Parameters*, which turned the force on.
    #[test]
    fn a_dialog_that_was_clicked_keeps_the_keys_until_a_click_beside_it() {
        let ctx = egui::Context::default();
        let frame = |events: Vec<Event>, open: bool| {
            let mut keys = Keys::default();
            let input = RawInput {
                events,
                ..RawInput::default()
            };
            let _ = ctx.run_ui(input, |ui| {
                keys = read(ui.ctx());
                egui::Window::new("dialog")
                    .fixed_pos([100.0, 100.0])
                    .show(ui.ctx(), |ui| ui.label("a value"));
                if !open {
                    ui.ctx().memory_mut(|m| m.reset_areas());
                }
            });
            keys.actions
        };
        let press = |at: [f32; 2]| {
            let button = |pressed| Event::PointerButton {
                pos: at.into(),
                button: egui::PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            };
            vec![Event::PointerMoved(at.into()), button(true), button(false)]
        };
        let e = || vec![event(Key::E, true), event(Key::E, false)];
        for _ in 0..3 {
            frame(Vec::new(), true);
        }
        assert_eq!(frame(e(), true), [Action::Send(Request::Engage)], "nothing was clicked");
        frame(press([110.0, 110.0]), true);
        assert_eq!(frame(e(), true), []);
        frame(press([20.0, 20.0]), true);
        assert_eq!(frame(e(), true), [Action::Send(Request::Engage)], "beside it");
        frame(press([110.0, 110.0]), true);
        frame(Vec::new(), false);
        assert_eq!(frame(e(), true), [Action::Send(Request::Engage)], "it was closed");
    }

    /// Guards against a seed that was dropped behind the question whether to remove all.
    #[test]
    fn behind_a_question_only_the_force_goes_off() {
        let ctx = egui::Context::default();
        let frame = |key: Key| {
            let input = RawInput {
                events: vec![event(key, true)],
                ..RawInput::default()
            };
            let mut keys = Keys::default();
            let _ = ctx.run_ui(input, |ui| {
                keys = read(ui.ctx());
                egui::Modal::new(egui::Id::unique("question")).show(ui.ctx(), |ui| ui.label("Reset?"));
            });
            (keys.actions, keys.drive_m_per_s)
        };
        frame(Key::A);
        assert_eq!(frame(Key::Space), (vec![], 0.0));
        assert_eq!(frame(Key::W), (vec![], 0.0));
        assert_eq!(frame(Key::D).0, [Action::Send(Request::Disengage)]);
    }

    #[test]
    fn releasing_alt_first_does_not_move_the_needle() {
        let ctx = egui::Context::default();
        let w = |pressed| event(Key::W, pressed);
        let alt = |modifiers| Event::ModifiersChanged(modifiers);
        let keys = read_after(&ctx, vec![alt(Modifiers::ALT), w(true)]);
        assert!(keys.second_m_per_s[2] > 0.0 && keys.drive_m_per_s == 0.0);
        let keys = read_after(&ctx, vec![alt(Modifiers::NONE)]);
        assert_eq!((keys.second_m_per_s, keys.drive_m_per_s), ([0.0; 3], 0.0));
        read_after(&ctx, vec![w(false)]);
        assert!(read_after(&ctx, vec![w(true)]).drive_m_per_s > 0.0);
    }
}

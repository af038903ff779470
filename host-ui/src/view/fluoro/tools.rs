//! The switch of the beam and the angles of the arm.

use super::{CRANIAL_DEG, FluoroView, ORBITAL_DEG};
use crate::theme::Press;
use egui::{Key, Modifiers};

/// Step of the keys, degrees.
const STEP_DEG: f64 = 5.0;

impl FluoroView {
    /// Draws the switch, the angles, and the button for another patient.
    pub fn tools_ui(&mut self, ui: &mut egui::Ui) {
        let beam = ui.toggle_value(&mut self.is_switched_on, "X-ray");
        beam.on_hover_text("Hold X: 8 pulses a second. The last image stays on the screen.");
        let hint = "Ctrl with left, right: turns the detector to the patient's left or right";
        angle_ui(ui, "Orbital", ORBITAL_DEG, hint, &mut self.angles.orbital);
        let hint = "Ctrl with up, down: tilts the detector towards the head or feet";
        angle_ui(ui, "Cranial", CRANIAL_DEG, hint, &mut self.angles.cranial);
        let hint = "Sets the dose to zero and clears the screen, as a new scene does";
        if Press("New case", hint).ui(ui, true) {
            self.begin_case();
        }
        self.keys(ui);
    }

    fn keys(&mut self, ui: &egui::Ui) {
        self.is_key_held = false;
        if ui.memory(|m| m.focused().is_some()) {
            return;
        }
        ui.input_mut(|i| {
            self.is_key_held = i.focused && i.key_down(Key::X);
            let mut steps = |more, less| {
                let mut count = |key| i.count_and_consume_key(Modifiers::CTRL, key) as f64;
                STEP_DEG * (count(more) - count(less))
            };
            let (orbital, cranial) = (
                steps(Key::ArrowRight, Key::ArrowLeft),
                steps(Key::ArrowUp, Key::ArrowDown),
            );
            self.angles.turn(orbital, cranial);
        });
    }
}

fn angle_ui(ui: &mut egui::Ui, name: &str, most: f64, hint: &str, degrees: &mut f64) {
    let drag = egui::DragValue::new(degrees)
        .range(-most..=most)
        .speed(0.5)
        .fixed_decimals(0)
        .prefix(format!("{name} "))
        .suffix("°");
    ui.add(drag).on_hover_text(hint);
}

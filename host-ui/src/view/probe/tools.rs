//! The stepper of the probe, and the knobs of the ultrasound machine.

use super::ProbeView;
use crate::action::{Action, ProbeAction};
use crate::shown::Shown;
use egui::Key;
use stylet_imaging::ultrasound::Pose;

/// Steps of the stepper, mm and degrees.
const STEP_MM: f64 = 5.0;
const STEP_DEG: f64 = 5.0;
/// Half the travel of the stepper, mm, and its turn to either side, degrees.
const WAY_MM: f64 = 60.0;
const TURN_DEG: f64 = 90.0;

/// Insertion and turn of a probe that no hand holds, and the knobs of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knobs {
    /// Insertion into the patient from the middle of the target, mm.
    way_mm: f64,
    /// Turn about its axis, degrees.
    turn_deg: f64,
    pub depth_mm: f64,
    pub gain_db: f64,
    pub template: bool,
}

impl Default for Knobs {
    fn default() -> Self {
        Self {
            way_mm: 0.0,
            turn_deg: 0.0,
            depth_mm: 60.0,
            gain_db: 0.0,
            template: true,
        }
    }
}

impl Knobs {
    pub fn stepper(&self, base: &Pose) -> Pose {
        base.moved(self.way_mm * 1e-3, self.turn_deg.to_radians())
    }

    /// Moves the window's own stepper; returns true if the run has a probe in a hand, which the
    /// core must move.
    pub fn step(&mut self, shown: &Shown, way_mm: f64, turn_deg: f64) -> bool {
        let is_in_hand = shown.probe_pose().is_some();
        if !is_in_hand {
            self.way_mm = (self.way_mm + way_mm).clamp(-WAY_MM, WAY_MM);
            self.turn_deg = (self.turn_deg + turn_deg).clamp(-TURN_DEG, TURN_DEG);
        }
        is_in_hand
    }
}

impl ProbeView {
    /// Draws stepper and knobs; returns their requests to the hand that holds the probe.
    pub fn tools_ui(&mut self, ui: &mut egui::Ui, shown: &Shown) -> Vec<Action> {
        let mut actions = self.stepper_ui(ui, shown);
        let knobs = &mut self.knobs;
        let depth = Knob("Depth", [30.0, 100.0], " mm", "Depth from the probe's surface");
        depth.ui(ui, &mut knobs.depth_mm, true);
        let gain = Knob("Gain", [-30.0, 30.0], " dB", "Gain of the whole picture");
        gain.ui(ui, &mut knobs.gain_db, true);
        ui.toggle_value(&mut knobs.template, "Grid")
            .on_hover_text("Holes of the template in the transverse picture");
        actions.extend(self.keys(ui, shown));
        actions
    }

    fn stepper_ui(&mut self, ui: &mut egui::Ui, shown: &Shown) -> Vec<Action> {
        let mut actions = Vec::new();
        // The goal of the hand, or its place; a real device's hand goes where it will.
        let in_hand = shown.scene.as_ref().zip(shown.stepper.goal.or(shown.probe_pose()));
        let (way_m, turn_rad) = in_hand.map_or(
            (self.knobs.way_mm * 1e-3, self.knobs.turn_deg.to_radians()),
            |(scene, pose)| pose.way_and_turn(&Pose::of_scene(scene)),
        );
        let before = [way_m * 1e3, turn_rad.to_degrees()].map(|value| (value * 10.0).round() / 10.0);
        let [mut way_mm, mut turn_deg] = before;
        let may_step = in_hand.is_none() || shown.is_second_simulated();
        let hint = "Keys PgUp, PgDn: 5 mm. 0 is the middle of the target, positive into the patient";
        Knob("In", [-WAY_MM, WAY_MM], " mm", hint).ui(ui, &mut way_mm, may_step);
        let hint = "Keys Home, End: 5°. Turn about the probe's axis";
        Knob("Turn", [-TURN_DEG, TURN_DEG], "°", hint).ui(ui, &mut turn_deg, may_step);
        let by = [way_mm - before[0], turn_deg - before[1]];
        if may_step && by != [0.0; 2] {
            actions.extend(self.step(shown, by));
        }
        // It keeps its place while the core is silent.
        let brake = egui::Button::selectable(shown.stepper.is_locked, "Brake");
        let brake = ui.add_enabled(in_hand.is_some() && may_step, brake);
        let hint = "Key B: the stepper holds the probe; only its steps move it";
        let brake = brake.on_disabled_hover_text("Only the simulated hand of rt-core --device-2 has a brake");
        if brake.on_hover_text(hint).clicked() {
            actions.push(Action::Probe(ProbeAction::ToggleBrake));
        }
        actions
    }

    fn keys(&mut self, ui: &egui::Ui, shown: &Shown) -> Option<Action> {
        if ui.memory(|m| m.focused().is_some()) {
            return None;
        }
        let pressed = |more, less| {
            let is = |key| f64::from(u8::from(ui.input(|i| i.key_pressed(key))));
            is(more) - is(less)
        };
        let by = [
            STEP_MM * pressed(Key::PageUp, Key::PageDown),
            STEP_DEG * pressed(Key::Home, Key::End),
        ];
        (by != [0.0; 2]).then(|| self.step(shown, by)).flatten()
    }

    fn step(&mut self, shown: &Shown, [way_mm, turn_deg]: [f64; 2]) -> Option<Action> {
        self.knobs.step(shown, way_mm, turn_deg).then(|| {
            Action::Probe(ProbeAction::Step {
                way_m: way_mm * 1e-3,
                turn_rad: turn_deg.to_radians(),
            })
        })
    }
}

/// Name, limits, unit and tooltip of a number that is dragged.
struct Knob(&'static str, [f64; 2], &'static str, &'static str);

impl Knob {
    fn ui(self, ui: &mut egui::Ui, value: &mut f64, is_enabled: bool) {
        let Self(name, [least, most], unit, hint) = self;
        // A hand may hold the probe beyond the stepper's range.
        let range = least.min(*value)..=most.max(*value);
        let drag = egui::DragValue::new(value)
            .range(range)
            .speed(0.5)
            .fixed_decimals(1)
            .prefix(format!("{name} "))
            .suffix(unit);
        // In one widget, so that no line break separates name and value.
        ui.add_enabled(is_enabled, drag).on_hover_text(hint);
    }
}

//! Needles that stay in: leaving the present one, resuming one, withdrawing one.

use crate::action::Action;
use crate::shown::Shown;
use crate::theme;
use egui::Button;
use stylet_procedure::Pace;
use stylet_shm_schema::{HandMove, LeftNeedlePose, MAX_LEFT_NEEDLES, Request, flags};

/// Draws the button that leaves the present needle in, next to its other buttons.
pub(super) fn leave_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let is_in = shown.has_flag(flags::IN_CONTACT) && shown.has_flag(flags::LINE_READY);
    let may = shown.is_live() && !shown.running && is_in && shown.left.len() < MAX_LEFT_NEEDLES;
    let button = ui.add_enabled(may, Button::new("Leave in"));
    let help =
        "The needle stays in place and holds the gland; move the hand out and take another needle. At most 4 stay in.";
    if button.on_hover_text(help).on_disabled_hover_text(help).clicked() {
        actions.push(Action::Send(Request::LeaveNeedle));
    }
}

/// Draws a row for each needle that stays in.
pub(super) fn left_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let may = shown.is_live() && !shown.running;
    if !shown.left.is_empty() {
        ui.label(theme::small("Needles left in"));
    }
    for (number, left) in shown.left.iter().enumerate() {
        // Larger text needs a second line.
        ui.horizontal_wrapped(|ui| {
            ui.label(theme::small(format!("{}", number + 1)));
            let take = ui.add_enabled(may && is_at(shown, left), Button::new("Resume").small());
            let help = "Bring the hand along this needle to its tip first";
            if take.on_hover_text(help).on_disabled_hover_text(help).clicked() {
                actions.extend(of(left).map(|number| Action::Send(Request::TakeNeedle(number))));
            }
            let (to, tip_m) = match is_at_rest_nearby(shown, left) {
                true => ("To its entry", left.entry_m),
                false => ("To its tip", left.tip_m),
            };
            let hand = ui.add_enabled(may && !shown.has_flag(flags::IN_CONTACT), Button::new(to).small());
            if hand
                .on_hover_text("Moves the empty hand along the path of a needle left in")
                .clicked()
            {
                let pace = Pace::default();
                actions.push(Action::Send(Request::MoveHand(HandMove {
                    tip_m,
                    direction: left.direction,
                    speed_m_per_s: pace.insert_m_per_s,
                    acceleration_m_per_s2: pace.acceleration_m_per_s2,
                })));
            }
            let draw = ui.add_enabled(may, Button::new("Withdraw").small());
            if draw.on_hover_text("Withdraws this needle without the hand").clicked() {
                let speed_m_per_s = Pace::default().retract_m_per_s;
                actions.extend(of(left).map(|number| Action::Send(Request::DrawNeedle { number, speed_m_per_s })));
            }
        });
    }
}

/// Returns the number of a needle for requests.
fn of(left: &LeftNeedlePose) -> Option<u32> {
    u32::try_from(left.number).ok()
}

/// Returns whether the hand is at its tip, within the core's tolerance.
fn is_at(shown: &Shown, left: &LeftNeedlePose) -> bool {
    const WITHIN_M: f64 = 2e-3;
    shown.tip_m().is_some_and(|tip| {
        let square: f64 = (0..3).map(|a| (tip[a] - left.tip_m[a]).powi(2)).sum();
        square <= WITHIN_M * WITHIN_M
    })
}

/// Returns whether the hand is at rest next to it, not on its way.
fn is_at_rest_nearby(shown: &Shown, left: &LeftNeedlePose) -> bool {
    const WITHIN_M: f64 = 0.8e-3;
    let Some(tip_m) = shown.tip_m() else { return true };
    let from_m = [0, 1, 2].map(|a| tip_m[a] - left.entry_m[a]);
    let along_m: f64 = (0..3).map(|a| from_m[a] * left.direction[a]).sum();
    let square: f64 = (0..3).map(|a| (from_m[a] - along_m * left.direction[a]).powi(2)).sum();
    square > WITHIN_M * WITHIN_M
}

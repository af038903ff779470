//! The bar at the top: link, figures, force and settings.

use crate::IN_PAGE;
use crate::action::Action;
use crate::panel::banners::not_real_time_words;
use crate::settings::{SCALES, STRENGTHS_U, Settings, ThemeChoice};
use crate::shown::{NeedleLine, SecondHand, Shown};
use crate::theme;
use crate::words::Explained;
use egui::{Align, Color32, DragValue, Layout, RichText, Sense, Vec2};
use stylet_base::format;
use stylet_host::link::LinkStatus;
use stylet_shm_schema::ParameterId;

/// Width below which the bar takes two or three rows. The number depends on the width alone, so
/// that nothing moves.
const ONE_ROW: f32 = 1240.0;
const TWO_ROWS: f32 = 780.0;

/// Returns the height of the bar without its margins.
pub fn status_height(ui: &egui::Ui, width: f32) -> f32 {
    let rows = 1.0 + f32::from(u8::from(width < ONE_ROW)) + f32::from(u8::from(width < TWO_ROWS));
    rows * ui.spacing().interact_size.y + (rows - 1.0) * ui.spacing().item_spacing.y
}

pub fn status_ui(ui: &mut egui::Ui, shown: &Shown, settings: &mut Settings) -> Option<Action> {
    let mut action = None;
    let width = ui.available_width();
    ui.horizontal(|ui| {
        ui.label(RichText::new("Stylet").strong().size(17.0));
        link_ui(ui, shown);
        if width >= ONE_ROW {
            ui.separator();
            figures_ui(ui, shown);
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            action = buttons_ui(ui, settings);
            if width >= ONE_ROW {
                force_ui(ui, shown);
            }
        });
    });
    if width >= ONE_ROW {
        return action;
    }
    ui.horizontal(|ui| {
        figures_ui(ui, shown);
        if width >= TWO_ROWS {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| force_ui(ui, shown));
        }
    });
    if width < TWO_ROWS {
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| force_ui(ui, shown));
        });
    }
    action
}

/// Draws the buttons from right to left.
fn buttons_ui(ui: &mut egui::Ui, settings: &mut Settings) -> Option<Action> {
    let mut action = None;
    if ui.button("Help").on_hover_text("Key F1").clicked() {
        action = Some(Action::ToggleHelp);
    }
    ui.menu_button("Settings", |ui| {
        settings_ui(ui, settings);
        ui.separator();
        if ui.button("Instructor").on_hover_text("Key K").clicked() {
            action = Some(Action::ToggleInstructor);
        }
    });
    if ui.button("Parameters").on_hover_text("Key P").clicked() {
        action = Some(Action::OpenParameters);
    }
    action
}

fn settings_ui(ui: &mut egui::Ui, settings: &mut Settings) {
    ui.label(theme::weak("Colours"));
    ui.horizontal(|ui| {
        ui.radio_value(&mut settings.theme, ThemeChoice::Dark, "Dark");
        ui.radio_value(&mut settings.theme, ThemeChoice::Light, "Light");
    });
    let label = ui.label(theme::weak("Text size"));
    let mut percent = settings.scale * 100.0;
    let drag = DragValue::new(&mut percent)
        .range(SCALES[0] * 100.0..=SCALES[1] * 100.0)
        .speed(1.0)
        .max_decimals(0)
        .update_while_editing(false)
        .suffix(" %");
    let drag = ui.add(drag).labelled_by(label.id);
    if drag.on_hover_text("100 % follows the size of the window").changed() {
        settings.scale = percent / 100.0;
    }
    let label = ui
        .label(theme::weak("Air kerma strength of a seed"))
        .explained("strength")
        .explained("U");
    let drag = DragValue::new(&mut settings.seed_strength_u)
        .range(STRENGTHS_U[0]..=STRENGTHS_U[1])
        .speed(0.01)
        .fixed_decimals(3)
        .update_while_editing(false)
        .suffix(" U");
    ui.add(drag).labelled_by(label.id);
}

fn link_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let (word, color) = match shown.status {
        _ if shown.watched.is_some() => ("RECORDING", tokens.accent),
        LinkStatus::Live => ("LIVE", tokens.good),
        LinkStatus::Silent { .. } => ("SILENT", tokens.bad),
        LinkStatus::Absent { .. } => ("ABSENT", tokens.bad),
    };
    let response = badge(ui, word, color);
    if let Some(session) = &shown.session {
        response.on_hover_text(format!(
            "instance {}, session {:016x}, process {}, version {}\nforce loop {}, tissue {}\ninvalid messages dropped: {}",
            shown.instance,
            session.session_id,
            session.pid,
            session.version.read(),
            format::rate(session.period_ns),
            format::rate(session.tissue_period_ns),
            shown.invalid_dropped
        ));
    }
    if shown.is_absent() {
        return;
    }
    // A recorded core may have had real time; the page around it has none.
    let is_played_in_page = IN_PAGE && shown.watched.is_some();
    if shown.state.is_some() && !is_played_in_page {
        if shown.is_real_time() {
            badge(ui, "REAL-TIME", tokens.good);
        } else {
            badge(ui, "not real-time", tokens.warn).on_hover_text(not_real_time_words(shown));
        }
    }
    line_ui(ui, shown);
    second_ui(ui, shown);
}

/// Draws the state of the second hand, in a run with a second device.
fn second_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let color = match shown.second_hand() {
        None => return,
        Some(SecondHand::On) => tokens.good,
        Some(SecondHand::Off | SecondHand::Unknown) => tokens.warn,
        Some(SecondHand::Faulty(_)) => tokens.bad,
    };
    let response = badge(ui, "HAND 2", color);
    if let Some(words) = shown.second_words() {
        response.on_hover_text(words);
    }
}

/// Draws whether the tissue is prepared for the needle at its place, with finite elements.
fn line_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let preparing = format!("preparing line {}", shown.line_wait.words());
    let (word, color, hint) = match shown.needle_line() {
        None => return,
        Some(NeedleLine::Ready) => (
            "LINE READY",
            tokens.good,
            "The tissue along the needle is computed: the insertion can begin.",
        ),
        Some(NeedleLine::Preparing) => (
            preparing.trim_end(),
            tokens.warn,
            "The tissue along the needle is being computed: seconds so far, of those for the last needle. Hold the needle at its \
             entry until LINE READY appears here.",
        ),
        Some(NeedleLine::Missing) => (
            "NO LINE",
            tokens.bad,
            "The needle went in before the tissue along it was computed: its force is approximate, and its seeds may rest up \
             to 2 cm from plan. Withdraw it, and wait for LINE READY.",
        ),
    };
    badge(ui, word, color)
        .on_hover_text(hint)
        .explained("needle line ready");
}

fn badge(ui: &mut egui::Ui, word: &str, color: Color32) -> egui::Response {
    let ink = theme::of(ui).on_signal;
    egui::Frame::new()
        .fill(color)
        .corner_radius(4)
        .inner_margin(egui::Margin::symmetric(6, 2))
        .show(ui, |ui| ui.label(RichText::new(word).strong().size(12.0).color(ink)))
        .response
}

fn figures_ui(ui: &mut egui::Ui, shown: &Shown) {
    let state = shown.state.as_ref();
    let na = || "n/a".to_owned();
    figure(ui, "phase", shown.phase(), 126.0);
    figure(ui, "depth", &shown.depth_m().map_or_else(na, format::length), 72.0);
    figure(
        ui,
        "speed",
        &state.map_or_else(na, |s| format::speed(s.speed_m_per_s)),
        92.0,
    );
}

/// Draws a figure with a fixed width, so that the bar does not jump.
fn figure(ui: &mut egui::Ui, name: &str, value: &str, width: f32) {
    ui.label(theme::small(name)).explained(name);
    let height = ui.spacing().interact_size.y;
    ui.allocate_ui_with_layout(Vec2::new(width, height), Layout::left_to_right(Align::Center), |ui| {
        ui.set_min_width(width);
        ui.add(egui::Label::new(RichText::new(value).strong()).truncate());
    });
}

/// Draws scale, bar and name of the force, from right to left.
fn force_ui(ui: &mut egui::Ui, shown: &Shown) {
    let scale = shown
        .state
        .map(|s| s.force_scale)
        .or_else(|| shown.parameters.map(|p| p.set.get(ParameterId::ForceScale)));
    let text = scale.map_or("scale n/a".to_owned(), |s| format!("scale {s:.2}"));
    ui.label(theme::weak(text)).explained("force scale");
    let (force, limit, peak) = shown.state.map_or((0.0, 0.0, 0.0), |s| {
        let size = s.force_on_hand_n.iter().map(|c| c * c).sum::<f64>().sqrt();
        (size, s.device_limit_n, s.peak_force_n)
    });
    let known = shown.state.is_some();
    let label = match (known, limit > 0.0) {
        (false, _) => "n/a".to_owned(),
        (true, false) => format::force(force),
        (true, true) => format!("{} of {limit:.1} N", format::force(force)),
    };
    let (rect, response) = ui.allocate_exact_size(Vec2::new(90.0, 14.0), Sense::hover());
    let share = |value: f64| {
        if limit > 0.0 {
            (value / limit).clamp(0.0, 1.0) as f32
        } else {
            0.0
        }
    };
    let (painter, tokens) = (ui.painter(), theme::of(ui));
    painter.rect_filled(rect, 3.0, tokens.background);
    let mut filled = rect;
    filled.set_width(rect.width() * share(force));
    let color = if share(force) > 0.85 { tokens.bad } else { tokens.force };
    painter.rect_filled(filled, 3.0, color);
    if peak > 0.0 && limit > 0.0 {
        let x = rect.left() + rect.width() * share(peak);
        painter.vline(x, rect.y_range(), egui::Stroke::new(1.5, tokens.text));
    }
    let name = || format!("Force {label}");
    theme::named(&response, egui::accesskit::Role::ProgressIndicator, name);
    response.on_hover_text(format!("Peak since the last reset: {}", format::force(peak)));
    // Outside the bar: no text colour is legible on both of its parts.
    let size = Vec2::new(106.0, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
        ui.set_min_width(size.x);
        ui.add(egui::Label::new(theme::strong(&label)).truncate());
    });
    ui.label(theme::small("force")).explained("force on the hand");
}

//! The bar at the top and the banners under it: is it alive, is it real time, is the force on.

use super::{Action, Shown};
use crate::settings::{SCALES, STRENGTHS_U, Settings, ThemeChoice};
use crate::theme;
use crate::theme::Tokens;
use egui::{Align, Color32, DragValue, Layout, RichText, Sense, Vec2};
use stylet_base::format;
use stylet_host::link::LinkStatus;
use stylet_shm_schema::{Fault, ParameterId, Request};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    Bad,
    Warn,
    Info,
}

impl Severity {
    fn color(self, tokens: &Tokens) -> Color32 {
        match self {
            Self::Bad => tokens.bad,
            Self::Warn => tokens.warn,
            Self::Info => tokens.accent,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Banner {
    pub severity: Severity,
    pub title: &'static str,
    pub text: String,
    /// The one thing to do about it, where a click can do it.
    pub remedy: Option<(&'static str, Action)>,
}

/// Worst first. What cannot be known is not claimed: without a core nothing is said about its force.
pub fn banners(shown: &Shown) -> Vec<Banner> {
    let mut list = of_core(shown);
    list.extend(of_controllers(shown));
    list
}

/// What went, and what may not be read.
fn of_controllers(shown: &Shown) -> Vec<Banner> {
    let banner = |title, text, remedy| Banner {
        severity: Severity::Warn,
        title,
        text,
        remedy,
    };
    let gone = shown.gone.as_ref().map(|name| {
        let text = format!("{name}. The needle stays where it is; keys and mouse still move it.");
        banner("Unplugged", text, Some(("Put away", Action::PutGoneAway)))
    });
    let denied = shown.controllers.denied.iter();
    let denied = denied.map(|why| banner("A controller is not read", why.clone(), None));
    gone.into_iter().chain(denied).collect()
}

fn of_core(shown: &Shown) -> Vec<Banner> {
    match &shown.status {
        LinkStatus::Absent { why } => return vec![absent(shown, why)],
        LinkStatus::Silent { since } => {
            return vec![Banner {
                severity: Severity::Bad,
                title: "rt-core is silent",
                text: format!(
                    "Nothing came for {:.1} s. What you see is old. If it stays so, look at the terminal where rt-core runs.",
                    since.as_secs_f64()
                ),
                remedy: None,
            }];
        }
        LinkStatus::Live => {}
    }
    let mut list = Vec::new();
    let fault = shown.fault();
    if fault != Some(Fault::None) {
        list.push(Banner {
            severity: Severity::Bad,
            title: "Fault: the force is off",
            text: fault.map_or(
                "rt-core reports a fault that this program does not know".to_owned(),
                |f| sentence(f.message()),
            ),
            remedy: Some(("Re-arm", Action::Send(Request::Engage))),
        });
    }
    if shown.state.is_some() && !shown.is_real_time() {
        list.push(not_real_time(shown));
    }
    if shown.state.is_some() && fault == Some(Fault::None) {
        list.extend(force_is_off(shown));
    }
    list.extend(refused(shown));
    list
}

fn force_is_off(shown: &Shown) -> Option<Banner> {
    if !shown.is_engaged() {
        return Some(Banner {
            severity: Severity::Warn,
            title: "The force is off",
            text: "The device is moved but not felt. Key E turns it on.".to_owned(),
            remedy: Some(("Turn it on", Action::Send(Request::Engage))),
        });
    }
    shown.is_waiting().then(|| Banner {
        severity: Severity::Warn,
        title: "The force waits",
        text: "It would begin with a jump. Move the needle until it is small: out of the tissue is surest.".to_owned(),
        remedy: None,
    })
}

/// Until they are put away: what was refused may have been asked by another host.
fn refused(shown: &Shown) -> Option<Banner> {
    (shown.refusals > 0).then(|| Banner {
        severity: Severity::Info,
        title: "rt-core refused",
        text: match shown.last_refusal.as_str() {
            "" => format!("{} requests", shown.refusals),
            why => format!("{} requests; the last: {}", shown.refusals, why.replace('\n', "; ")),
        },
        remedy: Some(("Put away", Action::PutRefusalsAway)),
    })
}

fn absent(shown: &Shown, why: &str) -> Banner {
    let text = if why.is_empty() {
        format!("Start it in another terminal: rt-core --instance {}", shown.instance)
    } else {
        sentence(why)
    };
    Banner {
        severity: Severity::Bad,
        title: "rt-core is absent",
        text,
        remedy: None,
    }
}

fn not_real_time(shown: &Shown) -> Banner {
    let advice = shown.session.map(|s| s.advice.read()).unwrap_or_default();
    let asked = shown.session.is_some_and(|s| s.no_rt_asked != 0);
    let text = match (advice.trim(), asked) {
        ("", true) => "rt-core was started with --no-rt: timing here says nothing about this machine.".to_owned(),
        ("", false) => "Run setcap cap_sys_nice,cap_ipc_lock=ep on rt-core, or allow rtprio and memlock in /etc/security/limits.d, then start it again.".to_owned(),
        (advice, _) => advice.replace('\n', "  "),
    };
    Banner {
        severity: Severity::Warn,
        title: "Not real-time",
        text,
        remedy: None,
    }
}

fn sentence(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map(|first| format!("{}{}.", first.to_uppercase(), chars.as_str()))
        .unwrap_or_default()
}

pub fn banners_ui(ui: &mut egui::Ui, list: &[Banner]) -> Option<Action> {
    let mut action = None;
    let tokens = theme::of(ui);
    let ink = tokens.on_signal;
    for banner in list {
        let fill = banner.severity.color(tokens);
        egui::Frame::new()
            .fill(fill)
            .inner_margin(egui::Margin::symmetric(10, 5))
            .show(ui, |ui| {
                ui.set_min_width(ui.available_width());
                ui.horizontal(|ui| {
                    ui.label(RichText::new(banner.title).strong().size(15.0).color(ink));
                    if let Some((name, remedy)) = &banner.remedy
                        && ui.button(*name).clicked()
                    {
                        action = Some(remedy.clone());
                    }
                    let body = RichText::new(&banner.text).color(ink);
                    // Two hyphens of a command must not look like one dash.
                    let body = if banner.text.contains("--") {
                        body.monospace()
                    } else {
                        body
                    };
                    ui.add(egui::Label::new(body).wrap()).on_hover_text(&banner.text);
                });
            });
    }
    action
}

pub fn status_ui(ui: &mut egui::Ui, shown: &Shown, settings: &mut Settings) -> Option<Action> {
    let mut action = None;
    ui.horizontal(|ui| {
        ui.label(RichText::new("Stylet").strong().size(17.0));
        link_ui(ui, shown);
        ui.separator();
        figures_ui(ui, shown);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.button("Help").on_hover_text("Key F1").clicked() {
                action = Some(Action::ToggleHelp);
            }
            ui.menu_button("Settings", |ui| settings_ui(ui, settings));
            if ui.button("Parameters").on_hover_text("Key P").clicked() {
                action = Some(Action::OpenParameters);
            }
            force_ui(ui, shown);
        });
    });
    action
}

fn settings_ui(ui: &mut egui::Ui, settings: &mut Settings) {
    ui.label(theme::weak("Colours"));
    ui.horizontal(|ui| {
        ui.radio_value(&mut settings.theme, ThemeChoice::Dark, "Dark");
        ui.radio_value(&mut settings.theme, ThemeChoice::Light, "Light");
    });
    let label = ui.label(theme::weak("Size of words"));
    let mut percent = settings.scale * 100.0;
    let drag = DragValue::new(&mut percent)
        .range(SCALES[0] * 100.0..=SCALES[1] * 100.0)
        .speed(1.0)
        .max_decimals(0)
        .update_while_editing(false)
        .suffix(" %");
    if ui.add(drag).labelled_by(label.id).changed() {
        settings.scale = percent / 100.0;
    }
    let label = ui.label(theme::weak("Air kerma strength of a seed"));
    let drag = DragValue::new(&mut settings.seed_strength_u)
        .range(STRENGTHS_U[0]..=STRENGTHS_U[1])
        .speed(0.01)
        .max_decimals(3)
        .update_while_editing(false)
        .suffix(" U");
    ui.add(drag).labelled_by(label.id);
}

fn link_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let (word, color) = match shown.status {
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
    if shown.state.is_some() {
        let (word, color) = if shown.is_real_time() {
            ("REAL-TIME", tokens.good)
        } else {
            ("not real-time", tokens.warn)
        };
        badge(ui, word, color);
    }
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
    figure(ui, "depth", &state.map_or_else(na, |s| format::length(s.depth_m)), 58.0);
    figure(
        ui,
        "speed",
        &state.map_or_else(na, |s| format::speed(s.speed_m_per_s)),
        72.0,
    );
}

/// Fixed width, so that the bar does not jump as figures change.
fn figure(ui: &mut egui::Ui, name: &str, value: &str, width: f32) {
    ui.label(theme::small(name));
    let height = ui.spacing().interact_size.y;
    ui.allocate_ui_with_layout(Vec2::new(width, height), Layout::left_to_right(Align::Center), |ui| {
        ui.set_min_width(width);
        ui.add(egui::Label::new(RichText::new(value).strong()).truncate());
    });
}

/// Right to left: the scale, the bar, its name.
fn force_ui(ui: &mut egui::Ui, shown: &Shown) {
    let scale = shown
        .state
        .map(|s| s.force_scale)
        .or_else(|| shown.parameters.map(|p| p.set.get(ParameterId::ForceScale)));
    let text = scale.map_or("scale n/a".to_owned(), |s| format!("scale {s:.2}"));
    ui.label(theme::weak(text))
        .on_hover_text("Force on the hand for each newton of a real needle");
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
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::accesskit::Role::ProgressIndicator, true, format!("Force {label}"))
    });
    response.on_hover_text(format!("Peak since the last reset: {}", format::force(peak)));
    // Beside the bar: no colour of words can be read on both of its parts.
    let size = Vec2::new(106.0, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
        ui.set_min_width(size.x);
        ui.add(egui::Label::new(theme::strong(&label)).truncate());
    });
    ui.label(theme::small("force"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::{HapticState, flags};

    fn live() -> Shown {
        let mut shown = Shown::empty("lab");
        shown.status = LinkStatus::Live;
        let mut state = HapticState::zeroed();
        state.flags = flags::REAL_TIME | flags::ENGAGED;
        shown.state = Some(state);
        shown
    }

    #[test]
    fn all_well_needs_no_banner_and_absence_says_what_to_type() {
        assert!(banners(&live()).is_empty());
        let list = banners(&Shown::empty("lab"));
        assert!(list[0].text.contains("rt-core --instance lab"), "{}", list[0].text);
    }

    #[test]
    fn a_force_that_is_off_or_waits_and_a_refusal_each_have_their_banner() {
        let titles = |shown: &Shown| banners(shown).iter().map(|b| b.title).collect::<Vec<_>>();
        let mut shown = live();
        if let Some(state) = &mut shown.state {
            state.flags |= flags::WAITING;
        }
        assert_eq!(titles(&shown), ["The force waits"]);
        if let Some(state) = &mut shown.state {
            state.flags = flags::REAL_TIME;
        }
        shown.refusals = 2;
        shown.last_refusal = "needle.puncture_depth = 1000 mm".to_owned();
        assert_eq!(titles(&shown), ["The force is off", "rt-core refused"]);
        assert!(banners(&shown)[1].text.contains("puncture_depth"));
    }

    #[test]
    fn a_controller_that_went_and_one_without_rights_are_told_with_or_without_a_core() {
        for mut shown in [live(), Shown::empty("lab")] {
            let before = banners(&shown).len();
            shown.gone = Some("Pad".to_owned());
            shown
                .controllers
                .denied
                .push("Cap may not be read. Run: that".to_owned());
            let list = banners(&shown);
            assert_eq!(list.len(), before + 2);
            assert!(list[before].text.contains("Pad. The needle stays where it is"));
            assert_eq!(list[before].remedy, Some(("Put away", Action::PutGoneAway)));
            assert!(list[before + 1].text.contains("Run: that"));
        }
    }

    #[test]
    fn fault_comes_first_and_an_unknown_one_is_a_fault() {
        let mut shown = live();
        if let Some(state) = &mut shown.state {
            (state.fault, state.flags) = (999, 0);
        }
        let list = banners(&shown);
        assert_eq!(list[0].severity, Severity::Bad);
        assert_eq!(list[1].title, "Not real-time");
    }
}

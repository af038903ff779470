//! The banners under the bar: problems of core, force and controllers, with their remedies.

use super::class;
use crate::IN_PAGE;
use crate::action::{Action, WatchAction};
use crate::shown::{NeedleLine, SecondHand, Shown, Watched};
use crate::theme;
use crate::theme::Tokens;
use crate::view::free::BANNERS;
use crate::words::{capital, counted, sentence};
use egui::{Color32, Rect, RichText};
use stylet_host::link::{LinkStatus, START_IT};
use stylet_shm_schema::{Exercise, Fault, Relayed, Request};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BannerLevel {
    Bad,
    Warn,
    Info,
}

impl BannerLevel {
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
    pub level: BannerLevel,
    pub title: &'static str,
    pub text: String,
    /// Remedy, if a click can apply one.
    pub remedy: Option<(&'static str, Action)>,
}

impl Banner {
    pub fn new(level: BannerLevel, title: &'static str, text: impl Into<String>) -> Self {
        Self {
            level,
            title,
            text: text.into(),
            remedy: None,
        }
    }

    /// Adds a remedy.
    pub fn with(self, name: &'static str, action: Action) -> Self {
        Self {
            remedy: Some((name, action)),
            ..self
        }
    }
}

/// Returns the banners, worst first. Without a core there is no banner about its force.
pub fn banners(shown: &Shown) -> Vec<Banner> {
    let mut list = match &shown.watched {
        Some(watched) => vec![of_recording(watched)],
        None => of_core(shown),
    };
    list.extend(of_controllers(shown));
    list
}

/// Returns the banner of a recording, which replaces the problems of the recorded core.
fn of_recording(watched: &Watched) -> Banner {
    let text = match (watched.has_ended, IN_PAGE) {
        (false, false) => "Needle, force and tissue are shown as recorded; nothing can be moved.",
        (true, false) => "End of recording. Close it, start rt-core, and insert a needle yourself.",
        (false, true) => {
            "Shown as recorded; nothing can be moved. A browser has no real time, and no force for your hand."
        }
        (true, true) => {
            "End of recording. Close it and insert a needle yourself, or drop another one (.mcap, by host-ui record)."
        }
    };
    Banner::new(BannerLevel::Info, "A recording", text).with("Close", Action::Watch(WatchAction::Close))
}

/// Returns banners for devices that were unplugged or cannot be read.
fn of_controllers(shown: &Shown) -> Vec<Banner> {
    let unplugged = shown.disconnected.as_ref().map(|name| {
        let text = format!("{name}. The needle stays where it is; keys and mouse still move it.");
        Banner::new(BannerLevel::Warn, "Unplugged", text).with("Dismiss", Action::DismissDisconnected)
    });
    let denied = shown.controllers.denied.iter();
    let denied = denied.map(|why| Banner::new(BannerLevel::Warn, "A controller cannot be read", why));
    unplugged.into_iter().chain(denied).collect()
}

fn of_core(shown: &Shown) -> Vec<Banner> {
    match &shown.status {
        LinkStatus::Absent { why } => return vec![absent(shown, why)],
        LinkStatus::Silent { .. } if shown.relayed.is_some_and(|r| r.is_heard == 0) => {
            return shown.relayed.as_ref().map(of_line).into_iter().collect();
        }
        LinkStatus::Silent { since } => {
            let since_s = since.as_secs_f64();
            let text = format!("No data from the core for {since_s:.1} s; showing the last state.");
            return vec![Banner::new(BannerLevel::Bad, "The core is silent", text)];
        }
        LinkStatus::Live => {}
    }
    let mut list = Vec::new();
    let fault = shown.fault();
    if fault != Some(Fault::None) {
        let unknown = || "rt-core reports a fault that this program does not know".to_owned();
        let text = fault.map_or_else(unknown, |f| sentence(f.message()));
        let banner = Banner::new(BannerLevel::Bad, "Fault: the force is off", text);
        list.push(banner.with("Re-arm", Action::Send(Request::Engage)));
    }
    list.extend(of_second(shown));
    let is_reduced = shown.reduced.is_some() && shown.reduced == shown.session.map(|s| s.session_id);
    if shown.state.is_some() && !shown.is_real_time() && !is_reduced {
        list.push(not_real_time(shown));
    }
    if shown.state.is_some() && fault == Some(Fault::None) {
        list.extend(force_is_off(shown));
    }
    list.extend(exercises(shown));
    list.extend(without_line(shown));
    list.extend(folded(shown));
    list.extend(refused(shown));
    list.extend(class::banners(shown));
    list.extend(shown.relayed.as_ref().map(of_line));
    list
}

/// Returns the banner of the second device; the needle's device has its own.
fn of_second(shown: &Shown) -> Option<Banner> {
    let Some(SecondHand::Faulty(fault)) = shown.second_hand() else {
        return None;
    };
    let text = match fault {
        Some(Fault::LoopStopped) => {
            "Its loop in rt-core has stopped, so its force is off. The needle continues; restart rt-core when you are done.".to_owned()
        }
        fault => format!(
            "{} The needle's force is not affected.",
            sentence(fault.map_or("it reports a fault that this program does not know", Fault::message))
        ),
    };
    let banner = Banner::new(BannerLevel::Bad, "Second device: its force is off", text);
    Some(match fault {
        Some(Fault::LoopStopped) => banner,
        _ => banner.with("Re-arm both", Action::Send(Request::Engage)),
    })
}

/// Returns the banner of a relay: the trainee shown, the delay and the losses.
fn of_line(line: &Relayed) -> Banner {
    let age_s = line.snapshot_age_ns as f64 * 1e-9;
    let (server, name) = (line.server.read(), line.name.read());
    if line.is_heard == 0 {
        let text = format!(
            "{server} has sent no data of {name} for {age_s:.1} s: the display is out of date, and requests are refused. The window continues \
             when the connection is restored."
        );
        return Banner::new(BannerLevel::Bad, "No data from the relay", text);
    }
    let operator = match (line.operates, line.operator.read()) {
        (1, _) => "You are operating".to_owned(),
        (_, nobody) if nobody.is_empty() => "No one is operating".to_owned(),
        (_, other) => format!("{} is operating", capital(&other)),
    };
    let text = format!(
        "{name}, {}, at {server}. {operator}. Shown {:.0} ms late, round trip {:.0} ms; {} records and {} snapshots lost.",
        line.role.read(),
        age_s * 1e3,
        line.round_trip_ns as f64 * 1e-6,
        line.records_lost,
        line.snapshots_lost
    );
    Banner::new(BannerLevel::Info, "Connected over a relay", text).with("Members", Action::ToggleClass)
}

fn force_is_off(shown: &Shown) -> Option<Banner> {
    if !shown.is_engaged() {
        let text = "The needle moves, but no force is felt. Key E turns it on.";
        let banner = Banner::new(BannerLevel::Warn, "The force is off", text);
        return Some(banner.with("Turn it on", Action::Send(Request::Engage)));
    }
    let text = "Turned on now, it would jolt the hand. Move the needle until the force is small, preferably outside the tissue.";
    shown
        .is_waiting()
        .then(|| Banner::new(BannerLevel::Warn, "The force is held back", text))
}

/// Names the faults that an instructor injected, so that a trainee does not suspect the machine.
fn exercises(shown: &Shown) -> Vec<Banner> {
    let in_force = shown.session.map(|s| s.exercises).unwrap_or_default();
    let banner = |exercise: Exercise| {
        let text = format!("{}. Injected by the instructor.", capital(&exercise.to_string()));
        Banner::new(BannerLevel::Warn, "Exercise", text)
    };
    in_force.all().map(banner).collect()
}

/// Warns while the needle is in tissue that was not prepared for it: force and positions are less
/// accurate, and may be late.
fn without_line(shown: &Shown) -> Option<Banner> {
    let is_missing = shown.needle_line() == Some(NeedleLine::Missing);
    let text = match shown.lag() {
        Some((lag_s, lag_m)) => format!(
            "The tissue was not prepared for this needle, and its answer is {:.0} ms and {} behind: neither force nor seed positions are \
             reliable. Withdraw the needle, and wait for LINE READY.",
            lag_s * 1e3,
            stylet_base::format::length(lag_m)
        ),
        None => {
            "The tissue was not prepared for this needle: its force is approximate, and its seeds may rest up to 2 cm \
                 from plan. Withdraw it, and wait for LINE READY."
                .to_owned()
        }
    };
    is_missing.then(|| Banner::new(BannerLevel::Warn, "No needle line", text))
}

/// Warns while the tissue is folded; results record from which displacement on it was.
fn folded(shown: &Shown) -> Option<Banner> {
    let folded_from_m = shown.folded_from_m().filter(|_| shown.is_folded());
    folded_from_m.map(|folded_from_m| {
        let text = format!(
            "The linear tissue model at the tip is folded beyond {:.1} mm of displacement. Until the load eases, force and positions \
             there are not realistic.",
            stylet_base::format::mm(folded_from_m)
        );
        Banner::new(BannerLevel::Warn, "Tissue folded", text)
    })
}

/// Returns the refusals until they are dismissed: the refused request may be another host's.
fn refused(shown: &Shown) -> Option<Banner> {
    let text = match shown.last_refusal.as_str() {
        "" => format!("{} requests", shown.refusals),
        why => format!("{} requests; the last: {}", shown.refusals, why.replace('\n', "; ")),
    };
    let banner = Banner::new(BannerLevel::Info, "Request refused", text).with("Dismiss", Action::DismissRefusals);
    (shown.refusals > 0).then_some(banner)
}

fn absent(shown: &Shown, why: &str) -> Banner {
    let can_start = !shown.reads_recording && shown.relayed.is_none();
    let said = match can_start {
        true => why.split(START_IT).next().unwrap_or_default().trim(),
        false => why,
    };
    let mut text = what_ended(shown) + &sentence(said.trim_end_matches('.'));
    if can_start && shown.session.is_none() {
        text += " Step 1 has a recorded example that needs no core.";
    }
    let banner = Banner::new(BannerLevel::Bad, "The simulator core is not running", text);
    match shown.session {
        _ if !can_start => banner,
        Some(_) => banner.with("Start it again", Action::StartCore),
        None => banner.with("Start it", Action::StartCore),
    }
}

/// Explains why the last core ended, as far as it reported, and what is kept.
fn what_ended(shown: &Shown) -> String {
    if shown.session.is_none() {
        return String::new();
    }
    let fault = match shown.last_fault.as_str() {
        "" => String::new(),
        fault => format!("Its last fault: {fault}. "),
    };
    let kept = match shown.seeds.len() {
        0 => String::new(),
        n => format!("The plan and {} remain on display. ", counted(n, "seed")),
    };
    fault + &kept
}

/// Returns what takes real time from the run, and what to do.
pub fn not_real_time_words(shown: &Shown) -> String {
    let advice = shown.session.map(|s| s.advice.read()).unwrap_or_default();
    let asked = shown.session.is_some_and(|s| s.no_rt_asked != 0);
    match (advice.trim(), asked) {
        _ if shown.is_stepped => {
            "The core is stepped by this window: motion and force are computed late, and no device renders the force."
                .to_owned()
        }
        (_, true) => "Started with --no-rt. Restart without it for real-time forces.".to_owned(),
        ("", false) => "Run rt-core doctor: it lists the problems and their remedies.".to_owned(),
        (advice, _) => advice.replace('\n', "  "),
    }
}

/// Warns of forces that may be late; on request only the badge at the top does.
fn not_real_time(shown: &Shown) -> Banner {
    let banner = Banner::new(BannerLevel::Warn, "Not real-time", not_real_time_words(shown));
    banner.with("Badge only", Action::ReduceNotRealTime)
}

/// Largest share of the pictures under banners.
const SHARE: f32 = 0.6;
/// Width below which the text stands under the title.
const NARROW: f32 = 560.0;

/// Draws the banners over the upper edge of the pictures, so that nothing moves when one appears or
/// disappears.
pub fn banners_ui(ctx: &egui::Context, pictures: Rect, list: &[Banner]) -> Option<Action> {
    if list.is_empty() {
        return None;
    }
    let area = egui::Area::new(egui::Id::unique(BANNERS))
        .fixed_pos(pictures.min)
        .movable(false)
        .constrain(false)
        .default_width(pictures.width());
    let shown = area.show(ctx, |ui| {
        ui.set_max_width(pictures.width());
        let most = SHARE * pictures.height();
        // It would scroll beyond 64 points.
        let scroll = egui::ScrollArea::vertical().max_height(most).min_scrolled_height(most);
        // The pictures must not show between two banners.
        let backed = egui::Frame::new().fill(theme::of(ui).panel);
        let inner = backed.show(ui, |ui| {
            scroll.show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 1.0;
                // The last clicked one wins.
                list.iter().filter_map(|banner| banner_ui(ui, banner)).last()
            })
        });
        inner.inner.inner
    });
    shown.inner
}

fn banner_ui(ui: &mut egui::Ui, banner: &Banner) -> Option<Action> {
    let tokens = theme::of(ui);
    let ink = tokens.on_signal;
    let head = |ui: &mut egui::Ui| {
        ui.label(RichText::new(banner.title).strong().size(15.0).color(ink));
        let (name, remedy) = banner.remedy.as_ref()?;
        ui.button(*name).clicked().then(|| remedy.clone())
    };
    let body = |ui: &mut egui::Ui| {
        let text = RichText::new(&banner.text).color(ink);
        // Two hyphens of a command must not look like one dash.
        let text = if banner.text.contains("--") {
            text.monospace()
        } else {
            text
        };
        ui.add(egui::Label::new(text).wrap());
    };
    let frame = egui::Frame::new()
        .fill(banner.level.color(tokens))
        .inner_margin(egui::Margin::symmetric(10, 5));
    let shown = frame.show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        if ui.available_width() < NARROW {
            let action = ui.horizontal(head).inner;
            body(ui);
            return action;
        }
        let both = ui.horizontal(|ui| {
            let action = head(ui);
            body(ui);
            action
        });
        both.inner
    });
    shown.inner
}

#[cfg(test)]
mod tests;

//! The banners under the bar: problems of core, force and controllers, with their remedies.

use super::class;
use crate::action::{Action, WatchAction};
use crate::shown::{NeedleLine, SecondHand, Shown, Watched};
use crate::theme;
use crate::theme::Tokens;
use crate::view::free::BANNERS;
use crate::words::{capital, sentence};
use egui::{Color32, Rect, RichText};
use stylet_host::link::LinkStatus;
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
    Banner {
        level: BannerLevel::Info,
        title: "A recording",
        text: match watched.has_ended {
            true => "End of recording. Close it, start rt-core, and insert a needle yourself.".to_owned(),
            false => "Needle, force and tissue are shown as recorded; nothing can be moved.".to_owned(),
        },
        remedy: Some(("Close", Action::Watch(WatchAction::Close))),
    }
}

/// Returns banners for devices that were unplugged or cannot be read.
fn of_controllers(shown: &Shown) -> Vec<Banner> {
    let banner = |title, text, remedy| Banner {
        level: BannerLevel::Warn,
        title,
        text,
        remedy,
    };
    let unplugged = shown.disconnected.as_ref().map(|name| {
        let text = format!("{name}. The needle stays where it is; keys and mouse still move it.");
        banner("Unplugged", text, Some(("Dismiss", Action::DismissDisconnected)))
    });
    let denied = shown.controllers.denied.iter();
    let denied = denied.map(|why| banner("A controller cannot be read", why.clone(), None));
    unplugged.into_iter().chain(denied).collect()
}

fn of_core(shown: &Shown) -> Vec<Banner> {
    match &shown.status {
        LinkStatus::Absent { why } => return vec![absent(shown, why)],
        LinkStatus::Silent { .. } if shown.relayed.is_some_and(|r| r.is_heard == 0) => {
            return shown.relayed.as_ref().map(of_line).into_iter().collect();
        }
        LinkStatus::Silent { since } => {
            return vec![Banner {
                level: BannerLevel::Bad,
                title: "The core is silent",
                text: format!(
                    "No data from the core for {:.1} s; showing the last state.",
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
            level: BannerLevel::Bad,
            title: "Fault: the force is off",
            text: fault.map_or(
                "rt-core reports a fault that this program does not know".to_owned(),
                |f| sentence(f.message()),
            ),
            remedy: Some(("Re-arm", Action::Send(Request::Engage))),
        });
    }
    list.extend(of_second(shown));
    if shown.state.is_some() && !shown.is_real_time() {
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
    Some(Banner {
        level: BannerLevel::Bad,
        title: "Second device: its force is off",
        text,
        remedy: (fault != Some(Fault::LoopStopped)).then_some(("Re-arm both", Action::Send(Request::Engage))),
    })
}

/// Returns the banner of a relay: the trainee shown, the delay and the losses.
fn of_line(line: &Relayed) -> Banner {
    let age_s = line.snapshot_age_ns as f64 * 1e-9;
    let (server, name) = (line.server.read(), line.name.read());
    if line.is_heard == 0 {
        return Banner {
            level: BannerLevel::Bad,
            title: "No data from the relay",
            text: format!(
                "{server} has sent no data of {name} for {age_s:.1} s: the display is out of date, and requests are refused. The window continues \
                 when the connection is restored."
            ),
            remedy: None,
        };
    }
    let operator = match (line.operates, line.operator.read()) {
        (1, _) => "You operate".to_owned(),
        (_, nobody) if nobody.is_empty() => "Nobody operates".to_owned(),
        (_, other) => format!("{} operates", capital(&other)),
    };
    Banner {
        level: BannerLevel::Info,
        title: "Connected over a relay",
        text: format!(
            "{name}, {}, at {server}. {operator}. Shown {:.0} ms late, round trip {:.0} ms; {} records and {} snapshots lost.",
            line.role.read(),
            age_s * 1e3,
            line.round_trip_ns as f64 * 1e-6,
            line.records_lost,
            line.snapshots_lost
        ),
        remedy: Some(("Members", Action::ToggleClass)),
    }
}

fn force_is_off(shown: &Shown) -> Option<Banner> {
    if !shown.is_engaged() {
        return Some(Banner {
            level: BannerLevel::Warn,
            title: "The force is off",
            text: "Motion is tracked, but no force is rendered. Key E turns it on.".to_owned(),
            remedy: Some(("Turn it on", Action::Send(Request::Engage))),
        });
    }
    shown.is_waiting().then(|| Banner {
        level: BannerLevel::Warn,
        title: "The force is held back",
        text: "It would start with a jump. Move the needle until the force is small, preferably outside the tissue."
            .to_owned(),
        remedy: None,
    })
}

/// Names the faults that an instructor injected, so that a trainee does not suspect the machine.
fn exercises(shown: &Shown) -> Vec<Banner> {
    let in_force = shown.session.map(|s| s.exercises).unwrap_or_default();
    let banner = |exercise: Exercise| Banner {
        level: BannerLevel::Warn,
        title: "Exercise",
        text: format!("{}. Injected by the instructor.", capital(&exercise.to_string())),
        remedy: None,
    };
    in_force.all().map(banner).collect()
}

/// Warns while the needle is in tissue that was not prepared for it: force and positions are less
/// accurate, and may be late.
fn without_line(shown: &Shown) -> Option<Banner> {
    let is_missing = shown.needle_line() == Some(NeedleLine::Missing);
    is_missing.then(|| Banner {
        level: BannerLevel::Warn,
        title: "No needle line",
        text: match shown.lag() {
            Some((lag_s, lag_m)) => format!(
                "The tissue was not prepared for this needle, and its answer is {:.0} ms and {} behind: neither force nor seed positions are \
                 reliable. Withdraw the needle, and wait for LINE READY.",
                lag_s * 1e3,
                stylet_base::format::length(lag_m)
            ),
            None => "The tissue was not prepared for this needle: its force follows the paper's law, and its seeds may rest up to 2 cm \
                     from plan. Withdraw it, and wait for LINE READY."
                .to_owned(),
        },
        remedy: None,
    })
}

/// Warns while the tissue is folded; results record from which displacement on it was.
fn folded(shown: &Shown) -> Option<Banner> {
    let folded_from_m = shown.folded_from_m().filter(|_| shown.is_folded());
    folded_from_m.map(|folded_from_m| Banner {
        level: BannerLevel::Warn,
        title: "Tissue folded",
        text: format!(
            "The linear tissue model at the tip is folded beyond {:.1} mm of displacement. Until the load eases, force and positions \
             there are not realistic.",
            stylet_base::format::mm(folded_from_m)
        ),
        remedy: None,
    })
}

/// Returns the refusals until they are dismissed: the refused request may be another host's.
fn refused(shown: &Shown) -> Option<Banner> {
    (shown.refusals > 0).then(|| Banner {
        level: BannerLevel::Info,
        title: "Request refused",
        text: match shown.last_refusal.as_str() {
            "" => format!("{} requests", shown.refusals),
            why => format!("{} requests; the last: {}", shown.refusals, why.replace('\n', "; ")),
        },
        remedy: Some(("Dismiss", Action::DismissRefusals)),
    })
}

fn absent(shown: &Shown, why: &str) -> Banner {
    let text = if why.is_empty() {
        format!("Start it in another terminal: rt-core --instance {}", shown.instance)
    } else {
        format!("{}{}", what_ended(shown), sentence(why))
    };
    let remedy = match shown.session.is_some() && shown.relayed.is_none() {
        true => ("Start it again", Action::StartCore),
        false => ("Watch example", Action::Watch(WatchAction::Example)),
    };
    Banner {
        level: BannerLevel::Bad,
        title: "The simulator core is not running",
        text,
        remedy: (!shown.reads_recording).then_some(remedy),
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
        1 => "The plan and 1 seed remain on display. ".to_owned(),
        n => format!("The plan and {n} seeds remain on display. "),
    };
    fault + &kept
}

fn not_real_time(shown: &Shown) -> Banner {
    let advice = shown.session.map(|s| s.advice.read()).unwrap_or_default();
    let asked = shown.session.is_some_and(|s| s.no_rt_asked != 0);
    let text = match (advice.trim(), asked) {
        ("", true) => "Started with --no-rt. Restart without it for real-time forces.".to_owned(),
        ("", false) => "Run rt-core doctor: it lists the problems and their remedies.".to_owned(),
        (advice, _) => advice.replace('\n', "  "),
    };
    Banner {
        level: BannerLevel::Warn,
        title: "Not real-time",
        text,
        remedy: None,
    }
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

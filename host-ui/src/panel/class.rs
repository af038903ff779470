//! Hosts connected over a relay: the operator, and the transfer of the needle.

use crate::action::Action;
use crate::panel::banners::{Banner, BannerLevel};
use crate::shown::Shown;
use crate::theme;
use egui::RichText;
use stylet_shm_schema::{Class, ClassMember, LeaseRequest};

/// Role in the certificates of those who may hold the needle.
const OPERATOR: &str = "operator";
const WIDTH: f32 = 480.0;
const NAME_WIDTH: f32 = 190.0;
/// Silence after which a member counts as lost; members report five times a second.
const SILENT_NS: u64 = 1_000_000_000;
const TITLE_AND_EDGES: f32 = 70.0;

/// Rights of this window's user to the needle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hand {
    /// Another role, without rights.
    None,
    /// May ask for it.
    Free,
    /// Holds it.
    Held,
}

fn hand(shown: &Shown, class: &Class) -> Hand {
    let (may, has) = match &shown.relayed {
        Some(line) => (line.role.read() == OPERATOR, line.operates != 0),
        // The user at the core's machine decides who operates.
        None => (class.is_beside_core != 0, class.local_operates != 0),
    };
    match (may, has) {
        (false, _) => Hand::None,
        (true, false) => Hand::Free,
        (true, true) => Hand::Held,
    }
}

/// Returns banners: connected hosts, at the core's machine; requests for the needle, wherever it
/// is.
pub fn banners(shown: &Shown) -> Vec<Banner> {
    let Some(class) = shown.class.as_ref().filter(|class| class.count > 0) else {
        return Vec::new();
    };
    let mut list = Vec::new();
    let asked = class.asked.read();
    if hand(shown, class) == Hand::Held && !asked.is_empty() {
        let text = format!("{asked} asks to operate. The hand stops when you hand over.");
        let banner = Banner::new(BannerLevel::Warn, "Request for the needle", text);
        list.push(banner.with("Hand over", Action::Lease(LeaseRequest::Give(asked))));
    }
    if shown.relayed.is_none() {
        let text = format!(
            "{} connected over the relay. {}",
            members(class),
            operates(shown, class)
        );
        let banner = Banner::new(BannerLevel::Info, "A class is watching", text);
        list.push(banner.with("Members", Action::ToggleClass));
    }
    list
}

fn members(class: &Class) -> String {
    match class.count + class.unlisted.min(1_000_000) {
        1 => "1 member is".to_owned(),
        n => format!("{n} members are"),
    }
}

fn operates(shown: &Shown, class: &Class) -> String {
    match (hand(shown, class), class.operator.read()) {
        (Hand::Held, _) => "You are operating.".to_owned(),
        (_, name) if name.is_empty() => "No one is operating.".to_owned(),
        (_, name) => format!("{name} is operating."),
    }
}

/// Draws the list of members while it is open.
pub fn class_ui(ctx: &egui::Context, shown: &Shown, open: &mut bool) -> Option<Action> {
    let window = egui::Window::new("Members")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO);
    let drawn = window.show(ctx, |ui| {
        let room = ui.ctx().content_rect().height() - TITLE_AND_EDGES;
        ui.set_width(WIDTH);
        let scroll = egui::ScrollArea::vertical().max_height(room).min_scrolled_height(room);
        scroll.show(ui, |ui| list_ui(ui, shown)).inner
    });
    drawn.and_then(|drawn| drawn.inner).flatten()
}

fn list_ui(ui: &mut egui::Ui, shown: &Shown) -> Option<Action> {
    let Some(class) = &shown.class else {
        ui.label(
            "No relay on this machine reports members. Start 'relay serve' on the core's machine, or 'relay join' here.",
        );
        return None;
    };
    let (hand, mut action) = (hand(shown, class), None);
    if let Some(line) = &shown.relayed {
        let age_ms = line.snapshot_age_ns as f64 * 1e-6;
        ui.label(theme::weak(format!(
            "{} shows the state of {age_ms:.0} ms ago.",
            line.server.read()
        )));
    }
    ui.horizontal_wrapped(|ui| {
        ui.label(theme::strong(operates(shown, class)));
        let (words, request) = match hand {
            Hand::None => return,
            Hand::Held => ("Release the needle", LeaseRequest::Release),
            Hand::Free if shown.relayed.is_some() => ("Ask for the needle", LeaseRequest::Take),
            Hand::Free => ("Operate from here", LeaseRequest::Take),
        };
        if ui.button(words).clicked() {
            action = Some(Action::Lease(request));
        }
    });
    let asked = class.asked.read();
    if !asked.is_empty() {
        ui.label(format!("{asked} asks to operate."));
    }
    // Over a relay only the holder of the needle can hand it over.
    let gives = hand == Hand::Held || (hand == Hand::Free && shown.relayed.is_none());
    ui.add_space(4.0);
    let rows = egui::Grid::new("members")
        .num_columns(5)
        .striped(true)
        .spacing([14.0, 6.0]);
    rows.show(ui, |ui| {
        theme::heads(ui, ["name", "role", "round trip", "lost", "last heard"]);
        for member in class.members() {
            let given = member_ui(ui, member, gives && member.name.read() != class.operator.read());
            action = given.or(action.take());
            ui.end_row();
        }
    });
    if class.unlisted > 0 {
        ui.label(theme::small(format!("and {} more", class.unlisted)));
    }
    action
}

/// Draws one row; the button that hands the needle over stands under the name.
fn member_ui(ui: &mut egui::Ui, member: &ClassMember, may_have_it: bool) -> Option<Action> {
    let (name, role) = (member.name.read(), member.role.read());
    let (role_words, color) = match role.is_empty() {
        true => ("revoked", theme::of(ui).bad),
        false => (role.as_str(), theme::of(ui).text),
    };
    let gives = ui.vertical(|ui| {
        ui.set_width(NAME_WIDTH);
        ui.add(egui::Label::new(&name).wrap());
        let give = || egui::Button::new(format!("Hand the needle to {name}")).wrap();
        may_have_it && role == OPERATOR && ui.add(give()).clicked()
    });
    ui.label(RichText::new(role_words).color(color));
    ui.monospace(milliseconds(member.round_trip_ns));
    let lost = RichText::new(member.records_lost.to_string()).monospace();
    ui.label(if member.records_lost > 0 {
        lost.color(theme::of(ui).warn)
    } else {
        lost
    });
    let heard = RichText::new(format!("{} ago", milliseconds(member.silent_ns))).small();
    let is_silent = member.silent_ns > SILENT_NS;
    ui.label(if is_silent {
        heard.color(theme::of(ui).warn)
    } else {
        heard.weak()
    });
    gives.inner.then_some(Action::Lease(LeaseRequest::Give(name)))
}

/// Formats short times to a tenth, long ones in seconds.
fn milliseconds(ns: u64) -> String {
    let ms = ns as f64 * 1e-6;
    match ms {
        ..10.0 => format!("{ms:.1} ms"),
        10.0..1000.0 => format!("{ms:.0} ms"),
        _ => format!("{:.1} s", ms * 1e-3),
    }
}

#[cfg(test)]
mod tests;

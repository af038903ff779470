//! Settings granted by the kernel, state of the link, and cost of a frame.

use crate::shown::{SecondHand, Shown};
use crate::theme;
use egui::RichText;
use stylet_base::format;
use stylet_host::link::LinkStatus;
use stylet_shm_schema::ThreadReport;

/// Length of a controller's name that leaves room for the reason why it does not hold the needle.
const LONGEST_CONTROLLER: usize = 24;

pub fn setup_ui(ui: &mut egui::Ui, shown: &Shown) {
    ui.separator();
    // Lines of text need less room than widgets.
    ui.spacing_mut().interact_size.y = 14.0;
    egui::Grid::new("set-up")
        .num_columns(2)
        .spacing([10.0, 1.0])
        .show(ui, |ui| {
            let mut row = |name: &str, value: String, fine: bool| {
                ui.label(theme::small(name));
                let tokens = theme::of(ui);
                let color = if fine { tokens.text } else { tokens.warn };
                ui.add(egui::Label::new(RichText::new(value).small().color(color)).truncate());
                ui.end_row();
            };
            if let Some(session) = &shown.session {
                row("device", session.device.read(), true);
            }
            if shown.is_stepped {
                row("both loops", "stepped by this window".to_owned(), true);
            } else if let Some(session) = &shown.session {
                row("force loop", thread(&session.haptic), session.haptic.is_fifo());
                row("tissue loop", thread(&session.tissue), session.tissue.is_fifo());
                if session.has_second() {
                    let fine = session.second.is_fifo() && !matches!(shown.second_hand(), Some(SecondHand::Faulty(_)));
                    row("device 2", session.second_device.read(), fine);
                }
                let locked = session.memory_locked != 0;
                let memory = if locked {
                    "locked"
                } else {
                    "not locked: pages may be missing"
                };
                row("memory", memory.to_owned(), locked);
            }
            let (link, fine) = link(shown);
            row("link", link, fine);
            row("this window", frame(shown), true);
            let (controller, fine) = controller(shown);
            row("controller", controller, fine);
            row("its axes", axes(shown), true);
        });
}

fn thread(report: &ThreadReport) -> String {
    let policy = match report.policy {
        1 => format!("SCHED_FIFO {}", report.priority),
        _ => format!("not SCHED_FIFO, {} requested", report.asked_priority),
    };
    match report.core {
        u32::MAX => format!("{policy}, any core"),
        core => format!("{policy}, core {core}"),
    }
}

fn link(shown: &Shown) -> (String, bool) {
    let (word, fine) = match &shown.status {
        LinkStatus::Live => ("live".to_owned(), true),
        LinkStatus::Silent { since } => (format!("silent for {:.1} s", since.as_secs_f64()), false),
        LinkStatus::Absent { .. } => ("absent".to_owned(), false),
    };
    let dropped = shown.invalid_dropped;
    let text = format!("{word}, {} invalid messages dropped", format::count(dropped));
    (text, fine && dropped == 0)
}

/// Returns the device that holds the needle, and the reason if it does not.
fn controller(shown: &Shown) -> (String, bool) {
    let Some(device) = &shown.controllers.holder else {
        return match shown.controllers.denied.is_empty() {
            true => ("n/a".to_owned(), true),
            false => ("cannot be read".to_owned(), false),
        };
    };
    let name: String = device.name.chars().take(LONGEST_CONTROLLER).collect();
    if !shown.has_focus {
        (format!("{name}: window not focused"), false)
    } else if !device.was_released {
        (format!("{name}: release it first"), false)
    } else {
        (name, true)
    }
}

fn axes(shown: &Shown) -> String {
    let holder = shown.controllers.holder.as_ref();
    holder.map_or("n/a", |device| device.kind.axes()).to_owned()
}

fn frame(shown: &Shown) -> String {
    let cost = shown.cost;
    format!(
        "{:.1} ms a frame, {:.1} in the driver, {:.0} KiB",
        cost.cpu_us * 1e-3,
        cost.driver_us * 1e-3,
        cost.uploaded_bytes as f64 / 1024.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_controllers::{Device, Kind};

    #[test]
    fn the_controller_is_shown_with_axes_and_state() {
        let mut shown = Shown::empty("lab");
        assert_eq!(
            (controller(&shown), axes(&shown)),
            (("n/a".to_owned(), true), "n/a".to_owned())
        );
        shown.controllers.denied.push("Pad cannot be read".to_owned());
        assert!(!controller(&shown).1);
        let holder = |was_released| Device {
            name: "A gamepad with a name that is long".to_owned(),
            kind: Kind::Gamepad,
            was_released,
        };
        shown.controllers.holder = Some(holder(true));
        assert_eq!(controller(&shown), ("A gamepad with a name th".to_owned(), true));
        assert!(axes(&shown).contains("left stick"));
        shown.controllers.holder = Some(holder(false));
        assert!(controller(&shown).0.ends_with("release it first"));
        shown.has_focus = false;
        assert!(controller(&shown).0.ends_with("window not focused"));
    }

    #[test]
    fn threads_show_granted_and_requested_settings() {
        let mut report = ThreadReport {
            policy: 1,
            priority: 80,
            asked_priority: 80,
            core: 2,
            ..ThreadReport::default()
        };
        assert_eq!(thread(&report), "SCHED_FIFO 80, core 2");
        (report.policy, report.core) = (0, u32::MAX);
        assert_eq!(thread(&report), "not SCHED_FIFO, 80 requested, any core");
    }
}

//! The figures as OpenMetrics text, which the textfile collector of node_exporter reads too.

use super::{Health, LAST};
use std::fmt::Write;
use stylet_shm_schema::{Instance, flags};

/// One family: name without the unit and without `_total`, unit, what it is, and its values with further labels.
struct Family<'a> {
    name: &'a str,
    kind: &'a str,
    unit: &'a str,
    about: &'a str,
    values: Vec<(String, f64)>,
}

/// Returns the whole file.
pub fn text(health: &Health, instance: &Instance) -> String {
    let families = families(health);
    let mut text = String::new();
    for family in families.iter().filter(|family| !family.values.is_empty()) {
        let name = match family.unit {
            "" => format!("stylet_{}", family.name),
            unit => format!("stylet_{}_{unit}", family.name),
        };
        let mut line = |words: &[&str]| {
            let _ok = writeln!(text, "{}", words.join(" "));
        };
        line(&["# TYPE", &name, family.kind]);
        if !family.unit.is_empty() {
            line(&["# UNIT", &name, family.unit]);
        }
        line(&["# HELP", &name, family.about]);
        let total = if family.kind == "counter" { "_total" } else { "" };
        for (labels, value) in &family.values {
            line(&[
                &format!("{name}{total}{{core=\"{}\"{labels}}}", instance.name()),
                &value.to_string(),
            ]);
        }
    }
    text + "# EOF\n"
}

fn families(h: &Health) -> Vec<Family<'static>> {
    let one = |value: f64| vec![(String::new(), value)];
    let counter = |name, about, value: u64| Family {
        name,
        kind: "counter",
        unit: "",
        about,
        values: one(value as f64),
    };
    let gauge = |name, unit, about, values| Family {
        name,
        kind: "gauge",
        unit,
        about,
        values,
    };
    let success = h.success().map_or(Vec::new(), |[last, all]| {
        let over = |what: &str| format!(",over=\"{what}\"");
        vec![(over(&format!("last_{LAST}")), last), (over("watched"), all)]
    });
    // The state of a core that has ended says nothing about the present.
    let state = h.state.filter(|_| h.answers);
    let of_core =
        |read: fn(&stylet_shm_schema::HapticState) -> f64| state.as_ref().map_or(Vec::new(), |s| one(read(s)));
    let is = |bit: u32| state.map_or(Vec::new(), |s| one(f64::from(u8::from(s.flags & bit != 0))));
    vec![
        gauge(
            "up",
            "",
            "Whether the core answers.",
            one(f64::from(u8::from(h.answers))),
        ),
        gauge(
            "force_engaged",
            "",
            "Whether the force is turned on.",
            is(flags::ENGAGED),
        ),
        gauge(
            "tick_success",
            "ratio",
            "Share of deadlines of the force loop whose force left within the period.",
            success,
        ),
        counter(
            "ticks",
            "Deadlines of the force loop that were watched, served or missed.",
            h.deadlines,
        ),
        counter("missed_deadlines", "Watched deadlines that no tick served.", h.missed),
        counter(
            "late_forces",
            "Watched ticks whose force left after their period.",
            h.late,
        ),
        counter("unseen_ticks", "Ticks whose record did not reach this host.", h.unseen),
        counter("rearms", "Times the force was armed again after a fault.", h.rearms),
        counter("faults", "Faults that turned the force off.", h.faults),
        gauge(
            "worst_wake",
            "seconds",
            "Latest wake-up of the force loop since the core started.",
            of_core(|s| s.since_start.worst_wake_ns as f64 / 1e9),
        ),
        gauge(
            "worst_wake_since_armed",
            "seconds",
            "Latest wake-up of the force loop since the force was last turned on.",
            of_core(|s| s.since_armed.worst_wake_ns as f64 / 1e9),
        ),
    ]
}

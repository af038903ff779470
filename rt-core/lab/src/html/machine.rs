//! Basis of the figures: counters of the kernel, settings, machine, method.

use crate::bound::MissBound;
use crate::others::Others;
use crate::report::{LoopCounts, Report};
use maud::{Markup, html};
use stylet_report::parts::{Column, cell, count, num, or_na, table};

const COUNTS: [Column; 4] = [Column::Text, Column::Number, Column::Number, Column::Number];

type ReadCount = fn(&LoopCounts) -> f64;

pub fn counters(r: &Report) -> Markup {
    let of: [(&str, ReadCount); 10] = [
        ("ticks", |c| c.ticks as f64),
        ("missed deadlines", |c| c.missed_deadlines as f64),
        ("overruns", |c| c.overruns as f64),
        ("ticks not measured", |c| c.unmeasured as f64),
        ("heap calls", |c| c.usage.heap_calls as f64),
        ("minor page faults", |c| c.usage.minor_faults as f64),
        ("major page faults", |c| c.usage.major_faults as f64),
        ("voluntary context switches", |c| c.usage.voluntary_switches as f64),
        ("... beyond one for each sleep", |c| {
            c.voluntary_switches_beyond_sleep as f64
        }),
        ("involuntary context switches", |c| c.usage.involuntary_switches as f64),
    ];
    let loops = [&r.haptic, &r.tissue].into_iter().chain(&r.second);
    let loops: Vec<_> = loops.map(|section| &section.counts).collect();
    let rows = of.map(|(what, read)| {
        let counts = loops.iter().map(|counts| count(read(counts)));
        std::iter::once(cell(what)).chain(counts).collect::<Vec<_>>()
    });
    let names = ["from arming to the end", "force loop", "tissue loop", "second device"];
    let names = &names[..=loops.len()];
    let cores: Vec<Vec<Markup>> = r
        .cores
        .iter()
        .map(|c| {
            let range = c.lowest_mhz.zip(c.highest_mhz);
            let mhz = range.map_or(or_na(None), |(low, high)| {
                cell(format!("{} to {}", num(low), num(high)))
            });
            let served = c.interrupts.map(|n| n as f64);
            let busy = |share: Option<f64>| or_na(share.map(|s| 100.0 * s));
            let counted = c.counted.iter().map(|c| format!("{} {}", c.what, num(c.times as f64)));
            let smi = c
                .system_management_interrupts
                .map(|n| format!("system management interrupts {n}"));
            let counted: Vec<String> = counted.chain(smi).collect();
            vec![
                cell(c.core),
                mhz,
                or_na(c.steal_s),
                or_na(served),
                busy(c.busy),
                busy(c.busy_before),
                cell(counted.join(", ")),
            ]
        })
        .collect();
    html! {
        h2 { "Counters" }
        (table(names, &rows, &COUNTS))
        (table(&CORES, &cores, &[Column::Number; 6]))
        (others(&r.others))
        (miss_bound("Force loop", &r.haptic.miss_bound))
        (miss_bound("Tissue loop", &r.tissue.miss_bound))
        @if let Some(second) = &r.second {
            (miss_bound("Loop of the second device", &second.miss_bound))
        }
    }
}

const CORES: [&str; 7] = [
    "core",
    "MHz",
    "steal time, s",
    "interrupts served",
    "busy, %",
    "since the start, %",
    "counted during the run",
];

/// Tabulates what ran beside the measurement.
fn others(o: &Others) -> Markup {
    let moments = o.moments.iter().map(|m| {
        let waited = m
            .waited_percent
            .iter()
            .map(|(what, percent)| format!("{what} {}", num(*percent)));
        vec![
            cell(&m.when),
            or_na(m.load),
            cell(waited.collect::<Vec<_>>().join(", ")),
        ]
    });
    let threads = o.threads.iter().map(|t| {
        let priority = t.priority.map_or("normal".to_owned(), |p| format!("real-time {p}"));
        vec![
            cell(&t.name),
            cell(t.id),
            cell(t.core),
            cell(priority),
            or_na(Some(100.0 * t.share)),
        ]
    });
    let (moments, threads): (Vec<_>, Vec<_>) = (moments.collect(), threads.collect());
    html! {
        h2 { "What else ran" }
        p { (o.words()) "." }
        (table(&["when", "load", "threads that waited for, % of 10 s"], &moments, &[Column::Text, Column::Number]))
        @if !threads.is_empty() {
            (table(&["thread", "number", "core", "priority", "% of a core"], &threads, &[Column::Text]))
        }
    }
}

fn miss_bound(name: &str, b: &MissBound) -> Markup {
    let Some((share, hourly)) = b.at_most.zip(b.at_most_per_hour) else {
        return Markup::default();
    };
    html! {
        p class="faint" {
            (name) ": " (b.misses) " missed of " (num(b.of as f64)) "; with 95 % confidence at most " (format!("{share:.2e}"))
            " of all, " (num(hourly)) " an hour (Clopper-Pearson, if misses are independent and the machine stays as it was)."
        }
    }
}

pub fn stiffness(r: &Report) -> Markup {
    let s = &r.stiffness;
    let rows: Vec<Vec<Markup>> = s
        .margins
        .iter()
        .map(|m| vec![cell(&m.at), or_na(m.delay_us), or_na(m.k_max_n_per_m.map(|k| k / 1e3))])
        .collect();
    html! {
        h2 { "What the delay costs the hand" }
        div class="half" { (table(&["at", "delay t_d, \u{b5}s", "K_max, N/mm"], &rows, &COUNTS)) }
        p class="faint" {
            (s.rule) ". b = " (num(s.hand_damping_n_s_per_m)) " N s/m, a hand in the middle of what people have; B = "
            (num(s.law_damping_n_s_per_m)) " N s/m, damping of the force law. Stiffer walls than K_max may vibrate."
        }
    }
}

pub fn provenance(r: &Report) -> Markup {
    let met = |is_met: bool| html! { @if is_met { "yes" } @else { b { "no" } } };
    let settings = r.settings.iter();
    let settings: Vec<_> = settings
        .map(|s| vec![cell(&s.name), cell(&s.asked), cell(&s.got), met(s.met)])
        .collect();
    let facts = r.facts.iter();
    let facts: Vec<_> = facts
        .map(|f| vec![cell(&f.group), cell(&f.name), cell(&f.value)])
        .collect();
    html! {
        h2 { "Settings, asked and read back" }
        (table(&["setting", "asked", "got", "met"], &settings, &[]))
        h2 { "Machine" }
        (table(&["", "what", "reported value"], &facts, &[Column::Text, Column::Text, Column::Wide]))
    }
}

pub fn method(r: &Report) -> Markup {
    html! {
        h2 { "Method" }
        p {
            "The run's own force loop, tissue loop and bridge, with the simulated device and a script that inserts and retracts \
             the needle every 4 s. The first " (num(r.protocol.warm_up_s)) " s are not recorded. Wake-up: clock read right after \
             the sleep, less the due time on the ideal grid. Missed deadline: a grid point that was skipped. Overrun: a tick that \
             ended after the next was due. A percentile needs ten samples beyond it; below it stands its 95 % interval, from how \
             far eight equal parts of the run differ (batch means): it holds for wake-ups that depend on each other over less than a \
             part, and not from run to run. Values are known to 0.1 %. This report is \
             evidence for whoever assesses the machine; it claims no conformity with any standard."
        }
        p class="faint" {
            "Command: " code { (r.command.join(" ")) } br;
            "Commit: " code { (r.commit) } ", schema " (r.schema)
            @for program in &r.programs { br; "SHA-256 of " (program.name) ": " code { (program.sha256) } }
        }
    }
}

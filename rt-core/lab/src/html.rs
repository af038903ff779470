//! The report as one page that needs nothing else: light, system fonts, pictures inside.

use crate::compare::Against;
use crate::measure::Measured;
use crate::plots::{self, BLUE, ORANGE, Series};
use crate::report::{LoopSection, NO_DIGEST, Report};
use crate::summary::{QUANTILES, Summary};
use crate::verdict::Outcome;
use std::fmt::Write;

const STYLE: &str = include_str!("report.css");

/// Text as HTML.
fn esc(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// Three significant digits or whole numbers; a thin space between thousands.
fn num(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.abs() < 100.0 {
        let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 3) as usize;
        let text = format!("{value:.digits$}");
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    let whole = format!("{value:.0}");
    let mut grouped = String::new();
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) && digit != '-' {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// The unit as a page writes it.
fn micro(unit: &str) -> String {
    unit.replace("us", "\u{b5}s")
}

fn or_na(value: Option<f64>) -> String {
    value.map_or("<span class=na>n/a</span>".to_owned(), num)
}

fn duration(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{} s", num(seconds.ceil()))
    } else {
        format!("{} min", num((seconds / 60.0).ceil()))
    }
}

/// The whole page; the report's digest stands in it as zeros, once.
pub fn page(report: &Report, measured: &Measured) -> Result<String, String> {
    let mut body = String::new();
    body += &header(report);
    body += &key_figures(report);
    body += &limits(report);
    body += &pictures(report, measured)?;
    body += &times("Force loop", &report.haptic);
    body += &times("Tissue loop", &report.tissue);
    body += &host(report);
    body += &comparison(report);
    body += &stiffness(report);
    body += &counters(report);
    body += &late(report);
    body += &provenance(report);
    body += &method(report);
    let title = format!("Latency report, {}", report.made_at);
    Ok(format!(
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8><title>{}</title>\
         <meta name=viewport content=\"width=device-width\">\n<style>\n{STYLE}</style></head>\n<body><main>\n{body}\
         <footer>SHA-256 of report.json: <code>{NO_DIGEST}</code>. Check with <code>rt-core verify</code>.</footer>\n\
         </main></body></html>\n",
        esc(&title)
    ))
}

fn badge(outcome: Outcome) -> String {
    let class = match outcome {
        Outcome::Pass => "pass",
        Outcome::Fail => "fail",
        Outcome::NotMeasurable => "open",
    };
    format!("<span class=\"badge {class}\">{}</span>", outcome.words())
}

fn header(r: &Report) -> String {
    let p = &r.protocol;
    let environment = if r.environment.qualified {
        "<p class=note>Environment qualified: no reason was found to doubt the tail.</p>".to_owned()
    } else {
        let items: String = r
            .environment
            .evidence
            .iter()
            .map(|e| format!("<li>{}</li>", esc(&e.replace(" us", " \u{b5}s"))))
            .collect();
        format!(
            "<div class=warning><strong>Environment not qualified.</strong> Percentiles above p99.5, maxima and missed \
             deadlines are shown but not compared with their limits: here they say more about the machine below than about this program.\
             <ul>{items}</ul></div>"
        )
    };
    format!(
        "<header><h1>Latency report</h1>{}</header>\n\
         <p class=sub>Scene <b>{}</b>, force loop at <b>{} Hz</b>, tissue at {} Hz, load <b>{}</b> ({}), \
         <b>{} s</b> measured, {} insertions. {}, {}.</p>\n{environment}\n",
        badge(r.verdict.overall),
        esc(&p.scene),
        num(p.rate_hz),
        num(p.tissue_rate_hz),
        format!("{:?}", p.load).to_lowercase(),
        esc(&p.load_is),
        num(p.measured_s.round()),
        p.insertions,
        esc(&r.made_at),
        esc(&r.program),
    )
}

fn key_figures(r: &Report) -> String {
    let of = |name: &str, q: &str| {
        let summary = r.haptic.times.iter().find(|t| t.name == name);
        summary.and_then(|s| s.quantile(q)).and_then(|q| q.us)
    };
    let share = r.haptic.work_p999_of_period.map(|s| s * 100.0);
    let k = r
        .stiffness
        .margins
        .iter()
        .find(|m| m.at == "p99.9")
        .and_then(|m| m.k_max_n_per_m);
    let cards = [
        ("wake-up, p50", or_na(of("wake-up", "p50")), "\u{b5}s"),
        ("wake-up, p99", or_na(of("wake-up", "p99")), "\u{b5}s"),
        ("own work, p99.9", or_na(of("whole tick", "p99.9")), "\u{b5}s"),
        ("of the period", or_na(share), "%"),
        ("missed deadlines", r.haptic.counts.missed_deadlines.to_string(), ""),
        ("stiffness margin, p99.9", or_na(k.map(|k| k / 1e3)), "N/mm"),
    ];
    let cards = cards.map(|(what, value, unit)| format!("<div><b>{value}</b> {unit}<br><span>{what}</span></div>"));
    format!("<section class=cards>{}</section>\n", cards.concat())
}

/// A table; the first column is text, the rest as `classes` say.
fn table(head: &[&str], rows: &[Vec<String>], classes: &[&str]) -> String {
    let mut out = String::from("<table><thead><tr>");
    let class = |i: usize| classes.get(i).map_or(String::new(), |c| format!(" class=\"{c}\""));
    for (i, h) in head.iter().enumerate() {
        let _ = write!(out, "<th{}>{h}</th>", class(i));
    }
    out += "</tr></thead><tbody>\n";
    for row in rows {
        out += "<tr>";
        for (i, cell) in row.iter().enumerate() {
            let _ = write!(out, "<td{}>{cell}</td>", class(i));
        }
        out += "</tr>\n";
    }
    out + "</tbody></table>\n"
}

fn limits(r: &Report) -> String {
    let rows: Vec<Vec<String>> = r
        .verdict
        .limits
        .iter()
        .map(|j| {
            let sign = if j.lower_bound { "\u{2265}" } else { "\u{2264}" };
            vec![
                badge(j.outcome),
                format!("<code>{}</code><br><span class=faint>{}</span>", j.name, j.id),
                or_na(j.value),
                format!("{sign} {}", num(j.limit)),
                micro(j.unit),
                format!(
                    "{}<br><span class=faint>{}</span>",
                    esc(j.reason),
                    esc(&short(&j.evidence).replace(" us", " \u{b5}s"))
                ),
            ]
        })
        .collect();
    let head = ["outcome", "limit", "value", "allowed", "unit", "reason and evidence"];
    let classes = ["", "", "n", "n", "", "wide"];
    format!("<h2>Limits</h2>\n{}", table(&head, &rows, &classes))
}

/// The reasons why the environment does not qualify stand at the top of the page once.
fn short(evidence: &str) -> String {
    match (
        evidence.strip_prefix("environment not qualified"),
        evidence.rsplit_once("; "),
    ) {
        (Some(_), Some((_, own))) => format!("environment not qualified; {own}"),
        _ => evidence.to_owned(),
    }
}

fn pictures(r: &Report, m: &Measured) -> Result<String, String> {
    let h = &m.haptic;
    let wake = Series {
        name: "force loop",
        color: BLUE,
        histogram: &h.wake,
    };
    let compared = r.comparison.as_ref().filter(|c| !c.rounds.is_empty());
    let turns = compared.map(|c| {
        let ours = Series {
            name: "force loop",
            color: BLUE,
            histogram: &c.ours,
        };
        let theirs = Series {
            name: c.against.name(),
            color: ORANGE,
            histogram: &c.others,
        };
        (c.against, [ours, theirs])
    });
    let own = Series {
        name: "own work",
        color: ORANGE,
        histogram: &h.work,
    };
    let mut figures = vec![
        (
            "Wake-up of the force loop",
            plots::wake_histogram(&[Series { ..wake }])?,
        ),
        ("Where a force tick goes", plots::stages(h)?),
        ("Worst of each window", plots::windows(&h.windows, m.window_ns)?),
        ("Cumulative tail", plots::tail(&[wake, own])?),
        ("Where a tissue tick goes", plots::stages(&m.tissue)?),
    ];
    match &turns {
        Some((Against::Cyclictest, turns)) => {
            figures.push(("Wake-up beside cyclictest, all turns", plots::wake_histogram(turns)?));
        }
        Some((Against::Unloaded, turns)) => {
            figures.push((
                "Wake-up with and without the load, all turns",
                plots::wake_histogram(turns)?,
            ));
        }
        None => {
            let seen = Series {
                name: "tip moved to host saw it",
                color: BLUE,
                histogram: &m.host.tip_to_host,
            };
            let answered = Series {
                name: "tip moved to tissue answered",
                color: ORANGE,
                histogram: &m.tissue.path,
            };
            figures.push(("From tip to tissue and host", plots::tail(&[seen, answered])?));
        }
    }
    let figures = figures
        .iter()
        .map(|(title, svg)| format!("<figure><figcaption>{title}</figcaption>{svg}</figure>\n"));
    Ok(format!(
        "<h2>Pictures</h2>\n<section class=figures>{}</section>\n",
        figures.collect::<String>()
    ))
}

fn time_table(times: &[Summary]) -> String {
    let mut head = vec!["microseconds", "min", "mean"];
    head.extend(QUANTILES.iter().map(|(name, _)| *name));
    head.extend(["max", "samples"]);
    let row = |s: &Summary| {
        let mut cells = vec![esc(&s.name), or_na(s.min_us), or_na(s.mean_us)];
        cells.extend(s.quantiles.iter().map(|q| or_na(q.us)));
        cells.extend([or_na(s.max_us), num(s.count as f64)]);
        cells
    };
    let rows: Vec<Vec<String>> = times.iter().map(row).collect();
    let table = table(&head, &rows, &["", "n", "n", "n", "n", "n", "n", "n", "n", "n"]);
    let mut needs: Vec<String> = Vec::new();
    for q in times.iter().flat_map(|t| &t.quantiles) {
        let said = q.needs_s.map(|s| format!("{} needs a run of {}", q.name, duration(s)));
        needs.extend(said.filter(|said| !needs.contains(said)));
    }
    if needs.is_empty() {
        return table;
    }
    format!("{table}<p class=faint>n/a: {}.</p>\n", needs.join(", "))
}

fn times(title: &str, section: &LoopSection) -> String {
    format!("<h2>{title}</h2>\n{}", time_table(&section.times))
}

fn host(r: &Report) -> String {
    format!(
        "<h2>Host</h2>\n{}<p class=faint>A thread of normal priority that looks once a millisecond; the bridge sends every two. \
         {} snapshots and {} records seen, {} records missing, {} faults.</p>\n",
        time_table(&r.host.times),
        num(r.host.snapshots as f64),
        num(r.host.records as f64),
        r.host.records_missing,
        r.host.faults
    )
}

fn comparison(r: &Report) -> String {
    let Some(c) = &r.comparison else { return String::new() };
    let (title, heads) = match c.against {
        Against::Cyclictest => ("<h2>Beside cyclictest</h2>\n", ["ours", "theirs"]),
        Against::Unloaded => ("<h2>With and without the load</h2>\n", ["with", "without"]),
    };
    if let Some(why) = &c.absent {
        return format!("{title}<p>{}</p>\n", esc(why));
    }
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (i, round) in c.rounds.iter().enumerate() {
        let cells = (0..c.names.len()).flat_map(|k| [round.ours_us[k], round.others_us[k], round.ratio[k]].map(or_na));
        rows.push([(i + 1).to_string()].into_iter().chain(cells).collect());
    }
    let median = c
        .median_ratio
        .iter()
        .flat_map(|m| [String::new(), String::new(), format!("<b>{}</b>", or_na(*m))]);
    rows.push(["<b>median</b>".to_owned()].into_iter().chain(median).collect());
    let mut head = vec!["round".to_owned()];
    for name in c.names {
        head.extend([
            format!("{name}<br>{}", heads[0]),
            format!("{name}<br>{}", heads[1]),
            "ratio".to_owned(),
        ]);
    }
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let classes = vec!["n"; head.len()];
    let turns = num(c.turn_s);
    let how = match c.against {
        Against::Cyclictest => format!(
            "{}, alternating (turns of {turns} s): same core, priority and interval, microseconds, both read right after the sleep. The force \
             loop does all its work, cyclictest sleeps only.",
            esc(&c.tool)
        ),
        Against::Unloaded => format!("The same loops, alternating (turns of {turns} s), microseconds."),
    };
    format!(
        "{title}{}<p class=faint>{how} Values past 1 ms are left out of p99 and p99.9.</p>\n",
        table(&head, &rows, &classes)
    )
}

fn stiffness(r: &Report) -> String {
    let s = &r.stiffness;
    let rows: Vec<Vec<String>> = s
        .margins
        .iter()
        .map(|m| {
            vec![
                m.at.to_owned(),
                or_na(m.delay_us),
                or_na(m.k_max_n_per_m.map(|k| k / 1e3)),
            ]
        })
        .collect();
    format!(
        "<h2>What the delay costs the hand</h2>\n<div class=half>{}</div><p class=faint>{}. b = {} N s/m, a hand in the middle of what people have; \
         B = {} N s/m, damping of the force law. Stiffer walls than K_max may vibrate.</p>\n",
        table(&["at", "delay t_d, \u{b5}s", "K_max, N/mm"], &rows, &["", "n", "n"]),
        esc(s.rule),
        num(s.hand_damping_n_s_per_m),
        num(s.law_damping_n_s_per_m)
    )
}

fn counters(r: &Report) -> String {
    let (h, t) = (&r.haptic.counts, &r.tissue.counts);
    let row = |what: &str, a: String, b: String| vec![what.to_owned(), a, b];
    let signed = |what: &str, a: i64, b: i64| row(what, num(a as f64), num(b as f64));
    let plain = |what: &str, a: u64, b: u64| row(what, num(a as f64), num(b as f64));
    let rows = [
        plain("ticks", h.ticks, t.ticks),
        plain("missed deadlines", h.missed_deadlines, t.missed_deadlines),
        plain("overruns", h.overruns, t.overruns),
        plain("ticks not measured", h.unmeasured, t.unmeasured),
        plain("heap calls", h.heap_calls, t.heap_calls),
        signed("minor page faults", h.minor_faults, t.minor_faults),
        signed("major page faults", h.major_faults, t.major_faults),
        signed("voluntary context switches", h.voluntary_switches, t.voluntary_switches),
        signed(
            "... beyond one for each sleep",
            h.voluntary_switches_beyond_sleep,
            t.voluntary_switches_beyond_sleep,
        ),
        signed(
            "involuntary context switches",
            h.involuntary_switches,
            t.involuntary_switches,
        ),
    ];
    let cores: Vec<Vec<String>> = r
        .cores
        .iter()
        .map(|c| {
            let range = c.lowest_mhz.zip(c.highest_mhz);
            let mhz = range.map_or(or_na(None), |(low, high)| format!("{} to {}", num(low), num(high)));
            let served = c.interrupts.map(|n| n as f64);
            vec![c.core.to_string(), mhz, or_na(c.steal_s), or_na(served)]
        })
        .collect();
    format!(
        "<h2>Counters</h2>\n<div class=pair>{}{}</div>\n",
        table(
            &["from arming to the end", "force loop", "tissue loop"],
            &rows,
            &["", "n", "n"]
        ),
        table(
            &["core", "MHz", "steal time, s", "interrupts served"],
            &cores,
            &["", "n", "n", "n"]
        )
    )
}

fn late(r: &Report) -> String {
    let rows: Vec<Vec<String>> = r
        .latest_wake_ups
        .iter()
        .map(|l| {
            vec![
                format!("{:.3}", l.at_s),
                num(l.wake_us),
                num(l.work_us),
                esc(&l.cause.replace(" us", " \u{b5}s")),
            ]
        })
        .collect();
    format!(
        "<h2>Latest wake-ups</h2>\n{}",
        table(
            &["at, s", "wake-up, \u{b5}s", "work, \u{b5}s", "cause"],
            &rows,
            &["n", "n", "n", "wide"]
        )
    )
}

fn provenance(r: &Report) -> String {
    let settings: Vec<Vec<String>> = r
        .settings
        .iter()
        .map(|s| {
            let met = if s.met { "yes" } else { "<b>no</b>" };
            vec![esc(&s.name), esc(&s.asked), esc(&s.got), met.to_owned()]
        })
        .collect();
    let facts: Vec<Vec<String>> = r
        .facts
        .iter()
        .map(|f| vec![f.group.to_owned(), esc(&f.name), esc(&f.value)])
        .collect();
    let dependencies: Vec<Vec<String>> = r
        .dependencies
        .iter()
        .map(|d| vec![esc(&d.name), esc(&d.version), esc(&d.known_anomalies.join(" "))])
        .collect();
    format!(
        "<h2>Settings, asked and read back</h2>\n{}<h2>Machine</h2>\n{}\
         <details><summary>{} packages that rt-core is built from, with what we know to be wrong with them</summary>\n{}</details>\n",
        table(&["setting", "asked", "got", "met"], &settings, &["", "", "", ""]),
        table(&["", "what", "reported value"], &facts, &["", "", "wide"]),
        r.dependencies.len(),
        table(
            &["package", "version", "known anomalies"],
            &dependencies,
            &["", "", "wide"]
        )
    )
}

fn method(r: &Report) -> String {
    format!(
        "<h2>Method</h2>\n<p>The run's own force loop, tissue loop and bridge, with the simulated device and a script that inserts \
         and retracts the needle every 4 s. The first {} s are not recorded. Wake-up: clock read right after the sleep, less the due \
         time on the ideal grid. Missed deadline: a grid point that was skipped. Overrun: a tick that ended after the next was due. \
         A percentile needs ten samples beyond it. Values are known to 0.1 %. This report is evidence for whoever assesses the \
         machine; it claims no conformity with any standard.</p>\n<p class=faint>Command: <code>{}</code><br>Commit: <code>{}</code>, schema \
         {}</p>\n",
        num(r.protocol.warm_up_s),
        esc(&r.command.join(" ")),
        esc(r.commit),
        r.schema
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_groups() {
        assert_eq!(
            [0.0, 0.0734, 1.5, 14.26, 812.4].map(num),
            ["0", "0.073", "1.5", "14.3", "812"]
        );
        assert_eq!(num(4_862_000.0), "4\u{202f}862\u{202f}000");
        assert_eq!([100.0, 20.0].map(num), ["100", "20"]);
    }

    #[test]
    fn text_cannot_break_out_of_the_page() {
        assert_eq!(esc("<b>&\""), "&lt;b&gt;&amp;&quot;");
    }

    #[test]
    fn reasons_are_not_repeated_in_each_row() {
        assert_eq!(
            short("environment not qualified: virtual machine (KVM); 60000 samples"),
            "environment not qualified; 60000 samples"
        );
        assert_eq!(short("haptic 0; tissue 0"), "haptic 0; tissue 0");
    }
}

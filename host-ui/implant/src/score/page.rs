//! The debrief: one page that stands by itself, with the pictures in it.

use super::{Score, picture};
use std::fmt::Write as _;

const STYLE: &str = "\
:root{--ink:#1c2126;--soft:#5b6570;--line:#d9dee3;--card:#f5f7f9;--planned:#0072b2;--delivered:#d55e00}
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,'Segoe UI',Roboto,'Liberation Sans',sans-serif;color:var(--ink);background:#fff;margin:0}
main{max-width:1220px;margin:0 auto;padding:28px 24px 48px}
h1{font-size:26px;font-weight:650;margin:0 0 2px}
h2{font-size:18px;font-weight:650;margin:36px 0 10px}
p{margin:4px 0;color:var(--soft)}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(180px,1fr));gap:12px;margin:22px 0 0}
.card{background:var(--card);border-radius:8px;padding:12px 14px}
.card b{display:block;font-size:20px;font-weight:650;font-variant-numeric:tabular-nums;white-space:nowrap}
.card span{color:var(--soft);font-size:13px}
svg{width:100%;height:auto;display:block}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:5px 10px;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th{font-size:13px;font-weight:600;color:var(--soft);vertical-align:bottom}
td:first-child,th:first-child{text-align:left}
.scroll{overflow-x:auto}
.key{display:flex;gap:22px;flex-wrap:wrap;color:var(--soft);font-size:14px;margin:0 0 6px}
.key i{display:inline-block;width:12px;height:12px;border-radius:50%;vertical-align:-1px;margin-right:6px}
.key .line{width:22px;height:0;border-radius:0;border-top:2px solid var(--ink);vertical-align:4px}
.bad{color:#a33c00;font-weight:600}
footer{margin-top:40px;border-top:1px solid var(--line);padding-top:12px}
@media print{.card{border:1px solid var(--line)}h2{break-after:avoid}}
";

/// Seeds in the table at most; the others are in the JSON.
const ROWS: usize = 20;

/// As HTML.
pub fn page(score: &Score) -> Result<String, String> {
    let i = &score.implant;
    let title = escaped(&i.title);
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>Debrief: {title}</title>\n<style>{STYLE}</style></head><body><main>\n<h1>Debrief</h1>\n\
         <p>{title} · {} seeds {} · prescription {:.0} Gy</p>\n",
        i.pairs.len(),
        escaped(&i.source),
        i.prescription_gy
    );
    if !i.lost.is_empty() {
        let _ = writeln!(
            text,
            "<p class=\"bad\">{} of {} planned seeds were lost: the tip was outside the tissue when they were dropped.</p>",
            i.lost.len(),
            i.pairs.len() + i.lost.len()
        );
    }
    text += &cards(score);
    text += "<h2>Where the seeds are</h2>\n<div class=\"key\"><span><i style=\"border:2px solid var(--planned)\"></i>planned</span>\
             <span><i style=\"background:var(--delivered)\"></i>delivered</span>\
             <span><i class=\"line\"></i>target, cut through its middle</span>\
             <span><i class=\"line\" style=\"border-color:#cc79a7\"></i>to be spared</span></div>\n";
    text += &picture::views(score)?;
    text += "<h2>Dose</h2>\n<div class=\"key\"><span><i class=\"line\" style=\"border-top-style:dashed\"></i>planned</span>\
             <span><i class=\"line\"></i>delivered</span></div>\n";
    text += &picture::dvh(score)?;
    text += &measures(score);
    text += "<h2>Which seeds cost what</h2>\n<p>Each line: what the implant would gain if this one seed lay on plan and all others where \
             they are. Largest loss of D90 first.</p>\n";
    text += &seeds(score);
    text += "<h2>Force and speed</h2>\n";
    text += &picture::over_time(i.records)?;
    text += "<footer><p>Made by a simulator for research and training. Not a medical device: no treatment may rest on it.</p></footer>\n\
             </main></body></html>\n";
    Ok(text)
}

fn cards(score: &Score) -> String {
    let [mean, worst] = score.errors_m();
    let m = &score.implant.motion;
    let value = |name: &str, delivered: bool| {
        let verdict = if delivered { &score.delivered } else { &score.planned };
        let values = score.judge.values(verdict);
        values.into_iter().find(|(n, _)| n.contains(name)).and_then(|(_, v)| v)
    };
    let both = |name: &str, digits: usize, unit: &str| match (value(name, false), value(name, true)) {
        (Some(planned), Some(delivered)) => format!("{planned:.digits$} → {delivered:.digits$} {unit}"),
        _ => "not defined".to_owned(),
    };
    let card = |value: String, what: &str| format!("<div class=\"card\"><b>{value}</b><span>{what}</span></div>\n");
    let all = [
        card(
            format!("{:.1} mm", mean * 1e3),
            &format!("mean seed error, worst {:.1} mm", worst * 1e3),
        ),
        card(both(" D90 ", 0, "Gy"), "D90 of the target, planned → delivered"),
        card(both(" V100 ", 1, "%"), "V100 of the target, planned → delivered"),
        card(format!("{:.1} N", m.peak_force_n), "peak force on the hand"),
        card(
            format!("{:.0} mm/s", m.mean_insertion_m_per_s * 1e3),
            &format!("mean speed inwards, peak {:.0} mm/s", m.peak_insertion_m_per_s * 1e3),
        ),
        card(
            clock(m.duration_s),
            &format!("{} insertions, {} re-insertions", m.insertions, m.reinsertions),
        ),
    ];
    format!("<div class=\"cards\">\n{}</div>\n", all.concat())
}

fn clock(seconds: f64) -> String {
    format!("{}:{:04.1} min", (seconds / 60.0) as u64, seconds % 60.0)
}

/// Every measure of every structure, planned beside delivered.
fn measures(score: &Score) -> String {
    let mut text = "<div class=\"scroll\"><table><thead><tr><th>Measure</th><th>planned</th><th>delivered</th><th>change</th></tr>\
                    </thead><tbody>\n"
        .to_owned();
    let (planned, delivered) = (score.judge.values(&score.planned), score.judge.values(&score.delivered));
    for ((name, before), (_, after)) in planned.iter().zip(&delivered) {
        let number = |v: &Option<f64>| v.map_or_else(|| "not defined".to_owned(), |v| figure(v, name));
        let change = match (before, after) {
            (Some(b), Some(a)) => format!("{}{}", if a >= b { "+" } else { "−" }, figure((a - b).abs(), name)),
            _ => String::new(),
        };
        let _ = writeln!(
            text,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{change}</td></tr>",
            escaped(&named(name)),
            number(before),
            number(after)
        );
    }
    text + "</tbody></table></div>\n"
}

fn figure(value: f64, name: &str) -> String {
    if name.ends_with("[1]") {
        format!("{value:.3}")
    } else {
        format!("{value:.1}")
    }
}

/// Names carry their unit in brackets.
fn named(name: &str) -> String {
    let name = name.replace("[gy]", "(Gy)").replace("[percent]", "(%)");
    name.trim_end_matches(" [1]").to_owned()
}

fn seeds(score: &Score) -> String {
    let mut order: Vec<usize> = (0..score.costs.len()).collect();
    order.sort_by(|&a, &b| score.costs[b].target_d90_gy.total_cmp(&score.costs[a].target_d90_gy));
    let has_urethra = score.costs.first().is_some_and(|c| c.urethra_d10_gy.is_some());
    let urethra_head = if has_urethra {
        "<th>urethra D10<br>saved (Gy)</th><th>urethra D30<br>saved (Gy)</th>"
    } else {
        ""
    };
    let mut text = format!(
        "<div class=\"scroll\"><table><thead><tr><th>Seed</th><th>needle</th><th>hole</th><th>error<br>(mm)</th>\
         <th>along<br>(mm)</th><th>across<br>(mm)</th><th>D90 lost<br>(Gy)</th><th>V100 lost<br>(%)</th>{urethra_head}</tr></thead><tbody>\n"
    );
    for &n in order.iter().take(ROWS) {
        let (pair, cost) = (&score.implant.pairs[n], &score.costs[n]);
        let hole = pair.hole.map_or_else(|| "–".to_owned(), |h| h.to_string());
        let urethra = [cost.urethra_d10_gy, cost.urethra_d30_gy];
        let urethra: String = urethra.iter().flatten().map(|gy| format!("<td>{gy:.2}</td>")).collect();
        let _ = writeln!(
            text,
            "<tr><td>{}</td><td>{}</td><td>{hole}</td><td>{:.2}</td><td>{:+.2}</td><td>{:.2}</td><td{}>{:.2}</td><td>{:.3}</td>{urethra}</tr>",
            n + 1,
            pair.needle + 1,
            pair.error_m() * 1e3,
            pair.error_along_m() * 1e3,
            pair.error_across_m() * 1e3,
            if cost.target_d90_gy > 0.5 { " class=\"bad\"" } else { "" },
            cost.target_d90_gy,
            cost.target_v100_percent,
        );
    }
    text += "</tbody></table></div>\n";
    if order.len() > ROWS {
        let _ = writeln!(text, "<p>The other {} seeds are in score.json.</p>", order.len() - ROWS);
    }
    text
}

fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            c => safe.push(c),
        }
    }
    safe
}

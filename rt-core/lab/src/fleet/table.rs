//! The table of all reports as CSV (RFC 4180), one row each.

use super::entry::Entry;
use std::fmt::Write;

const HEAD: &str = "pc,made_at,verdict,protocol,measured_s,wake_p50_us,wake_p99_us,wake_p999_us,wake_p999_low_us,wake_p999_high_us,\
                    wake_max_us,missed_deadlines,failed_limits,operator,site,kernel,firmware,program,verified,report\r\n";

pub fn csv(entries: &[Entry]) -> String {
    let mut all = HEAD.to_owned();
    for e in entries {
        let report = &e.report;
        let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        let machine = |name: &str| e.machine.get(name).cloned().unwrap_or_default();
        let us = |name: &str| number(e.percentile(name).map(|p| p.us));
        let interval = e.percentile("p99.9").and_then(|p| p.interval_us);
        let cells = [
            e.pc.clone(),
            report.made_at.clone(),
            e.outcome().words().to_owned(),
            e.protocol.clone(),
            report.protocol.measured_s.to_string(),
            us("p50"),
            us("p99"),
            us("p99.9"),
            number(interval.map(|i| i[0])),
            number(interval.map(|i| i[1])),
            number(e.max_us()),
            report.haptic.counts.missed_deadlines.to_string(),
            e.failed().join(" "),
            report.whose.operator.clone().unwrap_or_default(),
            report.whose.site.clone().unwrap_or_default(),
            machine("Kernel: version"),
            machine("Processor: firmware"),
            machine("Program: version"),
            report.notes.join("; "),
            e.path.clone(),
        ];
        let row: Vec<String> = cells.iter().map(|cell| quoted(cell)).collect();
        let _ = write!(all, "{}\r\n", row.join(","));
    }
    all
}

/// Quotes a cell where needed.
fn quoted(cell: &str) -> String {
    let cell = stylet_text::cell(cell).into_owned();
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_survive_commas_quotes_and_spreadsheets() {
        assert_eq!(
            ["plain", "a, b", "the \"old\" one", "=1+1", "-5"].map(quoted),
            ["plain", "\"a, b\"", "\"the \"\"old\"\" one\"", "'=1+1", "-5"]
        );
        assert_eq!(HEAD.split(',').count(), 20);
    }
}

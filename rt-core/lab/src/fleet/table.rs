//! The table of all reports as CSV (RFC 4180), one row each.

use super::entry::Entry;
use std::fmt::Write;

const HEAD: &str = "pc,made_at,verdict,protocol,measured_s,wake_p50_us,wake_p99_us,wake_p999_us,wake_p999_low_us,wake_p999_high_us,\
                    wake_max_us,missed_deadlines,failed_limits,operator,site,kernel,firmware,program,report\r\n";

pub fn csv(entries: &[Entry]) -> String {
    let mut all = HEAD.to_owned();
    for e in entries {
        let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        let machine = |name: &str| e.machine.get(name).cloned().unwrap_or_default();
        let interval = e.p999.and_then(|p| p.interval_us);
        let cells = [
            e.pc.clone(),
            e.made_at.clone(),
            e.outcome.words().to_owned(),
            e.protocol.clone(),
            e.measured_s.to_string(),
            number(e.p50.map(|p| p.us)),
            number(e.p99.map(|p| p.us)),
            number(e.p999.map(|p| p.us)),
            number(interval.map(|i| i[0])),
            number(interval.map(|i| i[1])),
            number(e.max_us),
            e.missed.to_string(),
            e.failed.join(" "),
            e.operator.clone(),
            e.site.clone(),
            machine("Kernel: version"),
            machine("Processor: firmware"),
            machine("Program: version"),
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
        assert_eq!(HEAD.split(',').count(), 19);
    }
}

//! From SI to what a person reads; the only place of the window that converts units.

pub use stylet_text::{cell, printable, printable_line, printable_table};

/// The present time as 20260131T235959Z, for names of files.
pub fn utc_now() -> String {
    jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ").to_string()
}

/// A time as [`utc_now`] writes it, as a person here reads it; `None` for any other text.
pub fn local_time(utc: &str) -> Option<String> {
    time_in(utc, jiff::tz::TimeZone::system())
}

fn time_in(utc: &str, zone: jiff::tz::TimeZone) -> Option<String> {
    let civil = jiff::civil::DateTime::strptime("%Y%m%dT%H%M%SZ", utc).ok()?;
    let there = civil.to_zoned(jiff::tz::TimeZone::UTC).ok()?.with_time_zone(zone);
    Some(there.strftime("%-d %b %Y, %H:%M").to_string())
}

/// Millimetres from metres.
pub fn mm(metres: f64) -> f64 {
    metres * 1e3
}

/// Metres from millimetres that a person typed or dragged.
pub fn metres(mm: f64) -> f64 {
    mm * 1e-3
}

/// Microseconds from nanoseconds.
pub fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// Seconds from nanoseconds.
pub fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// Length with its unit, to 0.1 mm.
pub fn length(metres: f64) -> String {
    format!("{} mm", decimal(mm(metres), 1))
}

/// With its sign, to be read as an error.
pub fn signed_mm(metres: f64) -> String {
    signed(mm(metres), 2)
}

/// Speed with its unit, to 0.1 mm/s.
pub fn speed(metres_per_second: f64) -> String {
    format!("{} mm/s", decimal(mm(metres_per_second), 1))
}

/// Force with its unit, to 0.01 N.
pub fn force(newton: f64) -> String {
    format!("{} N", decimal(newton, 2))
}

/// Volume with its unit, to 0.1 cc.
pub fn volume(cubic_metres: f64) -> String {
    format!("{:.1} cc", cubic_metres * 1e6)
}

/// `n/a` where there is no value.
pub fn microseconds(value: Option<f64>) -> String {
    match value {
        None => "n/a".to_owned(),
        Some(us) if us >= 1000.0 => format!("{:.1} ms", us * 1e-3),
        Some(us) => format!("{us:.1} us"),
    }
}

/// Rate of a loop with its unit, from its period; `n/a` for a period of 0.
pub fn rate(period_ns: u64) -> String {
    match period_ns {
        0 => "n/a".to_owned(),
        ns => format!("{:.0} Hz", 1e9 / ns as f64),
    }
}

/// Counts with a thin grouping, so that a tick of eight digits can be read.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

/// Without "-0.0", which makes a figure at rest flicker.
pub fn decimal(value: f64, decimals: usize) -> String {
    let is_zero = value.abs() < 0.5 * 10.0_f64.powi(-(decimals as i32));
    format!("{:.decimals$}", if is_zero { 0.0 } else { value })
}

/// With its sign, unless it is zero as shown.
pub fn signed(value: f64, decimals: usize) -> String {
    let shown = decimal(value, decimals);
    let is_zero = shown.bytes().all(|b| matches!(b, b'0' | b'.'));
    if is_zero || value < 0.0 {
        shown
    } else {
        format!("+{shown}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_read_where_the_reader_is() {
        let east = jiff::tz::TimeZone::fixed(jiff::tz::offset(2));
        assert_eq!(
            time_in("20261101T230512Z", east.clone()).as_deref(),
            Some("2 Nov 2026, 01:05")
        );
        assert!(time_in(&utc_now(), east.clone()).is_some());
        for other in ["", "monday", "20261301T090000Z", "2026-11-01"] {
            assert_eq!(time_in(other, east.clone()), None, "{other}");
        }
    }

    #[test]
    fn figures_read_as_a_person_writes_them() {
        assert_eq!(length(0.0123), "12.3 mm");
        assert_eq!(length(-1e-9), "0.0 mm");
        assert_eq!(signed_mm(-0.00125), "-1.25");
        assert_eq!(signed_mm(0.00125), "+1.25");
        assert_eq!(
            (signed(-0.004, 2), signed(0.004, 2)),
            ("0.00".to_owned(), "0.00".to_owned())
        );
        assert_eq!(signed(-0.006, 2), "-0.01");
        assert_eq!(count(12_345_678), "12 345 678");
        assert_eq!(count(999), "999");
        assert_eq!(microseconds(None), "n/a");
        assert_eq!(rate(1_000_000), "1000 Hz");
    }
}

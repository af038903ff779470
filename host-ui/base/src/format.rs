//! Conversion from SI to display units, the only place of the window that converts units.

pub use stylet_text::{cell, printable, printable_line, printable_table};

/// Returns the present time as 20260131T235959Z, for file names.
pub fn utc_now() -> String {
    jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ").to_string()
}

/// Returns the present local time for display.
pub fn local_now() -> String {
    local_time(&utc_now()).unwrap_or_default()
}

/// Converts a time from [`utc_now`] to local time with its zone for display; `None` for any other
/// text.
pub fn local_time(utc: &str) -> Option<String> {
    time_in(utc, jiff::tz::TimeZone::system())
}

fn time_in(utc: &str, zone: jiff::tz::TimeZone) -> Option<String> {
    let civil = jiff::civil::DateTime::strptime("%Y%m%dT%H%M%SZ", utc).ok()?;
    let there = civil.to_zoned(jiff::tz::TimeZone::UTC).ok()?.with_time_zone(zone);
    Some(there.strftime("%-d %b %Y, %H:%M %Z").to_string())
}

/// Converts metres to millimetres.
pub fn mm(metres: f64) -> f64 {
    metres * 1e3
}

/// Converts millimetres that a person typed or dragged to metres.
pub fn metres(mm: f64) -> f64 {
    mm * 1e-3
}

/// Converts nanoseconds to microseconds.
pub fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// Converts nanoseconds to seconds.
pub fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// Formats a length with its unit, to 0.1 mm.
pub fn length(metres: f64) -> String {
    format!("{} mm", decimal(mm(metres), 1))
}

/// Formats a signed length, as an error.
pub fn signed_mm(metres: f64) -> String {
    signed(mm(metres), 2)
}

/// Formats a speed with its unit, to 0.1 mm/s.
pub fn speed(metres_per_second: f64) -> String {
    format!("{} mm/s", decimal(mm(metres_per_second), 1))
}

/// Formats a force with its unit, to 0.01 N.
pub fn force(newton: f64) -> String {
    format!("{} N", decimal(newton, 2))
}

/// Formats a volume with its unit, to 0.1 cc.
pub fn volume(cubic_metres: f64) -> String {
    format!("{:.1} cc", cubic_metres * 1e6)
}

/// Formats a time in microseconds; `n/a` without a value.
pub fn microseconds(value: Option<f64>) -> String {
    match value {
        None => "n/a".to_owned(),
        Some(us) if us >= 1000.0 => format!("{:.1} ms", us * 1e-3),
        Some(us) => format!("{us:.1} µs"),
    }
}

/// Formats the rate of a loop with its unit, from its period; `n/a` for a period of 0.
pub fn rate(period_ns: u64) -> String {
    match period_ns {
        0 => "n/a".to_owned(),
        ns => format!("{:.0} Hz", 1e9 / ns as f64),
    }
}

/// Formats an estimate of the time left.
pub fn time_left(seconds: f64) -> String {
    match (seconds / 60.0).round() as u64 {
        0 => "less than a minute left".to_owned(),
        minutes @ 1..60 => format!("about {minutes} min left"),
        minutes => format!("about {} h {} min left", minutes / 60, minutes % 60),
    }
}

/// Formats a count with thin spaces between groups, so that eight digits are legible.
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

/// Formats a number without "-0.0", which would make a figure at rest flicker.
pub fn decimal(value: f64, decimals: usize) -> String {
    let is_zero = value.abs() < 0.5 * 10.0_f64.powi(-(decimals as i32));
    format!("{:.decimals$}", if is_zero { 0.0 } else { value })
}

/// Formats a number with its sign, unless it is zero as shown.
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
    fn times_are_shown_in_local_time() {
        let east = jiff::tz::TimeZone::fixed(jiff::tz::offset(2));
        assert_eq!(
            time_in("20261101T230512Z", east.clone()).as_deref(),
            Some("2 Nov 2026, 01:05 +02")
        );
        assert!(time_in(&utc_now(), east.clone()).is_some());
        for other in ["", "monday", "20261301T090000Z", "2026-11-01"] {
            assert_eq!(time_in(other, east.clone()), None, "{other}");
        }
    }

    #[test]
    fn figures_are_formatted_for_people() {
        assert_eq!(length(0.0123), "12.3 mm");
        let left = [20.0, 45.0, 290.0, 3661.0].map(time_left);
        let expected = ["less than a minute", "about 1 min", "about 5 min", "about 1 h 1 min"];
        assert_eq!(left, expected.map(|time| format!("{time} left")));
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

//! Conversion from strength at one time to dose over an interval.

const SECONDS_PER_DAY: f64 = 86_400.0;

/// Interval over which dose is counted, from the reference time of the strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Begin after the implant, in s.
    pub from_s: f64,
    /// End after the implant, in s; infinite for the whole life of a permanent seed.
    pub to_s: f64,
}

impl Interval {
    /// Interval from the implant on, without an end.
    pub const ALL: Self = Self {
        from_s: 0.0,
        to_s: f64::INFINITY,
    };

    /// Creates an interval from one day after the implant to another.
    pub fn days(from: f64, to: f64) -> Self {
        Self {
            from_s: from * SECONDS_PER_DAY,
            to_s: to * SECONDS_PER_DAY,
        }
    }

    /// Returns the time at the reference rate that gives the same dose (s): the integral of the
    /// decay.
    pub fn equivalent_s(self, half_life_s: f64) -> f64 {
        let rate_per_s = std::f64::consts::LN_2 / half_life_s;
        let left = |t: f64| (-rate_per_s * t).exp();
        (left(self.from_s) - left(self.to_s)) / rate_per_s
    }
}

/// Returns the remaining share of the strength.
pub fn left_after(elapsed_s: f64, half_life_s: f64) -> f64 {
    (-elapsed_s / half_life_s).exp2()
}

/// Converts days to seconds.
pub fn days_to_s(days: f64) -> f64 {
    days * SECONDS_PER_DAY
}

/// Converts seconds to days.
pub fn s_to_days(s: f64) -> f64 {
    s / days_to_s(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_add_up_and_half_the_dose_comes_in_the_first_half_life() {
        let half_life_s = days_to_s(59.4);
        let all = Interval::ALL.equivalent_s(half_life_s);
        assert!((all / half_life_s - 1.0 / std::f64::consts::LN_2).abs() < 1e-12);
        let first = Interval::days(0.0, 59.4).equivalent_s(half_life_s);
        assert!((first / all - 0.5).abs() < 1e-12);
        let second = Interval::days(59.4, 118.8).equivalent_s(half_life_s);
        assert!((second / all - 0.25).abs() < 1e-12);
        assert!((left_after(2.0 * half_life_s, half_life_s) - 0.25).abs() < 1e-12);
    }
}

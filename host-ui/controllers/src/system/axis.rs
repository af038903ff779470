//! Conversion of one device axis from counts to a share of the maximum speed.

use evdev::AbsInfo;

/// Smallest dead zone, as a share of the range. Many drivers report none (`flat`), or one that a
/// worn stick exceeds.
const LEAST_DEAD: f64 = 0.08;
/// Largest dead zone; a larger one is a driver's mistake.
const MOST_DEAD: f64 = 0.5;
/// Full deflection of a 3D mouse in counts, for drivers that report relative axes, which have no
/// range.
const RELATIVE_FULL: f64 = 350.0;

/// Range and dead zone in counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    middle: f64,
    half: f64,
    /// Dead zone as a share of `half`.
    dead: f64,
}

impl Axis {
    /// Creates an absolute axis; `None` for an empty range.
    pub fn absolute(info: &AbsInfo) -> Option<Self> {
        let (low, high) = (f64::from(info.minimum()), f64::from(info.maximum()));
        let half = (high - low) / 2.0;
        (half > 0.0).then(|| Self {
            middle: (high + low) / 2.0,
            half,
            dead: (f64::from(info.flat()) / half).clamp(LEAST_DEAD, MOST_DEAD),
        })
    }

    /// Creates an axis without a range; full speed is at the largest counts that such a device
    /// reports.
    pub fn relative() -> Self {
        Self {
            middle: 0.0,
            half: RELATIVE_FULL,
            dead: LEAST_DEAD,
        }
    }

    /// Returns the counts in the middle of the range, the value of an axis at rest.
    pub fn at_rest(&self) -> i32 {
        self.middle.round() as i32
    }

    /// Returns the share of the speed, -1 to 1. It is 0 in the dead zone, then grows with the
    /// square of the deflection, so that small speeds are easy to hold.
    pub fn share(&self, counts: i32) -> f64 {
        let way = (f64::from(counts) - self.middle) / self.half;
        let beyond = ((way.abs() - self.dead) / (1.0 - self.dead)).clamp(0.0, 1.0);
        beyond * beyond * way.signum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(low: i32, high: i32, flat: i32) -> Axis {
        Axis::absolute(&AbsInfo::new(0, low, high, 0, flat, 0)).expect("a range")
    }

    #[test]
    fn dead_zone_is_that_of_the_device_and_begins_without_a_jump() {
        let stick = axis(-32768, 32767, 8192);
        for counts in [0, 8000, -8000] {
            assert_eq!(stick.share(counts), 0.0, "{counts}");
        }
        let just_outside = stick.share(8400);
        assert!(just_outside > 0.0 && just_outside < 1e-3, "{just_outside}");
        // A quarter is dead: half of the rest ends at 5/8 of the range, and gives a quarter of the
        // speed.
        assert!((stick.share(20480) - 0.25).abs() < 1e-3);
        assert!((stick.share(-20480) + 0.25).abs() < 1e-3);
    }

    #[test]
    fn the_share_is_odd_grows_and_ends_at_one_whatever_the_range() {
        for axis in [
            axis(0, 255, 0),
            axis(-350, 350, 0),
            axis(i32::MIN, i32::MAX, 4095),
            Axis::relative(),
        ] {
            let at = |way: f64| (axis.middle + way * axis.half) as i32;
            let mut last = -1.0;
            for step in -100..=100 {
                let share = axis.share(at(f64::from(step) / 100.0));
                assert!(share >= last && (-1.0..=1.0).contains(&share), "{step}: {share}");
                last = share;
            }
            assert!((axis.share(i32::MAX) - 1.0).abs() < 1e-9);
            assert!((axis.share(i32::MIN) + 1.0).abs() < 1e-9);
            assert_eq!(axis.share(axis.at_rest()), 0.0);
        }
    }

    #[test]
    fn a_bad_dead_zone_or_range_gives_a_usable_axis() {
        assert_eq!(axis(0, 255, 0).share(127 + 9), 0.0, "8 % of the way is dead");
        assert!(axis(0, 255, 0).share(127 + 14) > 0.0);
        assert_eq!(axis(0, 255, i32::MAX).share(255), 1.0);
        assert!(Axis::absolute(&AbsInfo::new(0, 0, 0, 0, 0, 0)).is_none());
        assert!(Axis::absolute(&AbsInfo::new(0, 5, -5, 0, 0, 0)).is_none());
    }
}

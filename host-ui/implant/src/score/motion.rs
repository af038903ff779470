//! Motion of the hand: time, speed, force, and number of reinsertions.

use nalgebra::Vector3;
use stylet_base::seen::{Seen, TickOrder};
use stylet_shm_schema::{TickRecord, flags};

/// Speed below which the needle rests.
const RESTS_M_PER_S: f64 = 2e-3;
/// Distance of withdrawal and of advance that counts as a reinsertion.
const AGAIN_M: f64 = 2e-3;

/// Summary of the motion of the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Time from the first record to the last.
    pub duration_s: f64,
    /// Time with the tip in tissue.
    pub in_tissue_s: f64,
    /// Mean speed of the tip while it moves inwards in tissue, along the needle.
    pub mean_insertion_m_per_s: f64,
    /// Largest speed inwards, m/s.
    pub peak_insertion_m_per_s: f64,
    /// Largest force on the hand, N.
    pub peak_force_n: f64,
    /// Largest deflection of the tip from a rigid needle, m.
    pub deflection_m: f64,
    /// Number of times that the tip entered tissue.
    pub insertions: usize,
    /// Number of times that it turned inwards again without leaving.
    pub reinsertions: usize,
    /// Share of the ticks of this time that were seen, on which every figure here is based.
    pub seen: Seen,
    /// True if the procedure had begun before the first record.
    pub is_from_middle: bool,
}

impl Motion {
    /// Computes the motion. `direction` is that of the needles, into the body.
    pub fn of(records: &[TickRecord], direction: [f64; 3]) -> Self {
        let mut meter = MotionMeter::default();
        let mut order = TickOrder::default();
        for record in records {
            meter.miss(order.missing_before(record.session_id, record.tick));
            meter.take(record, direction);
        }
        meter.motion()
    }
}

/// Accumulator of a motion, record by record.
#[derive(Clone, Debug, Default)]
pub struct MotionMeter {
    motion: Motion,
    /// Times of the first record and of the last.
    due_ns: Option<[u64; 2]>,
    inwards_s: f64,
    inwards_m: f64,
    turns: Option<Turns>,
}

impl MotionMeter {
    /// Counts ticks that ran unseen before the next record.
    pub fn miss(&mut self, ticks: u64) {
        self.motion.seen.unseen += ticks;
    }

    /// Takes a record. `direction` is that of the needle, into the body.
    pub fn take(&mut self, record: &TickRecord, direction: [f64; 3]) {
        let [first_ns, before_ns] = self.due_ns.unwrap_or([record.due_ns; 2]);
        self.due_ns = Some([first_ns, record.due_ns]);
        // A gap in the records does not count as time in tissue.
        let dt_s = seconds(record.due_ns.saturating_sub(before_ns)).min(0.01);
        let motion = &mut self.motion;
        motion.seen.seen += 1;
        motion.duration_s = seconds(record.due_ns.saturating_sub(first_ns));
        motion.peak_force_n = motion.peak_force_n.max(Vector3::from(record.force_on_hand_n).norm());
        motion.deflection_m = motion.deflection_m.max(Vector3::from(record.tip_deflection_m).norm());
        if record.flags & flags::IN_CONTACT == 0 {
            self.turns = None;
            return;
        }
        motion.in_tissue_s += dt_s;
        let along_m = Vector3::from(record.tip_in_scene_m).dot(&Vector3::from(direction));
        let turn = self.turns.get_or_insert_with(|| {
            motion.insertions += 1;
            Turns::at(along_m)
        });
        motion.reinsertions += usize::from(turn.goes_in_again(along_m));
        if record.speed_m_per_s > RESTS_M_PER_S {
            self.inwards_s += dt_s;
            self.inwards_m += record.speed_m_per_s * dt_s;
            motion.peak_insertion_m_per_s = motion.peak_insertion_m_per_s.max(record.speed_m_per_s);
        }
    }

    pub fn motion(&self) -> Motion {
        let mut motion = self.motion;
        if self.inwards_s > 0.0 {
            motion.mean_insertion_m_per_s = self.inwards_m / self.inwards_s;
        }
        motion
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Detector of turning points of the tip, with hysteresis.
#[derive(Clone, Debug)]
struct Turns {
    inwards: bool,
    /// Farthest place since the last turn.
    extreme_m: f64,
}

impl Turns {
    fn at(along_m: f64) -> Self {
        Self {
            inwards: true,
            extreme_m: along_m,
        }
    }

    /// Returns true in the tick that makes it a reinsertion.
    fn goes_in_again(&mut self, along_m: f64) -> bool {
        let beyond_m = if self.inwards {
            along_m - self.extreme_m
        } else {
            self.extreme_m - along_m
        };
        if beyond_m > 0.0 {
            self.extreme_m = along_m;
        } else if beyond_m <= -AGAIN_M {
            (self.inwards, self.extreme_m) = (!self.inwards, along_m);
            return self.inwards;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    /// Returns the tip at places along z, a millisecond apart, in tissue above 0.
    fn records(z_mm: impl Iterator<Item = f64>) -> Vec<TickRecord> {
        let mut before = None;
        let record = |(i, z): (usize, f64)| {
            let mut r = TickRecord::zeroed();
            r.due_ns = (i as u64 + 1) * 1_000_000;
            r.tip_in_scene_m[2] = z * 1e-3;
            r.flags = if z > 0.0 { flags::IN_CONTACT } else { 0 };
            r.speed_m_per_s = before.replace(z).map_or(0.0, |b: f64| z - b);
            r.force_on_hand_n = [0.0, 0.0, -z / 10.0];
            r
        };
        z_mm.enumerate().map(record).collect()
    }

    fn ramp(from: f64, to: f64, mm_per_ms: f64) -> impl Iterator<Item = f64> {
        let steps = ((to - from).abs() / mm_per_ms).round() as usize;
        (1..=steps).map(move |i| from + (to - from) * i as f64 / steps as f64)
    }

    #[test]
    fn one_insertion_has_no_reinsertion() {
        let way = ramp(-10.0, 50.0, 0.05)
            .chain(std::iter::repeat_n(50.0, 100))
            .chain(ramp(50.0, -10.0, 0.1));
        let motion = Motion::of(&records(way), [0.0, 0.0, 1.0]);
        assert!((motion.duration_s - 1.899).abs() < 1e-9, "{motion:?}");
        assert!((motion.in_tissue_s - 1.6).abs() < 0.003, "{motion:?}");
        assert!(
            (motion.mean_insertion_m_per_s - 0.05).abs() < 1e-9 && (motion.peak_insertion_m_per_s - 0.05).abs() < 1e-9
        );
        assert!((motion.peak_force_n - 5.0).abs() < 1e-9);
        assert_eq!((motion.insertions, motion.reinsertions), (1, 0));
    }

    #[test]
    fn going_in_again_counts_from_two_millimetres_and_a_tremor_does_not() {
        let way = ramp(-5.0, 30.0, 0.05)
            .chain(ramp(30.0, 25.0, 0.05))
            .chain(ramp(25.0, 40.0, 0.05));
        let tremor = (0..2000).map(|i| 40.0 + (f64::from(i) * 0.05).sin() * 0.9);
        let way = way
            .chain(tremor)
            .chain(ramp(40.0, -5.0, 0.05))
            .chain(ramp(-5.0, 10.0, 0.05));
        let motion = Motion::of(&records(way), [0.0, 0.0, 1.0]);
        assert_eq!((motion.insertions, motion.reinsertions), (2, 1));
        assert_eq!(Motion::of(&[], [0.0, 0.0, 1.0]), Motion::default());
    }
}

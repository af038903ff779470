//! Force on the hand: a slow insertion, and its force record.

use crate::{Core, ask, until};
use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::{default_plan, move_request};
use stylet_shm_schema::{HapticState, ParameterId, Request, TickRecord, flags};

/// A host that inserts slowly and keeps every record.
pub struct Insertion {
    pub link: Link,
    pub records: Vec<TickRecord>,
    entry_m: [f64; 3],
    direction: [f64; 3],
}

impl Insertion {
    /// Begins engaged, with the tip at the entry, on a needle line if the tissue has one, then moves at `speed_m_per_s`
    /// for at most 60 mm.
    pub fn begin(core: &mut Core, speed_m_per_s: f64) -> Self {
        let mut link = core.host();
        let plan = default_plan(&link.scene().expect("live").header);
        ask(&mut link, &Request::SetPlan(Some(plan.clone()))).expect("planned");
        ask(&mut link, &Request::Engage).expect("engaged");
        let to = move_request(plan.entry_m, plan.direction, 0.2, 2.0);
        ask(&mut link, &to).expect("moved");
        // The hand keeps moving only while its host polls.
        until(Duration::from_millis(800), || {
            link.poll();
            false
        });
        let is_ready = until(Duration::from_secs(120), || {
            link.poll();
            link.take_records();
            let has_line = |s: &HapticState| s.flags & (flags::LINE_NEEDED | flags::LINE_READY) != flags::LINE_NEEDED;
            link.state().is_some_and(has_line)
        });
        assert!(is_ready, "no line: {:?}", link.state());
        link.take_records();
        let (entry_m, direction) = (plan.entry_m, plan.direction);
        let mut insertion = Self {
            link,
            records: Vec::new(),
            entry_m,
            direction,
        };
        insertion.go(0.06, speed_m_per_s);
        insertion
    }

    /// Keeps the records of a hand that moves by itself.
    pub fn of(link: Link) -> Self {
        Self {
            link,
            records: Vec::new(),
            entry_m: [0.0; 3],
            direction: [0.0; 3],
        }
    }

    /// Moves to `depth_m` behind the entry.
    pub fn go(&mut self, depth_m: f64, speed_m_per_s: f64) {
        let to = std::array::from_fn(|a| self.entry_m[a] + self.direction[a] * depth_m);
        let to = move_request(to, self.direction, speed_m_per_s, 2.0);
        ask(&mut self.link, &to).expect("moved");
        self.take();
    }

    pub fn take(&mut self) {
        self.link.poll();
        self.records.append(&mut self.link.take_records());
    }

    /// Takes data for that time.
    pub fn watch(&mut self, time: Duration) {
        until(time, || {
            self.take();
            false
        });
    }

    /// Takes data until `ready`; false if that does not happen in time.
    pub fn watch_until(&mut self, limit: Duration, mut ready: impl FnMut(&mut Link) -> bool) -> bool {
        until(limit, || {
            self.take();
            ready(&mut self.link)
        })
    }

    /// Pushes until the membrane resists with 2 N.
    pub fn press(&mut self) {
        let pressed = until(Duration::from_secs(20), || {
            self.take();
            self.records.last().is_some_and(|r| force_n(r) > 2.0)
        });
        assert!(pressed, "no force: {:?}", self.link.state());
    }
}

pub fn force_n(record: &TickRecord) -> f64 {
    record.force_on_hand_n.iter().map(|f| f * f).sum::<f64>().sqrt()
}

pub fn missed(records: &[TickRecord]) -> u64 {
    records.iter().map(|r| u64::from(r.missed)).sum()
}

/// Checks that no tick is missing, and that consecutive forces stay within the slew limit.
pub fn assert_smooth(records: &[TickRecord]) {
    assert!(records.len() > 100, "{} records", records.len());
    let slew = stylet_shm_schema::PARAMETERS
        .iter()
        .find(|p| p.id == ParameterId::SlewLimit)
        .expect("in the table");
    let longest_n = slew.default * 1e-3 * (1.0 + 1e-9);
    for pair in records.windows(2) {
        assert_eq!(pair[1].tick, pair[0].tick + 1, "a tick is missing");
        let (a, b) = (pair[0].force_on_hand_n, pair[1].force_on_hand_n);
        let step_n = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        assert!(step_n <= longest_n, "{a:?} N to {b:?} N in tick {}", pair[1].tick);
    }
}

/// Checks that the force was always on without a fault.
pub fn assert_undisturbed(records: &[TickRecord]) {
    assert_smooth(records);
    let disturbed = records.iter().find(|r| r.fault != 0 || r.flags & flags::ENGAGED == 0);
    assert!(disturbed.is_none(), "disturbed: {disturbed:?}");
}

//! Force and speed of a whole procedure in bounded memory, and the motion of the hand.

use super::motion::{Motion, MotionMeter};
use stylet_base::envelope::{Band, Envelope};
use stylet_base::format;
use stylet_base::seen::TickOrder;
use stylet_shm_schema::{SceneId, TickRecord, flags};

/// Most records kept: ten per second for twenty minutes, fewer for a longer procedure.
const MOST: usize = 12_000;
/// Initial thinning: one tick kept of this number, at 1 kHz a hundred per second.
const FIRST_STRETCH: usize = 10;
/// Most places in a plot of the whole, and the initial duration of each.
const MOST_SLOTS: usize = 600;
const FIRST_SLOT_NS: u64 = 10_000_000;
/// Time outside after which the tip belongs to no procedure until it touches tissue again.
const OUTSIDE_NS: u64 = 2_000_000_000;

/// Force and speed of one procedure, in bounded memory.
#[derive(Clone, Debug)]
pub struct Trace {
    scene: Option<SceneId>,
    /// Tick with the largest force in each stretch.
    records: Vec<TickRecord>,
    stretch: usize,
    strongest: Option<TickRecord>,
    in_stretch: usize,
    /// Force, N, and speed, mm/s.
    curves: Envelope<2>,
    began_ns: Option<u64>,
    /// Time at which the tip touched tissue last.
    contact_ns: Option<u64>,
    meter: MotionMeter,
    order: TickOrder,
    /// True if the procedure had begun before the first record.
    pub(crate) is_from_middle: bool,
}

impl Default for Trace {
    fn default() -> Self {
        Self {
            scene: None,
            records: Vec::new(),
            stretch: FIRST_STRETCH,
            strongest: None,
            in_stretch: 0,
            curves: Envelope::new(FIRST_SLOT_NS),
            began_ns: None,
            contact_ns: None,
            meter: MotionMeter::default(),
            order: TickOrder::default(),
            is_from_middle: false,
        }
    }
}

impl Trace {
    /// Takes records. `direction` is that of the needle, into the body. Another scene starts a new
    /// trace.
    pub fn take(&mut self, records: &[TickRecord], scene: Option<SceneId>, direction: [f64; 3]) {
        if scene.is_some() && scene != self.scene {
            *self = Self {
                scene,
                order: self.order,
                ..Self::default()
            };
        }
        for record in records {
            let missing = self.order.missing_before(record.session_id, record.tick);
            if record.flags & flags::IN_CONTACT != 0 {
                self.contact_ns = Some(record.due_ns);
            }
            let Some(contact_ns) = self.contact_ns else { continue };
            if record.due_ns.saturating_sub(contact_ns) <= OUTSIDE_NS {
                if missing > 0 && self.began_ns.is_some() {
                    self.meter.miss(missing);
                    self.curves.gap();
                }
                self.meter.take(record, direction);
                self.keep(record);
                self.began_ns.get_or_insert(record.due_ns);
                let plotted = [square(record).sqrt(), format::mm(record.speed_m_per_s)];
                self.curves.add(record.due_ns, plotted.map(|v| v as f32));
            }
        }
        self.curves.widen_to(MOST_SLOTS);
    }

    fn keep(&mut self, record: &TickRecord) {
        if self.strongest.is_none_or(|kept| square(record) > square(&kept)) {
            self.strongest = Some(*record);
        }
        self.in_stretch += 1;
        if self.in_stretch < self.stretch {
            return;
        }
        self.in_stretch = 0;
        self.records.extend(self.strongest.take());
        if self.records.len() >= MOST {
            self.stretch *= 2;
            let stronger = |pair: &[TickRecord]| match pair {
                [a, b] if square(b) > square(a) => *b,
                _ => pair[0],
            };
            self.records = self.records.chunks(2).map(stronger).collect();
        }
    }

    /// Returns its start, `CLOCK_MONOTONIC` of the core.
    pub fn began_ns(&self) -> Option<u64> {
        self.began_ns
    }

    /// Returns the records that were kept, in their order.
    pub fn records(&self) -> &[TickRecord] {
        &self.records
    }

    /// Returns whether the tip has not touched tissue yet.
    pub fn is_empty(&self) -> bool {
        self.curves.is_empty()
    }

    /// Returns the minimum and maximum over seconds since the start, in pieces with gaps between
    /// them.
    pub fn force_n(&self) -> Vec<Vec<[f64; 3]>> {
        self.curve(0)
    }

    /// Returns the same of the speed.
    pub fn speed_mm_per_s(&self) -> Vec<Vec<[f64; 3]>> {
        self.curve(1)
    }

    fn curve(&self, quantity: usize) -> Vec<Vec<[f64; 3]>> {
        let began_ns = self.began_ns.unwrap_or(0);
        let seconds = |time_ns: u64| format::seconds(time_ns.saturating_sub(began_ns));
        let point = |b: &Band| [seconds(b.time_ns), f64::from(b.low), f64::from(b.high)];
        let pieces = self.curves.pieces(quantity);
        pieces.iter().map(|piece| piece.iter().map(point).collect()).collect()
    }

    /// Returns the motion of the hand so far.
    pub fn motion(&self) -> Motion {
        Motion {
            is_from_middle: self.is_from_middle,
            ..self.meter.motion()
        }
    }
}

fn square(record: &TickRecord) -> f64 {
    record.force_on_hand_n.iter().map(|f| f * f).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn scene(generation: u64) -> SceneId {
        SceneId {
            session_id: 1,
            generation,
        }
    }

    /// Returns records a millisecond apart; the force rises and falls once a second, with one tick
    /// of 9 N.
    fn records(ticks: std::ops::Range<u64>, in_contact: bool) -> Vec<TickRecord> {
        let record = |tick: u64| {
            let mut r = TickRecord::zeroed();
            (r.tick, r.due_ns) = (tick, (tick + 1) * 1_000_000);
            r.flags = if in_contact { flags::IN_CONTACT } else { 0 };
            r.force_on_hand_n[2] = (tick as f64 / 159.0).sin();
            if tick == 5_003 {
                r.force_on_hand_n[2] = -9.0;
            }
            r
        };
        ticks.map(record).collect()
    }

    #[test]
    fn an_hour_is_kept_in_bounded_memory_with_its_largest_force() {
        let mut trace = Trace::default();
        for minute in 0..60 {
            trace.take(
                &records(minute * 60_000..(minute + 1) * 60_000, true),
                Some(scene(1)),
                [0.0, 0.0, 1.0],
            );
        }
        assert!(
            (MOST / 2..MOST).contains(&trace.records().len()),
            "{}",
            trace.records().len()
        );
        let largest = trace.records().iter().map(square).fold(0.0, f64::max);
        assert_eq!((largest, trace.motion().peak_force_n), (81.0, 9.0));
        assert!(trace.records().is_sorted_by_key(|r| r.due_ns));
        let last_ns = trace.records().last().map(|r| r.due_ns);
        assert!(last_ns.is_some_and(|ns| ns > 3_599_000_000_000), "{last_ns:?}");
        assert!((trace.motion().in_tissue_s - 3_599.999).abs() < 1e-6);
        let curve = trace.force_n().concat();
        assert!((MOST_SLOTS / 2..=MOST_SLOTS).contains(&curve.len()), "{}", curve.len());
        assert!(curve.is_sorted_by_key(|[s, ..]| *s) && curve[0][0] < 5.2);
        assert!(curve.last().is_some_and(|[s, ..]| *s > 3_594.0));
        let [at_s, low, high] = *curve.iter().max_by(|a, b| a[2].total_cmp(&b[2])).expect("some");
        assert!(
            (at_s - 5.003).abs() <= 5.13 && low < 0.1 && high == 9.0,
            "{at_s} {low} {high}"
        );
    }

    #[test]
    fn ticks_far_from_tissue_are_not_part_of_the_procedure() {
        let mut trace = Trace::default();
        trace.take(&records(0..10_000, false), Some(scene(1)), [0.0, 0.0, 1.0]);
        assert!(trace.records().is_empty());
        trace.take(&records(10_000..11_000, true), Some(scene(1)), [0.0, 0.0, 1.0]);
        trace.take(&records(11_000..60_000, false), Some(scene(1)), [0.0, 0.0, 1.0]);
        assert!((trace.motion().duration_s - 2.999).abs() < 1e-9, "{:?}", trace.motion());
        assert_eq!(trace.records().len(), 300);
        assert!(trace.motion().seen.is_all(), "{:?}", trace.motion());
        trace.take(&records(60_000..60_010, true), Some(scene(2)), [0.0, 0.0, 1.0]);
        assert_eq!(trace.records().len(), 1, "another scene");
    }

    /// Guards against peaks and curves from the ticks that arrived, without a remark on how many
    /// those were.
    #[test]
    fn ticks_that_were_not_seen_cut_the_curves_and_are_counted() {
        let mut trace = Trace::default();
        for ticks in [0..2_000, 3_500..5_000] {
            trace.take(&records(ticks, true), Some(scene(1)), [0.0, 0.0, 1.0]);
        }
        assert_eq!(trace.motion().seen.words(), "3 500 of 5 000 ticks seen");
        let pieces = trace.force_n();
        assert_eq!(pieces.len(), 2);
        let [end, begin] = [pieces[0].last(), pieces[1].first()].map(|p| p.expect("points")[0]);
        assert!((end - 2.0).abs() < 0.05 && (begin - 3.5).abs() < 0.05, "{end} {begin}");
    }
}

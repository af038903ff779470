//! Minimum and maximum of quantities over time, in slots of equal width, for plots narrower than
//! their samples.

use std::collections::VecDeque;

/// Minimum and maximum of one quantity about a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Middle of the slot, ns.
    pub time_ns: u64,
    /// Smallest value in the slot.
    pub low: f32,
    /// Largest value in the slot.
    pub high: f32,
    /// True if the band continues the one before it, without a gap.
    pub joined: bool,
}

/// Minimum and maximum.
type Extremes = [f32; 2];

#[derive(Clone, Copy, Debug)]
struct Slot<const N: usize> {
    number: u64,
    extremes: [Extremes; N],
    joined: bool,
}

/// Envelope of `N` quantities that are sampled together. Slots are aligned to absolute time, so
/// that a scrolling line keeps its shape.
#[derive(Clone, Debug)]
pub struct Envelope<const N: usize> {
    slot_ns: u64,
    slots: VecDeque<Slot<N>>,
    newest_ns: Option<u64>,
    after_gap: bool,
}

impl<const N: usize> Envelope<N> {
    /// Creates an empty envelope with slots of this width.
    pub fn new(slot_ns: u64) -> Self {
        Self {
            slot_ns: slot_ns.max(1),
            slots: VecDeque::new(),
            newest_ns: None,
            after_gap: false,
        }
    }

    /// Marks a gap before the next sample.
    pub fn gap(&mut self) {
        self.after_gap = true;
    }

    /// Adds a sample. Times must rise; a sample with an older one counts to the newest slot.
    pub fn add(&mut self, time_ns: u64, values: [f32; N]) {
        self.newest_ns = self.newest_ns.max(Some(time_ns));
        let (number, extremes) = (time_ns / self.slot_ns, values.map(|v| [v, v]));
        match self.slots.back_mut() {
            Some(last) if number <= last.number => join(&mut last.extremes, extremes),
            last => {
                let follows = last.is_some_and(|last| number == last.number + 1);
                self.slots.push_back(Slot {
                    number,
                    extremes,
                    joined: follows && !self.after_gap,
                });
            }
        }
        self.after_gap = false;
    }

    /// Drops the slots that ended before that time.
    pub fn forget_before(&mut self, time_ns: u64) {
        let first = time_ns / self.slot_ns;
        while self.slots.front().is_some_and(|slot| slot.number < first) {
            self.slots.pop_front();
        }
    }

    /// Doubles the width of the slots until there are at most `most`.
    pub fn widen_to(&mut self, most: usize) {
        while self.slots.len() > most.max(1) {
            self.slot_ns = self.slot_ns.saturating_mul(2);
            let narrow = std::mem::take(&mut self.slots);
            for slot in narrow {
                let number = slot.number / 2;
                match self.slots.back_mut() {
                    Some(last) if number == last.number => join(&mut last.extremes, slot.extremes),
                    _ => self.slots.push_back(Slot { number, ..slot }),
                }
            }
        }
    }

    /// Returns whether nothing was added, or all of it was dropped.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Returns the time of the newest sample, ns.
    pub fn newest_ns(&self) -> Option<u64> {
        self.newest_ns
    }

    /// Returns the bands of one quantity, one for each slot, at its middle.
    pub fn bands(&self, quantity: usize) -> impl Iterator<Item = Band> {
        let newest_ns = self.newest_ns.unwrap_or(0);
        self.slots.iter().map(move |slot| {
            let [low, high] = slot.extremes[quantity];
            let middle_ns = slot
                .number
                .saturating_mul(self.slot_ns)
                .saturating_add(self.slot_ns / 2);
            Band {
                time_ns: middle_ns.min(newest_ns),
                low,
                high,
                joined: slot.joined,
            }
        })
    }

    /// Returns the bands of one quantity, cut at gaps.
    pub fn pieces(&self, quantity: usize) -> Vec<Vec<Band>> {
        let mut pieces: Vec<Vec<Band>> = Vec::new();
        for band in self.bands(quantity) {
            match pieces.last_mut() {
                Some(piece) if band.joined => piece.push(band),
                _ => pieces.push(vec![band]),
            }
        }
        pieces
    }
}

fn join<const N: usize>(slot: &mut [Extremes; N], extremes: [Extremes; N]) {
    for ([low, high], [other_low, other_high]) in slot.iter_mut().zip(extremes) {
        *low = low.min(other_low);
        *high = high.max(other_high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Returns two quantities at 1 kHz that never repeat.
    fn sample(tick: u64) -> (u64, [f32; 2]) {
        let angle = tick as f64 * 0.37;
        let values = [angle.sin(), (angle * 1.7).cos() * angle];
        (tick * MS + 500, values.map(|v| v as f32))
    }

    /// Compares with the extremes of each slot among all samples, before and after widening.
    #[test]
    fn each_slot_keeps_its_extremes() {
        let mut envelope = Envelope::new(40 * MS);
        (0..10_000).map(sample).for_each(|(t, v)| envelope.add(t, v));
        for (slot_ns, most) in [(40 * MS, 250), (80 * MS, 249), (640 * MS, 16)] {
            envelope.widen_to(most);
            for quantity in [0, 1] {
                let bands: Vec<Band> = envelope.bands(quantity).collect();
                assert_eq!(bands.len() as u64, (10_000 * MS).div_ceil(slot_ns));
                for (band, slot) in bands.iter().zip(0..) {
                    let inside = (0..10_000).map(sample).filter(|(t, _)| t / slot_ns == slot);
                    let all: Vec<f32> = inside.map(|(_, v)| v[quantity]).collect();
                    assert_eq!(band.low, all.iter().copied().fold(f32::MAX, f32::min));
                    assert_eq!(band.high, all.iter().copied().fold(f32::MIN, f32::max));
                    let middle_ns = slot * slot_ns + slot_ns / 2;
                    assert_eq!(
                        band.time_ns,
                        middle_ns.min(sample(9_999).0),
                        "slot {slot} of {slot_ns} ns"
                    );
                }
            }
        }
    }

    #[test]
    fn forgotten_slots_are_removed() {
        let mut envelope = Envelope::new(40 * MS);
        (0..1_000).map(sample).for_each(|(t, v)| envelope.add(t, v));
        envelope.forget_before(400 * MS);
        assert_eq!(envelope.bands(0).next().map(|b| b.time_ns / (40 * MS)), Some(10));
        envelope.add(3, [9.0, 9.0]);
        assert_eq!(
            envelope.bands(0).last().map(|b| b.high),
            Some(9.0),
            "counted to the newest slot"
        );
        assert_eq!(envelope.newest_ns(), Some(sample(999).0));
        envelope.forget_before(u64::MAX);
        assert!(envelope.is_empty());
    }

    /// Guards against a line from the last sample before a loss to the first after it: a ramp that
    /// was never measured.
    #[test]
    fn gaps_cut_the_curve() {
        let mut envelope = Envelope::new(40 * MS);
        let add = |envelope: &mut Envelope<2>, ticks: std::ops::Range<u64>| {
            ticks.map(sample).for_each(|(t, v)| envelope.add(t, v));
        };
        let lengths = |e: &Envelope<2>| e.pieces(0).iter().map(Vec::len).collect::<Vec<_>>();
        add(&mut envelope, 0..400);
        // Time without a sample.
        add(&mut envelope, 480..800);
        // A loss of some ticks between two slots that both have samples, and one inside a slot.
        envelope.gap();
        add(&mut envelope, 810..820);
        envelope.gap();
        add(&mut envelope, 830..1_200);
        assert_eq!(lengths(&envelope), [10, 8, 10]);
        envelope.widen_to(15);
        assert_eq!(lengths(&envelope), [5, 4, 5]);
    }
}

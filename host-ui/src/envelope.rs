//! Smallest and largest of quantities over time, in slots of one width: what a plot that is narrower than its samples can show.

use std::collections::VecDeque;

/// When, and how much.
type Sample = (u64, f32);

#[derive(Clone, Copy, Debug)]
struct Extremes {
    low: Sample,
    high: Sample,
}

impl Extremes {
    fn of(sample: Sample) -> Self {
        Self {
            low: sample,
            high: sample,
        }
    }

    fn join(&mut self, other: Self) {
        if other.low.1 < self.low.1 {
            self.low = other.low;
        }
        if other.high.1 > self.high.1 {
            self.high = other.high;
        }
    }

    /// In the order of time; one where they are the same.
    fn samples(self) -> impl Iterator<Item = Sample> {
        let [first, second] = if self.low.0 <= self.high.0 {
            [self.low, self.high]
        } else {
            [self.high, self.low]
        };
        std::iter::once(first).chain((first != second).then_some(second))
    }
}

/// Of `N` quantities that are sampled together. The slots lie on the grid of time itself, so that a line that moves on keeps its shape.
#[derive(Clone, Debug)]
pub struct Envelope<const N: usize> {
    slot_ns: u64,
    slots: VecDeque<(u64, [Extremes; N])>,
    newest_ns: Option<u64>,
}

impl<const N: usize> Envelope<N> {
    pub fn new(slot_ns: u64) -> Self {
        Self {
            slot_ns: slot_ns.max(1),
            slots: VecDeque::new(),
            newest_ns: None,
        }
    }

    /// Times are to rise; one that does not is counted to the newest slot.
    pub fn add(&mut self, time_ns: u64, values: [f32; N]) {
        self.newest_ns = self.newest_ns.max(Some(time_ns));
        let (number, extremes) = (time_ns / self.slot_ns, values.map(|v| Extremes::of((time_ns, v))));
        match self.slots.back_mut() {
            Some((last, slot)) if number <= *last => join(slot, extremes),
            _ => self.slots.push_back((number, extremes)),
        }
    }

    /// What ended before that time goes.
    pub fn forget_before(&mut self, time_ns: u64) {
        let first = time_ns / self.slot_ns;
        while self.slots.front().is_some_and(|(number, _)| *number < first) {
            self.slots.pop_front();
        }
    }

    /// With slots twice as wide, again and again, until there are at most `most`.
    pub fn widen_to(&mut self, most: usize) {
        while self.slots.len() > most.max(1) {
            self.slot_ns = self.slot_ns.saturating_mul(2);
            let narrow = std::mem::take(&mut self.slots);
            for (number, extremes) in narrow {
                match self.slots.back_mut() {
                    Some((last, slot)) if number / 2 == *last => join(slot, extremes),
                    _ => self.slots.push_back((number / 2, extremes)),
                }
            }
        }
    }

    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    pub fn newest_ns(&self) -> Option<u64> {
        self.newest_ns
    }

    /// Of one quantity, at most two of a slot, in the order of time.
    pub fn samples(&self, quantity: usize) -> impl Iterator<Item = Sample> {
        self.slots.iter().flat_map(move |(_, slot)| slot[quantity].samples())
    }
}

fn join<const N: usize>(slot: &mut [Extremes; N], extremes: [Extremes; N]) {
    slot.iter_mut().zip(extremes).for_each(|(kept, new)| kept.join(new));
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Two quantities at 1 kHz that never repeat.
    fn sample(tick: u64) -> (u64, [f32; 2]) {
        let angle = tick as f64 * 0.37;
        (
            tick * MS + 500,
            [angle.sin(), (angle * 1.7).cos() * angle].map(|v| v as f32),
        )
    }

    /// Against the extremes of each slot among all samples, before and after it was widened.
    #[test]
    fn each_slot_keeps_its_extremes_and_when_they_were() {
        let mut envelope = Envelope::new(40 * MS);
        (0..10_000).map(sample).for_each(|(t, v)| envelope.add(t, v));
        for (slot_ns, most) in [(40 * MS, 250), (80 * MS, 249), (640 * MS, 16)] {
            envelope.widen_to(most);
            for quantity in [0, 1] {
                let mut told = envelope.samples(quantity).peekable();
                for slot in 0..(10_000 * MS).div_ceil(slot_ns) {
                    let inside = (0..10_000).map(sample).filter(|(t, _)| t / slot_ns == slot);
                    let all: Vec<Sample> = inside.map(|(t, v)| (t, v[quantity])).collect();
                    let by_value = |a: &&Sample, b: &&Sample| a.1.total_cmp(&b.1);
                    let mut ends =
                        [all.iter().min_by(by_value), all.iter().max_by(by_value)].map(|s| *s.expect("some"));
                    ends.sort_by_key(|s| s.0);
                    assert_eq!(
                        [told.next(), told.next()],
                        ends.map(Some),
                        "slot {slot} of {slot_ns} ns"
                    );
                }
                assert_eq!(told.peek(), None);
            }
        }
    }

    #[test]
    fn what_is_forgotten_is_gone_and_time_that_goes_back_does_no_harm() {
        let mut envelope = Envelope::new(40 * MS);
        (0..1_000).map(sample).for_each(|(t, v)| envelope.add(t, v));
        envelope.forget_before(400 * MS);
        assert_eq!(envelope.samples(0).next().map(|s| s.0 / (40 * MS)), Some(10));
        envelope.add(3, [9.0, 9.0]);
        assert!(envelope.samples(0).any(|s| s == (3, 9.0)), "counted to the newest slot");
        assert_eq!(envelope.newest_ns(), Some(sample(999).0));
        envelope.forget_before(u64::MAX);
        assert!(envelope.is_empty());
    }

    #[test]
    fn one_value_is_one_sample() {
        let mut envelope = Envelope::new(MS);
        envelope.add(5, [1.0]);
        envelope.add(6, [1.0]);
        assert_eq!(envelope.samples(0).collect::<Vec<_>>(), [(5, 1.0)]);
    }
}

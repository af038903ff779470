//! The flight recorder: the last ticks of a loop, with everything needed for a bit-identical repetition.
//!
//! A loop writes to its own tape without locks, heap calls or system calls. A tape holds the inputs and outputs of each
//! tick, the orders, and periodic checkpoints of all state between ticks. On request the loop hands the whole tape to
//! the control thread through a ring, continues without one, and records again when it returns.

/// Shortest length of a haptic recording, in ticks.
pub const FLIGHT_TICKS: usize = 4000;

/// The last values of a series numbered from 0, in memory that is touched before use.
pub struct Last<T> {
    slots: Vec<T>,
    next: u64,
}

impl<T> Last<T> {
    /// Uses these slots.
    pub fn of_slots(slots: Vec<T>) -> Self {
        Self { slots, next: 0 }
    }

    /// Returns the slot of the next value, to be written in place.
    pub fn advance(&mut self) -> Option<&mut T> {
        let at = self.place(self.next);
        self.next += 1;
        self.slots.get_mut(at)
    }

    /// Allocates room for `capacity` values, at least one.
    pub fn new(blank: &T, capacity: usize) -> Self
    where
        T: Clone,
    {
        Self::of_slots(vec![blank.clone(); capacity.max(1)])
    }

    /// Adds `value`, dropping the oldest if there is no room.
    pub fn push(&mut self, value: T) {
        // Every index has a slot, but a loop must not be able to panic.
        if let Some(slot) = self.advance() {
            *slot = value;
        }
    }

    /// Removes all values; the next number is 0.
    pub fn clear(&mut self) {
        self.next = 0;
    }

    /// Number of the next value.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Number of the oldest value still held.
    pub fn first(&self) -> u64 {
        self.next.saturating_sub(self.slots.len() as u64)
    }

    /// Returns the value of that number while it is held.
    pub fn get(&self, number: u64) -> Option<&T> {
        let held = (self.first()..self.next).contains(&number);
        held.then(|| self.slots.get(self.place(number))).flatten()
    }

    fn place(&self, number: u64) -> usize {
        (number % self.slots.len().max(1) as u64) as usize
    }

    /// The newest value.
    pub fn newest(&self) -> Option<&T> {
        self.get(self.next.checked_sub(1)?)
    }

    /// Returns the values from `number` on, oldest first.
    pub fn since(&self, number: u64) -> impl Iterator<Item = &T> {
        (number.max(self.first())..self.next).filter_map(|n| self.get(n))
    }
}

impl<T: Clone> Last<(u64, T)> {
    /// Returns the first tick from which every value is held; each value is paired with its tick number.
    pub fn complete_from(&self) -> u64 {
        if self.first() == 0 {
            return 0;
        }
        // The values of the oldest tick held may be incomplete.
        self.get(self.first()).map_or(0, |(tick, _)| tick + 1)
    }

    /// Returns the values of tick `first` and later, with their ticks counted from it.
    pub fn counted_from(&self, first: u64) -> Vec<(u64, T)> {
        let values = self.since(0).filter(|(tick, _)| *tick >= first);
        values.map(|(tick, value)| (tick - first, value.clone())).collect()
    }
}

/// A tape that a loop and the control thread exchange.
pub trait Tape {
    /// Clears the tape without allocating.
    fn clear(&mut self);
    /// True if the tape was made for this scene of a run; only the tissue's depends on it.
    fn is_for(&self, _scene_generation: u64) -> bool {
        true
    }
}

/// The loop's end: its current tape, and the two rings on which tapes travel.
pub struct Recorder<T> {
    tape: Option<Box<T>>,
    out: rtrb::Producer<Box<T>>,
    back: rtrb::Consumer<Box<T>>,
}

/// The control thread's end.
pub struct TapePort<T> {
    /// Tapes handed over by the loop.
    pub taken: rtrb::Consumer<Box<T>>,
    /// Tapes on their way back to the loop.
    pub back: rtrb::Producer<Box<T>>,
}

/// Most tapes on their way at once.
const UNDER_WAY: usize = 8;

/// Returns both ends of one loop's recorder, with its first tape; without one the loop is not recorded.
pub fn recorder<T>(tape: Option<Box<T>>) -> (Recorder<T>, TapePort<T>) {
    let (out, taken) = rtrb::RingBuffer::new(UNDER_WAY);
    let (give_back, back) = rtrb::RingBuffer::new(UNDER_WAY);
    (Recorder { tape, out, back }, TapePort { taken, back: give_back })
}

impl<T: Tape> Recorder<T> {
    /// Returns the tape for the next tick. A returned tape is cleared and begins with a whole tick; a tape of an
    /// earlier scene, returned before the control thread knew of the new one, is sent back.
    pub fn begin_tick(&mut self, scene_generation: u64) -> Option<&mut T> {
        if let Ok(mut tape) = self.back.pop() {
            if self.tape.is_none() && tape.is_for(scene_generation) {
                tape.clear();
                self.tape = Some(tape);
            } else {
                self.send(tape);
            }
        }
        self.tape()
    }

    /// Returns the tape of the current tick.
    pub fn tape(&mut self) -> Option<&mut T> {
        self.tape.as_deref_mut()
    }

    /// Takes the tape out, to write to it from elsewhere; put it back in the same tick.
    pub fn take(&mut self) -> Option<Box<T>> {
        self.tape.take()
    }

    /// Puts the tape back.
    pub fn put(&mut self, tape: Box<T>) {
        self.tape = Some(tape);
    }

    /// Sends the tape to the control thread.
    pub fn hand_over(&mut self) {
        if let Some(tape) = self.tape.take() {
            self.send(tape);
        }
    }

    /// Replaces the tape for a new scene.
    pub fn replace(&mut self, tape: Box<T>) {
        self.hand_over();
        self.tape = Some(tape);
    }

    fn send(&mut self, tape: Box<T>) {
        // The ring has room for every tape on its way; if not, leak it rather than free it here.
        if let Err(rtrb::PushError::Full(tape)) = self.out.push(tape) {
            std::mem::forget(tape);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_values_are_kept_under_their_numbers() {
        let mut last = Last::new(&0, 4);
        for value in 10..17 {
            last.push(value);
        }
        assert_eq!((last.first(), last.next()), (3, 7));
        assert_eq!(
            (last.get(2), last.get(3), last.get(6), last.get(7)),
            (None, Some(&13), Some(&16), None)
        );
        assert_eq!(last.since(5).copied().collect::<Vec<_>>(), [15, 16]);
        last.clear();
        assert_eq!(last.since(0).count(), 0);
    }

    struct Blank(u64, bool);
    impl Tape for Blank {
        fn clear(&mut self) {
            self.1 = false;
        }
        fn is_for(&self, scene_generation: u64) -> bool {
            self.0 == scene_generation
        }
    }

    #[test]
    fn a_tape_comes_back_blank_and_one_of_an_earlier_scene_not_at_all() {
        let (mut recorder, mut port) = recorder(Some(Box::new(Blank(1, true))));
        recorder.hand_over();
        assert!(recorder.begin_tick(1).is_none());
        let tape = port.taken.pop().unwrap();
        assert!(tape.1, "what it holds travels with it");
        port.back.push(tape).ok().unwrap();
        assert!(!recorder.begin_tick(1).unwrap().1);

        recorder.hand_over();
        recorder.replace(Box::new(Blank(2, false)));
        port.back.push(port.taken.pop().unwrap()).ok().unwrap();
        assert_eq!(recorder.begin_tick(2).unwrap().0, 2);
        // It used to stay in the ring while the loop had another: 7 MB for each change of scene that the control thread
        // learned of late.
        assert_eq!(port.taken.pop().expect("out again at once").0, 1);
        recorder.hand_over();
        assert!(recorder.begin_tick(2).is_none());
        assert!(port.taken.pop().is_ok(), "the second went out");
    }
}

//! The flight recorder: the last ticks of a loop with everything that a bit-identical repetition needs.
//!
//! A loop writes to a tape that it owns: no lock, no heap call, no system call. A tape holds the inputs and outputs of
//! each tick, the orders taken, and now and then a checkpoint of all that one tick leaves to the next. When asked, the
//! loop hands the whole tape to the control thread through a ring, continues without one, and records again when it returns.

/// Ticks of the haptic loop that a recording reaches back, at least.
pub const FLIGHT_TICKS: usize = 4000;

/// The last values of a series numbered from 0, in memory that is written to once before it is used.
pub struct Last<T> {
    slots: Vec<T>,
    next: u64,
}

impl<T> Last<T> {
    /// Into these slots.
    pub fn of_slots(slots: Vec<T>) -> Self {
        Self { slots, next: 0 }
    }

    /// The slot of the next value, to be written in place.
    pub fn advance(&mut self) -> Option<&mut T> {
        let at = self.place(self.next);
        self.next += 1;
        self.slots.get_mut(at)
    }

    /// Room for `capacity` values, at least one.
    pub fn new(blank: &T, capacity: usize) -> Self
    where
        T: Clone,
    {
        Self::of_slots(vec![blank.clone(); capacity.max(1)])
    }

    /// Keeps `value`; the oldest one is dropped when there is no room.
    pub fn push(&mut self, value: T) {
        // There is a slot at every place; a loop has no room for a panic all the same.
        if let Some(slot) = self.advance() {
            *slot = value;
        }
    }

    /// Forgets every value; the next number is 0.
    pub fn clear(&mut self) {
        self.next = 0;
    }

    /// The number that the next value will have.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// The number of the oldest value still held.
    pub fn first(&self) -> u64 {
        self.next.saturating_sub(self.slots.len() as u64)
    }

    /// The value of that number, while it is held.
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

    /// Those held from `number` on, oldest first.
    pub fn since(&self, number: u64) -> impl Iterator<Item = &T> {
        (number.max(self.first())..self.next).filter_map(|n| self.get(n))
    }
}

/// The first tick from which on every order is held; each stands beside the number of its tick.
pub fn complete_from<T>(orders: &Last<(u64, T)>) -> u64 {
    if orders.first() == 0 {
        return 0;
    }
    // The orders of the oldest tick held may be incomplete.
    orders.get(orders.first()).map_or(0, |(tick, _)| tick + 1)
}

/// A tape that a loop and the control thread pass to each other.
pub trait Tape {
    /// Forgets what it holds. Allocates nothing.
    fn clear(&mut self);
    /// Whether it was made for this scene of a run.
    fn is_for(&self, scene_generation: u64) -> bool;
}

/// The loop's end: the tape while the loop has it, and the two rings on which it travels.
pub struct Recorder<T> {
    tape: Option<Box<T>>,
    out: rtrb::Producer<Box<T>>,
    back: rtrb::Consumer<Box<T>>,
}

/// The control thread's end.
pub struct TapePort<T> {
    /// Tapes that the loop has handed over.
    pub taken: rtrb::Consumer<Box<T>>,
    /// Tapes that go back to the loop.
    pub back: rtrb::Producer<Box<T>>,
}

/// Tapes that can be under way at once.
const UNDER_WAY: usize = 8;

/// Both ends of one loop's recorder, with its first tape; without one the loop is not recorded.
pub fn recorder<T>(tape: Option<Box<T>>) -> (Recorder<T>, TapePort<T>) {
    let (out, taken) = rtrb::RingBuffer::new(UNDER_WAY);
    let (give_back, back) = rtrb::RingBuffer::new(UNDER_WAY);
    (Recorder { tape, out, back }, TapePort { taken, back: give_back })
}

impl<T: Tape> Recorder<T> {
    /// The tape for the tick that begins now. A returned tape is cleared and begins with a whole tick; one of an earlier
    /// scene is sent to the control thread again, which returned it before it knew of the present one.
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

    /// The tape of the tick that runs.
    pub fn tape(&mut self) -> Option<&mut T> {
        self.tape.as_deref_mut()
    }

    /// Takes the tape out, to be written to from elsewhere; to be put back in the same tick.
    pub fn take(&mut self) -> Option<Box<T>> {
        self.tape.take()
    }

    /// Puts back what was taken.
    pub fn put(&mut self, tape: Box<T>) {
        self.tape = Some(tape);
    }

    /// Sends the tape to the control thread.
    pub fn hand_over(&mut self) {
        if let Some(tape) = self.tape.take() {
            self.send(tape);
        }
    }

    /// The tape of a new scene.
    pub fn replace(&mut self, tape: Box<T>) {
        self.hand_over();
        self.tape = Some(tape);
    }

    fn send(&mut self, tape: Box<T>) {
        // The ring has room for every tape that can be under way; else leak it rather than free it here.
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
        // It used to stay in the ring as long as the loop had another: 7 MB for each change of the scene that the control thread knew late.
        assert_eq!(port.taken.pop().expect("out again at once").0, 1);
        recorder.hand_over();
        assert!(recorder.begin_tick(2).is_none());
        assert!(port.taken.pop().is_ok(), "the second went out");
    }
}

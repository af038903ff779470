//! Capacities of the rings between the loops and the control thread.

/// Slots in each ring, all at least one.
#[derive(Clone, Copy, Debug)]
pub struct Capacities {
    /// Records of the force loop.
    pub records: usize,
    /// Orders to each loop.
    pub orders: usize,
    /// Notices from each loop.
    pub notices: usize,
    /// Scenes that the tissue loop has replaced.
    pub old_worlds: usize,
}

impl Capacities {
    /// For a run: the control thread may lag by four seconds of records.
    pub const RUN: Self = Self {
        records: 4096,
        orders: 256,
        notices: 1024,
        old_worlds: 8,
    };
    /// For loops stepped on one thread: the stepper empties the rings after each tick.
    pub const STEPPED: Self = Self {
        records: 16,
        orders: 16,
        notices: 64,
        old_worlds: 1,
    };
}

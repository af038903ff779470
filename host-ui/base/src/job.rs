//! Work on a thread of its own that sends its results as it goes and can be ended.

use crate::interrupt::Interrupt;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// Work that runs on its own thread. Dropping it requests its end.
pub struct Job<T> {
    results: Receiver<T>,
    interrupt: Interrupt,
}

/// What a job has sent since it was last polled.
pub enum Update<T> {
    /// Nothing yet.
    Pending,
    /// The next result.
    Value(T),
    /// Its thread has ended.
    Ended,
}

impl<T: Send + 'static> Job<T> {
    /// Starts `work`, which sends its results and looks now and then whether it is to end.
    pub fn begin(name: &str, work: impl FnOnce(&Sender<T>, &Interrupt) + Send + 'static) -> Self {
        let (sender, results) = channel();
        let interrupt = Interrupt::default();
        let end = interrupt.clone();
        let spawned = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || work(&sender, &end));
        // Without a thread the sender is dropped, and `poll` reports the end.
        drop(spawned);
        Self { results, interrupt }
    }

    /// The next result without waiting for it.
    pub fn poll(&self) -> Update<T> {
        match self.results.try_recv() {
            Ok(value) => Update::Value(value),
            Err(TryRecvError::Empty) => Update::Pending,
            Err(TryRecvError::Disconnected) => Update::Ended,
        }
    }
}

/// Nobody receives its results any more.
impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.interrupt.request();
    }
}

//! Work on a thread of its own that reports what it finds as it goes and can be asked to end.

use crate::interrupt::Interrupt;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// Work on a thread of its own. Dropping it asks the thread to end.
pub struct Job<T> {
    messages: Receiver<T>,
    interrupt: Interrupt,
}

/// What a job reports when it is polled.
pub enum JobUpdate<T> {
    /// Nothing new; its thread is still at work.
    Pending,
    /// The next message, in the order in which they were sent.
    Message(T),
    /// Its thread has ended.
    Ended,
}

impl<T: Send + 'static> Job<T> {
    /// Starts `work` on a thread of this name; it sends its messages and watches the interrupt.
    pub fn begin(name: &str, work: impl FnOnce(&Sender<T>, &Interrupt) + Send + 'static) -> Self {
        let (sender, messages) = channel();
        let interrupt = Interrupt::default();
        let asked = interrupt.clone();
        let spawned = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || work(&sender, &asked));
        // Without a thread the sender is dropped, and `poll` reports the end.
        drop(spawned);
        Self { messages, interrupt }
    }

    /// The next message, if there is one. Never waits.
    pub fn poll(&self) -> JobUpdate<T> {
        match self.messages.try_recv() {
            Ok(message) => JobUpdate::Message(message),
            Err(TryRecvError::Empty) => JobUpdate::Pending,
            Err(TryRecvError::Disconnected) => JobUpdate::Ended,
        }
    }
}

/// Nobody reads its messages any more.
impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.interrupt.ask();
    }
}

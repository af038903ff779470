//! Work on a separate thread that reports its results as they arrive and can be cancelled. A web page has one thread
//! and does such work at once.

use crate::interrupt::Interrupt;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// Job on a separate thread. Dropping it asks the thread to end.
pub struct Job<T> {
    messages: Receiver<T>,
    interrupt: Interrupt,
}

/// Report of a job when it is polled.
pub enum JobUpdate<T> {
    /// Nothing new; its thread is still at work.
    Pending,
    /// Next message, in the order of sending.
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
        // Without a thread the sender is dropped, and `poll` reports the end.
        let _spawned = spawn(name, move || work(&sender, &asked));
        Self { messages, interrupt }
    }

    /// Creates a job whose messages come from elsewhere: from the event loop of a web page.
    #[cfg(target_family = "wasm")]
    pub fn elsewhere() -> (Sender<T>, Self) {
        let (sender, messages) = channel();
        let interrupt = Interrupt::default();
        (sender, Self { messages, interrupt })
    }

    /// Returns the next message, if there is one. Never waits.
    pub fn poll(&self) -> JobUpdate<T> {
        match self.messages.try_recv() {
            Ok(message) => JobUpdate::Message(message),
            Err(TryRecvError::Empty) => JobUpdate::Pending,
            Err(TryRecvError::Disconnected) => JobUpdate::Ended,
        }
    }
}

/// Runs `work` on a thread of this name; in a web page, before this returns.
///
/// # Errors
///
/// If no thread can be started.
pub fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    if cfg!(target_family = "wasm") {
        work();
        return Ok(());
    }
    let thread = std::thread::Builder::new().name(name.to_owned());
    thread.spawn(work).map(drop)
}

/// Asks the thread to end, because its messages are no longer read.
impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.interrupt.ask();
    }
}

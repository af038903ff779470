//! Work on a thread of its own that tells what it finds as it goes and can be asked to end.

use crate::interrupt::Interrupt;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

pub struct Job<T> {
    told: Receiver<T>,
    interrupt: Interrupt,
}

/// What a job has to say in this frame.
pub enum News<T> {
    None,
    Told(T),
    /// Its thread has ended.
    Ended,
}

impl<T: Send + 'static> Job<T> {
    pub fn begin(name: &str, work: impl FnOnce(&Sender<T>, &Interrupt) + Send + 'static) -> Self {
        let (sender, told) = channel();
        let interrupt = Interrupt::default();
        let asked = interrupt.clone();
        let spawned = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || work(&sender, &asked));
        // When no thread can be had the sender is gone and `poll` says so.
        drop(spawned);
        Self { told, interrupt }
    }

    pub fn poll(&self) -> News<T> {
        match self.told.try_recv() {
            Ok(news) => News::Told(news),
            Err(TryRecvError::Empty) => News::None,
            Err(TryRecvError::Disconnected) => News::Ended,
        }
    }
}

/// Nobody hears it any more.
impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.interrupt.ask();
    }
}

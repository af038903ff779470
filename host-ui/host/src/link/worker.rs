//! A function that is called again and again: by a thread, or in a web page, which has one thread, whenever the host
//! takes what it received.

#[cfg(target_family = "wasm")]
pub use in_turn::Worker;
#[cfg(not(target_family = "wasm"))]
pub use threaded::Worker;

#[cfg(not(target_family = "wasm"))]
mod threaded {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread::JoinHandle;
    use std::time::Duration;

    /// Thread that calls the function; dropping it ends the thread.
    pub struct Worker {
        end: Arc<AtomicBool>,
        thread: Option<JoinHandle<()>>,
    }

    impl Worker {
        /// Starts a thread that makes the function, and waits after each call for the returned time.
        pub fn start<P: FnMut() -> Duration>(
            name: &str,
            make: impl FnOnce() -> P + Send + 'static,
        ) -> std::io::Result<Self> {
            let end = Arc::new(AtomicBool::new(false));
            let ended = Arc::clone(&end);
            let work = move || {
                let mut pass = make();
                // SYNC: set when the host drops its side; nothing but the flag is carried.
                while !ended.load(Ordering::Relaxed) {
                    std::thread::park_timeout(pass());
                }
            };
            let thread = std::thread::Builder::new().name(name.to_owned()).spawn(work)?;
            Ok(Self {
                end,
                thread: Some(thread),
            })
        }

        /// Ends the present wait.
        pub fn wake(&self) {
            if let Some(thread) = &self.thread {
                thread.thread().unpark();
            }
        }

        /// The thread takes its turns by itself.
        pub fn turn(&self) {}
    }

    impl Drop for Worker {
        fn drop(&mut self) {
            // SYNC: read by the thread; nothing but the flag is carried.
            self.end.store(true, Ordering::Relaxed);
            if let Some(thread) = self.thread.take() {
                thread.thread().unpark();
                // A panic there was reported when it happened.
                let _ended = thread.join();
            }
        }
    }
}

#[cfg(target_family = "wasm")]
mod in_turn {
    use std::cell::RefCell;
    use std::time::Duration;

    /// The function, which does all that is due when it is called.
    pub struct Worker(RefCell<Box<dyn FnMut() -> Duration>>);

    impl Worker {
        pub fn start<P: FnMut() -> Duration + 'static>(
            _name: &str,
            make: impl FnOnce() -> P + 'static,
        ) -> std::io::Result<Self> {
            Ok(Self(RefCell::new(Box::new(make()))))
        }

        /// What is queued is sent at the next turn.
        pub fn wake(&self) {}

        /// Calls the function.
        pub fn turn(&self) {
            let mut pass = self.0.borrow_mut();
            pass();
        }
    }
}

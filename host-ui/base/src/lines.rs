//! Lines printed from a loop that must not wait: a thread writes them, and lines beyond the queue
//! are dropped.

use std::io::Write;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;
use web_time::{Duration, Instant};

/// Number of lines in the queue.
const WAITING: usize = 256;
/// Time for the last lines at the end of a program.
const LAST_LINES: Duration = Duration::from_millis(200);
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Queue of lines.
pub struct Lines {
    lines: Option<SyncSender<String>>,
    thread: Option<JoinHandle<()>>,
}

impl Lines {
    /// Creates a queue to standard output. Without a thread nothing is written.
    pub fn to_stdout() -> Self {
        Self::to(std::io::stdout())
    }

    /// To standard error.
    pub fn to_stderr() -> Self {
        Self::to(std::io::stderr())
    }

    fn to(mut out: impl Write + Send + 'static) -> Self {
        let (lines, waiting) = sync_channel::<String>(WAITING);
        let write = move || {
            for line in waiting {
                // A closed terminal must not end the program.
                let _written = writeln!(out, "{line}").and_then(|()| out.flush());
            }
        };
        let thread = std::thread::Builder::new().name("lines".to_owned()).spawn(write).ok();
        Self {
            lines: thread.is_some().then_some(lines),
            thread,
        }
    }

    /// Queues a line without waiting; returns false if it was dropped.
    pub fn say(&self, line: String) -> bool {
        let sent = |lines: &SyncSender<String>| lines.try_send(line).is_ok();
        self.lines.as_ref().is_some_and(sent)
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.lines = None;
        let begun = Instant::now();
        // An output that is blocked is abandoned.
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) && begun.elapsed() < LAST_LINES {
            std::thread::sleep(LOOK_EVERY);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex, mpsc};

    /// Output that accepts data only once it is released.
    struct Pipe {
        full: Option<mpsc::Receiver<()>>,
        taken: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Pipe {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if let Some(full) = self.full.take() {
                let _ = full.recv();
            }
            self.taken.lock().expect("held briefly").extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_come_in_order_and_the_last_is_written_before_the_end() {
        let taken = Arc::new(Mutex::new(Vec::new()));
        let full = None;
        let lines = Lines::to(Pipe {
            full,
            taken: Arc::clone(&taken),
        });
        assert!((1..=3).all(|n| lines.say(format!("line {n}"))));
        drop(lines);
        assert_eq!(*taken.lock().expect("held briefly"), b"line 1\nline 2\nline 3\n");
    }

    /// Guards against a full pipe: the loop that printed stood still, and the hand moved 47 mm.
    #[test]
    fn a_blocked_output_delays_nothing() {
        let (release, full) = mpsc::channel();
        let full = Some(full);
        let lines = Lines::to(Pipe {
            full,
            taken: Arc::default(),
        });
        let said = (0..10 * WAITING).filter(|n| lines.say(n.to_string())).count();
        assert!((WAITING..=WAITING + 1).contains(&said), "{said}");
        drop(lines);
        drop(release);
    }
}

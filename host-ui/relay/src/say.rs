//! Writes terminal lines on a separate thread: a full or closed output must not delay a stop of the hand.

use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

/// Most lines queued; more are dropped and counted.
const WAITING: usize = 256;
/// Longest wait for the last lines of an ending program.
const PATIENCE: Duration = Duration::from_millis(100);

enum Line {
    Out(String),
    Error(String),
    /// Answered once all lines before it are written.
    Flush(SyncSender<()>),
}

static WRITER: OnceLock<SyncSender<Line>> = OnceLock::new();
// SYNC: a figure on its own; no other data is published by it.
static DROPPED: AtomicU64 = AtomicU64::new(0);

/// Queues a line for the standard output. Never blocks and never panics.
pub fn say(line: impl Into<String>) {
    give(Line::Out(line.into()));
}

/// Queues a line for the standard error.
pub fn complain(line: impl Into<String>) {
    give(Line::Error(line.into()));
}

/// Waits until all lines are written, at most [`PATIENCE`].
pub fn flush() {
    let (done, written) = sync_channel(1);
    give(Line::Flush(done));
    let _ = written.recv_timeout(PATIENCE);
}

/// Ends the process when one of its threads panics: the hand stops when the process ends, but might move on for a
/// process that lacks a thread.
pub fn end_on_panic() {
    std::panic::set_hook(Box::new(|why| {
        complain(format!("relay: {why}"));
        flush();
        // SAFETY: nothing runs in this process after it.
        unsafe { libc::_exit(101) }
    }));
}

fn give(line: Line) {
    if writer().try_send(line).is_err() {
        DROPPED.fetch_add(1, Ordering::Relaxed);
    }
}

fn writer() -> &'static SyncSender<Line> {
    WRITER.get_or_init(|| {
        let (to_writer, lines) = sync_channel(WAITING);
        // Without the thread every line is dropped.
        let _ = std::thread::Builder::new()
            .name("say".to_owned())
            .spawn(move || write(&lines));
        to_writer
    })
}

/// Writes lines; failures are ignored, as there is no output to report them to.
fn write(lines: &Receiver<Line>) {
    for line in lines {
        let dropped = DROPPED.swap(0, Ordering::Relaxed);
        if dropped > 0 {
            let _ = writeln!(
                std::io::stdout(),
                "{dropped} lines were not written: the output was full"
            );
        }
        let _ = match line {
            Line::Out(line) => writeln!(std::io::stdout(), "{line}"),
            Line::Error(line) => writeln!(std::io::stderr(), "{line}"),
            Line::Flush(done) => done.send(()).map_err(std::io::Error::other),
        };
    }
}

//! Lines for the terminal, written by a thread of their own: an output that is full or closed holds up nobody who stops the hand.

use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

/// Lines that may wait; more are dropped and counted.
const WAITING: usize = 256;
/// The last lines of a program that ends are waited for no longer.
const PATIENCE: Duration = Duration::from_millis(100);

enum Line {
    Out(String),
    Error(String),
    /// All lines before it are written.
    Flush(SyncSender<()>),
}

static WRITER: OnceLock<SyncSender<Line>> = OnceLock::new();
// SYNC: a figure on its own; no other data is published by it.
static DROPPED: AtomicU64 = AtomicU64::new(0);

/// Writes a line to the standard output, soon. Never waits and never panics.
pub fn say(line: impl Into<String>) {
    give(Line::Out(line.into()));
}

/// The same to the standard error.
pub fn complain(line: impl Into<String>) {
    give(Line::Error(line.into()));
}

/// Waits until all lines are written, but no longer than [`PATIENCE`].
pub fn flush() {
    let (done, written) = sync_channel(1);
    give(Line::Flush(done));
    let _ = written.recv_timeout(PATIENCE);
}

/// Ends the process where one of its threads panics: the hand stops for a process that ends, and may go on for one without a thread.
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

/// What cannot be written is lost: there is nobody to tell.
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

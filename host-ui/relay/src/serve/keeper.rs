//! The process that starts the server and outlives it: it stops the hand if the server is killed or hangs while a
//! remote member operates, and restarts a killed server.

use super::lease::SILENCE;
use super::tape::{self, Tape};
use crate::say::say;
use crate::{RelayError, now_ns};
use std::ffi::OsString;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node, ServiceError};
use stylet_shm_schema::Instance;
use stylet_shm_schema::Request;

/// Exit code of a server that has reported itself why it cannot serve.
pub const CANNOT: u8 = 1;
const BEAT_EVERY: Duration = Duration::from_millis(50);
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Shortest run of a server that is restarted without a pause.
const SHORT: Duration = Duration::from_secs(1);
const PAUSE: Duration = Duration::from_millis(100);
/// Longest wait for a server that was asked to end.
const END_PATIENCE: Duration = Duration::from_secs(4);
/// Longest wait for a server that does not take the data it requested.
const WRITE_PATIENCE: Duration = Duration::from_millis(100);

/// The server's side: reports twenty times a second that it runs, and whether a remote member operates.
pub struct Beat {
    to_keeper: Option<UnixStream>,
    sent: Instant,
    operated: bool,
}

impl Beat {
    /// Connects over the standard input, which the keeper made.
    pub fn of_stdin() -> Self {
        let stream = std::io::stdin().as_fd().try_clone_to_owned().map(UnixStream::from);
        let stream = stream.and_then(|stream| stream.set_nonblocking(true).map(|()| stream));
        Self {
            to_keeper: stream.ok(),
            sent: Instant::now(),
            operated: false,
        }
    }

    /// Returns the keeper's socket, for requests to it.
    pub(super) fn keeper(&self) -> Option<UnixStream> {
        self.to_keeper.as_ref().and_then(|stream| stream.try_clone().ok())
    }

    /// Reports on each pass of the server.
    pub fn pass(&mut self, operated: bool) {
        if operated != self.operated || self.sent.elapsed() >= BEAT_EVERY {
            (self.operated, self.sent) = (operated, Instant::now());
            if let Some(stream) = &mut self.to_keeper {
                // If the keeper is killed, the kernel stops this process.
                let _ = stream.write(&[u8::from(operated)]);
            }
        }
    }
}

/// Runs this program with `arguments` and `--kept`, restarting it until `stop`.
pub fn keep(instance: &Instance, arguments: &[OsString], stop: &AtomicBool) -> Result<(), RelayError> {
    let failed = RelayError::Server;
    let mut tape = Tape::new(instance);
    loop {
        let begun = Instant::now();
        let (mut mine, theirs) = UnixStream::pair().map_err(failed)?;
        mine.set_read_timeout(Some(LOOK_EVERY)).map_err(failed)?;
        mine.set_write_timeout(Some(WRITE_PATIENCE)).map_err(failed)?;
        let mut child = start(arguments, theirs).map_err(failed)?;
        watch(instance, &mut mine, &mut tape, &child, stop);
        let status = child.wait().map_err(failed)?;
        // SYNC: set by a signal; nothing but the flag is carried.
        match (stop.load(Ordering::Relaxed), status.code()) {
            (true, _) | (_, Some(0)) => return Ok(()),
            (_, Some(code)) if code == i32::from(CANNOT) => {
                return Err(RelayError::ServerEnded);
            }
            _ => {
                say(format!("the server ended with {status}; it is started again"));
                if begun.elapsed() < SHORT {
                    std::thread::sleep(PAUSE);
                }
            }
        }
    }
}

fn start(arguments: &[OsString], theirs: UnixStream) -> std::io::Result<Child> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .args(arguments)
        .arg("--kept")
        .stdin(Stdio::from(OwnedFd::from(theirs)));
    // SAFETY: between fork and exec it only makes a system call.
    unsafe { command.pre_exec(end_with_keeper) };
    command.spawn()
}

/// Ends a server without its keeper; it stops the hand as it ends.
fn end_with_keeper() -> std::io::Result<()> {
    // SAFETY: a system call with plain arguments.
    match unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}

/// Watches until the server has ended.
fn watch(instance: &Instance, from_server: &mut UnixStream, tape: &mut Tape, child: &Child, stop: &AtomicBool) {
    let (mut operated, mut is_stopped, mut heard, mut asked) = (false, false, Instant::now(), None);
    let mut beats = [0; 64];
    loop {
        match from_server.read(&mut beats) {
            Ok(0) => break,
            Ok(count) => {
                let (said, asked) = (|byte: &&u8| **byte != tape::ASK, beats[..count].contains(&tape::ASK));
                operated = beats[..count].iter().rfind(said).map_or(operated, |byte| *byte == 1);
                (is_stopped, heard) = (false, Instant::now());
                if asked {
                    tape.send(from_server);
                }
            }
            Err(e)
                if matches!(
                    e.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(_) => break,
        }
        tape.pass();
        if operated && !is_stopped && heard.elapsed() >= SILENCE {
            is_stopped = true;
            stop_hand(instance, "the relay stands still");
        }
        // SYNC: as above.
        if stop.load(Ordering::Relaxed) {
            let signal = match *asked.get_or_insert_with(Instant::now) {
                since if since.elapsed() >= END_PATIENCE => libc::SIGKILL,
                _ => libc::SIGTERM,
            };
            // SAFETY: a signal to a child that was not waited for yet.
            unsafe { libc::kill(child.id() as libc::pid_t, signal) };
        }
    }
    // A server that ends on request stops the hand itself.
    let is_orderly = asked.is_some_and(|since| since.elapsed() < END_PATIENCE);
    if operated && !is_stopped && !is_orderly {
        stop_hand(instance, "the relay was killed");
    }
}

fn stop_hand(instance: &Instance, why: &str) {
    let send = || -> Result<(), ServiceError> {
        let node = Node::join(instance)?;
        let port = service::stops::publisher(&node)?;
        port.connect();
        if let Ok(command) = Request::StopHand.encode(now_ns(), 1) {
            let _ = port.send(command);
        }
        // The core connects to a new port within one of its passes, and takes its messages.
        std::thread::sleep(Duration::from_millis(30));
        Ok(())
    };
    say(match send() {
        Ok(()) => format!("the hand is stopped: {why}"),
        Err(failed) => format!("the hand could not be stopped ({why}): {failed}"),
    });
}

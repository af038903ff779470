//! The session with the server. zenoh reconnects by itself; if that fails, a new session replaces it.

use super::{Member, Options, Queues};
use crate::RelayError;
use crate::keys::Identity;
use crate::net::{self, Place, Session};
use crate::say::say;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Silence of the server after which a new session is opened. zenoh tries five times a second, but does not reopen a
/// transport that is closed while opening (zenoh 1.10: a session that has not noted its endpoints yet).
const DEAF: Duration = Duration::from_secs(2);

type Opening = Receiver<Result<Session, RelayError>>;

/// Connection of a member.
pub(super) struct Connection {
    server: String,
    identity: Identity,
    since: Instant,
    opening: Option<Opening>,
}

impl Connection {
    pub fn new(options: &Options) -> Self {
        Self {
            server: options.server.clone(),
            identity: options.identity.clone(),
            since: Instant::now(),
            opening: None,
        }
    }

    /// Opens a session on a separate thread: zenoh waits without limit for a server that does not answer.
    fn open(&self) -> Opening {
        let (server, identity) = (self.server.clone(), self.identity.clone());
        let (to_here, opened) = sync_channel(1);
        std::thread::spawn(move || to_here.send(net::join(&server, &identity)));
        opened
    }

    /// Opens the first session; `None` if `stop` came before a server answered.
    pub fn first(&mut self, stop: &AtomicBool) -> Result<Option<Session>, RelayError> {
        let opening = self.open();
        // SYNC: set by a signal; nothing but the flag is carried.
        while !stop.load(Ordering::Relaxed) {
            match opening.recv_timeout(LOOK_EVERY) {
                Ok(session) => {
                    self.since = Instant::now();
                    return session.map(Some);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(RelayError::ConnectionEnded);
                }
            }
        }
        Ok(None)
    }

    /// Opens a new session if the server is silent; it replaces the old one unless that was heard meanwhile.
    pub fn pass(&mut self, member: &Arc<Member>, queues: &Arc<Queues>) -> Result<(), RelayError> {
        match self.opening.as_ref().map(Receiver::try_recv) {
            None if self.since.elapsed() >= DEAF && !member.is_answered(DEAF) => self.opening = Some(self.open()),
            None | Some(Err(TryRecvError::Empty)) => {}
            Some(Err(TryRecvError::Disconnected)) => self.again(),
            Some(Ok(opened)) => {
                self.again();
                match opened {
                    // The old session was heard meanwhile.
                    Ok(session) if member.has_server() => close_aside(session),
                    Ok(session) => {
                        listen(&session, member, queues)?;
                        say("connected anew: the session before brought nothing");
                        close_aside(member.session.replace(session));
                    }
                    Err(why) => say(format!("not connected anew, which is tried again: {why}")),
                }
            }
        }
        Ok(())
    }

    fn again(&mut self) {
        (self.opening, self.since) = (None, Instant::now());
    }
}

/// Closes a session on a separate thread, since it may take two seconds.
fn close_aside(session: Session) {
    std::thread::spawn(move || net::close(session));
}

/// Queues the server's messages to this member.
pub(super) fn listen(session: &Session, member: &Arc<Member>, queues: &Arc<Queues>) -> Result<(), RelayError> {
    let (queues, place) = (Arc::clone(queues), Place::To(member.seat));
    let member = Arc::clone(member);
    net::hear(session, &place.key(), move |_, bytes| queues.take(&member, bytes))
}

/// The session in use, which may change from one message to the next.
pub(super) struct InUse(Mutex<Session>);

impl InUse {
    pub fn new(session: Session) -> Self {
        Self(Mutex::new(session))
    }

    pub fn get(&self) -> Session {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn replace(&self, session: Session) -> Session {
        std::mem::replace(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner), session)
    }
}

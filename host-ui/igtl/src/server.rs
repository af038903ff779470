//! Sends messages to every client over TCP, and receives transforms from them. A client that does
//! not read, or leaves a message unfinished, delays neither the sender nor the others.
//!
//! Each client has two threads. It keeps at most one pending message of each device, and one
//! received transform of each device; newer ones replace them. So memory is bounded, and a slow
//! client sees the newest data.

mod admission;
mod incoming;
mod outgoing;

use crate::codec::{Body, CodecError, Message, Status, Timestamp};
use admission::{Admission, Limits};
use outgoing::Client;
use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stylet_base::format::printable_line;

/// Period at which a thread checks whether the server has ended.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Most devices whose transforms one client may send.
const DEVICES_AT_MOST: usize = 16;

type Bytes = Arc<[u8]>;
/// Receiver of a line for each client that comes, goes or is refused.
type Log = Arc<dyn Fn(String) + Send + Sync>;

/// Reason why the server cannot serve.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The address is in use, or not one of this machine.
    #[error("cannot listen on {address}: {source}; choose another address with --listen")]
    Listen {
        /// Requested address.
        address: SocketAddr,
        /// Message of the system.
        source: io::Error,
    },
    /// The system gives no thread.
    #[error("cannot start the thread that accepts clients: {0}")]
    Thread(io::Error),
}

/// Transform from a client.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    /// Client.
    pub from: SocketAddr,
    /// Device of the client.
    pub device: String,
    /// Columns of the matrix: three axes, and the origin in mm.
    pub columns: [[f32; 3]; 4],
}

#[derive(Default)]
struct Shared {
    /// Newest message of each device, sent first to a new client.
    newest: BTreeMap<String, Bytes>,
    clients: Vec<Arc<Client>>,
    /// Newest transform of each client's devices that was not taken yet.
    received: BTreeMap<(SocketAddr, String), [[f32; 3]; 4]>,
}

/// Server, which ends when it is dropped.
pub struct Server {
    shared: Arc<Mutex<Shared>>,
    // SYNC: a flag alone; it publishes no data.
    ended: Arc<AtomicBool>,
    address: SocketAddr,
}

/// Locks the mutex; a thread that panicked leaves only whole maps behind.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Listens on the address; port 0 lets the system choose one.
    pub fn listen(address: SocketAddr, log: impl Fn(String) + Send + Sync + 'static) -> Result<Self, ServerError> {
        Self::listen_within(Limits::default(), address, log)
    }

    fn listen_within(
        limits: Limits,
        address: SocketAddr,
        log: impl Fn(String) + Send + Sync + 'static,
    ) -> Result<Self, ServerError> {
        let failed = |source| ServerError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let server = Self {
            shared: Arc::default(),
            ended: Arc::default(),
            address: listener.local_addr().map_err(failed)?,
        };
        let (shared, ended) = (server.shared.clone(), server.ended.clone());
        // Clients choose the text of some lines.
        let log: Log = Arc::new(move |line| log(printable_line(&line)));
        std::thread::Builder::new()
            .name("igtl-accept".to_owned())
            .spawn(move || accept(&listener, Admission::new(limits), &shared, &ended, &log))
            .map_err(ServerError::Thread)?;
        Ok(server)
    }

    /// Returns the address of the server.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Queues a message of a device as [`Self::publish`] does.
    pub fn send(&self, device: &str, time: Timestamp, body: Body) -> Result<(), CodecError> {
        let message = Message {
            device: device.to_owned(),
            time,
            body,
        };
        self.publish(device, message.encode()?);
        Ok(())
    }

    /// Queues a message for every client, replacing an older one of this device. Never waits for a
    /// client.
    pub fn publish(&self, device: &str, bytes: Vec<u8>) {
        let bytes: Bytes = bytes.into();
        let mut shared = lock(&self.shared);
        shared.newest.insert(device.to_owned(), bytes.clone());
        for client in &shared.clients {
            client.put(device, bytes.clone());
        }
    }

    /// Returns whether anyone is connected.
    pub fn has_clients(&self) -> bool {
        !lock(&self.shared).clients.is_empty()
    }

    /// Returns the newest transform of each device of each client since the last call.
    pub fn received(&self) -> Vec<Received> {
        let all = std::mem::take(&mut lock(&self.shared).received);
        all.into_iter()
            .map(|((from, device), columns)| Received { from, device, columns })
            .collect()
    }

    /// Records that a transform of this client moved a hand: no other client takes its place for a
    /// while.
    pub fn has_moved(&self, from: SocketAddr) {
        if let Some(client) = lock(&self.shared).clients.iter().find(|c| c.address == from) {
            client.has_moved();
        }
    }

    /// Answers a client's message with a STATUS, and logs it; repeats the same text to the same
    /// client only once in a while.
    pub fn refuse(&self, from: SocketAddr, device: &str, refusal: Status) {
        let client = lock(&self.shared).clients.iter().find(|c| c.address == from).cloned();
        if let Some(client) = client {
            client.refuse(device, refusal);
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

fn accept(
    listener: &TcpListener,
    mut admission: Admission,
    shared: &Arc<Mutex<Shared>>,
    ended: &Arc<AtomicBool>,
    log: &Log,
) {
    while !ended.load(Ordering::Relaxed) {
        let Ok((stream, from)) = listener.accept() else {
            std::thread::sleep(LOOK_EVERY);
            continue;
        };
        let client = Arc::new(Client::new(from, log.clone()));
        let admitted = {
            let mut shared = lock(shared);
            let admitted = admission.admit(from, &shared.clients);
            if let Ok(displaced) = &admitted {
                shared
                    .clients
                    .retain(|c| displaced.as_ref().is_none_or(|d| !Arc::ptr_eq(c, d)));
                client.put_all(&shared.newest);
                shared.clients.push(client.clone());
            }
            admitted
        };
        match admitted {
            Ok(displaced) => displaced
                .into_iter()
                .for_each(|d| d.end("another client has taken its place")),
            Err(refused) => {
                admission::answer(&stream, &refused.words);
                if refused.is_said {
                    log(format!("{from}: refused, {}", refused.words));
                }
                continue;
            }
        }
        log(format!("{from}: connected"));
        if let Err(error) = start(stream, &client, shared, ended) {
            lock(shared).clients.retain(|other| !Arc::ptr_eq(other, &client));
            log(format!("{from}: disconnected, no thread for it: {error}"));
        }
    }
}

/// Starts a thread that sends and one that reads. A client may close its own direction and continue
/// to receive.
fn start(
    stream: TcpStream,
    client: &Arc<Client>,
    shared: &Arc<Mutex<Shared>>,
    ended: &Arc<AtomicBool>,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(LOOK_EVERY))?;
    stream.set_read_timeout(Some(LOOK_EVERY))?;
    let reads = stream.try_clone()?;
    let thread = |name: &str| std::thread::Builder::new().name(name.to_owned());
    let (held, all, ends) = (client.clone(), shared.clone(), ended.clone());
    thread("igtl-client").spawn(move || {
        let why = held.send_to(stream, &ends);
        lock(&all).clients.retain(|other| !Arc::ptr_eq(other, &held));
        held.say(&format!("disconnected, {why}"));
    })?;
    let (held, all, ends) = (client.clone(), shared.clone(), ended.clone());
    let started = thread("igtl-reader").spawn(move || incoming::read(reads, &held, &all, &ends));
    started
        .map(drop)
        .inspect_err(|_| client.end("no thread to read from it"))
}

#[cfg(test)]
mod tests;

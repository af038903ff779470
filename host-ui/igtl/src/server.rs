//! Sends messages to every client over TCP; one that does not read costs neither the sender nor the others anything.
//!
//! Each client has a thread and keeps at most one message of each device that waits: a newer one replaces it. So memory is
//! bounded, and a slow client sees what is newest.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A client that has not taken one message for so long is disconnected.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often a thread looks whether the server has ended.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const CLIENTS_AT_MOST: usize = 16;

type Bytes = Arc<[u8]>;

/// Why the server cannot serve.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The address is in use, or not one of this machine.
    #[error("cannot listen on {address}: {source}; choose another address with --listen")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// The system gives no thread.
    #[error("cannot start the thread that accepts clients: {0}")]
    Thread(io::Error),
}

/// What one client is still to get, the newest message of each device.
#[derive(Default)]
struct Client {
    waiting: Mutex<BTreeMap<String, Bytes>>,
    arrived: Condvar,
}

#[derive(Default)]
struct Shared {
    /// The newest message of each device: what a new client gets first.
    newest: BTreeMap<String, Bytes>,
    clients: Vec<Arc<Client>>,
}

/// A server; it ends when it is dropped.
pub struct Server {
    shared: Arc<Mutex<Shared>>,
    // SYNC: a flag alone, no data is published by it.
    ended: Arc<AtomicBool>,
    address: SocketAddr,
}

/// A thread that panicked leaves only whole maps behind.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Listens on the address; port 0 lets the system choose one. `log` gets a line for each client that comes or goes.
    pub fn listen(address: SocketAddr, log: impl Fn(String) + Send + Sync + 'static) -> Result<Self, ServerError> {
        let failed = |source| ServerError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let server = Self {
            shared: Arc::default(),
            ended: Arc::default(),
            address: listener.local_addr().map_err(failed)?,
        };
        let (shared, ended) = (server.shared.clone(), server.ended.clone());
        std::thread::Builder::new()
            .name("igtl-accept".to_owned())
            .spawn(move || accept(&listener, &shared, &ended, &Arc::new(log)))
            .map_err(ServerError::Thread)?;
        Ok(server)
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// How many clients are connected.
    pub fn clients(&self) -> usize {
        lock(&self.shared).clients.len()
    }

    /// Gives the bytes of a message to every client, in place of an older one of this device. Never waits for a client.
    pub fn publish(&self, device: &str, bytes: Vec<u8>) {
        let bytes: Bytes = bytes.into();
        let mut shared = lock(&self.shared);
        shared.newest.insert(device.to_owned(), bytes.clone());
        for client in &shared.clients {
            lock(&client.waiting).insert(device.to_owned(), bytes.clone());
            client.arrived.notify_one();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

fn accept<L: Fn(String) + Send + Sync + 'static>(
    listener: &TcpListener,
    shared: &Arc<Mutex<Shared>>,
    ended: &Arc<AtomicBool>,
    log: &Arc<L>,
) {
    while !ended.load(Ordering::Relaxed) {
        let Ok((stream, from)) = listener.accept() else {
            std::thread::sleep(LOOK_EVERY);
            continue;
        };
        let client = Arc::new(Client::default());
        {
            let mut shared = lock(shared);
            if shared.clients.len() >= CLIENTS_AT_MOST {
                log(format!(
                    "{from}: refused, {CLIENTS_AT_MOST} clients are connected already"
                ));
                continue;
            }
            lock(&client.waiting).clone_from(&shared.newest);
            shared.clients.push(client.clone());
        }
        log(format!("{from}: connected"));
        let (all, ended, say) = (shared.clone(), ended.clone(), log.clone());
        let held = client.clone();
        let started = std::thread::Builder::new()
            .name("igtl-client".to_owned())
            .spawn(move || {
                let why = serve(stream, &held, &ended);
                lock(&all).clients.retain(|other| !Arc::ptr_eq(other, &held));
                say(format!("{from}: disconnected, {why}"));
            });
        if let Err(error) = started {
            lock(shared).clients.retain(|other| !Arc::ptr_eq(other, &client));
            log(format!("{from}: disconnected, no thread for it: {error}"));
        }
    }
}

/// Sends until the client or the server ends; why it ended.
fn serve(mut stream: TcpStream, client: &Client, ended: &AtomicBool) -> String {
    let prepared = stream
        .set_nonblocking(false)
        .and_then(|()| stream.set_nodelay(true))
        .and_then(|()| stream.set_write_timeout(Some(LOOK_EVERY)));
    if let Err(error) = prepared {
        return error.to_string();
    }
    while !ended.load(Ordering::Relaxed) {
        let waiting = lock(&client.waiting);
        let (mut waiting, _) = client
            .arrived
            .wait_timeout_while(waiting, LOOK_EVERY, |waiting| waiting.is_empty())
            .unwrap_or_else(PoisonError::into_inner);
        let batch = std::mem::take(&mut *waiting);
        drop(waiting);
        for bytes in batch.values() {
            if let Err(why) = send(&mut stream, bytes, ended) {
                return why;
            }
        }
    }
    "the server ends".to_owned()
}

fn send(stream: &mut TcpStream, mut bytes: &[u8], ended: &AtomicBool) -> Result<(), String> {
    let begun = Instant::now();
    while !bytes.is_empty() {
        match stream.write(bytes) {
            Ok(0) => return Err("it closed the connection".to_owned()),
            Ok(sent) => bytes = &bytes[sent..],
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(error) => return Err(error.to_string()),
        }
        if ended.load(Ordering::Relaxed) {
            return Err("the server ends".to_owned());
        }
        if !bytes.is_empty() && begun.elapsed() > PATIENCE {
            return Err(format!("it did not take a message for {} s", PATIENCE.as_secs()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;

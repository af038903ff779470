//! Messages still to be sent to one client.

use super::{Bytes, LOOK_EVERY, Log, lock};
use crate::codec::{Body, Message, Status, Timestamp};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time without taking a message after which a client is disconnected.
const PATIENCE: Duration = Duration::from_secs(3);
/// Times after which the same refusal is repeated, and after which another one follows.
const REFUSAL_EVERY: Duration = Duration::from_secs(10);
const OTHER_REFUSAL_EVERY: Duration = Duration::from_millis(50);
/// Key of an answer, which no device has; it is sent before the devices' messages.
const ANSWER: &str = "";

#[derive(Default)]
struct Waiting {
    /// Newest message of each device.
    messages: BTreeMap<String, Bytes>,
    /// Reason for ending the connection after these messages.
    end: Option<&'static str>,
}

/// One connection.
pub struct Client {
    pub address: SocketAddr,
    waiting: Mutex<Waiting>,
    arrived: Condvar,
    refused: Mutex<Option<(Status, Instant)>>,
    /// Time at which it came, or last moved a hand.
    active: Mutex<Instant>,
    log: Log,
}

impl Client {
    pub fn new(address: SocketAddr, log: Log) -> Self {
        Self {
            address,
            waiting: Mutex::default(),
            arrived: Condvar::new(),
            refused: Mutex::default(),
            active: Mutex::new(Instant::now()),
            log,
        }
    }

    pub fn has_moved(&self) {
        *lock(&self.active) = Instant::now();
    }

    pub fn active(&self) -> Instant {
        *lock(&self.active)
    }

    pub fn say(&self, line: &str) {
        (self.log)(format!("{}: {line}", self.address));
    }

    pub fn put(&self, device: &str, bytes: Bytes) {
        lock(&self.waiting).messages.insert(device.to_owned(), bytes);
        self.arrived.notify_one();
    }

    pub fn put_all(&self, messages: &BTreeMap<String, Bytes>) {
        lock(&self.waiting).messages.clone_from(messages);
    }

    /// Sends the pending messages, then disconnects.
    pub fn end(&self, why: &'static str) {
        lock(&self.waiting).end = Some(why);
        self.arrived.notify_one();
    }

    /// Returns whether the connection ends or has ended.
    pub fn ends(&self) -> bool {
        lock(&self.waiting).end.is_some()
    }

    pub fn refuse(&self, device: &str, refusal: Status) {
        {
            let mut refused = lock(&self.refused);
            let too_soon = |(known, at): &(Status, Instant)| {
                let every = if *known == refusal {
                    REFUSAL_EVERY
                } else {
                    OTHER_REFUSAL_EVERY
                };
                at.elapsed() < every
            };
            if refused.as_ref().is_some_and(too_soon) {
                return;
            }
            *refused = Some((refusal.clone(), Instant::now()));
        }
        self.say(&format!("refused, {}", refusal.text));
        let message = Message {
            device: device.to_owned(),
            time: Timestamp::now(),
            body: Body::Status(refusal),
        };
        // A name that is not text cannot be used in an answer.
        if let Ok(bytes) = message.encode() {
            self.put(ANSWER, bytes.into());
        }
    }

    /// Sends until the client or the server ends; returns the reason.
    pub fn send_to(&self, mut stream: TcpStream, ended: &AtomicBool) -> String {
        let why = self.send_all(&mut stream, ended);
        lock(&self.waiting).end.get_or_insert("it has ended");
        // This also ends the thread that reads.
        let _ = stream.shutdown(Shutdown::Both);
        why
    }

    fn send_all(&self, stream: &mut TcpStream, ended: &AtomicBool) -> String {
        while !ended.load(Ordering::Relaxed) {
            let (batch, end) = self.wait();
            for bytes in batch.values() {
                if let Err(why) = send(stream, bytes, ended) {
                    return why;
                }
            }
            if let Some(why) = end {
                return why.to_owned();
            }
        }
        "the server ends".to_owned()
    }

    fn wait(&self) -> (BTreeMap<String, Bytes>, Option<&'static str>) {
        let waiting = lock(&self.waiting);
        let is_idle = |waiting: &mut Waiting| waiting.messages.is_empty() && waiting.end.is_none();
        let (mut waiting, _) = self
            .arrived
            .wait_timeout_while(waiting, LOOK_EVERY, is_idle)
            .unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut waiting.messages), waiting.end)
    }
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

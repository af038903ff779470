//! Messages from one client: transforms are kept; every other one is answered with the reason why
//! it is refused.

use super::outgoing::Client;
use super::{DEVICES_AT_MOST, Shared, lock};
use crate::codec::{Body, CodecError, HEADER_BYTES, Header, Message, Status};
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Longest body of an unknown type that is skipped.
const PASSED_OVER_AT_MOST: u64 = 16 << 20;

/// End of reading: the client closed its direction, its connection broke, or the server ends.
struct Ended;

/// Reads until the client or the server ends.
pub fn read(mut stream: TcpStream, client: &Client, shared: &Mutex<Shared>, ended: &AtomicBool) {
    let mut whole = |bytes: &mut [u8]| read_whole(&mut stream, bytes, client, ended);
    let mut head = [0; HEADER_BYTES];
    while whole(&mut head).is_ok() {
        let taken = match Header::decode(&head) {
            Ok(header) => take(&header, &mut whole, client, shared),
            Err(CodecError::Type {
                kind,
                device,
                body_bytes,
            }) if body_bytes <= PASSED_OVER_AT_MOST => {
                let words = format!("{kind} is not taken: clients may send TRANSFORM");
                client.refuse(&device, unknown(words));
                pass_over(body_bytes, &mut whole)
            }
            Err(error) => {
                client.refuse("Stylet", unknown(error.to_string()));
                client.end("what it sent is no message");
                Err(Ended)
            }
        };
        if taken.is_err() {
            return;
        }
    }
}

fn unknown(words: String) -> Status {
    Status::refused(12, "Unknown instruction", words)
}

fn take(
    header: &Header,
    whole: &mut impl FnMut(&mut [u8]) -> Result<(), Ended>,
    client: &Client,
    shared: &Mutex<Shared>,
) -> Result<(), Ended> {
    let device = header.device.clone();
    if header.kind != "TRANSFORM" {
        let words = format!("{} is not taken: clients may send TRANSFORM", header.kind);
        client.refuse(&device, unknown(words));
        return pass_over(header.body_bytes as u64, whole);
    }
    let mut body = vec![0; header.body_bytes];
    whole(&mut body)?;
    match Message::of(header, &body).map(|message| message.body) {
        Ok(Body::Transform(columns)) => {
            let received = &mut lock(shared).received;
            let own = received.keys().filter(|(from, _)| *from == client.address).count();
            let key = (client.address, device);
            if own < DEVICES_AT_MOST || received.contains_key(&key) {
                received.insert(key, columns);
            }
        }
        Ok(_) => {}
        Err(error) => {
            let (code, name, words) = match error {
                CodecError::Checksum { .. } => (9, "Checksum error", "its checksum is not that of its body".to_owned()),
                other => (0, "Invalid packet", other.to_string()),
            };
            client.refuse(&device, Status::refused(code, name, words));
        }
    }
    Ok(())
}

fn pass_over(mut length: u64, whole: &mut impl FnMut(&mut [u8]) -> Result<(), Ended>) -> Result<(), Ended> {
    let mut bytes = [0; 4096];
    while length > 0 {
        let part = length.min(bytes.len() as u64);
        whole(&mut bytes[..part as usize])?;
        length -= part;
    }
    Ok(())
}

/// Waits for as long as the connection lasts: an unfinished message delays no other client.
fn read_whole(stream: &mut TcpStream, mut bytes: &mut [u8], client: &Client, ended: &AtomicBool) -> Result<(), Ended> {
    while !bytes.is_empty() {
        // SYNC: a flag alone.
        if ended.load(Ordering::Relaxed) || client.ends() {
            return Err(Ended);
        }
        match stream.read(bytes) {
            Ok(0) => return Err(Ended),
            Ok(length) => bytes = &mut bytes[length..],
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(_) => return Err(Ended),
        }
    }
    Ok(())
}

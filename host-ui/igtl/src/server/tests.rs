//! Clients that read, that hang, and that arrive late.

use super::*;
use crate::codec::{Body, HEADER_BYTES, Header, Message, Timestamp};
use std::io::Read;
use std::sync::mpsc;

fn text(device: &str, text: &str) -> Vec<u8> {
    let (device, time) = (device.to_owned(), Timestamp::default());
    let body = Body::Text(text.to_owned());
    Message { device, time, body }.encode().unwrap()
}

fn next(stream: &mut TcpStream) -> Message {
    let mut head = [0; HEADER_BYTES];
    stream.read_exact(&mut head).unwrap();
    let header = Header::decode(&head).unwrap();
    let mut body = vec![0; header.body_bytes];
    stream.read_exact(&mut body).unwrap();
    Message::of(&header, &body).unwrap()
}

#[test]
fn a_client_that_hangs_is_disconnected_with_a_reason_and_the_other_gets_what_is_newest() {
    let (log, lines) = mpsc::channel();
    let server = Server::listen("127.0.0.1:0".parse().unwrap(), move |line| drop(log.send(line))).unwrap();
    server.publish("State", text("State", "first"));
    let mut reads = TcpStream::connect(server.address()).unwrap();
    let hangs = TcpStream::connect(server.address()).unwrap();
    assert_eq!(next(&mut reads).body, Body::Text("first".to_owned()));
    let name = hangs.local_addr().unwrap().to_string();
    let large = "x".repeat(60_000);
    let mut disconnected = None;
    // What the system buffers for a connection is filled first.
    for _ in 0..60_000 {
        server.publish("State", text("State", &large));
        assert_eq!(next(&mut reads).device, "State");
        disconnected = lines
            .try_iter()
            .find(|line| line.starts_with(&name) && line.contains("disconnected"));
        if disconnected.is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let line = disconnected.expect("the client that hangs stays connected");
    assert!(line.contains("did not take a message for 3 s"), "{line}");
    assert_eq!(server.clients(), 1);
}

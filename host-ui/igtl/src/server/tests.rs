//! Clients that read, that hang, and that arrive late.

use super::*;
use crate::codec::{HEADER_BYTES, Header};
use std::io::{Read, Write};
use std::sync::mpsc;
use std::time::Instant;

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
fn a_hung_client_is_disconnected_and_others_get_the_newest() {
    let (log, lines) = mpsc::channel();
    let server = Server::listen("127.0.0.1:0".parse().unwrap(), move |line| drop(log.send(line))).unwrap();
    server.publish("State", text("State", "first"));
    let mut reads = TcpStream::connect(server.address()).unwrap();
    let hangs = TcpStream::connect(server.address()).unwrap();
    assert_eq!(next(&mut reads).body, Body::Text("first".to_owned()));
    let name = hangs.local_addr().unwrap().to_string();
    let large = "x".repeat(60_000);
    let mut disconnected = None;
    // First fill the system's buffer of the connection.
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
    assert_eq!(lock(&server.shared).clients.len(), 1);
}

const COLUMNS: [[f32; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 2.0, 3.0]];

fn transform(device: &str) -> Vec<u8> {
    let (device, time) = (device.to_owned(), Timestamp::default());
    let body = Body::Transform(COLUMNS);
    Message { device, time, body }.encode().unwrap()
}

fn received(server: &Server) -> Vec<Received> {
    let begun = Instant::now();
    loop {
        let all = server.received();
        if !all.is_empty() || begun.elapsed() > Duration::from_secs(10) {
            return all;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn refused(stream: &mut TcpStream) -> Status {
    match next(stream).body {
        Body::Status(status) => status,
        other => panic!("{other:?}"),
    }
}

#[test]
fn fragmented_transforms_are_read_and_other_messages_refused() {
    let server = Server::listen("127.0.0.1:0".parse().unwrap(), |_| ()).unwrap();
    let mut client = TcpStream::connect(server.address()).unwrap();
    let mut hangs = TcpStream::connect(server.address()).unwrap();
    hangs.write_all(&transform("Stylus")[..70]).unwrap();
    let bytes = transform("Stylus");
    for piece in bytes.chunks(40) {
        client.write_all(piece).unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
    let expected = Received {
        from: client.local_addr().unwrap(),
        device: "Stylus".to_owned(),
        columns: COLUMNS,
    };
    assert_eq!(received(&server), std::slice::from_ref(&expected));

    // Known and unknown types are skipped, whatever their length.
    client.write_all(&text("Words", &"x".repeat(9000))).unwrap();
    assert!(refused(&mut client).text.contains("STRING is not taken"));
    std::thread::sleep(Duration::from_millis(60));
    let mut unknown = text("Words", &"x".repeat(9000));
    unknown[2..8].copy_from_slice(b"QTDATA");
    client.write_all(&unknown).unwrap();
    assert!(refused(&mut client).text.contains("QTDATA is not taken"));
    client.write_all(&bytes).unwrap();
    assert_eq!(received(&server), [expected]);

    let mut changed = bytes.clone();
    changed[HEADER_BYTES] ^= 1;
    std::thread::sleep(Duration::from_millis(60));
    client.write_all(&changed).unwrap();
    assert_eq!(refused(&mut client).code, 9);
    // After this the start of the next message is unknown.
    let mut endless = bytes;
    endless[42..50].copy_from_slice(&u64::MAX.to_be_bytes());
    std::thread::sleep(Duration::from_millis(60));
    client.write_all(&endless).unwrap();
    assert!(refused(&mut client).text.contains("at most 48"));
    assert_eq!(client.read(&mut [0]).unwrap(), 0, "the connection ends");
    assert!(server.received().is_empty());
}

#[test]
fn the_devices_of_a_client_are_limited() {
    let server = Server::listen("127.0.0.1:0".parse().unwrap(), |_| ()).unwrap();
    let mut client = TcpStream::connect(server.address()).unwrap();
    for number in 0..3 * DEVICES_AT_MOST {
        client.write_all(&transform(&format!("Device {number}"))).unwrap();
    }
    client.write_all(&text("End", "")).unwrap();
    assert_eq!(refused(&mut client).code, 12, "all was read");
    assert_eq!(server.received().len(), DEVICES_AT_MOST);
}

/// Guards against escape sequences that a client wrote to the terminal in the type of a message.
#[test]
fn the_log_has_no_escape_sequences() {
    let (log, lines) = mpsc::channel();
    let server = Server::listen("127.0.0.1:0".parse().unwrap(), move |line| drop(log.send(line))).unwrap();
    let mut client = TcpStream::connect(server.address()).unwrap();
    let mut message = text("Words", "x");
    message[2..8].copy_from_slice(b"\x1b[2J\x1bc");
    client.write_all(&message).unwrap();
    let _ = refused(&mut client);
    std::thread::sleep(Duration::from_millis(60));
    // If a reason quotes the header, the client chose all of it.
    client.write_all(&[0x1b; HEADER_BYTES]).unwrap();
    let _ = refused(&mut client);
    assert_eq!(client.read(&mut [0]).unwrap(), 0, "the connection ends");
    let begun = Instant::now();
    let mut seen = Vec::new();
    while !seen.iter().any(|line: &String| line.contains("disconnected")) && begun.elapsed() < Duration::from_secs(10) {
        seen.extend(lines.try_iter());
    }
    assert!(
        seen.iter()
            .any(|line| line.contains("[2J") && line.contains("is not taken")),
        "{seen:?}"
    );
    assert!(
        seen.iter().all(|line| !line.contains(|c: char| c.is_control())),
        "{seen:?}"
    );
}

#[test]
fn a_reader_is_replaced_by_a_newcomer_with_a_reason() {
    let (log, lines) = mpsc::channel();
    let limits = Limits {
        of_one_address: 2,
        place_for: Duration::from_secs(3600),
        ..Limits::default()
    };
    let address = "127.0.0.1:0".parse().unwrap();
    let server = Server::listen_within(limits, address, move |line| drop(log.send(line))).unwrap();
    let _both = [0, 1].map(|_| TcpStream::connect(server.address()).unwrap());
    let mut third = TcpStream::connect(server.address()).unwrap();
    assert!(
        refused(&mut third)
            .text
            .contains("2 clients of its address are connected")
    );
    drop((server, lines));

    let limits = Limits {
        place_for: Duration::ZERO,
        ..limits
    };
    let server = Server::listen_within(limits, address, |_| ()).unwrap();
    server.publish("State", text("State", "newest"));
    let mut first = TcpStream::connect(server.address()).unwrap();
    assert_eq!(next(&mut first).device, "State");
    let mut others = [0, 1].map(|_| TcpStream::connect(server.address()).unwrap());
    assert_eq!(others.each_mut().map(|other| next(other).device), ["State", "State"]);
    assert_eq!(first.read(&mut [0]).unwrap(), 0, "the connection ends");
    assert_eq!(lock(&server.shared).clients.len(), 2);
}

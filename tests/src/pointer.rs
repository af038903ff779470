//! A pointer on a virtual display, by the protocol of X11 and its extension XTEST.

use crate::Display;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;

const QUERY_EXTENSION: u8 = 98;
const FAKE_INPUT: u8 = 2;
const BUTTON_PRESS: u8 = 4;
const BUTTON_RELEASE: u8 = 5;
const MOTION: u8 = 6;
const LEFT: u8 = 1;

/// A client of the display that moves its pointer.
pub struct Pointer {
    stream: UnixStream,
    opcode: u8,
}

impl Pointer {
    /// A pointer of this display.
    pub fn of(display: &Display) -> Self {
        let path = format!("/tmp/.X11-unix/X{}", &display.name()[1..]);
        let mut stream = UnixStream::connect(path).expect("a display");
        // Little-endian, version 11.0, without a name and a password.
        stream
            .write_all(&[b'l', 0, 11, 0, 0, 0, 0, 0, 0, 0, 0, 0])
            .expect("sent");
        let mut head = [0; 8];
        stream.read_exact(&mut head).expect("an answer");
        assert_eq!(head[0], 1, "the display refuses");
        let words = u16::from_le_bytes([head[6], head[7]]);
        stream
            .read_exact(&mut vec![0; 4 * usize::from(words)])
            .expect("its screens");
        let mut asked = vec![QUERY_EXTENSION, 0, 4, 0, 5, 0, 0, 0];
        asked.extend(b"XTEST\0\0\0");
        stream.write_all(&asked).expect("sent");
        let mut reply = [0; 32];
        stream.read_exact(&mut reply).expect("an answer");
        assert_eq!((reply[0], reply[8]), (1, 1), "the display has no XTEST");
        let opcode = reply[9];
        Self { stream, opcode }
    }

    fn fake(&mut self, kind: u8, detail: u8, [x, y]: [i16; 2]) {
        let mut request = [0; 36];
        (request[0], request[1], request[2]) = (self.opcode, FAKE_INPUT, 9);
        (request[4], request[5]) = (kind, detail);
        request[24..26].copy_from_slice(&x.to_le_bytes());
        request[26..28].copy_from_slice(&y.to_le_bytes());
        self.stream.write_all(&request).expect("sent");
    }

    /// Moves there, and clicks the left button.
    pub fn click(&mut self, [x, y]: [f32; 2]) {
        let place = [x as i16, y as i16];
        self.fake(MOTION, 0, place);
        std::thread::sleep(std::time::Duration::from_millis(100));
        self.fake(BUTTON_PRESS, LEFT, [0; 2]);
        std::thread::sleep(std::time::Duration::from_millis(100));
        self.fake(BUTTON_RELEASE, LEFT, [0; 2]);
    }
}

//! The service's websocket, and the version that the service gives over HTTP on the same port.

use core::fmt;
use core::str::FromStr;
use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::Instant;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

use crate::haply::message;
use crate::haply::owner::{self, NotTrusted};
use crate::haply::wire::{Wire, WireError};

/// Time limit for connecting, and for each step of the handshake.
const CONNECT_LIMIT: Duration = Duration::from_secs(2);
/// Longest message that is read; a list of a few devices has some kilobytes.
const LONGEST_MESSAGE: usize = 256 * 1024;
const LONGEST_VERSION: u64 = 16 * 1024;
/// Most messages without text that one call reads.
const MOST_OTHERS: u32 = 16;

/// Address of an Inverse service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Service {
    host_and_port: String,
}

/// Text that is not an address of a service.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is no address of an Inverse service; give ws://HOST:PORT, as in ws://localhost:10001")]
pub struct BadAddress(String);

/// Reason why no websocket opens.
#[derive(Debug, thiserror::Error)]
pub enum NoSocket {
    /// Nothing listens there.
    #[error("{0}")]
    Connection(#[from] std::io::Error),
    /// The program that listens is not a websocket server.
    #[error("no websocket: {0}")]
    Handshake(String),
    /// Another user's program, or another machine's.
    #[error(transparent)]
    NotTrusted(#[from] NotTrusted),
}

impl Default for Service {
    fn default() -> Self {
        Self {
            host_and_port: "localhost:10001".to_owned(),
        }
    }
}

impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ws://{}", self.host_and_port)
    }
}

impl FromStr for Service {
    type Err = BadAddress;

    fn from_str(text: &str) -> Result<Self, BadAddress> {
        let rest = text.strip_prefix("ws://").map(|rest| rest.trim_end_matches('/'));
        let port_of = |rest: &str| {
            rest.rsplit_once(':')
                .map(|(host, port)| (!host.is_empty(), port.parse::<u16>()))
        };
        match rest.map(|rest| (rest, port_of(rest))) {
            Some((rest, Some((true, Ok(_))))) if !rest.contains(['/', ' ', '@']) => Ok(Self {
                host_and_port: rest.to_owned(),
            }),
            _ => Err(BadAddress(text.to_owned())),
        }
    }
}

impl Service {
    /// Opens a websocket.
    pub fn connect(&self) -> Result<Socket, NoSocket> {
        let here = |a: SocketAddr| a.ip().to_canonical().is_loopback();
        if let Some(other) = self.host_and_port.to_socket_addrs()?.find(|a| !here(*a)) {
            return Err(NotTrusted::OtherMachine(other.ip()).into());
        }
        let stream = self.stream(CONNECT_LIMIT)?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE));
        let shaken = tungstenite::client::client_with_config(self.to_string(), stream, Some(config));
        let (socket, _) = shaken.map_err(|e| NoSocket::Handshake(e.to_string()))?;
        owner::check(socket.get_ref())??;
        socket.get_ref().set_nonblocking(true)?;
        Ok(Socket(socket))
    }

    /// Returns the version of the service, if it reports one.
    pub fn version(&self) -> Option<String> {
        let mut stream = self.stream(CONNECT_LIMIT / 4).ok()?;
        let host = &self.host_and_port;
        write!(
            stream,
            "GET /version HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .ok()?;
        let mut answer = Vec::new();
        // Whatever has arrived counts, even if the connection does not end in time.
        let _ = stream.take(LONGEST_VERSION).read_to_end(&mut answer);
        message::version(&String::from_utf8_lossy(&answer))
    }

    fn stream(&self, limit: Duration) -> std::io::Result<TcpStream> {
        let mut last = ErrorKind::AddrNotAvailable.into();
        for address in self.host_and_port.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, limit) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_read_timeout(Some(limit))?;
                    stream.set_write_timeout(Some(limit))?;
                    return Ok(stream);
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }
}

/// An open websocket that never blocks.
pub struct Socket(WebSocket<TcpStream>);

impl Wire for Socket {
    fn send(&mut self, text: &str) -> Result<(), WireError> {
        // A service that reads so little that a few forces fill the socket is as good as closed.
        self.0.send(Message::text(text)).map_err(|_| WireError::Closed)
    }

    fn receive(&mut self, until: Instant, text: &mut String) -> Result<bool, WireError> {
        let mut others = 0;
        while others < MOST_OTHERS {
            match self.0.read() {
                Ok(Message::Text(arrived)) => {
                    text.clear();
                    text.push_str(&arrived);
                    return Ok(true);
                }
                Ok(Message::Binary(_)) => return Err(WireError::NoText),
                Ok(Message::Close(_)) => return Err(WireError::Closed),
                Ok(_) => others += 1,
                Err(Error::Io(why)) if matches!(why.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    if !self.is_readable(until) {
                        return Ok(false);
                    }
                }
                Err(_) => return Err(WireError::Closed),
            }
        }
        Ok(false)
    }

    fn close(&mut self) {
        let _ = self.0.close(None);
        let _ = self.0.flush();
        let _ = self.0.get_ref().shutdown(std::net::Shutdown::Both);
    }
}

impl Socket {
    /// Waits until data can be read; returns false if there is none before `until`.
    fn is_readable(&self, until: Instant) -> bool {
        let left = until.saturating_duration_since(Instant::now());
        let timeout = Timespec {
            tv_sec: left.as_secs() as i64,
            tv_nsec: left.subsec_nanos().into(),
        };
        let mut ready = [PollFd::new(self.0.get_ref(), PollFlags::IN)];
        poll(&mut ready, Some(&timeout)).is_ok_and(|count| count > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_scheme_host_and_port_only() {
        for good in ["ws://localhost:10001", "ws://127.0.0.1:9/", "ws://[::1]:10001"] {
            assert_eq!(good.parse::<Service>().unwrap().to_string(), good.trim_end_matches('/'));
        }
        for wrong in [
            "",
            "localhost:10001",
            "wss://a:1",
            "ws://:1",
            "ws://a",
            "ws://a:b",
            "ws://a:70000",
            "ws://a/b:1",
            "ws://u@a:1",
        ] {
            assert!(wrong.parse::<Service>().is_err(), "{wrong}");
        }
        assert_eq!(Service::default().to_string(), "ws://localhost:10001");
    }
}

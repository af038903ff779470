//! The service on a port of this machine: websocket, and the version over HTTP.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tungstenite::{Error, Message};

use crate::service::{Sent, Service, Wrong};

const TICK: Duration = Duration::from_millis(1);

/// Serves until dropped.
pub struct Server {
    address: SocketAddr,
    // SYNC: relaxed throughout; the flag publishes no other data.
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves `service` on a free port.
    pub fn start(service: &Service) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        listener.set_nonblocking(true).expect("a socket");
        let address = listener.local_addr().expect("bound");
        let stop = Arc::<AtomicBool>::default();
        let (service, stopped) = (service.clone(), Arc::clone(&stop));
        let thread = thread::spawn(move || listen(&listener, &service, &stopped));
        Self {
            address,
            stop,
            thread: Some(thread),
        }
    }

    /// Returns the value for `--haply-url`.
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn listen(listener: &TcpListener, service: &Service, stop: &Arc<AtomicBool>) {
    let mut connections = Vec::new();
    while !stop.load(Relaxed) {
        match listener.accept() {
            Ok((stream, _)) if service.state().wrong != Wrong::Closes => {
                let (service, stop) = (service.clone(), Arc::clone(stop));
                connections.push(thread::spawn(move || drop(serve(stream, &service, &stop))));
            }
            // The stream is dropped.
            Ok(_) => {}
            Err(_) => thread::sleep(TICK),
        }
    }
    for connection in connections {
        let _ = connection.join();
    }
}

fn serve(stream: TcpStream, service: &Service, stop: &AtomicBool) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    let mut head = [0; 4096];
    let read = stream.peek(&mut head)?;
    let is_websocket = String::from_utf8_lossy(&head[..read])
        .to_lowercase()
        .contains("upgrade: websocket");
    if is_websocket {
        websocket(stream, service, stop);
        Ok(())
    } else {
        version(stream, service)
    }
}

fn version(mut stream: TcpStream, service: &Service) -> std::io::Result<()> {
    let mut head = [0; 4096];
    let _ = stream.read(&mut head)?;
    let version = service.state().version.clone();
    match version {
        Some(version) => {
            let body = format!("{{\"ok\":true,\"data\":{{\"project_version\":\"{version}\"}}}}");
            write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}",
                body.len()
            )
        }
        None => write!(stream, "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n"),
    }
}

fn websocket(stream: TcpStream, service: &Service, stop: &AtomicBool) {
    let Ok(mut socket) = tungstenite::accept(stream) else {
        return;
    };
    let _ = socket.get_ref().set_read_timeout(Some(TICK));
    if service.state().wrong != Wrong::Hangs {
        let list = service.state().open();
        let _ = socket.send(Message::text(list));
    }
    while !stop.load(Relaxed) {
        let wrong = service.state().wrong;
        match wrong {
            Wrong::Closes => break,
            Wrong::Hangs => {
                thread::sleep(TICK);
                continue;
            }
            _ => {}
        }
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(Message::Close(_)) => break,
            Ok(_) => continue,
            Err(Error::Io(why)) if matches!(why.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
            Err(_) => break,
        };
        let answers = service.state().answer(&text);
        if let Wrong::Late(ms) = wrong {
            thread::sleep(Duration::from_millis(ms));
        }
        for sent in answers {
            // Before it arrives, so that its answer is in turn.
            service.state().answered();
            let message = match sent {
                Sent::Text(text) => Message::text(text),
                Sent::Binary => Message::binary(vec![0xff; 8]),
            };
            if socket.send(message).is_err() {
                break;
            }
        }
    }
    service.state().closed();
}

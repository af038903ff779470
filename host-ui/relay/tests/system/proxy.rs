//! A cable between a member and the server: datagrams are delayed, lost, or cut off altogether.

use std::collections::VecDeque;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Treatment of a datagram. Flags and figures alone: no data is published by them.
#[derive(Default)]
struct Quality {
    end: AtomicBool,
    cut: AtomicBool,
    delay_us: AtomicU64,
    loss_per_mille: AtomicU32,
}

/// A UDP proxy on this machine; it ends when dropped.
pub struct Proxy {
    pub port: u16,
    quality: Arc<Quality>,
}

impl Proxy {
    /// Returns a good cable to a port of this machine.
    pub fn to(port: u16) -> Self {
        let front = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let own = front.local_addr().expect("bound").port();
        let quality = Arc::new(Quality::default());
        let shared = Arc::clone(&quality);
        std::thread::spawn(move || carry(&front, port, &shared));
        Self { port: own, quality }
    }

    /// Cuts or restores the cable.
    pub fn cut(&self, is_cut: bool) {
        self.quality.cut.store(is_cut, Ordering::Relaxed);
    }

    /// Delays each datagram by `delay`, and loses that many of a thousand, each way.
    pub fn worsen(&self, delay: Duration, loss_per_mille: u32) {
        self.quality.delay_us.store(delay.as_micros() as u64, Ordering::Relaxed);
        self.quality.loss_per_mille.store(loss_per_mille, Ordering::Relaxed);
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.quality.end.store(true, Ordering::Relaxed);
    }
}

/// Gives every front address its own socket behind, as a router would.
fn carry(front: &UdpSocket, port: u16, quality: &Quality) {
    front.set_nonblocking(true).expect("a socket");
    let mut routes: Vec<(SocketAddr, UdpSocket)> = Vec::new();
    let mut late: VecDeque<(Instant, bool, usize, Vec<u8>)> = VecDeque::new();
    let (mut buffer, mut dice) = (vec![0; 65_536], 88_172_645_463_325_252_u64);
    while !quality.end.load(Ordering::Relaxed) {
        let now = Instant::now();
        let delay = Duration::from_micros(quality.delay_us.load(Ordering::Relaxed));
        let mut is_lost = || {
            dice ^= dice << 13;
            dice ^= dice >> 7;
            dice ^= dice << 17;
            let lost = dice % 1000 < u64::from(quality.loss_per_mille.load(Ordering::Relaxed));
            lost || quality.cut.load(Ordering::Relaxed)
        };
        while let Ok((length, from)) = front.recv_from(&mut buffer) {
            let known = routes.iter().position(|(address, _)| *address == from);
            let route = known.unwrap_or_else(|| {
                let behind = UdpSocket::bind("127.0.0.1:0").expect("a free port");
                behind.connect(("127.0.0.1", port)).expect("this machine");
                behind.set_nonblocking(true).expect("a socket");
                routes.push((from, behind));
                routes.len() - 1
            });
            if !is_lost() {
                late.push_back((now + delay, true, route, buffer[..length].to_vec()));
            }
        }
        for (route, (_, behind)) in routes.iter().enumerate() {
            while let Ok(length) = behind.recv(&mut buffer) {
                if !is_lost() {
                    late.push_back((now + delay, false, route, buffer[..length].to_vec()));
                }
            }
        }
        while late.front().is_some_and(|(due, ..)| *due <= now) {
            if let Some((_, inwards, route, bytes)) = late.pop_front() {
                let (address, behind) = &routes[route];
                let _ = if inwards {
                    behind.send(&bytes)
                } else {
                    front.send_to(&bytes, address)
                };
            }
        }
        std::thread::sleep(Duration::from_micros(300));
    }
}

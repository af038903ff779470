//! Admission of clients: readers cannot keep others out.

use super::outgoing::Client;
use crate::codec::{Body, Message, Status, Timestamp};
use std::collections::BTreeMap;
use std::io::Write;
use std::net::{IpAddr, Ipv6Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most addresses in memory.
const ADDRESSES_AT_MOST: usize = 256;

/// Limits on clients.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub clients: usize,
    pub of_one_address: usize,
    /// Time without moving a hand after which a client may be replaced if the server is full.
    pub place_for: Duration,
    /// Most connections of one address in [`Limits::within`].
    pub connections: u32,
    pub within: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            clients: 16,
            of_one_address: 8,
            place_for: Duration::from_secs(30),
            connections: 20,
            within: Duration::from_secs(10),
        }
    }
}

/// Connections of one address since a time.
struct RecentConnections {
    since: Instant,
    connections: u32,
    was_refused: bool,
}

/// Admission of clients.
pub struct Admission {
    limits: Limits,
    seen: BTreeMap<IpAddr, RecentConnections>,
}

/// Reason why a client is refused.
#[derive(Debug)]
pub struct Refused {
    pub words: String,
    /// True for the first refusal of this address in a while, the only one that is logged.
    pub is_said: bool,
}

impl Admission {
    pub fn new(limits: Limits) -> Self {
        let seen = BTreeMap::new();
        Self { limits, seen }
    }

    /// Admits a client, replacing the returned one; or gives the reason of the refusal.
    pub fn admit(&mut self, from: SocketAddr, clients: &[Arc<Client>]) -> Result<Option<Arc<Client>>, Refused> {
        let Limits {
            clients: most,
            of_one_address,
            place_for,
            connections,
            within,
        } = self.limits;
        let now = Instant::now();
        let place = place(from.ip());
        self.seen.retain(|_, seen| now - seen.since < within);
        if self.seen.len() >= ADDRESSES_AT_MOST {
            self.seen.pop_first();
        }
        let seen = self.seen.entry(place).or_insert(RecentConnections {
            since: now,
            connections: 0,
            was_refused: false,
        });
        seen.connections = seen.connections.saturating_add(1);
        let mut refuse = |words: String| {
            let is_said = !std::mem::replace(&mut seen.was_refused, true);
            Err(Refused { words, is_said })
        };
        let too_many = seen.connections > connections;
        if too_many {
            let within = within.as_secs();
            return refuse(format!(
                "more than {connections} connections of its address in {within} s"
            ));
        }
        let of_address = |c: &&Arc<Client>| self::place(c.address.ip()) == place;
        let own = clients.iter().filter(of_address).count();
        let (is_full, what) = match own >= of_one_address {
            true => (true, format!("{of_one_address} clients of its address")),
            false => (clients.len() >= most, format!("{most} clients")),
        };
        if !is_full {
            return Ok(None);
        }
        let in_reach = clients.iter().filter(|c| own < of_one_address || of_address(c));
        match in_reach.min_by_key(|c| c.active()) {
            Some(idle) if now - idle.active() >= place_for => Ok(Some(idle.clone())),
            _ => {
                let place_for = place_for.as_secs();
                refuse(format!(
                    "{what} are connected, each for less than {place_for} s or moving a hand"
                ))
            }
        }
    }
}

/// Returns the part that identifies a machine: for IPv6 the network, in which a machine may choose
/// any address.
fn place(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(v6) => {
            let [a, b, c, d, ..] = v6.segments();
            Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0).into()
        }
        v4 => v4,
    }
}

/// Tells a client why it is refused, as far as its socket accepts data at once.
pub fn answer(mut stream: &TcpStream, words: &str) {
    let status = Status::refused(13, "Not ready", words);
    let message = Message {
        device: "Stylet".to_owned(),
        time: Timestamp::now(),
        body: Body::Status(status),
    };
    if let (Ok(bytes), Ok(())) = (message.encode(), stream.set_nonblocking(true)) {
        // It is refused, whether or not it receives the reason.
        let _ = stream.write(&bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(address: &str) -> Arc<Client> {
        Arc::new(Client::new(address.parse().expect("an address"), Arc::new(|_| ())))
    }

    fn admission(place_for: Duration) -> Admission {
        Admission::new(Limits {
            place_for,
            ..Limits::default()
        })
    }

    /// Guards against sixteen clients that only read and kept all others out.
    #[test]
    fn clients_of_one_address_leave_room_for_others() {
        let mut admission = admission(Duration::from_secs(3600));
        let mut clients = Vec::new();
        for port in 1..=16 {
            let from = format!("10.0.0.1:{port}");
            if admission.admit(from.parse().unwrap(), &clients).is_ok() {
                clients.push(client(&from));
            }
        }
        assert_eq!(clients.len(), 8);
        assert!(
            admission
                .admit("10.0.0.2:1".parse().unwrap(), &clients)
                .unwrap()
                .is_none()
        );
        // One network of IPv6 is one address.
        for port in 1..=8 {
            clients.push(client(&format!("[2001:db8::{port}]:1")));
        }
        let refused = admission
            .admit("[2001:db8::ffff]:1".parse().unwrap(), &clients)
            .err()
            .expect("no room");
        assert!(refused.words.contains("8 clients of its address"), "{}", refused.words);
        let refused = admission
            .admit("10.0.0.2:2".parse().unwrap(), &clients)
            .err()
            .expect("no room");
        assert!(refused.words.contains("16 clients are connected"), "{}", refused.words);
    }

    #[test]
    fn clients_that_move_a_hand_keep_their_place() {
        let wait = Duration::from_millis(200);
        let mut admission = admission(wait);
        let clients: Vec<_> = (1..=16).map(|n| client(&format!("10.0.0.{n}:1"))).collect();
        std::thread::sleep(wait);
        for moves in &clients[..15] {
            moves.has_moved();
        }
        let from = "10.0.1.1:1".parse().unwrap();
        let displaced = admission.admit(from, &clients).unwrap().expect("one that only reads");
        assert_eq!(displaced.address, clients[15].address);
        clients[15].has_moved();
        assert!(admission.admit(from, &clients).is_err());
    }

    #[test]
    fn a_repeated_address_is_refused_and_logged_once() {
        let mut admission = admission(Duration::ZERO);
        let said = (0..1000).filter(|n| {
            let admitted = admission.admit(format!("10.0.0.1:{}", n + 1).parse().unwrap(), &[]);
            admitted.as_ref().is_err_and(|refused| refused.is_said)
        });
        assert_eq!(said.count(), 1);
        assert!(admission.admit("10.0.0.1:9".parse().unwrap(), &[]).is_err());
        assert!(admission.admit("10.0.0.2:9".parse().unwrap(), &[]).is_ok());
    }
}

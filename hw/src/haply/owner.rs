//! Owner of the program that answers at the service's port, because anybody on this PC can take a
//! port first.

use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr, TcpStream};

/// State of an open connection in `/proc/net/tcp`.
const ESTABLISHED: &str = "01";
const ROOT: u32 = 0;

/// Reason why the program at the other end is not trusted.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotTrusted {
    /// Another user runs it.
    #[error(
        "the program that answers belongs to user {0}, not to this user or root: another user has taken the port of the service"
    )]
    OtherUser(u32),
    /// The program is on another machine, where its owner cannot be known.
    #[error("{0} is not on this PC: the service is neither encrypted nor signed, and is taken from this PC alone")]
    OtherMachine(IpAddr),
    /// The kernel does not show the connection.
    #[error("whose program answers is not to be seen in /proc/net/tcp")]
    NotShown,
}

/// Refuses a service of another user or another machine. Must be called after the first bytes
/// arrived: until the other side accepts the connection, the kernel attributes it to root.
pub fn check(stream: &TcpStream) -> io::Result<Result<(), NotTrusted>> {
    let (here, there) = (stream.local_addr()?, stream.peer_addr()?);
    if !there.ip().to_canonical().is_loopback() {
        return Ok(Err(NotTrusted::OtherMachine(there.ip())));
    }
    let own = rustix::process::geteuid().as_raw();
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(std::fs::read_to_string);
    let user = tables.iter().flatten().find_map(|table| owner(table, there, here));
    Ok(match user {
        Some(user) if user == own || user == ROOT => Ok(()),
        Some(user) => Err(NotTrusted::OtherUser(user)),
        None => Err(NotTrusted::NotShown),
    })
}

/// Returns the user of the socket at `local` that is connected with `remote`.
fn owner(table: &str, local: SocketAddr, remote: SocketAddr) -> Option<u32> {
    let both = |local: String, remote: String| {
        table.lines().find_map(|line| {
            let mut words = line.split_whitespace().skip(1);
            let is_it = words.next()? == local && words.next()? == remote && words.next()? == ESTABLISHED;
            is_it.then(|| words.nth(3)?.parse().ok())?
        })
    };
    both(plain(local), plain(remote)).or_else(|| both(mapped(local), mapped(remote)))
}

/// Returns an address as the kernel prints it: words in the byte order of this machine.
fn plain(address: SocketAddr) -> String {
    match address.ip() {
        IpAddr::V4(v4) => format!("{:08X}:{:04X}", u32::from_ne_bytes(v4.octets()), address.port()),
        IpAddr::V6(v6) => in_words(v6, address.port()),
    }
}

/// Like [`plain`], for a socket that takes both kinds of addresses.
fn mapped(address: SocketAddr) -> String {
    match address.ip() {
        IpAddr::V4(v4) => in_words(v4.to_ipv6_mapped(), address.port()),
        IpAddr::V6(_) => plain(address),
    }
}

fn in_words(address: Ipv6Addr, port: u16) -> String {
    let octets = address.octets();
    let (words, _) = octets.as_chunks::<4>();
    let words: String = words
        .iter()
        .map(|word| format!("{:08X}", u32::from_ne_bytes(*word)))
        .collect();
    format!("{words}:{port:04X}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    fn pair(listen: &str) -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind(listen).unwrap();
        let port = listener.local_addr().unwrap().port();
        let stream = TcpStream::connect(("localhost", port)).unwrap();
        (stream, listener.accept().unwrap().0)
    }

    #[test]
    fn a_program_of_this_user_is_trusted() {
        for listen in ["127.0.0.1:0", "0.0.0.0:0", "[::]:0"] {
            let Ok(listener) = TcpListener::bind(listen) else {
                println!("skipped: {listen}");
                continue;
            };
            drop(listener);
            let (here, _there) = pair(listen);
            assert_eq!(check(&here).unwrap(), Ok(()), "{listen}");
        }
    }

    #[test]
    fn the_owner_is_that_of_the_peer() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n\
             0: 0100007F:2711 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 1 1 0 100 0 0 10 0\n\
             1: 0100007F:D431 0100007F:2711 01 00000000:00000000 00:00000000 00000000     0        0 2 1 0 20 4 30 10 -1\n\
             2: 0100007F:2711 0100007F:D431 01 00000000:00000000 00:00000000 00000000  1001        0 3 1 0 20 4 30 10 -1\n";
        let address = |port| SocketAddr::from(([127, 0, 0, 1], port));
        assert_eq!(owner(table, address(0x2711), address(0xd431)), Some(1001));
        assert_eq!(owner(table, address(0x2711), address(0xd432)), None);
    }

    /// Guards against a port that another program took first.
    #[test]
    fn a_program_of_another_user_is_refused() {
        // SAFETY: none has preconditions; the child only accepts, waits and ends.
        let (here, child) = unsafe {
            if libc::geteuid() != 0 {
                println!("skipped: only root becomes another user");
                return;
            }
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let child = libc::fork();
            if child == 0 {
                use std::os::fd::AsRawFd;
                libc::setuid(65534);
                let accepted = libc::accept(listener.as_raw_fd(), std::ptr::null_mut(), std::ptr::null_mut());
                libc::write(accepted, c"x".as_ptr().cast(), 1);
                libc::pause();
                libc::_exit(0);
            }
            (TcpStream::connect(listener.local_addr().unwrap()).unwrap(), child)
        };
        let mut byte = [0];
        io::Read::read_exact(&mut &here, &mut byte).unwrap();
        let found = check(&here).unwrap();
        // SAFETY: the child is ours.
        unsafe {
            libc::kill(child, libc::SIGKILL);
            libc::waitpid(child, std::ptr::null_mut(), 0);
        }
        assert_eq!(found, Err(NotTrusted::OtherUser(65534)));
    }
}

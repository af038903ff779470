//! Packets between both processes: a kind, plain bytes, and for some the descriptor of sealed memory.

pub use crate::kind::{Alive, BoardSize, Kind, SeenRecords, SeenSnapshot, Start};
use bytemuck::{AnyBitPattern, Pod};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{MemfdFlags, SealFlags};
use rustix::net::{
    AddressFamily, RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage,
    SendFlags, SocketFlags, SocketType, recvmsg, sendmsg, socketpair,
};
use std::fs::File;
use std::io::{self, IoSlice, IoSliceMut, Write};
use std::mem::MaybeUninit;
use std::os::fd::{BorrowedFd, OwnedFd};
use std::os::unix::fs::FileExt;
use std::time::Duration;
#[cfg(test)]
use stylet_shm_schema::*;

/// The largest packet: a batch of records, or a rehearsal.
pub const MOST_BYTES: usize = 64 << 10;
/// Polling interval of the bridge, and of the host of a measurement.
pub const LOOK_EVERY: Duration = Duration::from_millis(1);
/// Interval of the bridge's heartbeat.
pub const ALIVE_EVERY: Duration = Duration::from_millis(50);
/// Length of the head: the kind, and four bytes that keep the rest aligned.
const HEAD: usize = 8;

/// A received packet.
#[derive(Debug)]
pub struct Packet {
    /// Kind of the content.
    pub kind: Kind,
    /// Descriptor that came with it.
    pub memory: Option<OwnedFd>,
    /// Bytes after its head.
    pub bytes: Vec<u8>,
}

impl Packet {
    /// Returns the bytes as one value; `None` if the length differs.
    pub fn value<T: AnyBitPattern>(&self) -> Option<T> {
        bytemuck::try_pod_read_unaligned(&self.bytes).ok()
    }

    /// Returns the bytes as values; none if they do not divide evenly.
    pub fn values<T: AnyBitPattern + Pod>(&self) -> Vec<T> {
        let whole = self.bytes.len().is_multiple_of(size_of::<T>().max(1));
        let chunks = self.bytes.chunks_exact(size_of::<T>().max(1)).filter(|_| whole);
        chunks.map(bytemuck::pod_read_unaligned).collect()
    }
}

/// One end of a connection; never blocks.
#[derive(Debug)]
pub struct Socket {
    end: OwnedFd,
    buffer: Vec<u8>,
}

/// Reason why nothing was received or sent.
#[derive(Debug)]
pub enum Closed {
    /// The other process has ended.
    Ended,
    /// The system refuses.
    Io(io::Error),
}

impl Socket {
    /// Returns both ends.
    pub fn pair() -> io::Result<(Self, OwnedFd)> {
        let flags = SocketFlags::CLOEXEC;
        let (own, other) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None)?;
        for end in [&own, &other] {
            // Larger than the default, for the initial state of a new bridge; a smaller buffer is slower, not wrong.
            let _ = rustix::net::sockopt::set_socket_send_buffer_size(end, 4 << 20);
        }
        Ok((Self::of(own), other))
    }

    /// Wraps the end given to a process.
    pub fn of(end: OwnedFd) -> Self {
        Self {
            end,
            buffer: vec![0; HEAD + MOST_BYTES],
        }
    }

    /// Waits until something arrives, at most `longest`.
    pub fn wait(&self, longest: Duration) {
        let longest = Timespec::try_from(longest).ok();
        let _ = poll(&mut [PollFd::new(&self.end, PollFlags::IN)], longest.as_ref());
    }

    /// Sends a packet whole; false if there is no room for it now.
    pub fn send(&self, kind: Kind, bytes: &[u8], memory: Option<BorrowedFd>) -> Result<bool, Closed> {
        let mut head = [0; HEAD];
        head[..4].copy_from_slice(&(kind as u32).to_ne_bytes());
        let parts = [IoSlice::new(&head), IoSlice::new(bytes)];
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut with = SendAncillaryBuffer::new(&mut space);
        let passed = memory.as_slice();
        if !passed.is_empty() {
            with.push(SendAncillaryMessage::ScmRights(passed));
        }
        loop {
            return match sendmsg(&self.end, &parts, &mut with, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
                Ok(_) => Ok(true),
                Err(rustix::io::Errno::INTR) => continue,
                Err(rustix::io::Errno::AGAIN | rustix::io::Errno::NOBUFS) => Ok(false),
                Err(rustix::io::Errno::PIPE | rustix::io::Errno::CONNRESET) => Err(Closed::Ended),
                Err(why) => Err(Closed::Io(why.into())),
            };
        }
    }

    /// Returns the next valid packet; `None` if there is none now. Packets of unknown kind are dropped.
    pub fn receive(&mut self) -> Result<Option<Packet>, Closed> {
        let mut was_reset = false;
        loop {
            let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
            let mut with = RecvAncillaryBuffer::new(&mut space);
            let flags = RecvFlags::DONTWAIT | RecvFlags::CMSG_CLOEXEC;
            let received = match recvmsg(&self.end, &mut [IoSliceMut::new(&mut self.buffer)], &mut with, flags) {
                Ok(received) => received,
                Err(rustix::io::Errno::INTR) => continue,
                Err(rustix::io::Errno::AGAIN) => return Ok(None),
                // Reported first if the other process ended with packets unread; its own packets follow.
                Err(rustix::io::Errno::CONNRESET) if !std::mem::replace(&mut was_reset, true) => continue,
                Err(rustix::io::Errno::CONNRESET) => return Err(Closed::Ended),
                Err(why) => return Err(Closed::Io(why.into())),
            };
            let mut memory = None;
            for message in with.drain() {
                if let RecvAncillaryMessage::ScmRights(descriptors) = message {
                    memory = descriptors.last();
                }
            }
            if received.bytes == 0 {
                return Err(Closed::Ended);
            }
            let bytes = self.buffer.get(..received.bytes).unwrap_or(&[]);
            if let Some(packet) = parse(bytes, memory) {
                return Ok(Some(packet));
            }
        }
    }
}

/// Parses a packet from any bytes.
pub fn parse(bytes: &[u8], memory: Option<OwnedFd>) -> Option<Packet> {
    let (head, bytes) = bytes.split_at_checked(HEAD)?;
    let kind = Kind::try_from(u32::from_ne_bytes(*head.first_chunk()?)).ok()?;
    let bytes = bytes.to_vec();
    Some(Packet { kind, memory, bytes })
}

/// Returns immutable memory that holds these values.
pub fn sealed<T: Pod>(name: &str, values: &[T]) -> io::Result<OwnedFd> {
    let memory = rustix::fs::memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    let mut file = File::from(memory);
    file.write_all(bytemuck::cast_slice(values))?;
    let memory = OwnedFd::from(file);
    rustix::fs::fcntl_add_seals(
        &memory,
        SealFlags::SHRINK | SealFlags::GROW | SealFlags::WRITE | SealFlags::SEAL,
    )?;
    Ok(memory)
}

/// Returns the values of sealed memory, at most `most` of them; fails if it could still be changed, or is not memory.
pub fn unsealed<T: Pod>(memory: OwnedFd, most: usize) -> io::Result<Vec<T>> {
    let refuse = || io::Error::from(io::ErrorKind::InvalidData);
    let is_sealed = rustix::fs::fcntl_get_seals(&memory)?.contains(SealFlags::SHRINK | SealFlags::WRITE);
    let size = usize::try_from(rustix::fs::fstat(&memory)?.st_size).map_err(|_| refuse())?;
    let count = size / size_of::<T>().max(1);
    if !is_sealed || count > most || count * size_of::<T>() != size {
        return Err(refuse());
    }
    let mut values = vec![T::zeroed(); count];
    File::from(memory).read_exact_at(bytemuck::cast_slice_mut(&mut values), 0)?;
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::AsFd;

    #[test]
    fn a_packet_arrives_with_its_memory() {
        let (own, other) = Socket::pair().expect("a socket");
        let mut other = Socket::of(other);
        let memory = sealed("test", &[1_u32, 2, 3]).expect("room");
        assert!(own.send(Kind::Scene, &[7; 5], Some(memory.as_fd())).expect("open"));
        let packet = other.receive().expect("open").expect("sent");
        assert_eq!((packet.kind, &packet.bytes[..]), (Kind::Scene, &[7; 5][..]));
        let values: Vec<u32> = unsealed(packet.memory.expect("came with it"), 3).expect("sealed");
        assert_eq!(values, [1, 2, 3]);
        assert!(other.receive().expect("open").is_none());
        drop(own);
        assert!(matches!(other.receive(), Err(Closed::Ended)));
    }

    /// The kernel reports the reset before the remaining data: the reason of a bridge's failure was lost.
    #[test]
    fn what_a_process_said_last_arrives_though_it_read_nothing() {
        let (mut own, other) = Socket::pair().expect("a socket");
        let other = Socket::of(other);
        own.send(Kind::Start, &[0; 32], None).expect("open");
        other.send(Kind::Failed, b"why", None).expect("open");
        drop(other);
        let packet = own.receive().expect("said before the end").expect("said");
        assert_eq!((packet.kind, &packet.bytes[..]), (Kind::Failed, &b"why"[..]));
        assert!(matches!(own.receive(), Err(Closed::Ended)));
    }

    #[test]
    fn a_process_that_reads_nothing_is_not_waited_for() {
        let (own, _other) = Socket::pair().expect("a socket");
        let mut sent = 0;
        while own.send(Kind::Records, &[0; 8192], None).expect("open") {
            sent += 1;
            assert!(sent < 100_000);
        }
        assert!(sent > 1);
    }

    #[test]
    fn memory_that_can_change_or_is_none_is_refused() {
        let loose = rustix::fs::memfd_create("test", MemfdFlags::ALLOW_SEALING).expect("room");
        assert!(unsealed::<u8>(loose, 10).is_err());
        assert!(unsealed::<u8>(sealed("test", &[0_u8; 11]).expect("room"), 10).is_err());
        assert!(unsealed::<u32>(sealed("test", &[0_u8; 11]).expect("room"), 10).is_err());
        assert!(unsealed::<u8>(File::open("/dev/zero").expect("there").into(), 10).is_err());
        assert!(unsealed::<u8>(Socket::pair().expect("a socket").1, 10).is_err());
    }

    /// Every payload of a kind fits into a packet.
    #[test]
    fn the_largest_payload_fits() {
        let sizes = [
            size_of::<Rehearsal>(),
            size_of::<PlanInForce>(),
            size_of::<SceneHeader>(),
            size_of::<UploadHeader>(),
            size_of::<Command>(),
            size_of::<Session>(),
        ];
        assert!(sizes.iter().all(|&size| size <= MOST_BYTES), "{sizes:?}");
    }
}

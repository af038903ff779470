//! Queue of packets for the bridge.

use std::collections::VecDeque;
use std::os::fd::{AsFd, OwnedFd};
use std::rc::Rc;
use stylet_wall::packet::{Kind, Packet, Socket};

/// A packet for the bridge: kind, bytes, and memory that goes with it.
pub type Outgoing = (Kind, Vec<u8>, Option<Rc<OwnedFd>>);

/// Packets that the bridge has not yet taken.
#[derive(Default)]
pub struct Outbox {
    pub(super) waiting: VecDeque<Outgoing>,
    pub(super) socket: Option<Socket>,
    /// The other end is closed.
    pub(super) is_closed: bool,
}

impl Outbox {
    /// Sends, or queues until there is room. Does nothing without a bridge: a new one gets the whole state.
    pub fn put(&mut self, packet: Outgoing) {
        if self.socket.is_some() {
            self.waiting.push_back(packet);
            self.flush();
        }
    }

    /// True while packets are queued.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty() || self.socket.is_none()
    }

    pub(super) fn flush(&mut self) {
        let Some(socket) = &self.socket else { return };
        while let Some((kind, bytes, memory)) = self.waiting.front() {
            match socket.send(*kind, bytes, memory.as_deref().map(AsFd::as_fd)) {
                Ok(true) => drop(self.waiting.pop_front()),
                Ok(false) => return,
                Err(_) => {
                    self.is_closed = true;
                    return;
                }
            }
        }
    }

    pub(super) fn receive(&mut self) -> Option<Packet> {
        let received = self.socket.as_mut()?.receive();
        self.is_closed |= received.is_err();
        received.ok().flatten()
    }
}

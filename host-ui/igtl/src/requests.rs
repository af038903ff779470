//! Requests from the transforms of clients, and answers from the core to clients.

use crate::codec::Status;
use crate::hand::{Hand, HandOptions, Held};
use crate::server::{Received, Server};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use stylet_host::link::{Link, LinkStatus};

/// Most requests whose answer is awaited.
const AWAITED_AT_MOST: usize = 64;
/// Time after which the link's thread has sent a request.
const SENT_AFTER: Duration = Duration::from_millis(100);

/// Requests of clients.
pub struct Requests {
    /// Hands with the needle and with the probe.
    hands: [Hand; 2],
    /// Requests that the core has not answered yet, and their clients.
    awaited: VecDeque<(u64, Received)>,
}

impl Requests {
    /// Creates requests of clients that may move needle and probe by these options, or not at all.
    pub fn new(needle: Option<HandOptions>, probe: Option<HandOptions>) -> Self {
        Self {
            hands: [Hand::new(Held::Needle, needle), Hand::new(Held::Probe, probe)],
            awaited: VecDeque::new(),
        }
    }

    /// Takes the transforms of clients, and passes on the answers of the core.
    pub fn pass(&mut self, link: &mut Link, server: &Server) {
        for received in server.received() {
            if let Err(refusal) = self.take(link, server, &received) {
                server.refuse(received.from, &received.device, refusal);
            }
        }
        for hand in &mut self.hands {
            if hand.falls_silent(Instant::now()) {
                // Without a core there is no hand to stop.
                let _ = link.send(&hand.held().stopped());
            }
        }
        self.awaited.retain(|(id, received)| match link.reply(*id) {
            Some(Err(refusal)) => {
                server.refuse(received.from, &received.device, not_ready(refusal.text));
                false
            }
            answer => answer.is_none(),
        });
    }

    /// Stops the hands when clients are no longer served.
    pub fn end(&mut self, link: &mut Link) {
        let held = self.hands.iter().filter(|hand| hand.is_held());
        let stopped = held.filter(|hand| link.send(&hand.held().stopped()).is_ok()).count();
        if stopped > 0 {
            std::thread::sleep(SENT_AFTER);
        }
    }

    fn take(&mut self, link: &mut Link, server: &Server, received: &Received) -> Result<(), Status> {
        let [needle, probe] = &mut self.hands;
        let hand = if probe.is_moved_by(&received.device) {
            probe
        } else {
            needle
        };
        // Whether or not a core answers at this moment.
        hand.agreed(&received.device)?;
        let scene = match (link.scene(), link.status()) {
            (Some(scene), LinkStatus::Live) => scene,
            (_, LinkStatus::Absent { why }) => return Err(not_ready(why)),
            _ => return Err(not_ready("rt-core is silent".to_owned())),
        };
        let patient = scene.header.patient();
        if let Some(goal) = hand.take(received, &patient, Instant::now())? {
            server.has_moved(received.from);
            let sent = link.send(&hand.held().moved(goal));
            let id = sent.map_err(|error| not_ready(error.to_string()))?;
            self.awaited.push_back((id, received.clone()));
            self.awaited.drain(..self.awaited.len().saturating_sub(AWAITED_AT_MOST));
        }
        Ok(())
    }
}

fn not_ready(words: String) -> Status {
    Status::refused(13, "Not ready", words)
}

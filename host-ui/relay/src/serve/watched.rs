//! Ports to the core of one thread, made again when they are silent: another core may have swept their folder.

use std::time::{Duration, Instant};
use stylet_shm_schema::service::{Node, ServiceError};

const SILENT: Duration = Duration::from_secs(4);
const OPEN_EVERY: Duration = Duration::from_secs(1);

/// Ports, and the node that they live on.
pub struct Watched<P> {
    ports: Option<(P, Node)>,
    tried: Option<Instant>,
    heard: Instant,
}

impl<P> Watched<P> {
    /// None yet.
    pub fn new() -> Self {
        Self {
            ports: None,
            tried: None,
            heard: Instant::now(),
        }
    }

    /// Something came through them.
    pub fn heard(&mut self) {
        self.heard = Instant::now();
    }

    /// The ports, when there are any.
    pub fn get(&mut self, make: impl FnOnce() -> Result<(P, Node), ServiceError>) -> Option<&P> {
        let now = Instant::now();
        let is_due = self.tried.is_none_or(|tried| now - tried >= OPEN_EVERY);
        if is_due && (self.ports.is_none() || now - self.heard >= SILENT) {
            (self.tried, self.ports, self.heard) = (Some(now), None, now);
            self.ports = make().ok();
        }
        self.ports.as_ref().map(|(ports, _)| ports)
    }
}

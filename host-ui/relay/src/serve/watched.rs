//! Ports of one thread to the core, recreated in each epoch.

use std::time::{Duration, Instant};
use stylet_ports::{Node, ServiceError};
use stylet_shm_schema::Instance;

const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Ports and their node.
pub struct Watched<P> {
    ports: Option<(P, Node)>,
    looked: Option<Instant>,
    had_any: bool,
}

impl<P> Watched<P> {
    /// Returns a value without ports.
    pub fn new() -> Self {
        Self {
            ports: None,
            looked: None,
            had_any: false,
        }
    }

    /// Returns the ports, if any.
    pub fn get(&mut self, instance: &Instance, make: impl FnOnce(&Node) -> Result<P, ServiceError>) -> Option<&P> {
        let now = Instant::now();
        if self.looked.is_none_or(|looked| now - looked >= LOOK_EVERY) {
            self.looked = Some(now);
            // Ports of a past epoch are dropped before new ones are made.
            self.ports = self.ports.take().filter(|(_, node)| node.is_current());
            if self.ports.is_none() {
                self.ports = self.open(instance, make).ok();
                self.had_any |= self.ports.is_some();
            }
        }
        self.ports.as_ref().map(|(ports, _)| ports)
    }

    fn open(
        &self,
        instance: &Instance,
        make: impl FnOnce(&Node) -> Result<P, ServiceError>,
    ) -> Result<(P, Node), ServiceError> {
        let node = match self.had_any {
            true => Node::join_again(instance),
            false => Node::join(instance),
        }?;
        Ok((make(&node)?, node))
    }
}

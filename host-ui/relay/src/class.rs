//! The class list for hosts of this machine, and their requests for the lease.

use crate::control::Order;
use stylet_ports::{self as service, Node, Publisher, ServiceError, Subscriber};
use stylet_shm_schema::{Class, LeaseOrder, LeaseRequest};

/// Ports of the class; every relay has them, whether next to a core or replacing one.
pub struct ClassPorts {
    class: Publisher<Class>,
    orders: Subscriber<LeaseOrder>,
}

impl ClassPorts {
    /// Opens the ports on a node of the instance.
    pub fn new(node: &Node) -> Result<Self, ServiceError> {
        Ok(Self {
            class: service::class::publisher(node)?,
            orders: service::lease::subscriber(node)?,
        })
    }

    /// Connects new hosts and drops those that left.
    pub fn connect(&self) {
        self.class.connect();
    }

    /// Publishes the class to hosts.
    pub fn show(&self, class: Class) {
        let _ = self.class.send(class);
    }

    /// Returns a host's order; invalid ones are dropped.
    pub fn order(&self) -> Option<Order> {
        loop {
            let order = self.orders.receive()?;
            if let Ok(request) = LeaseRequest::decode(&order) {
                return Some(match request {
                    LeaseRequest::Take => Order::Take,
                    LeaseRequest::Release => Order::Release,
                    LeaseRequest::Give(name) => Order::Give(name),
                });
            }
        }
    }
}

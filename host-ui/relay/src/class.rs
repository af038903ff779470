//! The class list for hosts of this machine, and their requests for the lease.

use crate::control::Order;
use crate::wire::Who;
use bytemuck::Zeroable;
use stylet_ports::{self as service, Node, Publisher, ServiceError, Subscriber};
use stylet_shm_schema::{Class, ClassMember, LeaseOrder, LeaseRequest, MAX_CLASS, Text};

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
    pub fn show(&self, who: &Who, session_id: u64, is_beside_core: bool) {
        let _ = self.class.send(class(who, session_id, is_beside_core));
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

fn class(who: &Who, session_id: u64, is_beside_core: bool) -> Class {
    let mut class = Class {
        session_id,
        count: who.present.len().min(MAX_CLASS) as u32,
        unlisted: who.present.len().saturating_sub(MAX_CLASS) as u32,
        local_operates: u32::from(who.local),
        is_beside_core: u32::from(is_beside_core),
        operator: Text::new(who.operator.as_deref().unwrap_or_default()),
        asked: Text::new(who.asked.as_deref().unwrap_or_default()),
        ..Class::zeroed()
    };
    for (to, from) in class.members.iter_mut().zip(&who.present) {
        *to = ClassMember {
            name: Text::new(&from.name),
            role: Text::new(&from.role.map_or_else(String::new, |role| role.to_string())),
            round_trip_ns: ns(from.round_trip_ms),
            records_lost: from.lost,
            silent_ns: ns(from.silent_ms),
        };
    }
    class
}

/// Converts ms to ns; a value that is not a number gives 0.
fn ns(ms: f64) -> u64 {
    (ms * 1e6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::Role;
    use crate::wire::Present;

    #[test]
    fn a_class_that_is_larger_than_the_list_says_how_many_more_there_are() {
        let present = |n: usize| Present {
            name: format!("student {n}"),
            role: (n != 1).then_some(Role::Observer),
            round_trip_ms: 1.5,
            ..Present::default()
        };
        let who = Who {
            operator: Some("Otto".to_owned()),
            present: (0..40).map(present).collect(),
            ..Who::default()
        };
        let class = class(&who, 3, true);
        assert_eq!(
            (class.members().len(), class.unlisted),
            (MAX_CLASS, 40 - MAX_CLASS as u32)
        );
        let [first, revoked] = [class.members[0], class.members[1]];
        assert_eq!(
            (first.name.read().as_str(), first.role.read().as_str()),
            ("student 0", "observer")
        );
        assert_eq!((first.round_trip_ns, revoked.role.read().as_str()), (1_500_000, ""));
    }
}

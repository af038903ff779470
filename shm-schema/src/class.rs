//! Members connected to a core through its relay, and requests of hosts for the needle's lease.

use crate::Text;
use crate::check::Invalid;
use bytemuck::{Pod, Zeroable};

/// Most members listed.
pub const MAX_CLASS: usize = 32;

/// One connected member.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ClassMember {
    /// Name for people.
    pub name: Text<64>,
    /// Role of the member, in one word; empty for a revoked member.
    pub role: Text<16>,
    /// Round trip to the server.
    pub round_trip_ns: u64,
    /// Records that the member lost for good.
    pub records_lost: u64,
    /// Time since the server last heard the member.
    pub silent_ns: u64,
}

/// The class, published five times a second by a relay, whether it runs next to a core or replaces one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Class {
    /// The run of the core, as announced here.
    pub session_id: u64,
    /// Members in `members`.
    pub count: u32,
    /// Members beyond those listed.
    pub unlisted: u32,
    /// 1 if a host on the core's machine operates.
    pub local_operates: u32,
    /// 1 if this list is that of the machine with the core.
    pub is_beside_core: u32,
    /// Name of the operator; empty for none.
    pub operator: Text<64>,
    /// Name of the member who asked to operate and does not; empty for none.
    pub asked: Text<64>,
    /// Connected members.
    pub members: [ClassMember; MAX_CLASS],
}

impl Class {
    /// Returns the connected members.
    pub fn members(&self) -> &[ClassMember] {
        &self.members[..MAX_CLASS.min(self.count as usize)]
    }
}

/// A host's request for the lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LeaseRequest {
    /// To operate from here.
    Take,
    /// To stop operating from here.
    Release,
    /// To let the member of this name operate.
    Give(String),
}

/// A [`LeaseRequest`] as plain old data, from a host to the relay of its machine. It has no reply: [`Class`] shows the
/// result.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LeaseOrder {
    kind: u64,
    name: Text<64>,
}

impl LeaseRequest {
    /// Encodes as plain old data; a name is truncated to fit.
    pub fn encode(&self) -> LeaseOrder {
        let (kind, name) = match self {
            Self::Take => (1, ""),
            Self::Release => (2, ""),
            Self::Give(name) => (3, name.as_str()),
        };
        LeaseOrder {
            kind,
            name: Text::new(name),
        }
    }

    /// Decodes the request of a host.
    pub fn decode(order: &LeaseOrder) -> Result<Self, Invalid> {
        match order.kind {
            1 => Ok(Self::Take),
            2 => Ok(Self::Release),
            3 => Ok(Self::Give(order.name.read())),
            _ => Err(Invalid("order of the lease")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lease_requests_survive_and_member_counts_are_clamped() {
        for request in [
            LeaseRequest::Take,
            LeaseRequest::Release,
            LeaseRequest::Give("Dr. B".to_owned()),
        ] {
            assert_eq!(LeaseRequest::decode(&request.encode()), Ok(request));
        }
        assert!(LeaseRequest::decode(&LeaseOrder::zeroed()).is_err());
        let class = Class {
            count: u32::MAX,
            ..Class::zeroed()
        };
        assert_eq!(class.members().len(), MAX_CLASS);
    }
}

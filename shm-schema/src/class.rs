//! Who is connected to a core over its relay, and what a host asks of the needle's lease.

use crate::Text;
use crate::check::Invalid;
use bytemuck::{Pod, Zeroable};

/// Members that are listed at most.
pub const MAX_CLASS: usize = 32;

/// One member that is connected.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ClassMember {
    /// Name for people.
    pub name: Text<64>,
    /// What the member may do, in one word; empty for one who was revoked.
    pub role: Text<16>,
    /// Round trip to the server.
    pub round_trip_ns: u64,
    /// Records that the member lost for good.
    pub records_lost: u64,
    /// Since the server heard the member last.
    pub silent_ns: u64,
}

/// The class, published five times a second by a relay, beside a core as well as in place of one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Class {
    /// The run of the core, as it is announced here.
    pub session_id: u64,
    /// Members in `members`.
    pub count: u32,
    /// Members beyond those.
    pub unlisted: u32,
    /// 1 where a host beside the core operates.
    pub local_operates: u32,
    /// 1 where this list is that of the machine with the core.
    pub is_beside_core: u32,
    /// Name of who operates; empty for nobody.
    pub operator: Text<64>,
    /// Name of who asked to operate and does not; empty for nobody.
    pub asked: Text<64>,
    /// Those who are connected.
    pub members: [ClassMember; MAX_CLASS],
}

impl Class {
    /// Those who are connected.
    pub fn members(&self) -> &[ClassMember] {
        &self.members[..MAX_CLASS.min(self.count as usize)]
    }
}

/// What a host asks of the lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LeaseRequest {
    /// To operate from here.
    Take,
    /// Not to operate from here any more.
    Release,
    /// That the member of this name operates.
    Give(String),
}

/// A [`LeaseRequest`] as plain old data, from a host to the relay of its machine. It has no reply: [`Class`] shows what came of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LeaseOrder {
    kind: u64,
    name: Text<64>,
}

impl LeaseRequest {
    /// As plain old data; a name is cut to what fits.
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

    /// What a host asked.
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
    fn requests_of_the_lease_survive_and_a_count_of_others_lists_no_more_than_there_are() {
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

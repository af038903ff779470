//! Small control payloads of both sides of the relay: signs of life, missing records, members.

use crate::keys::Role;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use stylet_shm_schema::check::Invalid;

/// A member's sign of life, twenty times a second.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Hello {
    /// Changes after each silence: the whole state is then sent again.
    pub epoch: u64,
    /// The scene that the member has: run of the core.
    pub scene_session: u64,
    /// The scene that the member has: its generation.
    pub scene_generation: u64,
    /// Round trip as measured by the member.
    pub round_trip_ns: u64,
    /// Records that the member lost for good.
    pub lost: u64,
}

/// Ticks of one run of the core, first to last inclusive.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Ticks {
    /// The run of the core.
    pub session_id: u64,
    /// First tick.
    pub from: u64,
    /// Last tick.
    pub to: u64,
}

/// One connected member.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Present {
    /// Name for people.
    pub name: String,
    /// Its role; `None` for a member no longer in the list.
    pub role: Option<Role>,
    /// Round trip, ms.
    pub round_trip_ms: f64,
    /// Records that it lost for good.
    pub lost: u64,
    /// Time since it was last heard, ms.
    pub silent_ms: f64,
}

/// Connected members and the operator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Who {
    /// Name of the operator; "the window beside the core", or `None`.
    pub operator: Option<String>,
    /// The operator is a host next to the core.
    #[serde(default)]
    pub local: bool,
    /// Name of the member who asked to operate.
    pub asked: Option<String>,
    /// All connected members.
    pub present: Vec<Present>,
}

impl Who {
    /// Encodes as JSON.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Decodes JSON of bounded size.
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, Invalid> {
        const MOST: usize = 128 << 10;
        match bytes.len() <= MOST {
            true => serde_json::from_slice(bytes).map_err(|_| Invalid("list of members")),
            false => Err(Invalid("list of members")),
        }
    }

    /// Formats for a terminal, one line per member.
    pub fn words(&self) -> String {
        let mut lines = vec![format!("operates: {}", self.operator.as_deref().unwrap_or("nobody"))];
        lines.extend(self.asked.as_ref().map(|name| format!("asks to operate: {name}")));
        lines.extend(self.present.iter().map(|p| {
            let role = p.role.map_or("revoked".to_owned(), |role| role.to_string());
            format!(
                "{} ({role}): round trip {:.1} ms, {} records lost, heard {:.0} ms ago",
                p.name, p.round_trip_ms, p.lost, p.silent_ms
            )
        }));
        lines.join("\n")
    }
}

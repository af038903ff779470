//! The small payloads by which the two sides of the relay keep each other: who is alive, what is missing, who is there.

use crate::keys::Role;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use stylet_shm_schema::check::Invalid;

/// A member is alive, twenty times a second.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Hello {
    /// Another number after each silence: everything that is in force is sent again.
    pub epoch: u64,
    /// The scene that the member has: run of the core.
    pub scene_session: u64,
    /// The scene that the member has: its generation.
    pub scene_generation: u64,
    /// Round trip as the member measures it.
    pub round_trip_ns: u64,
    /// Records that the member lost for good.
    pub lost: u64,
}

/// Ticks of one run of the core, from the first to the last.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Ticks {
    /// The run of the core.
    pub session_id: u64,
    /// The first.
    pub from: u64,
    /// The last.
    pub to: u64,
}

/// One member that is connected.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Present {
    /// Name for people.
    pub name: String,
    /// Its role; none for one that is not in the list any more.
    pub role: Option<Role>,
    /// Round trip, ms.
    pub round_trip_ms: f64,
    /// Records that it lost for good.
    pub lost: u64,
    /// Since it was heard last, ms.
    pub silent_ms: f64,
}

/// Who is connected and who operates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Who {
    /// Name of who operates; "the window beside the core", or nobody.
    pub operator: Option<String>,
    /// Whether that is a host beside the core.
    #[serde(default)]
    pub local: bool,
    /// Name of who asked to operate.
    pub asked: Option<String>,
    /// Everybody who is connected.
    pub present: Vec<Present>,
}

impl Who {
    /// As JSON.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// From JSON of bounded size.
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, Invalid> {
        const MOST: usize = 128 << 10;
        match bytes.len() <= MOST {
            true => serde_json::from_slice(bytes).map_err(|_| Invalid("list of members")),
            false => Err(Invalid("list of members")),
        }
    }

    /// For a terminal, a line each.
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

//! State of the connection to the server, as shown to hosts here.

use super::{Member, Options};
use crate::now_ns;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use stylet_shm_schema::{Class, Relayed, Text};

const EVERY: Duration = Duration::from_millis(200);

/// This member, its server, and the time of the last report to hosts.
pub(super) struct Line {
    /// The run of the core, as announced to hosts here.
    pub session_id: u64,
    server: String,
    name: String,
    role: String,
    said: Option<Instant>,
}

impl Line {
    pub fn new(options: &Options) -> Self {
        Self {
            session_id: 0,
            server: options.server.clone(),
            name: options.invitation.name.clone(),
            role: options.invitation.role.to_string(),
            said: None,
        }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the report for hosts, five times a second.
    pub fn due(&mut self, member: &Member, class: &Class, is_heard: bool, round_trip_ns: u64) -> Option<Relayed> {
        if self.said.is_some_and(|said| said.elapsed() < EVERY) {
            return None;
        }
        self.said = Some(Instant::now());
        let made_ns = match member.snapshot_made_ns.load(Ordering::Relaxed) {
            0 => now_ns(),
            made_ns => made_ns,
        };
        let name = Text::new(&self.name);
        Some(Relayed {
            session_id: self.session_id,
            round_trip_ns,
            snapshot_age_ns: now_ns().saturating_sub(made_ns),
            records_lost: member.lost.load(Ordering::Relaxed),
            snapshots_lost: member.snapshots_lost.load(Ordering::Relaxed),
            is_heard: u32::from(is_heard),
            operates: u32::from(is_heard && class.operator == name),
            server: Text::new(&self.server),
            name,
            operator: class.operator,
            role: Text::new(&self.role),
        })
    }
}

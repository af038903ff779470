//! Share and speed of migrating seeds: settings of the tissue loop's law (docs/physics.md, *Seeds that migrate*).

use serde::{Deserialize, Serialize};

/// Off with a share of 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Migration {
    /// Share of the loose seeds that migrate.
    pub share: f64,
    /// Speed along the track to its entry.
    pub speed_m_per_s: f64,
}

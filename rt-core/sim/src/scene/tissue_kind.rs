//! Which tissue model a scene takes.

use serde::{Deserialize, Serialize};

/// The tissue models that a scene can choose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum TissueKind {
    /// Restricted ChainMail.
    #[default]
    ChainMail,
    /// Linear elastic finite elements.
    Fem,
}

impl TissueKind {
    /// In the order of the help.
    pub const ALL: [Self; 2] = [Self::ChainMail, Self::Fem];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            TissueKind::ChainMail => "chainmail",
            TissueKind::Fem => "fem",
        }
    }

    /// What it is good for, in one line.
    pub fn help(self) -> &'static str {
        match self {
            TissueKind::ChainMail => "Restricted ChainMail: microseconds a tick, limits that always hold, no forces",
            TissueKind::Fem => {
                "Linear elastic finite elements: displacements and forces of the material; a body of more than 60,000 elements is solved in larger ones"
            }
        }
    }

    /// The model of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// A body of more elements is made coarser. FEM: a tick of 200 Hz and some seconds for a needle's line allow no more.
    pub fn most_elements(self) -> usize {
        match self {
            TissueKind::ChainMail => usize::MAX,
            TissueKind::Fem => 60_000,
        }
    }

    /// Edge of the tissue that moves as one piece with the tip. FEM needs one: the force on a single node goes to
    /// zero with the spacing.
    pub fn tip_patch_m(self) -> f64 {
        match self {
            TissueKind::ChainMail => 0.0,
            TissueKind::Fem => 4e-3,
        }
    }

    /// Whether `TissueModel::prepare` does anything: only then need the loop look where the tip goes.
    pub fn prepares(self) -> bool {
        match self {
            TissueKind::ChainMail => false,
            TissueKind::Fem => true,
        }
    }
}

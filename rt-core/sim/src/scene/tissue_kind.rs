//! Tissue model of a scene.

use serde::{Deserialize, Serialize};

/// The tissue models that a scene can choose.
// Flight recordings know them by their place: new ones go to the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum TissueKind {
    /// Restricted ChainMail around a needle that slips by force, on a body that shifts as a whole.
    #[default]
    ChainMail,
    /// Linear elastic finite elements.
    Fem,
    /// Restricted ChainMail around a needle that slips by speed: the paper as printed, eq. 6.
    Paper,
}

impl TissueKind {
    /// Kinds in the order of the help.
    pub const ALL: [Self; 3] = [Self::ChainMail, Self::Fem, Self::Paper];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            TissueKind::ChainMail => "chainmail",
            TissueKind::Fem => "fem",
            TissueKind::Paper => "paper",
        }
    }

    /// Returns its purpose, in one line.
    pub fn help(self) -> &'static str {
        match self {
            TissueKind::ChainMail => {
                "Restricted ChainMail: microseconds a tick; the needle slips by force, and a needle's line is ready within a second"
            }
            TissueKind::Fem => {
                "Linear elastic finite elements: displacements and forces of the material; a needle's line takes seconds, and a body of more than 60,000 elements is solved in larger ones"
            }
            TissueKind::Paper => {
                "Restricted ChainMail as the paper prints it: the needle slips by speed (eq. 6), so slow needles misplace seeds by centimetres"
            }
        }
    }

    /// Returns the model of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

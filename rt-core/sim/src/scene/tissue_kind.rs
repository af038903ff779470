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

    /// Returns the number of elements above which a body is made coarser. FEM: a tick of 200 Hz and some seconds for a
    /// needle's line allow no more.
    pub fn most_elements(self) -> usize {
        match self {
            TissueKind::ChainMail | TissueKind::Paper => usize::MAX,
            TissueKind::Fem => 60_000,
        }
    }

    /// Needles go along lines, which are solved for in a body of at most so many elements; `None` where they slip by
    /// speed. ChainMail takes no more of the answer than how the line moves, and how the body is carried by it.
    pub fn most_line_elements(self) -> Option<usize> {
        match self {
            TissueKind::ChainMail => Some(8_000),
            TissueKind::Fem => Some(self.most_elements()),
            TissueKind::Paper => None,
        }
    }

    /// Returns whether needles go along lines.
    pub fn has_lines(self) -> bool {
        self.most_line_elements().is_some()
    }

    /// Returns whether the tissue answers a line's loads by the sum of its columns.
    pub fn adds_columns(self) -> bool {
        self == TissueKind::Fem
    }

    /// Returns the edge of the tissue that moves as one piece with the tip. FEM needs one: the force on a single node
    /// goes to zero with the spacing.
    pub fn tip_patch_m(self) -> f64 {
        match self {
            TissueKind::ChainMail | TissueKind::Paper => 0.0,
            TissueKind::Fem => 4e-3,
        }
    }

    /// Returns whether `TissueModel::prepare` does anything: only then need the loop predict where the tip goes.
    pub fn prepares(self) -> bool {
        self == TissueKind::Fem
    }
}

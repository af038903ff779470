//! Which tissue model a scene takes.

/// The tissue models that a scene can choose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum TissueKind {
    /// Restricted ChainMail: microseconds a tick, limits that always hold, no forces
    #[default]
    #[value(name = "chainmail")]
    ChainMail,
    /// Linear elastic finite elements: displacements and forces of the material, for bodies of up to 20,000 elements
    Fem,
}

impl TissueKind {
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

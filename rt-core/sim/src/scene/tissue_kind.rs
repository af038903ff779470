//! Tissue model of a scene.

use serde::{Deserialize, Serialize};

/// Makes the kinds from their rows: variant, name on the command line, purpose.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident $name:literal $help:literal;)+) => {
        /// The tissue models that a scene can choose.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub enum TissueKind {
            $($(#[$doc])* $kind,)+
        }

        impl TissueKind {
            /// Kinds in the order of the help.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$kind),+];

            /// Returns the name on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)+
                }
            }

            /// Returns its purpose, in one line.
            pub fn help(self) -> &'static str {
                match self {
                    $(Self::$kind => $help,)+
                }
            }
        }
    };
}

// Flight recordings know the kinds by their place: new ones go to the end.
kinds! {
    /// Restricted ChainMail around a needle that slips by force, on a body that shifts as a whole.
    #[default]
    ChainMail "chainmail" "Restricted ChainMail: microseconds a tick; the needle slips by force, and a needle's line is ready within a second";
    /// Linear elastic finite elements.
    Fem "fem" "Linear elastic finite elements: displacements and forces of the material; a needle's line takes seconds, and a body of more than 60,000 elements is solved in larger ones";
    /// Restricted ChainMail around a needle that slips by speed: the paper as printed, eq. 6.
    Paper "paper" "Restricted ChainMail as the paper prints it: the needle slips by speed (eq. 6), so slow needles misplace seeds by centimetres";
}

impl TissueKind {
    /// Returns the model of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

//! Published measurements in patients and phantoms, for comparison.

/// One published value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Distribution of the page in which it is drawn; if empty, it is in the table only.
    pub shown_in: &'static str,
    /// Measured quantity.
    pub what: &'static str,
    /// Mean or median, as `how` states.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// Statistic, range and sample.
    pub how: &'static str,
    /// Source.
    pub source: &'static str,
    /// Use of the value.
    pub used: Use,
    /// Reason why it is comparable or not.
    pub note: &'static str,
}

/// Relation of a published value to the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// A parameter was fitted to it or set by it, so agreement proves nothing.
    Fitted,
    /// No parameter was fitted to it, so it is a check.
    Check,
    /// Related to the simulation: another organ, needle, or cause.
    Context,
}

impl Use {
    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Use::Fitted => "fitted",
            Use::Check => "check",
            Use::Context => "context",
        }
    }
}

/// Values with their sources. Those marked as unverified were not compared with the publication.
pub const PUBLISHED: &[Published] = &[
    Published {
        shown_in: "Seed misplacement",
        what: "seed misplacement",
        value: 4.9,
        unit: "mm",
        how: "mean, 0 to 20; 1,197 seeds",
        source: "University of Alberta",
        used: Use::Fitted,
        note: "patients; all causes together, swelling and needle deflection among them. Mean speed had no significant effect (p = .47).",
    },
    Published {
        shown_in: "Seed misplacement",
        what: "targeting error, transperineal in MRI",
        value: 6.3,
        unit: "mm",
        how: "median; 188 insertions",
        source: "Moreira 2018",
        used: Use::Check,
        note: "patients; biopsy needles, skin contact was the main cause.",
    },
    Published {
        shown_in: "Shift of the gland",
        what: "shift of the base",
        value: 15.0,
        unit: "mm",
        how: "median, 0 to 30; 19 patients",
        source: "PMID 15090279",
        used: Use::Check,
        note: "patients; with all 16 needles in. Here each needle begins with tissue at rest.",
    },
    Published {
        shown_in: "",
        what: "deformation in the plane, all needles in",
        value: 6.8,
        unit: "mm",
        how: "19 patients",
        source: "PMID 15090279",
        used: Use::Context,
        note: "patients; across the needles, and with all of them in.",
    },
    Published {
        shown_in: "Shift of the gland",
        what: "shift, needle pushed by hand",
        value: 5.6,
        unit: "mm",
        how: "0.3 to 21.6; tapped 0.9, 0 to 2",
        source: "Lagerburg 2006",
        used: Use::Check,
        note: "unverified: not compared with the publication. A tapped needle is not simulated. Here the largest shift of the middle of the gland in an insertion; what surrounds the body has no spread.",
    },
    Published {
        shown_in: "",
        what: "shift, pushed and by a fast pneumatic tool",
        value: 20.0,
        unit: "mm",
        how: "largest; pneumatic 1 mm",
        source: "McLaughlin, AAPM 2022",
        used: Use::Context,
        note: "phantom.",
    },
    Published {
        shown_in: "",
        what: "rotation of the gland",
        value: 14.0,
        unit: "degrees",
        how: "largest",
        source: "Lagerburg 2005",
        used: Use::Context,
        note: "unverified: not compared with the publication. The study keeps no rotation.",
    },
    Published {
        shown_in: "Largest displacement of tissue",
        what: "displacement of the target, biopsy",
        value: 6.3,
        unit: "mm",
        how: "means of 6.0 to 6.6, their middle is drawn",
        source: "Schouten 2012",
        used: Use::Check,
        note: "patients; one needle.",
    },
    Published {
        shown_in: "Peak force on the hand",
        what: "force of an 18 G needle",
        value: 8.9,
        unit: "N",
        how: "mean",
        source: "Podder 2006",
        used: Use::Fitted,
        note: "patients; unverified: the layer it belongs to was not compared with the publication. The skin of `pelvis` gives way at 9 N by it, and `paper` has no skin. A hand feels 0.9 of the needle's force (force.scale).",
    },
    Published {
        shown_in: "",
        what: "force of a 17 G needle",
        value: 15.6,
        unit: "N",
        how: "mean",
        source: "Podder 2006",
        used: Use::Context,
        note: "patients; a thicker needle than the simulator's. Unverified as the one of 18 G.",
    },
    Published {
        shown_in: "",
        what: "friction of a shaft in liver",
        value: 14.0,
        unit: "N/m",
        how: "10 to 18, their middle; cutting 0.94 N",
        source: "Okamura 2004",
        used: Use::Context,
        note: "another organ, without a capsule; unverified. The gland of the simulator has 80 N/m.",
    },
    Published {
        shown_in: "",
        what: "odds that a deviation goes with anatomy",
        value: 10.9,
        unit: "(ratio)",
        how: "231 insertions; orientation of the bevel not significant",
        source: "Ma 2025",
        used: Use::Context,
        note: "patients.",
    },
    Published {
        shown_in: "",
        what: "swelling in the theatre",
        value: 4.5,
        unit: "cc",
        how: "of 37.4 cc; 149 patients",
        source: "PMC3720214",
        used: Use::Context,
        note: "patients; not simulated: volumes stay as they are.",
    },
    Published {
        shown_in: "",
        what: "seeds that migrate away",
        value: 0.47,
        unit: "%",
        how: "of 19,236 seeds",
        source: "1748-717X-6-130",
        used: Use::Context,
        note: "patients; over weeks, not during the insertion.",
    },
    Published {
        shown_in: "",
        what: "finite elements against a phantom",
        value: 0.36,
        unit: "mm",
        how: "indentation; tip 0.14 mm",
        source: "Moreira 2013",
        used: Use::Context,
        note: "phantom; what a model with known materials can reach.",
    },
    Published {
        shown_in: "",
        what: "deflection of the tip, transrectal",
        value: 1.77,
        unit: "mm",
        how: "median, 1.35 to 2.47",
        source: "Halstuch 2018",
        used: Use::Context,
        note: "not simulated: the needle of the simulator is straight.",
    },
    Published {
        shown_in: "",
        what: "18 G needle in gelatin",
        value: 0.9,
        unit: "mm",
        how: "0.3 to 1.3",
        source: "PMID 27708117",
        used: Use::Context,
        note: "phantom; error of the needle alone.",
    },
];

/// Returns the values that are drawn in one distribution.
pub fn published_in(name: &str) -> impl Iterator<Item = &'static Published> {
    PUBLISHED.iter().filter(move |p| p.shown_in == name)
}

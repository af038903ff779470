//! What was measured in patients and phantoms, for comparison.

/// One published value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Distribution of the page that it is drawn in; empty: in the table alone.
    pub beside: &'static str,
    /// What was measured.
    pub what: &'static str,
    /// Mean or median, as the text says.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// Which statistic, range, and of how many.
    pub how: &'static str,
    /// Source.
    pub source: &'static str,
    /// What makes it comparable or not.
    pub note: &'static str,
}

/// Values with their sources. Those marked as unverified were not compared with the publication.
pub const PUBLISHED: &[Published] = &[
    Published {
        beside: "Seed misplacement",
        what: "seed misplacement",
        value: 4.9,
        unit: "mm",
        how: "mean, 0 to 20; 1,197 seeds",
        source: "University of Alberta",
        note: "patients; all causes together, swelling and needle deflection among them. Mean speed had no significant effect (p = .47).",
    },
    Published {
        beside: "Seed misplacement",
        what: "targeting error, transperineal in MRI",
        value: 6.3,
        unit: "mm",
        how: "median; 188 insertions",
        source: "Moreira 2018",
        note: "patients; biopsy needles, skin contact was the main cause.",
    },
    Published {
        beside: "Shift of the gland",
        what: "shift of the base",
        value: 15.0,
        unit: "mm",
        how: "median, 0 to 30; 19 patients",
        source: "PMID 15090279",
        note: "patients; with all 16 needles in. Here each needle begins with tissue at rest.",
    },
    Published {
        beside: "Largest displacement of tissue",
        what: "displacement of the target, biopsy",
        value: 6.3,
        unit: "mm",
        how: "means of 6.0 to 6.6, their middle is drawn",
        source: "Schouten 2012",
        note: "patients; one needle.",
    },
    Published {
        beside: "Peak force on the hand",
        what: "force of an 18 G needle",
        value: 8.9,
        unit: "N",
        how: "mean",
        source: "Podder 2006",
        note: "patients; unverified: the layer it belongs to was not compared with the publication. The skin is part of `pelvis` alone.",
    },
    Published {
        beside: "",
        what: "deflection of the tip, transrectal",
        value: 1.77,
        unit: "mm",
        how: "median, 1.35 to 2.47",
        source: "Halstuch 2018",
        note: "not simulated: the needle of the simulator is straight.",
    },
    Published {
        beside: "",
        what: "18 G needle in gelatin",
        value: 0.9,
        unit: "mm",
        how: "0.3 to 1.3",
        source: "PMID 27708117",
        note: "phantom; error of the needle alone.",
    },
];

/// Those that are drawn in one distribution.
pub fn beside(name: &str) -> impl Iterator<Item = &'static Published> {
    PUBLISHED.iter().filter(move |p| p.beside == name)
}

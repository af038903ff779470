//! Nuclides in the spellings that files use: I-125, 125I, Iodine 125.

/// Isotope: chemical symbol in lower case, and mass number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nuclide {
    symbol: String,
    mass: u16,
}

/// Names that are written instead of the symbol.
const NAMES: [(&str, &str); 10] = [
    ("iodine", "i"),
    ("iod", "i"),
    ("jod", "i"),
    ("palladium", "pd"),
    ("cesium", "cs"),
    ("caesium", "cs"),
    ("iridium", "ir"),
    ("gold", "au"),
    ("cobalt", "co"),
    ("ytterbium", "yb"),
];
/// Nuclides of permanent implants.
const PERMANENT: [(&str, u16); 4] = [("i", 125), ("pd", 103), ("cs", 131), ("au", 198)];

impl Nuclide {
    /// Reads letters and one number, in any order and with anything between them; `None` for
    /// anything else.
    ///
    /// ```
    /// use stylet_base::nuclide::Nuclide;
    /// assert_eq!(Nuclide::parse("Iodine-125"), Nuclide::parse("125I"));
    /// assert_ne!(Nuclide::parse("I-125"), Nuclide::parse("Pd-103"));
    /// assert_eq!(Nuclide::parse("seed"), None);
    /// ```
    pub fn parse(text: &str) -> Option<Self> {
        let letters: String = text.chars().filter(char::is_ascii_alphabetic).collect();
        let digits: String = text.chars().filter(char::is_ascii_digit).collect();
        let letters = letters.to_ascii_lowercase();
        let named = NAMES.iter().find(|(name, _)| *name == letters);
        let symbol = named.map_or(letters.as_str(), |(_, symbol)| symbol);
        let mass = digits.parse().ok().filter(|mass| (1..=300).contains(mass))?;
        (1..=2).contains(&symbol.len()).then(|| Self {
            symbol: symbol.to_owned(),
            mass,
        })
    }

    /// Returns whether its seeds are permanent; sources of other nuclides are removed again.
    pub fn is_of_permanent_seeds(&self) -> bool {
        PERMANENT.contains(&(self.symbol.as_str(), self.mass))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_nuclide_has_many_spellings_and_two_have_none_in_common() {
        for text in [
            "I-125",
            "i125",
            "125I",
            "125-I",
            "I 125",
            "IODINE-125",
            "Iod-125",
            " I_125 ",
        ] {
            assert_eq!(Nuclide::parse(text), Nuclide::parse("I-125"), "{text}");
        }
        let all = ["I-125", "I-131", "Pd-103", "Cs-131", "Ir-192", "Cs-137"].map(|t| Nuclide::parse(t).unwrap());
        for (i, one) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|other| other != one));
        }
        for text in ["", "125", "I", "seed 125", "I-125 Pd-103", "I-0", "I-99999"] {
            assert_eq!(Nuclide::parse(text), None, "{text}");
        }
        assert!(Nuclide::parse("103Pd").unwrap().is_of_permanent_seeds());
        assert!(!Nuclide::parse("Ir-192").unwrap().is_of_permanent_seeds());
    }
}

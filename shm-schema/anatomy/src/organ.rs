//! Classifies structures by name: names of TG-263, and common variants.

use crate::tissue::{Material, Role};

/// An organ, or a volume drawn for the treatment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Organ {
    /// PTV, CTV, GTV or ITV.
    TargetVolume,
    /// Bed of the removed prostate.
    ProstateBed,
    /// The prostate.
    Prostate,
    /// A seminal vesicle.
    SeminalVesicle,
    /// The urethra.
    Urethra,
    /// The rectum as a whole.
    Rectum,
    /// The wall of the rectum, or another part of it.
    RectalWall,
    /// The urinary bladder.
    Bladder,
    /// Bowel, penile bulb, anal canal, neurovascular bundles.
    OtherAtRisk,
    /// The pelvis or another bone.
    Bone,
    /// Fat.
    Fat,
    /// The perineum.
    Perineum,
    /// Skin.
    Skin,
    /// Muscle, and everything else around the organs.
    Surroundings,
}

/// Names of one organ, and its properties.
struct Row {
    organ: Organ,
    /// Prefixes of the name, lower case, letters and digits only.
    names: &'static str,
    /// Words that may occur anywhere in the name.
    words: &'static str,
    role: Role,
    material: Material,
}

const fn row(organ: Organ, names: &'static str, words: &'static str, role: Role, material: Material) -> Row {
    Row {
        organ,
        names,
        words,
        role,
        material,
    }
}

const PROSTATE: &str = "prostate prostata prostaat prosztata eturauhanen gland";
const URETHRA: &str = "urethra uretra uretre harnrohre";
const AT_RISK: &str = "penilebulb bowel colonsigmoid sigmoid analcanal canalanal nvb neurovascular";
const BONE: &str = "bone femur pubic symphys pelvis sacrum";

/// A longer name comes before its prefix.
const TABLE: [Row; 14] = {
    use Material as M;
    use Organ as O;
    use Role::{Spare, Target, Tissue};
    [
        row(O::TargetVolume, "ptv ctv gtv itv", "", Target, M::GLAND),
        row(O::ProstateBed, "prostatebed prostatabett", "", Target, M::GLAND),
        row(O::Prostate, PROSTATE, "", Target, M::GLAND),
        row(O::SeminalVesicle, "semvesicle seminalves", "", Tissue, M::GLAND),
        row(O::Urethra, URETHRA, URETHRA, Spare, M::URETHRA),
        row(
            O::Rectum,
            "rectum anorectum wallrectum rektum",
            "rectum rektum",
            Spare,
            M::WALL,
        ),
        row(O::RectalWall, "rectalwall", "rect rekt", Spare, M::WALL),
        row(O::Bladder, "bladder", "bladder", Spare, M::WALL),
        row(O::OtherAtRisk, AT_RISK, "", Spare, M::OTHER),
        row(O::Bone, BONE, "arch bone", Tissue, M::BONE),
        row(O::Fat, "fat", "fat", Tissue, M::OTHER),
        row(O::Perineum, "perineum", "perineum", Tissue, M::OTHER),
        row(O::Skin, "skin", "skin", Tissue, M::OTHER),
        row(O::Surroundings, "external body muscle levator", "", Tissue, M::OTHER),
    ]
};

impl Organ {
    /// Returns the organ whose TG-263 name is a prefix of the name; `None` for an unknown name.
    ///
    /// ```
    /// use stylet_anatomy::{Organ, Role};
    /// assert_eq!(Organ::of_name("Wall_Rectum"), Some(Organ::Rectum));
    /// assert_eq!(Organ::of_name("PTV 145").map(Organ::role), Some(Role::Target));
    /// assert_eq!(Organ::of_name("helper 3"), None);
    /// ```
    pub fn of_name(name: &str) -> Option<Self> {
        let plain: String = folded(name).chars().filter(char::is_ascii_alphanumeric).collect();
        TABLE
            .iter()
            .find(|row| row.names.split(' ').any(|n| plain.starts_with(n)))
            .map(|row| row.organ)
    }

    /// True if a word for the organ occurs anywhere in the name, in any case: "wall of the urethra" mentions the
    /// urethra, but does not begin with it.
    pub fn is_mentioned_in(self, name: &str) -> bool {
        let name = folded(name);
        self.row().words.split_whitespace().any(|word| name.contains(word))
    }

    /// Role of the organ in the procedure.
    pub fn role(self) -> Role {
        self.row().role
    }

    /// Default material of the organ.
    pub fn material(self) -> Material {
        self.row().material
    }

    /// RT ROI Interpreted Type of DICOM.
    pub fn dicom_type(self) -> &'static str {
        match self.role() {
            Role::Target => "CTV",
            Role::Spare | Role::Tissue => "ORGAN",
        }
    }

    fn row(self) -> &'static Row {
        // In the order of the variants, as a test checks.
        &TABLE[self as usize]
    }
}

/// Converts to lower case without accents: "Próstata" gives "prostata".
fn folded(name: &str) -> String {
    let plain = |c: char| match c {
        'à' | 'á' | 'â' | 'ã' | 'ä' | 'å' => 'a',
        'è' | 'é' | 'ê' | 'ë' => 'e',
        'ì' | 'í' | 'î' | 'ï' => 'i',
        'ò' | 'ó' | 'ô' | 'õ' | 'ö' | 'ø' => 'o',
        'ù' | 'ú' | 'û' | 'ü' => 'u',
        'ç' => 'c',
        'ñ' => 'n',
        c => c,
    };
    // The accent may be a separate character.
    let is_mark = |c: &char| ('\u{300}'..='\u{36f}').contains(c);
    name.to_lowercase().chars().filter(|c| !is_mark(c)).map(plain).collect()
}

/// Part of an organ that a name mentions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Content of a hollow organ.
    Content,
    /// The capsule of the prostate.
    Capsule,
    /// The wall of a hollow organ.
    Wall,
}

impl Part {
    const WORDS: [(Self, &str); 3] = [
        (Self::Content, "content"),
        (Self::Capsule, "capsule"),
        (Self::Wall, "wall"),
    ];

    /// Returns the first part mentioned in the name.
    pub fn of_name(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        let mentioned = |(_, word): &&(Self, &str)| name.contains(word);
        Self::WORDS.iter().find(mentioned).map(|(part, _)| *part)
    }
}

/// Words for the target in the order of preference.
const TARGET_WORDS: &str = "ptv ctv prostate prostata prostaat prosztata eturauhanen gland gtv target";

/// Returns the index of the name most likely to be the target's; `None` if none resembles one.
pub fn target_among(names: &[&str]) -> Option<usize> {
    let mentions = |word: &str| names.iter().position(|n| folded(n).contains(word));
    TARGET_WORDS.split(' ').find_map(mentions)
}

#[cfg(test)]
mod tests;

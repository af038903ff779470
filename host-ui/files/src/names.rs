//! What a structure is, from its name as TG-263 has it.

/// What is done with a structure in the procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// What seeds are planned in.
    Target,
    /// To be kept from needles and dose.
    Spare,
    Tissue,
}

/// How a structure yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub young_pa: f64,
    pub poisson: f64,
    /// For links along x, y, z: shortest, longest as a share of the rest, shear (rad); `None`: as the operator sets them.
    pub limits: Option<[[f64; 3]; 3]>,
    pub fixed: bool,
}

const fn soft(young_pa: f64) -> Material {
    Material {
        young_pa,
        poisson: 0.49,
        limits: None,
        fixed: false,
    }
}

/// 17 kPa: Ahn 2010.
pub const GLAND: Material = soft(17e3);
/// Assumed, as in the built-in pelvis: muscle.
const URETHRA: Material = soft(30e3);
/// Assumed, as in the built-in pelvis: muscle, relaxed.
const WALL: Material = soft(20e3);
/// Assumed, as in the built-in pelvis: skin and muscle together.
const OTHER: Material = soft(15e3);
/// Apparent modulus of cancellous bone: 0.1 to 0.5 GPa, Goldstein 1987. Fixed, as the table holds the pelvis.
const BONE: Material = Material {
    young_pa: 300e6,
    poisson: 0.3,
    limits: None,
    fixed: true,
};

/// The longest first where one begins with another. Names of TG-263, and what people write instead.
const KNOWN: [(&[&str], Role, Material); 10] = [
    (&["ptv", "ctv", "gtv", "itv"], Role::Target, GLAND),
    (&["prostatebed"], Role::Target, GLAND),
    (&["prostate", "gland"], Role::Target, GLAND),
    (&["semvesicle", "seminalves"], Role::Tissue, GLAND),
    (&["urethra"], Role::Spare, URETHRA),
    (&["rectum", "anorectum", "rectalwall", "wallrectum"], Role::Spare, WALL),
    (&["bladder"], Role::Spare, WALL),
    (
        &[
            "penilebulb",
            "bowel",
            "colonsigmoid",
            "sigmoid",
            "analcanal",
            "canalanal",
            "nvb",
            "neurovascular",
        ],
        Role::Spare,
        OTHER,
    ),
    (
        &["bone", "femur", "pubic", "symphys", "pelvis", "sacrum"],
        Role::Tissue,
        BONE,
    ),
    (
        &["external", "body", "skin", "muscle", "fat", "perineum", "levator"],
        Role::Tissue,
        OTHER,
    ),
];

/// `None` for a name that says nothing.
pub fn known(name: &str) -> Option<(Role, Material)> {
    let plain: String = name
        .to_ascii_lowercase()
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    let row = KNOWN
        .iter()
        .find(|(names, ..)| names.iter().any(|n| plain.starts_with(n)))?;
    Some((row.1, row.2))
}

/// Tissue of one kind that is not known by name.
pub fn unknown() -> (Role, Material) {
    (Role::Tissue, OTHER)
}

/// For RT ROI Interpreted Type.
pub fn dicom_kind(name: &str) -> &'static str {
    match known(name) {
        Some((Role::Target, _)) => "CTV",
        Some(_) => "ORGAN",
        None => "",
    }
}

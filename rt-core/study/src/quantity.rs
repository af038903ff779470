//! Quantities that may vary in a study: those of hand, needle and tissue, and every parameter of the core.

use stylet_shm_schema::{PARAMETERS, ParameterSpec};
use stylet_sim::scene::TissueKind;
use stylet_sim::tissue::TissueSpec;

/// Scope of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Once for all needles of an implant: the same patient and the same operator.
    Implant,
    /// Draw for each needle.
    Needle,
}

/// A quantity that a study may vary.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Key in the study file and as the column of the results; the unit stands at its end.
    pub key: &'static str,
    /// Scope in which it is drawn.
    pub scope: Scope,
    /// Least and largest value.
    pub limits: [f64; 2],
    /// Value where the study file has none.
    pub default: f64,
}

macro_rules! quantities {
    ($( $id:ident $key:literal $scope:ident $limits:expr, $default:expr; )*) => {
        /// Place of a quantity in [`QUANTITIES`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Id { $( $id ),* }

        /// Quantities in the order of [`Id`].
        pub const QUANTITIES: &[Quantity] = &[ $( Quantity { key: $key, scope: Scope::$scope, limits: $limits, default: $default } ),* ];
    };
}

quantities! {
    Stiffness "stiffness" Implant [0.1, 10.0], 1.0;
    HandMass "hand_mass_kg" Implant [0.1, 1.0], 0.5;
    HandDamping "hand_damping_n_s_per_m" Implant [2.0, 20.0], 5.0;
    HandStiffness "hand_stiffness_n_per_m" Implant [50.0, 1000.0], 300.0;
    Insert "insert_mm_per_s" Needle [0.5, 280.0], 50.0;
    Retract "retract_mm_per_s" Needle [0.5, 280.0], 50.0;
    EntryRight "entry_right_mm" Needle [-20.0, 20.0], 0.0;
    EntryAnterior "entry_anterior_mm" Needle [-20.0, 20.0], 0.0;
    TiltRight "tilt_right_deg" Needle [-10.0, 10.0], 0.0;
    TiltAnterior "tilt_anterior_deg" Needle [-10.0, 10.0], 0.0;
}

/// Returns the parameter of that key, such as `force.cutting`.
pub fn parameter(key: &str) -> Option<&'static ParameterSpec> {
    PARAMETERS.iter().find(|spec| spec.key == key)
}

/// Its column in the results: `force.cutting` in N is `force_cutting_n`.
pub fn column(spec: &ParameterSpec) -> String {
    let plain = |text: &str| -> String {
        let letters = text.chars().map(|c| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '_'
            }
        });
        letters.collect()
    };
    let unit = plain(spec.unit);
    format!("{}{}{unit}", plain(spec.key), if unit.is_empty() { "" } else { "_" })
}

/// Limits in the unit of the study file.
pub fn limits(spec: &ParameterSpec) -> [f64; 2] {
    [spec.min, spec.max].map(|si| si * spec.display_per_si)
}

/// Returns whether the parameter does nothing in that tissue, so that its variation would be an empty column.
pub fn has_no_part(spec: &ParameterSpec, tissue: TissueKind) -> bool {
    TissueSpec::from(tissue).has_lines() && !spec.acts_on_a_line()
}

/// Returns every key that may vary, for errors.
pub fn keys() -> impl Iterator<Item = &'static str> {
    QUANTITIES.iter().map(|q| q.key).chain(PARAMETERS.iter().map(|p| p.key))
}

//! A source file (TOML), checked; all problems are reported at once.

use super::curve::{Curve, Table};
use super::decay::days_to_s;
use super::error::DoseError;
use super::tg43::{Capsule, Tables};
use read::Reader;

mod read;

const M_PER_CM: f64 = 0.01;
/// 1 cGy/h in Gy/s.
const GY_PER_S_PER_CGY_PER_H: f64 = 0.01 / 3600.0;

/// Model of a seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Name of the model.
    pub model: String,
    /// Isotope, as in I-125.
    pub nuclide: String,
    /// Half-life, in s.
    pub half_life_s: f64,
    /// The tables of TG-43.
    pub tables: Tables,
    /// Air kerma strength for an apparent activity of 1 mCi.
    pub strength_per_activity_u_per_mci: Option<f64>,
    /// Usual prescription.
    pub prescription_gy: Option<f64>,
}

/// Sources that need no file.
const KNOWN: [&str; 2] = [
    include_str!("../../../sources/i125_6711.toml"),
    include_str!("../../../sources/pd103_200.toml"),
];

impl Source {
    /// Returns a source of the program, by its model.
    pub fn known(model: &str) -> Option<Self> {
        Self::all_known().find(|source| source.model == model)
    }

    /// Returns all sources of the program.
    pub fn all_known() -> impl Iterator<Item = Self> {
        KNOWN.iter().filter_map(|text| Self::parse(text).ok())
    }

    /// Reads and checks the text of a source file; the error lists every problem in it.
    pub fn parse(text: &str) -> Result<Self, DoseError> {
        let table: toml::Table = text
            .parse()
            .map_err(|e| DoseError::Source(format!("it is not TOML: {e}")))?;
        let mut reader = Reader::new(&table);
        let source = build(&mut reader);
        reader.finish().map(|()| source)
    }

    /// Returns the total dose of 1 U at 1 cm from the middle of the source, perpendicular to its
    /// axis (Gy).
    pub fn reference_dose_gy_per_u(&self) -> f64 {
        let rate = self.tables.rate_gy_per_s(super::tg43::Formalism::TwoD, M_PER_CM, 0.0);
        rate * super::decay::Interval::ALL.equivalent_s(self.half_life_s)
    }
}

fn build(r: &mut Reader) -> Source {
    let model = r.text("source", "model");
    let nuclide = r.text("source", "nuclide");
    let half_life_days = r.number("source", "half_life_days", 1e-3, 1e6);
    let constant = r.number("source", "dose_rate_constant", 1e-3, 100.0);
    let length_cm = r.optional("source", "active_length_cm", 0.0, 10.0).unwrap_or(0.0);
    r.fixed("source", "r0_cm", 1.0);
    r.fixed("source", "theta0_deg", 90.0);
    let radii_cm = r.rising("radial", "r_cm", 1e-3, 100.0);
    // A line source needs g_L and a point source g_P, because their geometry functions differ.
    let (used, other) = if length_cm > 0.0 {
        ("g_line", "g_point")
    } else {
        ("g_point", "g_line")
    };
    let radial = r.column("radial", used, radii_cm.len(), 1e-12, 100.0);
    if r.has("radial", other) {
        r.column("radial", other, radii_cm.len(), 1e-12, 100.0);
    }
    let ln_radial = curve(&radii_cm, radial.iter().map(|g| g.ln()).collect());
    r.must_be_one(used, "r = 1 cm", ln_radial.as_ref().map(|c| c.held(M_PER_CM).exp()));
    let capsule = capsule(r, length_cm, radii_cm.first().copied());
    Source {
        model,
        nuclide,
        half_life_s: days_to_s(half_life_days),
        tables: Tables {
            dose_rate_constant_gy_per_s: constant * GY_PER_S_PER_CGY_PER_H,
            active_length_m: length_cm * M_PER_CM,
            capsule,
            ln_radial: ln_radial.unwrap_or(Curve {
                at: vec![0.0],
                values: vec![0.0],
            }),
            anisotropy_1d: anisotropy_1d(r),
            anisotropy_2d: anisotropy_2d(r),
        },
        strength_per_activity_u_per_mci: r.optional("source", "strength_per_activity_u_per_mci", 1e-3, 100.0),
        prescription_gy: r.optional("source", "prescription_gy", 1e-3, 1e4),
    }
}

/// Reads the capsule. Without its size, uses the smallest radius with data, around the active line
/// and beyond its ends.
fn capsule(r: &mut Reader, active_cm: f64, smallest_radius_cm: Option<f64>) -> Capsule {
    let length = r.optional("source", "physical_length_cm", 1e-3, 10.0);
    let diameter = r.optional("source", "physical_diameter_cm", 1e-3, 10.0);
    if length.is_some_and(|l| l <= active_cm) {
        r.problem("[source] physical_length_cm is not more than active_length_cm".to_owned());
    }
    let radius_cm = diameter.map_or(smallest_radius_cm.unwrap_or(0.1), |d| d / 2.0);
    Capsule {
        radius_m: radius_cm * M_PER_CM,
        half_length_m: length.map_or(active_cm / 2.0 + radius_cm, |l| l / 2.0) * M_PER_CM,
    }
}

fn anisotropy_1d(r: &mut Reader) -> Option<Curve> {
    if !r.has_table("anisotropy_1d") {
        return None;
    }
    let radii_cm = r.rising("anisotropy_1d", "r_cm", 1e-3, 100.0);
    let values = r.column("anisotropy_1d", "phi_an", radii_cm.len(), 1e-3, 10.0);
    curve(&radii_cm, values)
}

fn anisotropy_2d(r: &mut Reader) -> Option<Table> {
    if !r.has_table("anisotropy_2d") {
        return None;
    }
    let radii_cm = r.rising("anisotropy_2d", "r_cm", 1e-3, 100.0);
    let angles_deg = r.rising("anisotropy_2d", "theta_deg", 0.0, 180.0);
    let values = r.matrix("anisotropy_2d", "F", radii_cm.len(), angles_deg.len(), 0.0, 10.0);
    if let (Some(&first), Some(&last)) = (angles_deg.first(), angles_deg.last())
        && (first != 0.0 || (last != 90.0 && last != 180.0))
    {
        r.problem(format!(
            "[anisotropy_2d] theta_deg goes from {first} to {last}; it must go from 0 to 90 or to 180"
        ));
    }
    if radii_cm.is_empty() || values.len() != radii_cm.len() * angles_deg.len() {
        return None;
    }
    let table = Table {
        rows_at: in_m(&radii_cm),
        columns_at: angles_deg,
        values,
    };
    for (row, &r_m) in table.rows_at.iter().enumerate() {
        let at = format!("r = {} cm, theta = 90 deg", radii_cm[row]);
        r.must_be_one("F", &at, Some(table.held(r_m, 90.0)));
    }
    Some(table)
}

fn in_m(cm: &[f64]) -> Vec<f64> {
    cm.iter().map(|r| r * M_PER_CM).collect()
}

/// Creates a curve; `None` if the two do not fit, which the reader has reported already.
fn curve(radii_cm: &[f64], values: Vec<f64>) -> Option<Curve> {
    (!values.is_empty() && values.len() == radii_cm.len()).then(|| Curve {
        at: in_m(radii_cm),
        values,
    })
}

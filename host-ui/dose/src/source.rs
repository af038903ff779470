//! A source file (TOML), checked; all wrong values are reported at once.

use super::curve::{Curve, Table};
use super::decay::days_to_s;
use super::error::DoseError;
use super::tg43::{Capsule, Tables};
use read::{Anisotropy1d, Anisotropy2d, Problems, Radial, SourceFile};
pub use read::{Model, Reference};

mod read;
pub mod sheet;

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
    /// Where the numbers are from.
    pub reference: Option<Reference>,
}

/// Sources that need no file.
const KNOWN: [&str; 3] = [
    include_str!("../sources/i125_6711.toml"),
    include_str!("../sources/i125_iai125a.toml"),
    include_str!("../sources/pd103_200.toml"),
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

    /// Returns the file of a source of the program, by its model.
    pub fn file_of(model: &str) -> Option<&'static str> {
        let is_model = |text: &&str| Self::parse(text).is_ok_and(|source| source.model == model);
        KNOWN.into_iter().find(is_model)
    }

    /// Returns a source of the program by its model; the error lists the models.
    pub fn named(model: &str) -> Result<Self, DoseError> {
        Self::known(model).ok_or_else(|| {
            let known: Vec<String> = Self::all_known().map(|source| source.model).collect();
            DoseError::Source(format!("source {model:?} is not known; known are {}", known.join(", ")))
        })
    }

    /// Reads and checks the text of a source file; the error lists every problem in it.
    pub fn parse(text: &str) -> Result<Self, DoseError> {
        let file: SourceFile =
            toml::from_str(text).map_err(|e| DoseError::Source(format!("it is no source file: {e}")))?;
        let mut problems = Problems::default();
        let source = build(file, &mut problems);
        problems.finish().map(|()| source)
    }

    /// Returns the total dose of 1 U at 1 cm from the middle of the source, perpendicular to its
    /// axis (Gy).
    pub fn reference_dose_gy_per_u(&self) -> f64 {
        let rate = self.tables.rate_gy_per_s(super::tg43::Formalism::TwoD, M_PER_CM, 0.0);
        rate * super::decay::Interval::ALL.equivalent_s(self.half_life_s)
    }
}

fn build(file: SourceFile, problems: &mut Problems) -> Source {
    let of = file.source;
    for (key, text) in [("model", &of.model), ("nuclide", &of.nuclide)] {
        if text.trim().is_empty() {
            problems.add(format!("[source] {key} must be a name in quotes"));
        }
    }
    for (key, value, least, most) in [
        ("half_life_days", Some(of.half_life_days), 1e-3, 1e6),
        ("dose_rate_constant", Some(of.dose_rate_constant), 1e-3, 100.0),
        ("active_length_cm", Some(of.active_length_cm), 0.0, 10.0),
        ("physical_length_cm", of.physical_length_cm, 1e-3, 10.0),
        ("physical_diameter_cm", of.physical_diameter_cm, 1e-3, 10.0),
        // The reference point of TG-43.
        ("r0_cm", of.r0_cm, 1.0, 1.0),
        ("theta0_deg", of.theta0_deg, 90.0, 90.0),
        (
            "strength_per_activity_u_per_mci",
            of.strength_per_activity_u_per_mci,
            1e-3,
            100.0,
        ),
        ("prescription_gy", of.prescription_gy, 1e-3, 1e4),
    ] {
        problems.within(&format!("[source] {key}"), value, least, most);
    }
    if of.physical_length_cm.is_some_and(|l| l <= of.active_length_cm) {
        problems.add("[source] physical_length_cm is not more than active_length_cm".to_owned());
    }
    Source {
        half_life_s: days_to_s(of.half_life_days),
        tables: Tables {
            dose_rate_constant_gy_per_s: of.dose_rate_constant * GY_PER_S_PER_CGY_PER_H,
            active_length_m: of.active_length_cm * M_PER_CM,
            capsule: capsule(&of, file.radial.r_cm.first().copied()),
            ln_radial: ln_radial(file.radial, of.active_length_cm > 0.0, problems),
            anisotropy_1d: file.anisotropy_1d.and_then(|table| anisotropy_1d(table, problems)),
            anisotropy_2d: file.anisotropy_2d.and_then(|table| anisotropy_2d(table, problems)),
        },
        model: of.model,
        nuclide: of.nuclide,
        strength_per_activity_u_per_mci: of.strength_per_activity_u_per_mci,
        prescription_gy: of.prescription_gy,
        reference: file.reference,
    }
}

/// Returns the capsule. Without its size, uses the smallest radius with data, around the active line
/// and beyond its ends.
fn capsule(of: &Model, smallest_radius_cm: Option<f64>) -> Capsule {
    let radius_cm = of
        .physical_diameter_cm
        .map_or(smallest_radius_cm.unwrap_or(0.1), |d| d / 2.0);
    let half_cm = of
        .physical_length_cm
        .map_or(of.active_length_cm / 2.0 + radius_cm, |l| l / 2.0);
    Capsule {
        radius_m: radius_cm * M_PER_CM,
        half_length_m: half_cm * M_PER_CM,
    }
}

/// Returns ln g over r. A line source needs g_L and a point source g_P, because their geometry functions differ.
fn ln_radial(table: Radial, is_line: bool, problems: &mut Problems) -> Curve {
    problems.rising("[radial] r_cm", &table.r_cm, 1e-3, 100.0);
    for (name, g) in [("g_line", &table.g_line), ("g_point", &table.g_point)] {
        let g = g.iter();
        g.for_each(|g| problems.column(&format!("[radial] {name}"), g, ("r_cm", table.r_cm.len()), 1e-12, 100.0));
    }
    let (name, used) = match is_line {
        true => ("g_line", table.g_line),
        false => ("g_point", table.g_point),
    };
    let ln_g = used.map(|g| g.iter().map(|g| g.ln()).collect());
    match ln_g.and_then(|ln_g| curve(&table.r_cm, ln_g)) {
        Some(ln_radial) => {
            problems.must_be_one(name, "r = 1 cm", ln_radial.held(M_PER_CM).exp());
            ln_radial
        }
        None => {
            problems.add(format!("[radial] {name} must be a list of numbers, one for each r_cm"));
            Curve {
                at: vec![0.0],
                values: vec![0.0],
            }
        }
    }
}

fn anisotropy_1d(table: Anisotropy1d, problems: &mut Problems) -> Option<Curve> {
    problems.rising("[anisotropy_1d] r_cm", &table.r_cm, 1e-3, 100.0);
    let radii = ("r_cm", table.r_cm.len());
    problems.column("[anisotropy_1d] phi_an", &table.phi_an, radii, 1e-3, 10.0);
    curve(&table.r_cm, table.phi_an)
}

fn anisotropy_2d(table: Anisotropy2d, problems: &mut Problems) -> Option<Table> {
    problems.rising("[anisotropy_2d] r_cm", &table.r_cm, 1e-3, 100.0);
    problems.rising("[anisotropy_2d] theta_deg", &table.theta_deg, 0.0, 180.0);
    let (radii, angles) = (table.r_cm.len(), table.theta_deg.len());
    if table.f.len() != radii {
        problems.add(format!(
            "[anisotropy_2d] F has {} rows and r_cm {radii} entries",
            table.f.len()
        ));
    }
    for (row, number) in table.f.iter().zip(1..) {
        let name = format!("[anisotropy_2d] F, row {number}");
        problems.column(&name, row, ("theta_deg", angles), 0.0, 10.0);
    }
    if let (Some(&first), Some(&last)) = (table.theta_deg.first(), table.theta_deg.last())
        && (first != 0.0 || (last != 90.0 && last != 180.0))
    {
        problems.add(format!(
            "[anisotropy_2d] theta_deg goes from {first} to {last}; it must go from 0 to 90 or to 180"
        ));
    }
    let values = table.f.concat();
    if values.is_empty() || values.len() != radii * angles {
        return None;
    }
    let f = Table {
        rows_at: in_m(&table.r_cm),
        columns_at: table.theta_deg,
        values,
    };
    for (r_cm, &r_m) in table.r_cm.iter().zip(&f.rows_at) {
        problems.must_be_one("F", &format!("r = {r_cm} cm, theta = 90 deg"), f.held(r_m, 90.0));
    }
    Some(f)
}

fn in_m(cm: &[f64]) -> Vec<f64> {
    cm.iter().map(|r| r * M_PER_CM).collect()
}

/// Creates a curve; `None` if the two do not fit.
fn curve(radii_cm: &[f64], values: Vec<f64>) -> Option<Curve> {
    (!values.is_empty() && values.len() == radii_cm.len()).then(|| Curve {
        at: in_m(radii_cm),
        values,
    })
}

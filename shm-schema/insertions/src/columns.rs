//! The columns of a file: names, types and order, for writer, reader and digest alike.

use crate::{Insertion, Motion, Rest, Seed};
use parquet::errors::ParquetError;
use parquet::schema::{parser, types::TypePtr};
use std::sync::Arc;

pub type Text = (&'static str, fn(&Insertion) -> &str);
pub type Whole = (&'static str, fn(&Insertion) -> i32);
/// Name and value of a result.
pub type Measured = (&'static str, fn(&Motion) -> f64);

/// Text columns, set in every row.
pub const TEXTS: [Text; 6] = [
    ("id", |row| &row.id),
    ("scene", |row| &row.scene),
    ("plan", |row| &row.plan),
    ("hole", |row| &row.hole),
    ("tissue", |row| &row.tissue),
    ("source", |row| &row.source),
];
/// Integer columns, set in every row.
pub const WHOLES: [Whole; 2] = [("implant", |row| row.implant), ("needle", |row| row.needle)];
pub const PRESCRIPTION: &str = "prescription_gy";
/// Results; null if the insertion failed.
pub const MEASURED: [Measured; 5] = [
    ("peak_force_n", |m| m.peak_force_n),
    ("displacement_before_puncture_mm", |m| m.displacement_before_puncture_mm),
    ("largest_displacement_mm", |m| m.largest_displacement_mm),
    ("target_shift_mm", |m| m.target_shift_mm),
    ("duration_s", |m| m.duration_s),
];
/// Null if the insertion succeeded.
pub const FAILURE: &str = "failure";
/// The list of seeds.
pub const SEEDS: &str = "seeds";

/// Fields of a seed in the list `seeds`; the last seven are null if the insertion failed.
pub const SEED_COLUMNS: [&str; 14] = [
    "planned_x_mm",
    "planned_y_mm",
    "planned_z_mm",
    "planned_axis_x",
    "planned_axis_y",
    "planned_axis_z",
    "strength_u",
    "rest_x_mm",
    "rest_y_mm",
    "rest_z_mm",
    "rest_axis_x",
    "rest_axis_y",
    "rest_axis_z",
    "dropped_after_s",
];
/// Number of these that are always set.
pub const PLANNED: usize = 7;

/// Returns the values of a seed in the order of [`SEED_COLUMNS`].
pub fn seed_values(seed: &Seed) -> [Option<f64>; SEED_COLUMNS.len()] {
    let mut values = [None; SEED_COLUMNS.len()];
    let planned = seed
        .planned_mm
        .into_iter()
        .chain(seed.planned_axis)
        .chain([seed.strength_u]);
    let rest = seed.rest.iter();
    let rest = rest.flat_map(|r| r.at_mm.into_iter().chain(r.axis).chain([r.dropped_after_s]));
    for (slot, value) in values.iter_mut().zip(planned.chain(rest)) {
        *slot = Some(value);
    }
    values
}

/// Returns the seed with the values of [`seed_values`]; `None` if a planned one is missing.
pub fn seed_of(values: [Option<f64>; SEED_COLUMNS.len()]) -> Option<Seed> {
    let three = |first: usize| Some([values[first]?, values[first + 1]?, values[first + 2]?]);
    let rest = || {
        Some(Rest {
            at_mm: three(PLANNED)?,
            axis: three(PLANNED + 3)?,
            dropped_after_s: values[PLANNED + 6]?,
        })
    };
    Some(Seed {
        planned_mm: three(0)?,
        planned_axis: three(3)?,
        strength_u: values[6]?,
        rest: rest(),
    })
}

/// Returns the schema of a file with these drawn quantities.
///
/// # Errors
/// If Parquet does not accept the name of a quantity.
pub fn schema(quantities: &[String]) -> Result<TypePtr, ParquetError> {
    let mut text = String::from("message insertion {\n");
    for (name, _) in TEXTS {
        text += &format!("required binary {name} (UTF8);\n");
    }
    for (name, _) in WHOLES {
        text += &format!("required int32 {name};\n");
    }
    text += &format!("required double {PRESCRIPTION};\n");
    for name in quantities {
        text += &format!("required double {name};\n");
    }
    for (name, _) in MEASURED {
        text += &format!("optional double {name};\n");
    }
    text += &format!(
        "optional binary {FAILURE} (UTF8);\nrequired group {SEEDS} (LIST) {{ repeated group list {{ required group element {{\n"
    );
    for (n, name) in SEED_COLUMNS.iter().enumerate() {
        let kind = if n < PLANNED { "required" } else { "optional" };
        text += &format!("{kind} double {name};\n");
    }
    text += "} } }\n}";
    parser::parse_message_type(&text).map(Arc::new)
}

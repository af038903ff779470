//! Meaning of a table's columns: our names, headers that state a quantity and its unit, or a user's
//! mapping.

use super::table::{LineError, shown};
use std::str::FromStr;

/// Words that announce the axes of a place.
const PLACE_WORDS: [&str; 6] = ["position", "pos", "coordinate", "coord", "seed", "location"];
/// Units by the quantity of a column, with the factor of its numbers.
const UNITS: [(Quantity, &str, f64); 9] = [
    (Quantity::Length, "mm", 1.0),
    (Quantity::Length, "cm", 10.0),
    (Quantity::Length, "m", 1000.0),
    (Quantity::Strength, "u", 1.0),
    (Quantity::Strength, "cgy*cm2/h", 1.0),
    (Quantity::Strength, "ugy*m2/h", 1.0),
    (Quantity::Activity, "mci", 1.0),
    // 1 mCi is 37 MBq.
    (Quantity::Activity, "mbq", 1.0 / 37.0),
    (Quantity::Activity, "gbq", 1000.0 / 37.0),
];

/// Quantity in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Length,
    Strength,
    Activity,
    /// Numbers without a unit: directions, numbers of needles, names, dates.
    Plain,
}

impl Quantity {
    fn of(column: &str) -> Self {
        match column {
            "strength_u" => Self::Strength,
            "activity_mci" => Self::Activity,
            _ if column.ends_with("_mm") => Self::Length,
            _ => Self::Plain,
        }
    }

    /// Returns the factor of numbers in this unit.
    fn unit(self, name: &str) -> Option<f64> {
        let name = name
            .trim()
            .to_lowercase()
            .replace('µ', "u")
            .replace('²', "2")
            .replace('·', "*");
        let of = UNITS
            .iter()
            .find(|(quantity, unit, _)| *quantity == self && *unit == name);
        of.map(|(_, _, factor)| *factor)
    }
}

/// User's mapping of one column: `x_mm=-Lateral:cm`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// Our name.
    known: String,
    /// Header in the file.
    header: String,
    is_negated: bool,
    /// Factor of its numbers, if a unit was given.
    factor: Option<f64>,
}

/// Error of a mapping that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "\"{0}\" is not a column; write NAME=HEADER, as in x_mm=\"Pos X:cm\" or y_mm=-Y:cm; units are mm, cm, m, U, mCi, MBq, GBq"
)]
pub struct NotAColumn(String);

impl FromStr for Mapped {
    type Err = NotAColumn;

    fn from_str(text: &str) -> Result<Self, NotAColumn> {
        let refused = || NotAColumn(shown(text));
        let (known, header) = text.split_once('=').ok_or_else(refused)?;
        let (known, header) = (known.trim().to_lowercase(), header.trim());
        let quantity = Quantity::of(&known);
        let (header, factor) = match header.rsplit_once(':') {
            Some((header, unit)) if quantity != Quantity::Plain => match quantity.unit(unit) {
                Some(factor) => (header.trim(), Some(factor)),
                None => return Err(refused()),
            },
            _ => (header, None),
        };
        let (header, is_negated) = match header.strip_prefix('-') {
            Some(header) => (header.trim(), true),
            None => (header, false),
        };
        if known.is_empty()
            || header.is_empty()
            || (is_negated && quantity == Quantity::Plain && !known.starts_with("axis_"))
        {
            return Err(refused());
        }
        Ok(Self {
            known,
            header: header.to_lowercase(),
            is_negated,
            factor,
        })
    }
}

/// Column of a table: our name, and the factor of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    /// Our name; empty if the column is skipped.
    pub name: String,
    pub factor: f64,
}

/// Returns the columns of a header, and the skipped ones. Without a mapping every header must be
/// one of `known` or state its quantity and unit.
pub(super) fn of_header(
    headers: &[String],
    known: &[&str],
    mapped: &[Mapped],
) -> Result<(Vec<Column>, Vec<String>), LineError> {
    let mut problems = Vec::new();
    let (mut columns, mut passed_over) = (Vec::new(), Vec::new());
    for header in headers {
        match of_one(header, known, mapped) {
            Ok(Some(column)) => columns.push(column),
            Ok(None) => {
                passed_over.push(shown(header));
                columns.push(Column {
                    name: String::new(),
                    factor: 1.0,
                });
            }
            Err(why) => problems.push(why),
        }
    }
    if mapped.is_empty() && !passed_over.is_empty() {
        problems.push(format!(
            "the column{} \"{}\" {} unknown; valid are {}, or name columns with --column",
            if passed_over.len() == 1 { "" } else { "s" },
            passed_over.join("\", \""),
            if passed_over.len() == 1 { "is" } else { "are" },
            known.join(",")
        ));
    }
    for wanted in mapped {
        if !known.contains(&wanted.known.as_str()) {
            problems.push(format!(
                "no column {} to map; valid are {}",
                shown(&wanted.known),
                known.join(",")
            ));
        } else if !headers.contains(&wanted.header) {
            let all: Vec<String> = headers.iter().map(|header| shown(header)).collect();
            problems.push(format!(
                "it has no column \"{}\"; it has {}",
                shown(&wanted.header),
                all.join(", ")
            ));
        }
    }
    let twice = |(n, column): &(usize, &Column)| {
        !column.name.is_empty() && columns[..*n].iter().any(|other| other.name == column.name)
    };
    if let Some((_, column)) = columns.iter().enumerate().find(twice) {
        problems.push(format!("the column {} is there twice", column.name));
    }
    match problems.is_empty() {
        true => Ok((columns, passed_over)),
        false => Err(LineError::new(problems.join("; "))),
    }
}

/// Recognises one column; `None` for an unknown one, or a length without a unit.
fn of_one(header: &str, known: &[&str], mapped: &[Mapped]) -> Result<Option<Column>, String> {
    let (words, unit) = stated(header);
    let by_user = mapped.iter().find(|wanted| wanted.header == *header);
    // A column that the user mapped from elsewhere is not taken from here.
    let is_free = |name: &&str| known.contains(name) && !mapped.iter().any(|wanted| wanted.known == *name);
    let ours = known.contains(&header).then_some(header);
    let found = ours.or_else(|| recognised(&words, unit.as_deref()).filter(is_free));
    let Some(name) = by_user.map(|wanted| wanted.known.as_str()).or(found) else {
        return Ok(None);
    };
    let quantity = Quantity::of(name);
    let by_header = unit.and_then(|unit| quantity.unit(&unit));
    let plain = (name == header || quantity == Quantity::Plain).then_some(1.0);
    let factor = by_user.and_then(|wanted| wanted.factor).or(by_header).or(plain);
    match (factor, by_user) {
        (Some(factor), _) => Ok(Some(Column {
            name: name.to_owned(),
            factor: match by_user {
                Some(wanted) if wanted.is_negated => -factor,
                _ => factor,
            },
        })),
        (None, None) => Ok(None),
        (None, Some(_)) => Err(format!(
            "the column \"{0}\" states no unit; give it, as in {name}={0}:mm",
            shown(header)
        )),
    }
}

/// Returns the words of a header, and the unit in brackets or after the last underscore or space:
/// "Pos X (cm)", "y_cm", "Z [mm]".
fn stated(header: &str) -> (Vec<String>, Option<String>) {
    let (name, unit) = match header.find(['(', '[']) {
        Some(at) => {
            let inside = header[at + 1..].trim_end_matches([')', ']', ' ']);
            (&header[..at], Some(inside.to_owned()))
        }
        None => (header, None),
    };
    let mut words: Vec<String> = name
        .split(|c: char| !c.is_alphanumeric() && c != '#')
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    let is_unit = |word: &String| UNITS.iter().any(|(_, unit, _)| unit == word) && word != "u" && word != "m";
    let unit = unit.or_else(|| {
        let last = words.last().filter(|word| words.len() > 1 && is_unit(word)).cloned()?;
        words.pop();
        Some(last)
    });
    (words, unit)
}

/// Returns our name for these words.
fn recognised(words: &[String], unit: Option<&str>) -> Option<&'static str> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let without: Vec<&str> = words
        .iter()
        .copied()
        .filter(|word| !PLACE_WORDS.contains(word))
        .collect();
    match without[..] {
        ["x"] => return Some("x_mm"),
        ["y"] => return Some("y_mm"),
        ["z"] => return Some("z_mm"),
        _ => {}
    }
    match words[..] {
        ["strength"] | ["air", "kerma", "strength"] | ["aks"] | ["sk"] => Some("strength_u"),
        // Some call an activity a strength; its unit tells.
        ["activity"] | ["apparent", "activity"] | ["seed", "activity"] => match unit {
            Some(unit) if Quantity::Strength.unit(unit).is_some() => Some("strength_u"),
            _ => Some("activity_mci"),
        },
        ["needle", "#" | "no" | "nr" | "number" | "id"] | ["needle#"] => Some("needle"),
        ["grid"] | ["template", "hole"] | ["grid", "location"] | ["needle", "hole"] => Some("hole"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [&str; 9] = [
        "x_mm",
        "y_mm",
        "z_mm",
        "axis_x",
        "strength_u",
        "activity_mci",
        "needle",
        "hole",
        "strength_date",
    ];

    /// Names with factors, and skipped headers.
    type Columns = (Vec<(String, f64)>, Vec<String>);

    fn columns(headers: &[&str], mapped: &[&str]) -> Result<Columns, String> {
        let headers: Vec<String> = headers.iter().map(|h| h.to_lowercase()).collect();
        let mapped: Vec<Mapped> = mapped.iter().map(|m| m.parse().unwrap()).collect();
        let (columns, passed) = of_header(&headers, &KNOWN, &mapped).map_err(|why| why.to_string())?;
        Ok((columns.into_iter().map(|c| (c.name, c.factor)).collect(), passed))
    }

    #[test]
    fn headers_that_state_their_unit_are_recognised_and_others_refused() {
        let found = columns(
            &[
                "Needle #",
                "Pos X (cm)",
                "y_cm",
                "Seed Z [mm]",
                "Activity (MBq)",
                "Hole",
            ],
            &[],
        );
        let expected = [
            ("needle", 1.0),
            ("x_mm", 10.0),
            ("y_mm", 10.0),
            ("z_mm", 1.0),
            ("activity_mci", 1.0 / 37.0),
            ("hole", 1.0),
        ];
        let expected: Vec<(String, f64)> = expected.iter().map(|(n, f)| ((*n).to_owned(), *f)).collect();
        assert_eq!(found.unwrap().0, expected);
        for headers in [&["x", "y_mm", "z_mm"][..], &["x_mm", "y_mm", "z_mm", "strength_q"]] {
            let why = columns(headers, &[]).unwrap_err();
            assert!(why.contains("is unknown") && why.contains("--column"), "{why}");
        }
        let why = columns(&["x_mm", "X (cm)", "y_mm", "z_mm"], &[]).unwrap_err();
        assert!(why.contains("x_mm is there twice"), "{why}");
    }

    #[test]
    fn a_mapping_sets_names_units_and_signs() {
        let mapped = [
            "x_mm=-Lateral:cm",
            "y_mm=Height (mm)",
            "z_mm=depth:m",
            "strength_u=S:U",
            "needle=n",
        ];
        let headers = ["Lateral", "Height (mm)", "Depth", "S", "N", "Comment"];
        let (found, passed) = columns(&headers, &mapped).unwrap();
        let factors: Vec<f64> = found.iter().map(|c| c.1).collect();
        assert_eq!(factors, [-10.0, 1.0, 1000.0, 1.0, 1.0, 1.0]);
        assert_eq!(passed, ["comment"]);
        let why = columns(&["a", "y_mm", "z_mm"], &["x_mm=a"]).unwrap_err();
        assert!(why.contains("states no unit"), "{why}");
        let why = columns(&["a", "y_mm", "z_mm"], &["x_mm=b:mm"]).unwrap_err();
        assert!(why.contains("no column \"b\""), "{why}");
        for wrong in ["x_mm", "x_mm=a:kg", "=a:mm", "needle=-n"] {
            assert!(wrong.parse::<Mapped>().is_err(), "{wrong}");
        }
    }
}

//! Cells of a spreadsheet that was saved as text, and the tables that its headings mark.

use crate::error::DoseError;

/// Cells, row by row, without white space around them.
pub struct Cells(Vec<Vec<String>>);

/// Table with arguments at its left and upper edge.
#[derive(PartialEq)]
pub struct Grid {
    pub rows_at: Vec<f64>,
    pub columns_at: Vec<f64>,
    pub values: Vec<Vec<Option<f64>>>,
}

/// Radii and columns of g(r), each with its heading.
#[derive(PartialEq)]
pub struct Radial {
    pub r_cm: Vec<f64>,
    columns: Vec<(String, Vec<Option<f64>>)>,
}

impl Radial {
    /// Returns the column whose heading is g followed by this letter.
    pub fn column(&self, letter: char) -> Option<(String, Vec<Option<f64>>)> {
        let is_it = |(heading, _): &&(String, _)| {
            plain(heading)
                .strip_prefix('g')
                .is_some_and(|rest| rest.starts_with(letter))
        };
        self.columns.iter().find(is_it).cloned()
    }
}

impl Cells {
    /// Splits text at tabs, semicolons or commas: the first of them that most lines contain.
    pub fn of(text: &str) -> Self {
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        let is_usual =
            |mark: &&u8| 2 * lines.iter().filter(|line| line.contains(char::from(**mark))).count() > lines.len();
        let delimiter = *b"\t;".iter().find(is_usual).unwrap_or(&b',');
        let mut reader = csv::ReaderBuilder::new();
        let reader = reader
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .trim(csv::Trim::All);
        let rows = reader
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes())
            .into_records();
        Self(
            rows.map_while(Result::ok)
                .map(|row| row.iter().map(str::to_owned).collect())
                .collect(),
        )
    }

    /// Returns Λ, in cGy/h for 1 U.
    pub fn constants(&self) -> Result<Vec<f64>, DoseError> {
        let found = self
            .assigned(&["l", "λ", "lambda"])
            .filter(|(_, _, unit)| unit.contains("gy"));
        let in_unit = |(key, value, unit): (String, f64, String)| match unit.contains("cgy")
            && unit.contains('h')
            && unit.contains('u')
        {
            true => Ok(value),
            false => Err(DoseError::Source(format!(
                "{key} = {value} has the unit {unit}; it must be in cGy/(h U)"
            ))),
        };
        found.map(in_unit).collect()
    }

    /// Returns active lengths, in cm.
    pub fn lengths(&self) -> Result<Vec<f64>, DoseError> {
        let found = self
            .assigned(&["l"])
            .filter(|(_, _, unit)| !unit.contains("gy") && unit.contains('m'));
        let in_cm = |(_, value, unit): (String, f64, String)| match unit.starts_with("cm") {
            true => Ok(value),
            false => Err(DoseError::Source(format!(
                "the active length {value} must be in cm, not in {unit}"
            ))),
        };
        found.map(in_cm).collect()
    }

    /// Returns all `key = value unit`, in one cell or in adjacent ones.
    fn assigned<'a>(&'a self, keys: &'a [&str]) -> impl Iterator<Item = (String, f64, String)> + 'a {
        let cells = self
            .0
            .iter()
            .flat_map(|row| (0..row.len()).map(move |c| &row[c..row.len().min(c + 5)]));
        cells.filter_map(move |cells| {
            let (key, rest) = cells[0].split_once('=')?;
            let rest = format!("{rest} {}", cells[1..].join(" "));
            let unit = rest
                .trim_start()
                .split_once(char::is_whitespace)
                .map_or("", |(_, unit)| unit);
            keys.contains(&plain(key).as_str())
                .then(|| Some((key.trim().to_owned(), number(&rest)?, plain(unit))))?
        })
    }

    /// Returns tables of g(r): a column of radii under `r (cm)`, with columns whose headings begin
    /// with g to its right.
    pub fn radial(&self) -> Result<Vec<Radial>, DoseError> {
        let is_heading = |r: usize, c: usize| {
            let name = plain(self.at(r, c));
            (name == "r" || ["r(", "r/", "r["].iter().any(|begin| name.starts_with(begin)))
                && plain(self.at(r, c + 1)).starts_with('g')
        };
        let table = |(r, c): (usize, usize)| {
            self.must_be_in_cm(r, c)?;
            let r_cm = self.column_from(r + 1, c);
            let headings = (c + 1..).take_while(|&c| plain(self.at(r, c)).starts_with('g'));
            let column = |c| {
                (
                    self.at(r, c).to_owned(),
                    (0..r_cm.len()).map(|i| number(self.at(r + 1 + i, c))).collect(),
                )
            };
            Ok(Radial {
                columns: headings.map(column).collect(),
                r_cm,
            })
        };
        self.places(is_heading).map(table).collect()
    }

    /// Returns tables of F, with angles as rows.
    pub fn anisotropy(&self) -> Result<Vec<Grid>, DoseError> {
        self.grids(&["theta", "θ", "q(", "q/", "q["])
    }

    /// Returns tables of dose rates, with distances along the axis as rows.
    pub fn along_away(&self) -> Result<Vec<Grid>, DoseError> {
        self.grids(&["z(", "z/", "z[", "along"])
    }

    /// Returns the tables under a heading that has numbers to its right.
    fn grids(&self, begins: &[&str]) -> Result<Vec<Grid>, DoseError> {
        let is_heading = |r: usize, c: usize| {
            let name = plain(self.at(r, c));
            begins.iter().any(|begin| name.starts_with(begin)) && number(self.at(r, c + 1)).is_some()
        };
        let table = |(r, c): (usize, usize)| {
            self.must_be_in_cm(r, c)?;
            // The unit of the upper edge stands above it.
            for (above, beside) in
                (r.saturating_sub(2)..r).flat_map(|above| (c..c + 12).map(move |beside| (above, beside)))
            {
                self.must_be_in_cm(above, beside)?;
            }
            let (rows_at, columns_at) = (self.column_from(r + 1, c), self.row_from(r, c + 1));
            let entry = |i: usize, j: usize| number(self.at(r + 1 + i, c + 1 + j));
            let row = |i: usize| (0..columns_at.len()).map(|j| entry(i, j)).collect();
            Ok(Grid {
                values: (0..rows_at.len()).map(row).collect(),
                rows_at,
                columns_at,
            })
        };
        self.places(is_heading).map(table).collect()
    }

    fn must_be_in_cm(&self, r: usize, c: usize) -> Result<(), DoseError> {
        let name = plain(self.at(r, c));
        match ["mm", "rad)", "rad]", "/rad"].iter().find(|unit| name.contains(**unit)) {
            Some(_) => Err(DoseError::Source(format!(
                "'{}': distances must be in cm and angles in degrees",
                self.at(r, c)
            ))),
            None => Ok(()),
        }
    }

    fn places(&self, is_it: impl Fn(usize, usize) -> bool) -> impl Iterator<Item = (usize, usize)> {
        let all = self
            .0
            .iter()
            .enumerate()
            .flat_map(|(r, row)| (0..row.len()).map(move |c| (r, c)));
        all.filter(move |&(r, c)| is_it(r, c))
    }

    fn at(&self, r: usize, c: usize) -> &str {
        self.0.get(r).and_then(|row| row.get(c)).map_or("", String::as_str)
    }

    /// Returns the numbers from a cell downwards.
    fn column_from(&self, r: usize, c: usize) -> Vec<f64> {
        (r..).map_while(|r| number(self.at(r, c))).collect()
    }

    /// Returns the numbers from a cell to the right.
    fn row_from(&self, r: usize, c: usize) -> Vec<f64> {
        (c..).map_while(|c| number(self.at(r, c))).collect()
    }
}

/// Returns the active length that a heading names, as in `gL(r) L = 0,35 cm`.
pub fn length_in(heading: &str) -> Option<f64> {
    let (_, rest) = heading.split_once('=')?;
    rest.contains("cm").then(|| number(rest))?
}

/// Returns text in lower case and without white space.
pub fn plain(text: &str) -> String {
    text.to_lowercase().split_whitespace().collect()
}

/// Returns the first word as a number, with a decimal point or comma.
fn number(text: &str) -> Option<f64> {
    let word = text.split_whitespace().next()?.replace(',', ".");
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

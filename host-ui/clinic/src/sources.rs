//! The command `host-ui sources`: the sources of the program, and the import of published tables.

use super::CommandError;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::{input, write_whole};
use stylet_dose::Source;
use stylet_dose::decay::s_to_days;
use stylet_dose::source::sheet::{self, Given};
use stylet_dose::source::{Model, Reference};

/// Largest size of a sheet.
const MAX_BYTES: u64 = 4 << 20;
/// First bytes of workbooks: .xls, and the archives .xlsx and .ods.
const WORKBOOKS: [&[u8]; 2] = [b"\xd0\xcf\x11\xe0", b"PK\x03\x04"];

const HELP: &str = "\
The models in the list are values of --source, like source files:
  host-ui dose --source IAI-125A --seeds seeds.csv --strength-u 0.5 --structures gland.nrrd --out dose";

const IMPORT_HELP: &str = "\
The sheets are those of the consensus data of ESTRO and AAPM, or have the same headings: 'L =' with its unit (cGy/(h U) for the dose
rate constant, cm for the active length), 'r (cm)' beside 'gL(r)', 'Theta/deg' or 'q' beside the radii of F, and 'z / cm' beside the
distances of the table of dose rates along and away. Save each sheet of a workbook as text (CSV); decimals may have a comma.

The dose rates are computed from the imported tables and compared with those of the sheet; the deviation is printed and written to
the source file. The file is not written if a table does not fit: other units, angles that do not end at 90 or 180 degrees, gaps,
g that is not 1 at 1 cm, F that is not 1 at 90 degrees, g for another geometry than the active length.

Example:
  host-ui sources import sheet.csv --model S1 --nuclide I-125 --half-life-days 59.4 --publication 'Author, Journal 1, 2 (2020)' \\
      --length-cm 0.45 --diameter-cm 0.08 --out s1.toml
  host-ui dose --source s1.toml --seeds seeds.csv --strength-u 0.5 --points points.csv --out dose";

/// Options of `host-ui sources`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct SourcesArgs {
    #[command(subcommand)]
    task: Option<SourcesTask>,
}

#[derive(Subcommand, Debug)]
enum SourcesTask {
    /// Import published tables of a source, compare them with their table of dose rates, and write a
    /// source file
    Import(Box<ImportArgs>),
}

#[derive(Args, Debug)]
#[command(after_long_help = IMPORT_HELP)]
struct ImportArgs {
    /// Sheets of one source, as text with tabs, semicolons or commas
    #[arg(required = true, value_name = "FILE")]
    sheets: Vec<PathBuf>,
    /// Name of the model
    #[arg(long)]
    model: String,
    /// Nuclide, such as I-125
    #[arg(long)]
    nuclide: String,
    /// Half-life
    #[arg(long, value_name = "DAYS")]
    half_life_days: f64,
    /// Publication of the tables
    #[arg(long, value_name = "TEXT")]
    publication: String,
    /// Digital object identifier of the publication
    #[arg(long)]
    doi: Option<String>,
    /// Dose rate constant in cGy/(h U) [default: that of the sheets]
    #[arg(long, value_name = "VALUE")]
    dose_rate_constant: Option<f64>,
    /// Active length [default: that of the sheets]
    #[arg(long, value_name = "CM")]
    active_length_cm: Option<f64>,
    /// Outer length of the capsule, in which there is no dose [default: from the least radius]
    #[arg(long, value_name = "CM")]
    length_cm: Option<f64>,
    /// Outer diameter of the capsule
    #[arg(long, value_name = "CM")]
    diameter_cm: Option<f64>,
    /// Source file (.toml)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl SourcesArgs {
    pub fn run(self) -> Result<(), CommandError> {
        match self.task {
            Some(SourcesTask::Import(args)) => args.run(),
            None => {
                Source::all_known().for_each(|source| print!("{}", described(&source)));
                Ok(())
            }
        }
    }
}

/// Returns the figures of a source and where they are from.
fn described(source: &Source) -> String {
    let tables = &source.tables;
    let mut text = format!(
        "{}  {}: half-life {} days, dose rate constant {:.3} cGy/(h U), active length {:.2} mm\n",
        source.model,
        source.nuclide,
        s_to_days(source.half_life_s),
        tables.dose_rate_constant_gy_per_s * 3.6e5,
        tables.active_length_m * 1e3,
    );
    let Some(Reference {
        publication,
        doi,
        half_life,
        checked,
    }) = &source.reference
    else {
        return text;
    };
    for (what, said) in [
        ("tables", Some(publication)),
        ("DOI", doi.as_ref()),
        ("half-life", half_life.as_ref()),
        ("checked", checked.as_ref()),
    ] {
        text += &said.map_or_else(String::new, |said| format!("  {what}: {}\n", printable(said)));
    }
    text
}

impl ImportArgs {
    fn run(self) -> Result<(), CommandError> {
        let sheets: Result<Vec<String>, CommandError> = self.sheets.iter().map(|path| text_of(path)).collect();
        let given = Given {
            model: Model {
                model: self.model,
                nuclide: self.nuclide,
                half_life_days: self.half_life_days,
                physical_length_cm: self.length_cm,
                physical_diameter_cm: self.diameter_cm,
                ..Model::default()
            },
            reference: Reference {
                publication: self.publication,
                doi: self.doi,
                ..Reference::default()
            },
            dose_rate_constant: self.dose_rate_constant,
            active_length_cm: self.active_length_cm,
        };
        let imported = sheet::import(&sheets?, given).map_err(|why| format!("{}: {why}", self.sheets[0].display()))?;
        write_whole(&self.out, imported.text.as_bytes())?;
        print!("{}", described(&imported.source));
        for note in &imported.notes {
            println!("  note: {}", printable(note));
        }
        if imported.comparison.is_none() {
            println!("  note: the sheets have no table of dose rates ('z / cm'); nothing was compared");
        }
        println!("written: {}", self.out.display());
        Ok(())
    }
}

/// Reads a sheet; bytes that are not UTF-8, such as a degree sign in Latin-1, are replaced.
fn text_of(path: &Path) -> Result<String, CommandError> {
    let bytes = input::read(path, MAX_BYTES).map_err(|why| format!("{}: {why}", path.display()))?;
    if WORKBOOKS.iter().any(|begin| bytes.starts_with(begin)) {
        return Err(format!("{}: it is a workbook; save each of its sheets as CSV", path.display()).into());
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

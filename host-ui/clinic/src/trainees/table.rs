//! The table of a class: one row for each procedure.

use super::{Class, FIGURES};
use stylet_base::format::cell;

/// Writes CSV with a header.
///
/// # Errors
///
/// If writing fails.
pub fn write(class: &Class, to: impl std::io::Write) -> Result<(), csv::Error> {
    let mut table = csv::Writer::from_writer(to);
    let head = ["trainee", "session"]
        .into_iter()
        .chain(FIGURES.iter().map(|f| f.column));
    table.write_record(head.chain(["exercises", "seeds_planned"]))?;
    for a in &class.attempts {
        let figures = FIGURES
            .iter()
            .map(|f| (f.of)(a).map_or_else(String::new, |v| v.to_string()));
        let names = [&a.trainee, &a.session].map(|name| cell(name).into_owned()).into_iter();
        table.write_record(
            names
                .chain(figures)
                .chain([a.exercises.to_string(), a.seeds[0].to_string()]),
        )?;
    }
    table.flush()?;
    Ok(())
}

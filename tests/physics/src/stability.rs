//! Every hard case of tissue, for every model: finite, unfolded, residual met; and the page with the results.

mod cases;
mod drive;
mod models;
mod table;

#[test]
fn every_model_meets_every_hard_case() {
    let rows = cases::all();
    for row in &rows {
        println!(
            "{:>2} {:<42} {:<20} {} {}",
            row.number, row.case, row.model, row.met, row.happened
        );
    }
    table::write_or_compare(&rows);
    let known = |row: &table::Row| cases::SHORT.iter().any(|(n, kind, _)| table::is(row, *n, *kind));
    let failed: Vec<_> = rows
        .iter()
        .filter(|row| row.met == known(row))
        .map(|row| (row.number, row.case, row.model, row.met))
        .collect();
    assert!(failed.is_empty(), "not met, or met again: {failed:?}");
}

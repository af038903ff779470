//! A class: the debriefs of several trainees over several sessions, compared on one page and in one table.

mod figures;
mod page;
mod picture;
mod read;
mod table;

pub use page::page;
pub use read::Class;
pub use table::write as write_table;

/// Procedure of a trainee.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attempt {
    /// Name of the trainee's folder.
    pub trainee: String,
    /// Name of the procedure's folder, which begins with its date.
    pub session: String,
    /// Heading of the debrief, such as its scene.
    pub title: String,
    /// Mean distance of the seeds from plan, mm.
    pub mean_error_mm: f64,
    /// Largest distance of a seed from plan, mm.
    pub worst_error_mm: f64,
    /// Number of planned seeds, and of lost ones.
    pub seeds: [u64; 2],
    /// D90 of the target over the prescription, %.
    pub d90_percent: Option<f64>,
    /// V100 of the target, %.
    pub v100_percent: Option<f64>,
    /// From the first contact to the last, s.
    pub duration_s: f64,
    /// Largest force on the hand, N.
    pub peak_force_n: f64,
    /// Number of times that an instructor stopped the hand.
    pub stops: u64,
    /// Number of faults that turned the force off.
    pub faults: u64,
    /// Number of faults that an instructor injected.
    pub exercises: u64,
}

/// Figure of an attempt, as page and table show it.
pub struct Figure {
    /// Display name.
    pub name: &'static str,
    /// Name of the table's column.
    pub column: &'static str,
    /// Number of decimals shown; 0 for a count of rare events, for which an interval of Student's t
    /// would be wrong.
    pub decimals: usize,
    /// Value of an attempt, if it has one.
    pub of: fn(&Attempt) -> Option<f64>,
}

const fn figure(name: &'static str, column: &'static str, decimals: usize, of: fn(&Attempt) -> Option<f64>) -> Figure {
    Figure {
        name,
        column,
        decimals,
        of,
    }
}

/// Figures in the order of the columns.
pub const FIGURES: [Figure; 9] = [
    figure("mean seed error (mm)", "mean_error_mm", 2, |a| Some(a.mean_error_mm)),
    figure("worst seed error (mm)", "worst_error_mm", 2, |a| Some(a.worst_error_mm)),
    figure("D90 of the target (% of prescription)", "d90_percent", 1, |a| {
        a.d90_percent
    }),
    figure("V100 of the target (%)", "v100_percent", 1, |a| a.v100_percent),
    figure("time (min)", "time_min", 1, |a| Some(a.duration_s / 60.0)),
    figure("peak force (N)", "peak_force_n", 1, |a| Some(a.peak_force_n)),
    figure("seeds lost", "seeds_lost", 0, |a| Some(a.seeds[1] as f64)),
    figure("stops by the instructor", "stops", 0, |a| Some(a.stops as f64)),
    figure("faults", "faults", 0, |a| Some(a.faults as f64)),
];

#[cfg(test)]
mod tests;

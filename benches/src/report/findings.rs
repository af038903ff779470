//! Findings of a run of the report.

use crate::budget::Cause;
use crate::models::Fitted;
use crate::passes::Passes;
use crate::ships::Ships;
use crate::table::{Point, Row};

/// Everything that the page is written from.
pub struct Findings<'a> {
    pub machine: &'a [(String, String)],
    pub rows: &'a [Row],
    pub points: &'a [Point],
    pub fitted: &'a Fitted,
    /// Spacing (mm) and how far its seeds are from those of the finest spacing (mm, RMS and largest).
    pub refinement: &'a [(f64, f64, f64)],
    /// Shipped models against the converged solution of each tick.
    pub ships: &'a [Ships],
    /// Causes of the error of a needle's line.
    pub causes: &'a [Cause],
    /// One pass over a body in which everything moves.
    pub passes: &'a [Passes],
    pub seconds: f64,
}

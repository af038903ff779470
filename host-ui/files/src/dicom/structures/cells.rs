//! Contours that run along the cells of a lattice, as programs outline a segmentation: their voxels
//! should be those cells.

/// Distance below which corners have the same coordinate; files keep some ten digits.
const SAME_M: f64 = 1e-6;
/// Largest deviation of a coordinate from its lattice, as a share of the pitch.
const OFF: f64 = 0.01;
/// Smallest cell of a segmentation: corners of a drawn contour lie anywhere, and closer together.
const FINEST_M: f64 = 0.1e-3;
/// Fewest lines that show a lattice.
const FEWEST: usize = 3;

/// Returns the pitch of the lattice on which all these coordinates of corners lie; `None` if there
/// is none.
pub fn pitch_m(coordinates: impl Iterator<Item = f64>) -> Option<f64> {
    let mut lines: Vec<f64> = coordinates.collect();
    lines.sort_by(f64::total_cmp);
    lines.dedup_by(|next, line| *next - *line < SAME_M);
    let smallest_m = lines.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    if lines.len() < FEWEST || smallest_m < FINEST_M {
        return None;
    }
    let (first, last) = (lines[0], lines[lines.len() - 1]);
    // The whole extent is known to more digits than one cell.
    let pitch_m = (last - first) / ((last - first) / smallest_m).round();
    let is_on = |line: &f64| {
        let cells = (line - first) / pitch_m;
        (cells - cells.round()).abs() < OFF
    };
    lines.iter().all(is_on).then_some(pitch_m)
}

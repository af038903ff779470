//! Contours that run along the cells of a lattice, as programs outline a segmentation: their voxels should be those cells.

/// Corners nearer than this have the same coordinate; files keep some ten digits.
const SAME_M: f64 = 1e-6;
/// A coordinate may be so far off its lattice, as a share of the pitch.
const OFF: f64 = 0.01;
/// Cells of a segmentation are larger than this: the corners of a contour that was drawn lie anywhere, and near each other.
const FINEST_M: f64 = 0.1e-3;
/// Fewer lines than this show no lattice.
const FEWEST: usize = 3;

/// The distance between two neighbouring lines of the lattice on which all these coordinates of corners lie; `None` where there is
/// none.
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

//! Two lines in the paper's gland, solved.

use crate::line::columns::{ColumnQueue, TOLERANCE, tests::paper};
use crate::line::cross::{Cross, LineStations};
use crate::line::{Line, Stations};
use std::sync::Arc;

/// By reciprocity the columns of one line, read at the other, are those of the other, read at the one: as nearly as
/// they are solved.
#[test]
fn either_line_of_a_pair_may_be_the_one_that_is_solved_for() {
    let (model, first) = paper(1.0);
    let entry_m = first.line.point_m(15e-3, [7e-3, 3e-3]);
    let line = Line::new(entry_m, first.line.axes[0]).expect("a direction");
    // A few stations are enough.
    let first = Stations::along(&model, first.line, first.settings, 12);
    let second = Stations::along(&model, line, first.settings, 16);
    let [of_first, of_second] = [(1, &first), (2, &second)].map(|(n, s)| [Arc::new(LineStations::of(n, s))]);
    let cross = |stations: &Stations, others: &[Arc<LineStations>; 1], tolerance: f64| {
        let mut queue = ColumnQueue::new(&model, stations, false, tolerance).read_beside(others);
        queue.prepare(&model, usize::MAX);
        Cross::of_columns(queue.columns(), stations.line.axes[0], (&model, stations), others).remove(0)
    };
    let mut worst = Vec::new();
    for tolerance in [TOLERANCE, 1e-4] {
        let a = cross(&first, &of_second, tolerance);
        let b = cross(&second, &of_first, tolerance);
        assert_eq!((a.rows(), b.rows()), ([24, 32], [32, 24]));
        let (mut off, mut largest) = (0.0_f64, 0.0_f64);
        for i in 0..24 {
            for j in 0..32 {
                off = off.max((a.at(i, j) - b.at(j, i)).abs());
                largest = largest.max(a.at(i, j).abs());
            }
        }
        println!(
            "columns to {tolerance:.0e}: rows of a pair differ by {:.1e} of the largest, {:.2} mm/N",
            off / largest,
            largest * 1e3
        );
        worst.push(off / largest);
    }
    assert!(worst[0] < 1e-2 && worst[1] < 1e-4, "{worst:?}");
}

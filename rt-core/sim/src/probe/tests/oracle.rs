//! The probe in a small body against felupe's elements and SciPy's solvers (`tests/oracles/probe_felupe.py`).

use super::{displace, finely};
use crate::probe::{ProbePose, ProbeState, step};
use nalgebra::Vector3;

const PRESSED: &str = include_str!("../../../../../tests/oracles/probe_pressed.csv");
/// Last place of the probe in the script, and the middle of the hollow.
const TIP_M: [f64; 3] = [36e-3, 28e-3, 48e-3];
const MIDDLE_M: f64 = 20e-3;

#[test]
fn a_press_of_10_mm_moves_body_and_hand_as_by_felupe_and_scipy() {
    let fixture = finely();
    let mut state = ProbeState::new(&fixture.probe);
    let mut force_n = Vector3::zeros();
    for n in 0..=32 {
        let y = MIDDLE_M + (TIP_M[1] - MIDDLE_M) * f64::from(n) / 32.0;
        let pose = ProbePose::new([TIP_M[0], y, TIP_M[2]], [0.0, 0.0, 1.0]).expect("a pose");
        force_n = Vector3::from(step(&fixture.probe, &mut state, &pose, &[]).wrench.force_n());
    }
    displace(&fixture.probe, &mut state);
    let mut wanted_n = Vector3::zeros();
    let (mut square, mut worst, mut largest, mut count) = (0.0, 0.0_f64, 0.0_f64, 0.0);
    for line in PRESSED.lines().filter(|line| !line.starts_with('#')) {
        let (first, rest) = line.split_once(',').expect("a row");
        let numbers: Vec<f64> = rest.split(',').map(|n| n.parse().expect("a number")).collect();
        if first == "force" {
            wanted_n = Vector3::from_column_slice(&numbers);
            continue;
        }
        let cell = [first.parse().expect("a cell"), numbers[0] as usize, numbers[1] as usize];
        let element = fixture
            .scene
            .body
            .element_of_cell(cell[0], cell[1], cell[2])
            .expect("in the body");
        let ours = Vector3::from_fn(|c, _| f64::from(state.share.0[c][element as usize]));
        let theirs = Vector3::from_column_slice(&numbers[2..]);
        square += (ours - theirs).norm_squared();
        worst = worst.max((ours - theirs).norm());
        largest = largest.max(theirs.norm());
        count += 1.0;
    }
    let off = (force_n - wanted_n).norm() / wanted_n.norm();
    println!(
        "force {:.4?} N, by felupe and SciPy {:.4?} N, off by {:.2} %; {count} cells off by {:.4} mm rms, {:.4} mm at most, of {:.3} mm",
        force_n.as_slice(),
        wanted_n.as_slice(),
        1e2 * off,
        1e3 * f64::sqrt(square / count),
        1e3 * worst,
        1e3 * largest
    );
    assert!(off < 0.05, "{force_n} {wanted_n}");
    assert!(worst < 0.02 * largest, "{worst} of {largest}");
}

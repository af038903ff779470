//! A needle's line and the probe displace each other with the same work.

use super::small;
use crate::line::{Line, ReadyLine};
use crate::needle::LayerKind;
use crate::probe::BodyProbe;

const NUMBER: u64 = 3;

/// Makes a line through the gland above the hollow, along the probe.
fn line() -> ReadyLine {
    let fixture = small();
    let line =
        Line::into_body(&fixture.scene.lattice, [38e-3, 38e-3, -5e-3], [0.0, 0.0, 1.0]).expect("through the block");
    let layer_of = |_: u32| Some(LayerKind::default());
    let ready = ReadyLine::prepare(
        NUMBER,
        &fixture.body,
        &fixture.scene.lattice,
        &layer_of,
        line,
        false,
        &[],
        &mut |_| true,
    );
    ready.expect("a line")
}

#[test]
fn probe_and_line_displace_each_other_reciprocally() {
    let fixture = small();
    let line = line();
    let columns = line.body.answer.columns();
    let mut probe = BodyProbe::new(fixture.probe.clone());
    // A needle that pushes along its line, and the probe pressed.
    let loads_n: Vec<f64> = (0..columns.len())
        .map(|n| if n % 5 == 2 { 0.1 + 0.01 * n as f64 } else { 0.0 })
        .collect();
    let pose = |pressed_m: f64| fixture.pose(pressed_m, 20e-3);
    for n in 0..=20 {
        probe.nothing_beside(|generation| generation == NUMBER);
        probe.beside(NUMBER, columns, &[]);
        probe.follow(&pose(0.4e-3 * f64::from(n)));
    }
    let mut rows_m = vec![0.0; columns.len()];
    assert_eq!(probe.displace_line(NUMBER, &mut rows_m), columns.len());
    let at_line_j: f64 = rows_m.iter().zip(&loads_n).map(|(m, n)| m * n).sum();
    probe.nothing_beside(|generation| generation == NUMBER);
    probe.beside(NUMBER, columns, &loads_n);
    let at_pads_j: f64 = probe
        .beside_m
        .iter()
        .zip(probe.state.loads_n())
        .map(|(m, n)| m * n)
        .sum();
    assert!(
        (at_line_j - at_pads_j).abs() < 1e-12 * at_pads_j.abs() && at_pads_j.abs() > 1e-7,
        "{at_line_j} {at_pads_j}"
    );
    // The other way round: the probe's own columns, read where the stations are, with another element's middle for
    // each.
    let stations = columns.len() / 2;
    let axis = line.body.line.axes[0];
    let (mut square, mut off) = (0.0, 0.0);
    for (n, row_m) in rows_m.iter().enumerate().take(stations) {
        let place_m = line.body.line.point_m((n as f64 + 0.5) * 4e-3, [0.0; 2]);
        let element = fixture.body.lattice().element_at_rest(place_m).expect("in the body");
        let own_m: f64 = (0..3)
            .map(|c| axis[c] * f64::from(probe.share().0[c][element as usize]))
            .sum();
        square += own_m * own_m;
        off += (own_m - row_m).powi(2);
    }
    let off = f64::sqrt(off / square);
    println!(
        "{stations} stations moved by {:.3} mm rms along the line, by the table of the line's columns {:.1} % off",
        1e3 * f64::sqrt(square / stations as f64),
        1e2 * off
    );
    assert!(off < 0.2, "{off}");
}

#[test]
fn columns_of_another_body_do_not_count() {
    let fixture = small();
    let mut probe = BodyProbe::new(fixture.probe.clone());
    let other = vec![crate::tissue::PackedField::zeros(7); 4];
    probe.beside(9, &other, &[1.0; 4]);
    let mut rows_m = [0.0; 4];
    assert_eq!(probe.displace_line(9, &mut rows_m), 0);
    assert!(probe.beside_m.iter().all(|m| *m == 0.0));
}

//! A body in elements of twice the edge.

use super::*;

/// Cells of one material that fill their elements: the same as if the lattice had been that coarse from the start.
#[test]
fn full_elements_are_those_of_a_coarse_lattice() {
    let (fine, coarse) = (block([8, 10, 6], 1e-3), block([4, 5, 3], 2e-3));
    let settings = FemSettings::homogeneous(material(0.45, MEAN), 1e6);
    let made = Arc::new(fine.coarser());
    assert_eq!((made.dims, made.element_count()), (coarse.dims, coarse.element_count()));
    let made = FemModel::<f64>::coarser(&fine, &made, &settings).expect("valid");
    let given = FemModel::<f64>::new(&coarse, &settings).expect("valid");
    let moved = |model: &FemModel<f64>| {
        let mut state = FemState::at_rest(model);
        let held = patch(model.lattice(), 21, [0.2e-3, -0.1e-3, 0.4e-3], 0.0);
        let report = step(model, &mut state, Some(held), &EXACT);
        assert!(report.converged && report.max_displacement > 0.1, "{report:?}");
        (0..60)
            .map(|e| [0, 1, 2].map(|a| state.displacement(a)[e]))
            .collect::<Vec<_>>()
    };
    for (a, b) in moved(&made).iter().zip(moved(&given)) {
        for axis in 0..3 {
            assert!((a[axis] - b[axis]).abs() < 1e-12, "{a:?} {b:?}");
        }
    }
}

/// Half of each element at one side is no tissue: the force for a displacement is near that of the cells, where
/// elements that were full would be twice as stiff.
#[test]
fn elements_that_are_partly_outside_are_as_stiff_as_their_part() {
    let (thin, thick) = (block([3, 8, 8], 1e-3), block([4, 8, 8], 1e-3));
    let settings = FemSettings::homogeneous(material(0.3, MEAN), 0.0);
    let stiffness = |fine: &Lattice, of: &Arc<Lattice>| {
        let model = <f64 as Compiled>::model(fine, of, &settings, &|place_m| place_m[2] < 1e-9).expect("valid");
        let mut state = FemState::at_rest(&model);
        let last = of.element_count() as u32 - 1;
        let report = step(
            &model,
            &mut state,
            Some(patch(of, last, [0.0, 0.0, 0.1e-3], 0.0)),
            &EXACT,
        );
        report.tip_force_n[2]
    };
    let of = |fine: &Lattice| Arc::new(fine.coarser());
    let (part, full) = (stiffness(&thin, &of(&thin)), stiffness(&thick, &of(&thick)));
    assert!((0.6..0.9).contains(&(part / full)), "{part} N and {full} N for 0.1 mm");
}

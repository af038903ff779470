//! A needle on a reused stage gives the same result, bit by bit.

use super::{needle, stage_of};
use crate::rehearse::Stage;
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use stylet_hw::Hand;
use stylet_shm_schema::ParameterSet;
use stylet_sim::scene::TissueKind;

/// A study groups its needles freely: a needle's result must not depend on those before it, nor on their hands.
fn needles_do_not_know_each_other(tissue: TissueKind) {
    let (set, stop) = (ParameterSet::default(), AtomicBool::new(false));
    let needles = [[0.0, 0.0], [0.006, -0.004], [-0.009, 0.002]].map(|[x, y]| {
        let mut run = needle();
        let entry_m = Vector3::from(run.entry_m) + Vector3::new(x, y, 0.0);
        let direction = Vector3::new(0.02 * x.signum(), 0.0, 1.0).normalize();
        (run.entry_m, run.direction) = (entry_m.into(), direction.into());
        let along = |drop: &[f64; 3]| (entry_m + direction * (drop[2] - entry_m.z)).into();
        run.drops_m = run.drops_m.iter().map(along).collect();
        run
    });
    let hands = [200.0, 300.0, 500.0].map(|stiffness_n_per_m| Hand {
        stiffness_n_per_m,
        ..Hand::steady()
    });
    let rehearse = |stage: &mut Stage, n: usize| {
        stage.take_hand(hands[n]);
        stage.rehearse(&needles[n], &set, &stop).expect("goes through")
    };
    let alone = [0, 1, 2].map(|n| rehearse(&mut stage_of(tissue), n));
    let mut shared = stage_of(tissue);
    for n in [2, 0, 1, 1, 2, 0] {
        assert_eq!(rehearse(&mut shared, n), alone[n], "needle {n} in {}", tissue.name());
    }
    assert_ne!(alone[0].peak_force_n, alone[1].peak_force_n);
    assert!(
        alone
            .iter()
            .all(|r| r.target_shift_m > 0.1e-3 && r.target_shift_m <= r.largest_displacement_m)
    );
    assert!(
        alone
            .iter()
            .all(|r| r.displacement_before_puncture_m <= r.largest_displacement_m)
    );
}

#[test]
fn in_chainmail_the_order_of_needles_changes_no_bit() {
    needles_do_not_know_each_other(TissueKind::ChainMail);
}

#[test]
fn in_the_paper_s_tissue_the_order_of_needles_changes_no_bit() {
    needles_do_not_know_each_other(TissueKind::Paper);
}

#[test]
fn in_finite_elements_the_order_of_needles_changes_no_bit() {
    needles_do_not_know_each_other(TissueKind::Fem);
}

//! Rehearsals of needles that bend, of creeping tissue, and of needles that miss their holes.

use super::*;

/// Creeping tissue keeps moving after the needle stops, and its seeds rest where it ends up.
#[test]
fn tissue_that_creeps_repeats_bit_by_bit_and_moves_seeds() {
    let (mut stage, run, stop) = (stage(), needle(), AtomicBool::new(false));
    let mut creeping = ParameterSet::default();
    creeping.set(ParameterId::QuickCreep, 0.6);
    creeping.set(ParameterId::SlowCreep, 1.0);
    let elastic = stage
        .rehearse(&run, &ParameterSet::default(), &stop)
        .expect("goes through");
    let first = stage.rehearse(&run, &creeping, &stop).expect("goes through");
    assert_eq!(first, stage.rehearse(&run, &creeping, &stop).expect("goes through"));
    let along = |r: &Rehearsed| r.seeds.iter().map(|s| 1e3 * s.position_m[2]).collect::<Vec<_>>();
    println!(
        "elastic {:.2?} mm, {:.2} N; creeping {:.2?} mm, {:.2} N",
        along(&elastic),
        elastic.peak_force_n,
        along(&first),
        first.peak_force_n
    );
    let moved = along(&elastic)
        .iter()
        .zip(along(&first))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(moved > 0.1 && moved < 10.0, "{moved} mm");
    // Terms that are off have no effect.
    assert_eq!(
        elastic,
        stage
            .rehearse(&run, &ParameterSet::default(), &stop)
            .expect("goes through")
    );
}

/// A bending needle drops its seeds off the straight path, towards its bevel side, at every speed alike; a rigid one
/// does not.
#[test]
fn a_needle_that_bends_leaves_its_seeds_to_the_side_of_its_bevel() {
    let (mut stage, mut run, stop) = (stage(), needle(), AtomicBool::new(false));
    let rigid = stage
        .rehearse(&run, &ParameterSet::default(), &stop)
        .expect("goes through");
    assert_eq!(rigid.deflection_m, 0.0);
    let mut bending = ParameterSet::default();
    bending.set(ParameterId::BendingStiffness, 0.016);
    let first = stage.rehearse(&run, &bending, &stop).expect("goes through");
    assert_eq!(first, stage.rehearse(&run, &bending, &stop).expect("goes through"));
    let beside = |r: &Rehearsed| {
        let pairs = r.seeds.iter().zip(&rigid.seeds);
        pairs
            .map(|(a, b)| 1e3 * (a.position_m[0] - b.position_m[0]))
            .collect::<Vec<_>>()
    };
    println!(
        "deflection {:.3} mm; seeds {:.3?} mm towards x",
        1e3 * first.deflection_m,
        beside(&first)
    );
    assert!(first.deflection_m > 0.1e-3 && first.deflection_m < 5e-3);
    assert!(beside(&first)[0] > 0.05, "the deepest");
    run.insert_m_per_s = 0.12;
    let fast = stage.rehearse(&run, &bending, &stop).expect("goes through");
    let apart = beside(&first)
        .iter()
        .zip(beside(&fast))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    println!("50 against 120 mm/s: {apart:.4} mm apart across");
    assert!(apart < 0.1);
    run.insert_m_per_s = 0.05;
    assert_eq!(
        rigid,
        stage
            .rehearse(&run, &ParameterSet::default(), &stop)
            .expect("goes through")
    );
}

#[test]
fn scatter_moves_a_rehearsed_needle_reproducibly_by_seed() {
    let (mut stage, run, stop) = (stage(), needle(), AtomicBool::new(false));
    let mut set = ParameterSet::default();
    set.set(ParameterId::EntryScatter, 1.5e-3);
    set.set(ParameterId::SkinDeflection, 3.7_f64.to_radians());
    let first = stage.rehearse(&run, &set, &stop).expect("goes through");
    assert_eq!(first, stage.rehearse(&run, &set, &stop).expect("goes through"));
    set.set(ParameterId::ScatterSeed, 2.0);
    let second = stage.rehearse(&run, &set, &stop).expect("goes through");
    let beside = |r: &Rehearsed| {
        (Vector3::from(r.seeds[0].position_m) - Vector3::from(run.drops_m[0]))
            .xy()
            .norm()
    };
    println!("{:.2} and {:.2} mm beside", 1e3 * beside(&first), 1e3 * beside(&second));
    assert!(beside(&first) > 0.2e-3 && (beside(&first) - beside(&second)).abs() > 0.1e-3);
}

//! Seeds that migrate back along their track once the needle is out.

use super::*;

#[test]
fn seeds_migrate_towards_the_entry_where_it_is_asked_for() {
    let (mut stage, stop) = (stage(), AtomicBool::new(false));
    let mut set = ParameterSet::default();
    let still = stage.rehearse(&needle(), &set, &stop).expect("goes through");
    set.set(ParameterId::MigratingShare, 1.0);
    set.set(ParameterId::MigrationSpeed, 2e-3);
    let moved = stage.rehearse(&needle(), &set, &stop).expect("goes through");
    for (a, b) in still.seeds.iter().zip(&moved.seeds) {
        let by_m = Vector3::from(b.position_m) - Vector3::from(a.position_m);
        println!("moved by {:?} mm", by_m * 1e3);
        assert!(by_m.z < -0.2e-3 && by_m.xy().norm() < 0.05e-3, "{by_m:?}");
    }
    // A strand holds its seeds.
    let mut strand = needle();
    strand.strand_pitch_m = Some(strand.drops_m[0][2] - strand.drops_m[1][2]);
    let held = stage.rehearse(&strand, &set, &stop).expect("goes through");
    set.set(ParameterId::MigratingShare, 0.0);
    assert_eq!(
        held.seeds,
        stage.rehearse(&strand, &set, &stop).expect("goes through").seeds
    );
    assert_eq!(
        still.seeds,
        stage.rehearse(&needle(), &set, &stop).expect("goes through").seeds
    );
}

//! Shards, threads and interruptions: the same bits, and nothing twice.

use super::{study_in, text};
use crate::progress::Progress;
use crate::{Ended, Order, Study, StudyError, run};
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};
use stylet_insertions::{Shard, Table, digest, read, shard_files, structures_file};

const FEW: &str = r#"
implants = 9
tissue = "paper"
[vary]
stiffness = { choice = [0.5, 1.0, 2.0] }
hand_stiffness_n_per_m = { uniform = [150.0, 600.0] }
insert_mm_per_s = { uniform = [60.0, 120.0] }
entry_right_mm = { normal = [0.0, 1.0], within = [-3.0, 3.0] }
tilt_anterior_deg = { uniform = [-1.0, 1.0] }
"needle.puncture_depth" = { uniform = [7.5, 10.0] }
"#;

fn few(folder: &Path) -> Study {
    // [vary] would end the keys of the first table.
    let (keys, vary) = FEW.split_once("[vary]").expect("it varies");
    study_in(folder, &(text(keys) + "[vary]" + vary)).expect("valid")
}

fn order(folder: &Path, number: u32, of: u32, jobs: usize) -> Order {
    Order {
        shard: Shard { number, of },
        folder: folder.to_owned(),
        jobs: NonZeroUsize::new(jobs).expect("some"),
    }
}

fn finished(study: &Study, order: &Order) -> Table {
    match run(
        study,
        order,
        &AtomicBool::new(false),
        &Progress::new(std::time::Duration::MAX),
    )
    .expect("runs")
    {
        Ended::Now { table, .. } => table,
        ended => panic!("{ended:?}"),
    }
}

/// Runs all of a study on every core.
pub fn finished_in(study: &Study) -> Table {
    let folder = tempfile::tempdir().expect("a folder");
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    finished(study, &order(folder.path(), 1, 1, jobs))
}

fn all_of(folder: &Path) -> Table {
    let files = shard_files(folder).expect("there is a folder");
    let tables = files.iter().map(|(_, path)| read(path).expect("complete"));
    tables
        .reduce(|mut all, next| {
            all.rows.extend(next.rows);
            all
        })
        .expect("at least one shard")
}

#[test]
fn two_shards_and_seven_give_the_same_bits_on_any_number_of_threads() {
    let place = tempfile::tempdir().unwrap();
    let study = few(place.path());
    let (two, seven) = (place.path().join("two"), place.path().join("seven"));
    (1..=2).for_each(|k| drop(finished(&study, &order(&two, k, 2, 2))));
    // The last ones first.
    (1..=7)
        .rev()
        .for_each(|k| drop(finished(&study, &order(&seven, k, 7, 1))));
    let (two, seven) = (all_of(&two), all_of(&seven));
    assert_eq!((two.rows.len(), digest(&two)), (18, digest(&seven)));
    assert_eq!(two.rows, seven.rows, "and stand in the same order");
    let failed: Vec<_> = two.rows.iter().filter_map(|row| row.outcome.as_ref().err()).collect();
    assert!(
        failed.is_empty() && two.rows.iter().all(|row| row.seeds.len() == 2),
        "{failed:?}"
    );
    let ids: std::collections::BTreeSet<_> = two.rows.iter().map(|row| &row.id).collect();
    assert_eq!(ids.len(), 18);
    let stiffness: std::collections::BTreeSet<u64> = two.rows.iter().map(|row| row.drawn[0].to_bits()).collect();
    assert!(stiffness.len() > 1, "bodies were exchanged on the way");
}

fn parts(folder: &Path) -> BTreeMap<String, (Vec<u8>, SystemTime)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let parts = entries.filter(|e| e.path().extension().is_some_and(|ending| ending == "parquet"));
    let about = |e: std::fs::DirEntry| {
        let modified = e.metadata().and_then(|m| m.modified()).expect("there");
        (
            e.file_name().into_string().expect("ours"),
            (std::fs::read(e.path()).expect("there"), modified),
        )
    };
    parts.map(about).collect()
}

#[test]
fn a_shard_that_is_stopped_continues_with_what_is_missing_and_a_finished_one_is_skipped() {
    let place = tempfile::tempdir().unwrap();
    let study = few(place.path());
    let folder = place.path().join("out");
    let order = order(&folder, 1, 1, 1);
    let under_way = folder.join(order.shard.name());
    let stop = AtomicBool::new(false);
    let ended = std::thread::scope(|scope| {
        scope.spawn(|| {
            while parts(&under_way).len() < 3 {
                std::thread::sleep(Duration::from_millis(1));
            }
            stop.store(true, Ordering::Relaxed);
        });
        run(&study, &order, &stop, &Progress::new(std::time::Duration::MAX)).expect("stops")
    });
    let kept = parts(&under_way);
    assert!(
        matches!(ended, Ended::Stopped { implants, of: 9 } if implants == kept.len()),
        "{ended:?}"
    );
    assert!(
        shard_files(&folder).unwrap().is_empty(),
        "nothing has the name of a finished shard"
    );

    // Half of the rest, then all.
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while parts(&under_way).len() < kept.len() + 2 {
                std::thread::sleep(Duration::from_millis(1));
            }
            stop.store(true, Ordering::Relaxed);
        });
        run(&study, &order, &stop, &Progress::new(std::time::Duration::MAX)).expect("stops")
    });
    let again = parts(&under_way);
    for (name, before) in &kept {
        assert_eq!(Some(before), again.get(name), "{name} was not written again");
    }
    let Ended::Now { table, kept } = run(
        &study,
        &order,
        &AtomicBool::new(false),
        &Progress::new(std::time::Duration::MAX),
    )
    .unwrap() else {
        panic!("it was not finished");
    };
    assert_eq!((kept, table.rows.len()), (2 * again.len(), 18));
    assert!(!under_way.exists());
    let other = place.path().join("other");
    assert_eq!(
        digest(&table),
        digest(&finished(&study, &self::order(&other, 1, 1, 2))),
        "as without a stop"
    );

    let written = std::fs::metadata(order.shard.file(&folder))
        .and_then(|m| m.modified())
        .unwrap();
    let skipped = run(
        &study,
        &order,
        &AtomicBool::new(false),
        &Progress::new(std::time::Duration::MAX),
    )
    .unwrap();
    assert!(matches!(skipped, Ended::Before(found) if found == table));
    assert_eq!(
        std::fs::metadata(order.shard.file(&folder))
            .and_then(|m| m.modified())
            .unwrap(),
        written
    );
}

#[test]
fn another_study_and_another_division_do_not_get_into_the_folder() {
    let place = tempfile::tempdir().unwrap();
    let mut study = few(place.path());
    study.implants = 1;
    let folder = place.path().join("out");
    finished(&study, &order(&folder, 1, 1, 1));
    let refused = |study: &Study, of| {
        run(
            study,
            &order(&folder, 1, of, 1),
            &AtomicBool::new(false),
            &Progress::new(std::time::Duration::MAX),
        )
    };
    let why = refused(&study, 2).expect_err("divided otherwise");
    assert!(
        matches!(why, StudyError::OtherDivision { found: 1, asked: 2, .. }),
        "{why}"
    );
    study.fingerprint = "another".to_owned();
    let why = refused(&study, 1).expect_err("another study").to_string();
    assert!(why.contains("belongs to another study"), "{why}");
}

#[test]
fn a_needle_that_cannot_go_in_is_a_row_with_its_reason_and_its_plan() {
    let place = tempfile::tempdir().unwrap();
    let mut study = few(place.path());
    study.implants = 1;
    study.glands[0].plan.needles[0].seeds = vec![(5.0, 0.5)];
    let table = finished(&study, &order(&place.path().join("out"), 1, 1, 1));
    let why = table.rows[0]
        .outcome
        .as_ref()
        .expect_err("the drop is in front of the gland");
    assert!(why.contains("outside the tissue"), "{why}");
    assert!(table.rows[0].seeds[0].rest.is_none() && table.rows[1].outcome.is_ok());
}

/// The cells of the label volume are those of the scene: 19,307 elements of `paper`, by its documentation.
#[test]
fn the_structures_stand_beside_the_results() {
    let place = tempfile::tempdir().unwrap();
    let mut study = few(place.path());
    study.implants = 1;
    let folder = place.path().join("out");
    finished(&study, &order(&folder, 1, 1, 1));
    let bytes = std::fs::read(structures_file(&folder, "paper")).unwrap();
    let labels = &bytes[bytes.len() - 107 * 62 * 176..];
    assert_eq!(labels.iter().filter(|&&label| label == 1).count(), 19_307);
    assert!(bytes.starts_with(b"NRRD0004\n") && labels.iter().all(|&label| label <= 1));
}

//! Figures against closed forms, folders with inconsistent studies, dose of moved and unmoved
//! seeds.

use super::*;
use figures::influences;
use std::path::Path;
use stylet_insertions::{About, Insertion, Motion, Rest, Seed, Shard, Table, structures_file};

const SIDE: usize = 20;

/// Returns an insertion whose seeds are off by `off_mm` along z.
fn row(implant: i32, needle: i32, off_mm: f64) -> Insertion {
    let seed = |z: f64| Seed {
        planned_mm: [8.0 + 4.0 * f64::from(needle), 20.0, z],
        planned_axis: [0.0, 0.0, 1.0],
        strength_u: 0.5,
        rest: Some(Rest {
            at_mm: [8.0 + 4.0 * f64::from(needle), 20.0, z + off_mm],
            axis: [0.0, 0.0, 1.0],
            dropped_after_s: 1.0,
        }),
    };
    Insertion {
        id: format!("t/cube/p/{implant:06}/{needle:03}"),
        scene: "cube".to_owned(),
        plan: "p".to_owned(),
        implant,
        needle,
        hole: String::new(),
        tissue: "chainmail".to_owned(),
        source: "6711".to_owned(),
        prescription_gy: 20.0,
        drawn: vec![off_mm.powi(3), f64::from(implant % 2)],
        outcome: Ok(Motion {
            peak_force_n: 5.0,
            displacement_before_puncture_mm: 1.0,
            largest_displacement_mm: 2.0,
            target_shift_mm: 1.5,
            duration_s: 9.0,
        }),
        seeds: vec![seed(15.0), seed(25.0)],
    }
}

/// Returns an insertion with other seeds.
pub fn insertion_with(seeds: Vec<Seed>) -> Insertion {
    Insertion {
        seeds,
        ..row(1, 1, 0.0)
    }
}

fn table(rows: Vec<Insertion>) -> Table {
    Table {
        about: About {
            study: "t".to_owned(),
            fingerprint: "one".to_owned(),
            ..About::default()
        },
        quantities: vec!["grows".to_owned(), "alternates".to_owned()],
        rows,
    }
}

fn write(folder: &Path, number: u32, of: u32, table: &Table) {
    stylet_insertions::write(&Shard { number, of }.file(folder), table).expect("written");
}

/// Writes a cube of 40 mm that is all target.
fn structures(folder: &Path) {
    let text = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: {SIDE} {SIDE} {SIDE}\n\
         space directions: (2,0,0) (0,2,0) (0,0,2)\nkinds: domain domain domain\nencoding: raw\nspace origin: (1,1,1)\n\n"
    );
    let mut bytes = text.into_bytes();
    bytes.extend(vec![1; SIDE.pow(3)]);
    std::fs::write(structures_file(folder, "cube"), bytes).unwrap();
}

#[test]
fn figures_are_those_of_the_closed_form() {
    let d = Distribution::new("n", "", "seed", (1..=101).rev().map(f64::from).collect());
    assert_eq!(
        (d.mean(), d.percentile(0.0), d.percentile(5.0), d.percentile(100.0)),
        (Some(51.0), Some(1.0), Some(6.0), Some(101.0))
    );
    // n (n + 1) / 12 for 1 to n.
    assert!((d.deviation().unwrap().powi(2) - 101.0 * 102.0 / 12.0).abs() < 1e-9);
    assert_eq!(Distribution::new("n", "", "seed", Vec::new()).percentile(50.0), None);
}

/// Two seeds planned 10 mm apart: one insertion leaves them so, in the other one the second rests behind the first.
#[test]
fn neighbours_without_a_gap_touch() {
    let mut rows = vec![row(1, 1, 0.0), row(1, 2, 0.0)];
    let first_mm = rows[1].seeds[0].rest.unwrap().at_mm;
    rows[1].seeds[1].rest.as_mut().unwrap().at_mm = [first_mm[0], first_mm[1], first_mm[2] + 4.55];
    let gaps = figures::gaps_mm(&rows);
    assert!(
        (gaps[0] - 5.5).abs() < 1e-9 && (gaps[1] - 0.05).abs() < 1e-9,
        "{gaps:?}"
    );
    assert_eq!(figures::touching(&gaps), 1);
}

#[test]
fn a_monotone_influence_has_rank_correlation_one() {
    let rows = (1..=8).map(|n| row(n, 1, f64::from((n + 1) / 2))).collect();
    let found = influences(&table(rows));
    assert_eq!(found[0].0, "grows");
    assert!(
        (found[0].1 - 1.0).abs() < 1e-12 && found[1].1.abs() < 1e-12,
        "{found:?}"
    );
}

#[test]
fn unmoved_seeds_give_the_planned_dose() {
    let folder = tempfile::tempdir().unwrap();
    structures(folder.path());
    let mut rows: Vec<Insertion> = (1..=3).map(|needle| row(1, needle, 0.0)).collect();
    rows.extend((1..=3).map(|needle| row(2, needle, 12.0)));
    rows.extend((1..=2).map(|needle| row(3, needle, 0.0)));
    let scored = score(folder.path(), &table(rows), || ()).expect("scores");
    assert_eq!(
        (scored.implants.len(), scored.incomplete),
        (2, 1),
        "the third lacks a needle"
    );
    let [still, moved] = &scored.implants[..] else { panic!() };
    assert_eq!((still.planned, still.seeds), (still.delivered, 6));
    assert_eq!(still.planned, moved.planned);
    assert!(
        moved.delivered.d90_percent < 0.9 * still.delivered.d90_percent,
        "{moved:?} {still:?}"
    );
    assert!(moved.delivered.v100_percent < still.delivered.v100_percent);
}

#[test]
fn only_shards_of_one_study_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(load(folder.path()), Err(PopulationError::Empty(_))));
    let (first, second) = (table(vec![row(1, 1, 1.0)]), table(vec![row(2, 1, 2.0)]));
    write(folder.path(), 1, 3, &first);
    write(folder.path(), 3, 3, &second);
    let both = load(folder.path()).expect("joins");
    assert_eq!((both.table.rows.len(), both.shards), (2, [2, 3]));

    write(folder.path(), 2, 3, &first);
    assert!(matches!(load(folder.path()), Err(PopulationError::Twice(id)) if id == first.rows[0].id));
    let mut other = second.clone();
    other.about.fingerprint = "two".to_owned();
    write(folder.path(), 2, 3, &other);
    assert!(matches!(load(folder.path()), Err(PopulationError::OtherStudy { .. })));
    write(folder.path(), 2, 2, &second);
    assert!(matches!(
        load(folder.path()),
        Err(PopulationError::OtherDivision { .. })
    ));
}

#[test]
fn the_page_is_self_contained_and_shows_missing_data() {
    let folder = tempfile::tempdir().unwrap();
    structures(folder.path());
    let mut rows: Vec<Insertion> = (1..=30).map(|n| row(n, 1, 0.1 * f64::from(n))).collect();
    rows[3].outcome = Err("the tip <was> outside".to_owned());
    rows[3].seeds.iter_mut().for_each(|seed| seed.rest = None);
    write(folder.path(), 2, 5, &table(rows));
    let population = load(folder.path()).expect("reads");
    let scored = score(folder.path(), &population.table, || ()).expect("scores");
    let figures = figures(&population.table, &scored);
    let page = page(&population, &scored, &figures).expect("draws");
    for text in [
        "1 of 5 shards",
        "Failed insertions, in no distribution: 1 of 30",
        "the tip &lt;was&gt; outside",
        "4.9 mm",
        "1,197 seeds",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("http") || !page.contains("<script"), "nothing is loaded");
    write_tables(folder.path(), &population.table, &scored, &figures).expect("written");
    let lines = |name: &str| {
        std::fs::read_to_string(folder.path().join(name))
            .unwrap()
            .lines()
            .count()
    };
    assert_eq!((lines("insertions.csv"), lines("implants.csv")), (31, 30));
    let distributions = std::fs::read_to_string(folder.path().join("distributions.csv")).unwrap();
    assert!(
        distributions.contains("Seed misplacement,mm,seed,58,"),
        "{distributions}"
    );
}

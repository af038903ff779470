//! Files preserve every bit, and a damaged file names what it lacks.

use super::*;
use std::path::Path;

fn seed(n: usize, rests: bool) -> Seed {
    let x = n as f64 + 0.1;
    Seed {
        planned_mm: [x, -x, 2.0 * x],
        planned_axis: [0.0, 0.0, 1.0],
        strength_u: 0.5,
        rest: rests.then_some(Rest {
            at_mm: [x + 3.0, -x, 2.0 * x - 4.0],
            axis: [0.0, 1.0, 0.0],
            dropped_after_s: 1.0 / 3.0,
        }),
    }
}

fn row(n: usize, seeds: usize, outcome: Result<Motion, String>) -> Insertion {
    Insertion {
        id: format!("s/paper/p/{n:06}/001"),
        scene: "paper".to_owned(),
        plan: "p".to_owned(),
        implant: n as i32,
        needle: 1,
        hole: "G7".to_owned(),
        tissue: "chainmail".to_owned(),
        source: "6711".to_owned(),
        prescription_gy: 145.0,
        drawn: vec![n as f64 / 7.0, f64::MIN_POSITIVE],
        seeds: (0..seeds).map(|n| seed(n, outcome.is_ok())).collect(),
        outcome,
    }
}

fn table() -> Table {
    let motion = Motion {
        peak_force_n: 5.25,
        displacement_before_puncture_mm: 1.0 / 3.0,
        largest_displacement_mm: 7.0,
        target_shift_mm: 2.0,
        duration_s: 9.5,
    };
    Table {
        about: About {
            study: "s".to_owned(),
            fingerprint: "ab".to_owned(),
            definition: "name = \"s\"\n".to_owned(),
            made_by: "test 1".to_owned(),
        },
        quantities: vec!["stiffness".to_owned(), "insert_mm_per_s".to_owned()],
        rows: vec![
            row(1, 3, Ok(motion)),
            row(2, 0, Ok(motion)),
            row(3, 2, Err("the tip was outside".to_owned())),
            row(4, 1, Ok(motion)),
        ],
    }
}

fn written(folder: &Path, table: &Table) -> std::path::PathBuf {
    let path = Shard::WHOLE.file(folder);
    write(&path, table).expect("written");
    path
}

#[test]
fn a_table_survives_its_file_bit_by_bit_and_so_does_one_without_rows() {
    let folder = tempfile::tempdir().unwrap();
    let empty = Table {
        rows: Vec::new(),
        ..table()
    };
    for table in [table(), empty] {
        let path = written(folder.path(), &table);
        assert_eq!(read(&path).expect("reads"), table);
    }
}

#[test]
fn the_same_table_is_written_as_the_same_bytes() {
    let [one, other] = [(), ()].map(|()| tempfile::tempdir().unwrap());
    let bytes = |folder: &Path| std::fs::read(written(folder, &table())).unwrap();
    assert_eq!(bytes(one.path()), bytes(other.path()));
}

#[test]
fn the_digest_knows_every_bit_and_no_order() {
    let (sorted, mut turned) = (table(), table());
    turned.rows.reverse();
    assert_eq!(digest(&sorted), digest(&turned));
    let rest = turned.rows[3].seeds[1].rest.as_mut().expect("rests");
    rest.at_mm[2] = f64::from_bits(rest.at_mm[2].to_bits() + 1);
    assert_ne!(digest(&sorted), digest(&turned));
}

#[test]
fn what_is_no_table_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &table());
    let whole = std::fs::read(&path).unwrap();
    for cut in [0, 3, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let why = read(&path).expect_err("it is cut").to_string();
        assert!(
            why.contains("shard-00001-of-00001.parquet") && why.contains("run its shard again"),
            "{why}"
        );
    }
}

#[test]
fn misplacement_is_the_distance_to_plan_and_its_axial_part() {
    assert_eq!(seed(2, true).misplacement_mm(), Some([5.0, -4.0]));
    assert_eq!(seed(2, false).misplacement_mm(), None);
}

#[test]
fn shards_divide_everything_once() {
    for (count, of) in [(1000, 2), (1000, 7), (3, 5), (0, 4)] {
        let all: Vec<usize> = (1..=of).flat_map(|number| Shard { number, of }.range(count)).collect();
        assert_eq!(all, (0..count).collect::<Vec<_>>(), "{count} in {of}");
    }
    let shard: Shard = "3/8".parse().unwrap();
    assert_eq!(Shard::of_name(&format!("{}.parquet", shard.name())), Some(shard));
    for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2"] {
        assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
    }
}

//! The study of `make population` in short: no two seeds of a needle rest nearer than touching.

use super::shards::finished_in;
use super::validation::study;
use crate::Study;
use stylet_insertions::{Insertion, Seed};
use stylet_shm_schema::SEED_LENGTH_M;

/// The next seed used to pass the last one: 65 % of loose neighbours planned 10 mm apart rested less than a seed's
/// length apart.
#[test]
fn no_two_seeds_of_a_population_rest_nearer_than_touching() {
    let short = Study {
        implants: 1,
        ..study("population.toml")
    };
    let table = finished_in(&short);
    let apart_mm = |row: &Insertion| -> Vec<f64> {
        let rest = |seed: &Seed| seed.rest.map(|rest| nalgebra::Vector3::from(rest.at_mm));
        let pairs = row.seeds.windows(2);
        pairs
            .filter_map(|pair| Some((rest(&pair[0])? - rest(&pair[1])?).norm()))
            .collect()
    };
    let loose = table.rows.iter().filter(|row| row.plan == "paper-loose-plan");
    let apart_mm: Vec<f64> = loose.flat_map(apart_mm).collect();
    let nearest_mm = apart_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let touching = apart_mm.iter().filter(|mm| **mm < 1e3 * SEED_LENGTH_M + 0.1).count();
    println!(
        "{touching} of {} pairs touch, the nearest two at {nearest_mm} mm",
        apart_mm.len()
    );
    assert!(apart_mm.len() > 20 && touching > 0, "{apart_mm:?}");
    // The tissue is at rest to 0.05 mm somewhere.
    assert!(nearest_mm > 1e3 * SEED_LENGTH_M - 1e-2, "{nearest_mm}");
}

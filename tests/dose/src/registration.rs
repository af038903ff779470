//! The fit of day 30 to day 0 by seeds, on simulated pairs of a gland that swells, with lost and migrated seeds, beside
//! a shift of the centroids alone.

use nalgebra::{Rotation3, Unit, Vector3};
use std::fmt::Write;
use stylet_dose::edema::Edema;
use stylet_implant::registration::RigidFit;
use stylet_random::Random;
use stylet_test_kit::repository;

const PAGE: &str = "docs/after-implant.md";
const MARKS: [&str; 2] = [
    "<!-- rows of registration -->\n",
    "<!-- end of the rows of registration -->",
];
const PAIRS: u64 = 40;
/// Standard deviations in mm: of a seed from its planned place across and along its needle, and of its place in a CT.
const PLACED_MM: [f64; 3] = [1.5, 1.5, 3.0];
const FOUND_MM: f64 = 0.5;
const MOST_TURN_DEG: f64 = 10.0;
const MOST_SHIFT_MM: f64 = 60.0;
const MIGRATION_MM: f64 = 20.0;
/// Share of the volume and half-life in days (mean of Waterman et al. 1998).
const EDEMA: [f64; 2] = [0.5, 9.3];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Swelling {
    None,
    Even,
    Along,
}

impl Swelling {
    const ALL: [(Self, &'static str); 3] = [
        (Self::None, "none"),
        (Self::Even, "even"),
        (Self::Along, "along the needles"),
    ];

    /// Returns the stretch of each axis some days after the implant.
    fn stretch(self, days: f64) -> Vector3<f64> {
        let even = Edema::of_days(EDEMA[0], EDEMA[1]).stretch(days * 86_400.0);
        match self {
            Self::None => Vector3::repeat(1.0),
            Self::Even => Vector3::repeat(even),
            Self::Along => Vector3::new(1.0, 1.0, even.powi(3)),
        }
    }
}

/// Errors in mm, of the fit and of the centroids.
#[derive(Default)]
struct Found {
    fit_mm: Vec<f64>,
    centroids_mm: Vec<f64>,
    right: usize,
    pairs: usize,
}

fn normal(random: &mut Random) -> f64 {
    // Box and Muller; 1 - unit is above 0.
    (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (std::f64::consts::TAU * random.unit()).cos()
}

fn deviations(random: &mut Random, sigma_mm: [f64; 3]) -> Vector3<f64> {
    Vector3::from(sigma_mm.map(|sigma| sigma * normal(random)))
}

fn direction(random: &mut Random) -> Unit<Vector3<f64>> {
    Unit::new_normalize(deviations(random, [1.0; 3]))
}

/// Returns seeds 10 mm apart on needles in an ellipsoid of 36 cc, misplaced at random, in mm.
fn implant(random: &mut Random) -> Vec<Vector3<f64>> {
    let mut seeds = Vec::new();
    for (i, j) in (-2..=2).flat_map(|i| (-2..=2).map(move |j| (i, j))) {
        let (x, y) = (f64::from(i) * 10.0, f64::from(j) * 8.0);
        for k in -4..=4 {
            // Neighbouring needles begin half a distance apart.
            let z = f64::from(k) * 10.0 + f64::from((i + j) & 1) * 5.0;
            if (x / 24.0_f64).powi(2) + (y / 18.0_f64).powi(2) + (z / 20.0_f64).powi(2) < 1.0 {
                seeds.push(Vector3::new(x, y, z) + deviations(random, PLACED_MM));
            }
        }
    }
    seeds
}

fn metres(places_mm: &[Vector3<f64>]) -> Vec<[f64; 3]> {
    places_mm.iter().map(|p| (p * 1e-3).into()).collect()
}

fn middle(places: &[Vector3<f64>]) -> Vector3<f64> {
    places.iter().sum::<Vector3<f64>>() / places.len() as f64
}

/// Simulates a pair and registers it.
fn simulate(random: &mut Random, swelling: Swelling, (lost, migrated): (usize, usize), found: &mut Found) {
    let seeds = implant(random);
    let seen = |random: &mut Random, days: f64| -> Vec<Vector3<f64>> {
        let stretch = swelling.stretch(days);
        let place = |p: &Vector3<f64>| p.component_mul(&stretch) + deviations(random, [FOUND_MM; 3]);
        seeds.iter().map(place).collect()
    };
    let (day0, mut truth) = (seen(random, 0.0), seen(random, 30.0));
    let mut order: Vec<usize> = (0..truth.len()).collect();
    // Shuffles, so that the first ones are lost, and the others lie in any order.
    for n in (1..order.len()).rev() {
        order.swap(n, random.below(n + 1));
    }
    order.drain(..lost);
    for &seed in &order[..migrated] {
        truth[seed] += direction(random).into_inner() * MIGRATION_MM;
    }
    order.rotate_left(migrated * 7);
    let turn = Rotation3::from_axis_angle(&direction(random), (random.unit() * MOST_TURN_DEG).to_radians());
    let shift = Vector3::from([(); 3].map(|()| random.signed() * MOST_SHIFT_MM));
    let truth: Vec<Vector3<f64>> = order.iter().map(|&seed| truth[seed]).collect();
    let day30: Vec<Vector3<f64>> = truth.iter().map(|p| turn.inverse() * (p - shift)).collect();
    let fit = RigidFit::of(&metres(&day0), &metres(&day30)).expect("enough seeds");
    let centroids = middle(&day0) - middle(&day30);
    for (there, truth) in day30.iter().zip(&truth) {
        let placed = Vector3::from(fit.place_m((there * 1e-3).into())) * 1e3;
        found.fit_mm.push((placed - truth).norm());
        found.centroids_mm.push((there + centroids - truth).norm());
    }
    for (n, pair) in fit.pairs.iter().enumerate() {
        let is_there = order.iter().position(|&seed| seed == n);
        found.pairs += usize::from(is_there.is_some());
        found.right += usize::from(is_there.is_some() && *pair == is_there);
    }
}

/// Returns mean, 95th percentile and highest.
fn figures(values: &mut [f64]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = (values.len() * 95).div_ceil(100) - 1;
    [
        values.iter().sum::<f64>() / values.len() as f64,
        values[at],
        values[values.len() - 1],
    ]
}

/// The page used to promise a fit without saying how far off it is.
#[test]
fn registration_by_seeds_has_the_errors_of_the_page() {
    let mut rows = String::from(
        "| edema | lost | migrated | fit: mean | p95 | worst | pairs right | centroids: mean | p95 | worst |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (swelling, name) in Swelling::ALL {
        for (lost, migrated) in [(0, 0), (1, 0), (3, 0), (5, 0), (0, 1), (3, 1)] {
            let mut found = Found::default();
            for pair in 0..PAIRS {
                simulate(&mut Random(pair), swelling, (lost, migrated), &mut found);
            }
            let (fit, centroids) = (figures(&mut found.fit_mm), figures(&mut found.centroids_mm));
            let share = found.right as f64 / found.pairs as f64 * 100.0;
            assert!(
                (0..3).all(|n| fit[n] < centroids[n]),
                "{name} {lost} {migrated}: {fit:?} {centroids:?}"
            );
            let [mean, p95, worst] = fit.map(|mm| format!("{mm:.2}"));
            let [mean_c, p95_c, worst_c] = centroids.map(|mm| format!("{mm:.2}"));
            writeln!(
                rows,
                "| {name} | {lost} | {migrated} | {mean} | {p95} | {worst} | {share:.1} % | {mean_c} | {p95_c} | {worst_c} |"
            )
            .expect("a text");
        }
    }
    let path = repository(PAGE);
    let page = std::fs::read_to_string(&path).expect("the page is there");
    let (before, rest) = page.split_once(MARKS[0]).expect("the rows have a beginning");
    let (old, after) = rest.split_once(MARKS[1]).expect("the rows have an end");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, [before, MARKS[0], &rows, MARKS[1], after].concat()).expect("the page can be written");
        return;
    }
    assert_eq!(
        old, rows,
        "write them anew: UPDATE_DOCS=1 cargo test --profile quick -p stylet-tests-dose registration"
    );
}

//! A synthetic CT of a known implant: the seeds found in it.

use super::{FinderError, Found, Search, find};
use nalgebra::{Matrix3, Vector3};
use phantom::Phantom;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Region, Seed, Source, Structure};
use stylet_files::{VoxelFrame, VoxelValues};
use stylet_implant::pairing;

mod phantom;

struct Gland;

impl Region for Gland {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        (phantom::SEMI_AXES_M.map(|s| -s), phantom::SEMI_AXES_M)
    }

    fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).map(|a| (p[a] / phantom::SEMI_AXES_M[a]).powi(2)).sum::<f64>() <= 1.0
    }
}

/// Returns the D90 of the gland by seeds of 0.45 U with their axes, in Gy.
fn d90_gy(seeds: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> f64 {
    let source = Source::known("6711").unwrap();
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let gland = Structure::of_region("Prostate", &Gland, 1.5e-3);
    let seed = |(position_m, axis)| Seed {
        position_m,
        axis: Some(axis),
        strength_u: 0.45,
    };
    let seeds: Vec<Seed> = seeds.map(seed).collect();
    let dose = DosePoints::new(&gland.points_m).of_seeds_gy(&kernel, &seeds);
    let dvh = Dvh::new(&dose, &gland.volumes_m3).unwrap();
    dvh.dose_of_gy(0.9 * gland.volume_m3()).unwrap()
}

/// Comparison of found and implanted seeds.
#[derive(Debug)]
#[allow(dead_code, reason = "shown where a test fails")]
struct Outcome {
    within_1_mm: usize,
    mean_m: f64,
    d90_share: f64,
}

fn outcome(phantom: &Phantom, found: &Found) -> Outcome {
    let truth: Vec<[f64; 3]> = phantom.seeds.iter().map(|s| s.0).collect();
    let places: Vec<[f64; 3]> = found.seeds.iter().map(|s| s.position_m).collect();
    let pairs = pairing::nearest(&truth, &places);
    let off = |(at, found): (&[f64; 3], &Option<usize>)| {
        found.map(|n| (Vector3::from(places[n]) - Vector3::from(*at)).norm())
    };
    let off_m: Vec<f64> = truth
        .iter()
        .zip(&pairs)
        .filter_map(off)
        .filter(|m| *m <= 1e-3)
        .collect();
    let d90 = d90_gy(found.seeds.iter().map(|s| (s.position_m, s.axis)));
    Outcome {
        within_1_mm: off_m.len(),
        mean_m: off_m.iter().sum::<f64>() / off_m.len().max(1) as f64,
        d90_share: d90 / d90_gy(phantom.seeds.iter().copied()),
    }
}

/// Tests 53 seeds that touch another: side by side, end to end, and three together.
#[test]
fn a_hundred_seeds_are_found_within_a_millimetre_and_give_the_same_d90() {
    // Guards against uneven tissue that counted as signal: in the second implant 101 seeds were
    // found and D90 was 3.7 % off.
    for random_seed in [1, 2, 5, 6] {
        let phantom = Phantom::new(random_seed, None);
        let search = Search {
            count: Some(phantom.seeds.len()),
            ..Search::default()
        };
        let found = find(&phantom.volume, &search).unwrap();
        let result = outcome(&phantom, &found);
        println!(
            "{random_seed}: {result:?}, threshold {:.0}, blur {:.2} mm, {} components, {} split, {:?}",
            found.threshold,
            found.blur_m * 1e3,
            found.components,
            found.split_components,
            found.doubts
        );
        assert_eq!(found.seeds.len(), 100);
        let left_out = |why: &str| found.doubts.iter().filter(|d| d.why.starts_with(why)).count();
        assert_eq!(left_out("too large"), 1, "the bone: {:?}", found.doubts);
        assert!(left_out("too faint") >= 1, "the calcification: {:?}", found.doubts);
        assert!(result.within_1_mm >= 98, "{result:?}");
        assert!((result.d90_share - 1.0).abs() < 0.01, "{result:?}");
    }
}

/// Guards against uneven tissue that counted as signal: a single seed in a dark place was left out
/// as too faint, and another one was invented for it.
#[test]
#[ignore = "a minute or two; the command is in docs/after-implant.md"]
fn implants_one_to_twelve_are_found() {
    let mut missed = Vec::new();
    for random_seed in 1..=12 {
        let phantom = Phantom::new(random_seed, None);
        let search = Search {
            count: Some(phantom.seeds.len()),
            ..Search::default()
        };
        let found = find(&phantom.volume, &search).unwrap();
        let result = outcome(&phantom, &found);
        println!(
            "| {random_seed} | {} | {} | {:.2} | {:.2} % |",
            found.seeds.len(),
            result.within_1_mm,
            result.mean_m * 1e3,
            (result.d90_share - 1.0) * 100.0
        );
        for (place_m, off_m, nearest_m) in far(&phantom, &found) {
            println!(
                "    at {place_m:.1?} mm: found {off_m:.2} mm off; its nearest other seed is at {nearest_m:.2} mm"
            );
        }
        assert!((result.d90_share - 1.0).abs() < 0.01, "{random_seed}: {result:?}");
        missed.extend((result.within_1_mm < 98).then_some((random_seed, result.within_1_mm)));
    }
    // In 4, 10 and 12 two pairs side by side are each found turned: 96 seeds.
    assert!(
        missed.len() <= 3 && missed.iter().all(|(_, found)| *found >= 96),
        "{missed:?}"
    );
}

/// Returns seeds that are not found within 1 mm: place, distance of the found seed, distance of the
/// nearest other seed, mm.
fn far(phantom: &Phantom, found: &Found) -> Vec<([f64; 3], f64, f64)> {
    let truth: Vec<[f64; 3]> = phantom.seeds.iter().map(|s| s.0).collect();
    let places: Vec<[f64; 3]> = found.seeds.iter().map(|s| s.position_m).collect();
    let pairs = pairing::nearest(&truth, &places);
    let mm = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).norm() * 1e3;
    let all = truth.iter().zip(&pairs).map(|(at, pair)| {
        let others = truth.iter().filter(|other| *other != at).map(|other| mm(*other, *at));
        (
            at.map(|c| c * 1e3),
            pair.map_or(f64::INFINITY, |n| mm(places[n], *at)),
            others.fold(f64::INFINITY, f64::min),
        )
    });
    all.filter(|(_, off_mm, _)| *off_mm > 1.0).collect()
}

/// Tests the signal alone, without the number implanted: it gives 104 for 100 here.
#[test]
fn the_number_of_seeds_is_estimated_if_unknown() {
    let phantom = Phantom::new(3, None);
    let found = find(&phantom.volume, &Search::default()).unwrap();
    let result = outcome(&phantom, &found);
    println!(
        "without a count: {} seeds, {result:?}, {:?}",
        found.seeds.len(),
        found.doubts
    );
    assert!(
        (98..=105).contains(&found.seeds.len()) && result.within_1_mm >= 98,
        "{result:?}"
    );
}

/// Tests a scanner that ends at 3071 HU and saturates the highest voxels.
#[test]
fn seeds_are_found_where_the_scanner_cuts_their_values_off() {
    let phantom = Phantom::new(4, Some(3071.0));
    let search = Search {
        count: Some(phantom.seeds.len()),
        ..Search::default()
    };
    let found = find(&phantom.volume, &search).unwrap();
    let result = outcome(&phantom, &found);
    println!("cut off: {result:?}, {:?}", found.doubts);
    assert!(result.within_1_mm >= 98, "{result:?}");
}

#[test]
fn a_volume_without_seeds_is_refused() {
    let frame = VoxelFrame::new(Matrix3::identity() * 1e-3, Vector3::zeros(), "test").unwrap();
    let volume = |peak: f32| VoxelValues {
        dims: [9; 3],
        values: (0..729).map(|n| if n == 364 { peak } else { 40.0 }).collect(),
        frame: frame.clone(),
    };
    assert_eq!(find(&volume(40.0), &Search::default()), Err(FinderError::Nothing));
    let high = Search {
        threshold: Some(9e4),
        ..Search::default()
    };
    let none = find(&volume(2000.0), &high).unwrap_err();
    assert!(none.to_string().contains("choose a lower --threshold"), "{none}");
}

/// Returns a CT of seeds along z, each with its signal, and of a body of gold; with a dark streak
/// across the seed `in_streak`.
fn scan(seeds_mm: &[[f64; 3]], in_streak: usize, gold_mm: Option<[f64; 3]>) -> VoxelValues<f32> {
    let sides_mm = [0.6, 0.6, 1.25];
    let dims = [80, 80, 33];
    let columns = Matrix3::from_diagonal(&(Vector3::from(sides_mm) * 1e-3));
    let middle = [0, 1, 2].map(|a| (dims[a] - 1) as f64 / 2.0);
    let frame = VoxelFrame::new(columns, -(columns * Vector3::from(middle)), "test").unwrap();
    let line = |at: [f64; 3], of: [f64; 3], half_mm: f64, wide_mm: f64| {
        let across = (at[0] - of[0]).powi(2) + (at[1] - of[1]).powi(2);
        let beyond = ((at[2] - of[2]).abs() - half_mm).max(0.0);
        (-0.5 * (across + beyond * beyond) / (wide_mm * wide_mm)).exp()
    };
    let value = |n: usize| {
        let index = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
        let at = [0, 1, 2].map(|a| (index[a] as f64 - middle[a]) * sides_mm[a]);
        let metal: f64 = seeds_mm.iter().map(|of| 3000.0 * line(at, *of, 2.0, 0.75)).sum();
        let gold = gold_mm.map_or(0.0, |of| 9000.0 * line(at, of, 1.2, 0.8));
        let [x, y, z] = seeds_mm[in_streak];
        let is_dark = (at[1] - y).abs() < 2.5 && (at[2] - z).abs() < 5.0 && (1.5..15.0).contains(&(at[0] - x).abs());
        let noise = f64::from(((n as u32).wrapping_mul(2_654_435_761) >> 16) as u8) / 8.0;
        (30.0 + noise + metal + gold - if is_dark { 400.0 } else { 0.0 }) as f32
    };
    VoxelValues {
        dims,
        values: (0..dims.iter().product()).map(value).collect(),
        frame,
    }
}

const SCANNED_MM: [[f64; 3]; 6] = [
    [12.0, 10.0, -8.0],
    [-10.0, 8.0, -5.0],
    [0.0, -8.0, 0.0],
    [8.0, -12.0, 8.0],
    [-12.0, -10.0, 10.0],
    [-3.0, 14.0, 4.0],
];

/// Guards against a seed of 3,200 HU in a streak of 400 HU that was neither found nor listed, while
/// another one counted as two, or as five without a number.
#[test]
fn a_seed_in_a_dark_streak_is_found() {
    for in_streak in 0..6 {
        let volume = scan(&SCANNED_MM, in_streak, None);
        for count in [Some(6), None] {
            let search = Search {
                count,
                ..Search::default()
            };
            let found = find(&volume, &search).unwrap();
            assert_eq!(found.seeds.len(), 6, "{in_streak}, {count:?}: {:?}", found.doubts);
            for place_mm in SCANNED_MM {
                let off =
                    |seed: &super::FoundSeed| (Vector3::from(seed.position_m) * 1e3 - Vector3::from(place_mm)).norm();
                let nearest = found.seeds.iter().map(off).fold(f64::INFINITY, f64::min);
                assert!(nearest < 0.5, "{in_streak}: {place_mm:?} is {nearest:.2} mm off");
            }
        }
    }
}

/// Guards against a gold marker that became three seeds without a word, and holds the promise that
/// all that is left out is listed.
#[test]
fn a_marker_is_doubtful_and_all_components_are_seeds_or_listed() {
    let volume = scan(&SCANNED_MM, 0, Some([3.0, 3.0, 0.0]));
    for threshold in [None, Some(300.0)] {
        let search = Search {
            threshold,
            ..Search::default()
        };
        let found = find(&volume, &search).unwrap();
        let marker = found.doubts.iter().find(|doubt| (doubt.place_m[0] - 3e-3).abs() < 1e-3);
        let marker = marker.unwrap_or_else(|| panic!("{:?}", found.doubts));
        assert!(marker.counted != 1 && marker.peak > 5000.0, "{marker:?}");
        let left_out = found.doubts.iter().filter(|doubt| doubt.counted == 0).count();
        let single = found.seeds.iter().filter(|seed| seed.together == 1).count();
        assert_eq!(
            single + found.split_components + left_out,
            found.components,
            "{:?}",
            found.doubts
        );
    }
}

//! Suspicious places of seeds: on one spot, or outside the target; reported with number and
//! distance.

use std::collections::HashSet;
use stylet_dose::{Seed, Structure};

/// Thickness of a seed, the smallest possible distance of two.
const SAME_SPOT_M: f64 = 0.8e-3;
/// Distance from the edge of the target up to which seeds are planned.
const EDGE_M: f64 = 1e-3;
/// Most points of the target for the distance of a seed outside.
const MOST_POINTS: usize = 50_000;
/// Most pairs of seeds that are compared; beyond, only exact duplicates are found.
const MOST_PAIRS: usize = 5_000;

/// Reports seeds that lie on the spot of another one.
pub fn on_one_spot(seeds: &[Seed]) -> Option<String> {
    let (mut on_another, mut first) = (0, None);
    if seeds.len() <= MOST_PAIRS {
        for (n, seed) in seeds.iter().enumerate() {
            let near = |other: &Seed| distance_m(seed.position_m, other.position_m) < SAME_SPOT_M;
            if let Some(other) = seeds[..n].iter().position(near) {
                on_another += 1;
                let m = distance_m(seed.position_m, seeds[other].position_m);
                first.get_or_insert((other + 1, n + 1, m));
            }
        }
    } else {
        let mut seen = HashSet::new();
        let spot = |s: &Seed| s.position_m.map(|v| (v / SAME_SPOT_M).round() as i64);
        on_another = seeds.iter().filter(|s| !seen.insert(spot(s))).count();
    }
    let pair = first.map_or_else(String::new, |(one, other, m)| {
        format!(" (the first are {one} and {other}, {:.2} mm apart)", m * 1e3)
    });
    (on_another > 0).then(|| {
        format!(
            "{on_another} of its {} seeds lie on the spot of another one, nearer than the {} mm that a seed is thick{pair}: \
             each counts; is it in the file twice?",
            seeds.len(),
            SAME_SPOT_M * 1e3
        )
    })
}

/// Reports seeds that lie outside the target by more than its edge.
pub fn outside(seeds: &[Seed], target: &Structure) -> Option<String> {
    let point_m3 = target.volume_m3() / target.points_m.len().max(1) as f64;
    // Points represent cells of about this side: nearer to the edge nothing is known.
    let edge_m = EDGE_M.max(point_m3.cbrt());
    let cell = |p: [f64; 3]| p.map(|v| (v / edge_m).floor() as i64);
    let cells: HashSet<[i64; 3]> = target.points_m.iter().map(|p| cell(*p)).collect();
    let is_near = |p: [f64; 3]| {
        let at = cell(p);
        (0..27).any(|n| cells.contains(&[at[0] + n % 3 - 1, at[1] + n / 3 % 3 - 1, at[2] + n / 9 - 1]))
    };
    let far = seeds.iter().map(|s| s.position_m).filter(|p| !is_near(*p));
    let off_m = |p: [f64; 3]| {
        let sample = target.points_m.len().div_ceil(MOST_POINTS).max(1);
        let nearest = target.points_m.iter().step_by(sample).map(|q| distance_m(p, *q));
        nearest.fold(f64::INFINITY, f64::min)
    };
    let (mut count, mut farthest_m) = (0, 0.0_f64);
    for place in far {
        count += 1;
        farthest_m = farthest_m.max(off_m(place));
    }
    (count > 0).then(|| {
        format!(
            "{count} of its {} seeds lie outside {}, the farthest by {:.1} mm",
            seeds.len(),
            target.name,
            farthest_m * 1e3
        )
    })
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seeds(places_mm: &[[f64; 3]]) -> Vec<Seed> {
        let seed = |mm: &[f64; 3]| Seed {
            position_m: mm.map(|v| v * 1e-3),
            axis: None,
            strength_u: 0.5,
        };
        places_mm.iter().map(seed).collect()
    }

    /// Guards against a silently doubled dose of a seed that was in the file twice.
    #[test]
    fn seeds_on_one_spot_are_reported_with_their_number() {
        assert_eq!(on_one_spot(&seeds(&[[0.0; 3], [0.0, 0.0, 5.0]])), None);
        let note = on_one_spot(&seeds(&[[0.0; 3], [0.0, 0.0, 5.0], [0.1, 0.0, 0.0]])).unwrap();
        assert!(
            note.contains("1 of its 3 seeds") && note.contains("are 1 and 3, 0.10 mm apart"),
            "{note}"
        );
        let many: Vec<[f64; 3]> = (0..6000).map(|n| [f64::from(n / 2 * 2), 0.0, 0.0]).collect();
        assert!(on_one_spot(&seeds(&many)).unwrap().contains("3000 of its 6000 seeds"));
    }

    /// Guards against the silent dose of seeds outside the target, such as those of another frame.
    #[test]
    fn seeds_outside_the_target_are_reported_with_the_farthest() {
        let target = Structure::of_box("Prostate", [0.0; 3], [0.02; 3], 0.5e-3);
        assert_eq!(outside(&seeds(&[[10.0; 3], [20.5, 10.0, 10.0]]), &target), None);
        let note = outside(&seeds(&[[10.0; 3], [30.0, 10.0, 10.0], [10.0, 24.0, 10.0]]), &target).unwrap();
        assert!(
            note.starts_with("2 of its 3 seeds lie outside Prostate, the farthest by 10."),
            "{note}"
        );
    }
}

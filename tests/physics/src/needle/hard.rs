//! Hard cases that no plan foresees: busy machines, edges, bone, closely spaced membranes, unsupported bodies.

use super::*;
use stylet_anatomy::{Beyond, Surroundings};
use stylet_sim::scene::{Labels, Role, Structure};

/// Largest change of force, N per tick: the gate's limit, plus the contribution of the hand's own filter.
const SLEW_N: f64 = 0.5 + 1e-9;

fn largest_step_n(ticks: &[Tick]) -> f64 {
    let forces = ticks.iter().map(|t| t.output.wrench.force_n);
    let steps = forces.clone().zip(forces.skip(1)).map(|(a, b)| (b - a).norm());
    steps.fold(0.0, f64::max)
}

/// Makes 56 x 56 x 80 mm of gland in cells of 2 mm; `label` names other structures by the depth of a cell.
fn block(label: impl Fn(usize) -> u8, others: Vec<Structure>, beyond: Beyond) -> SceneSource {
    let mut gland = Structure::soft("gland", 1);
    gland.role = Role::Target;
    let mut structures = vec![gland];
    structures.extend(others);
    for structure in &mut structures {
        structure.material.surroundings = Surroundings::all(beyond);
    }
    let labels = Labels {
        dims: [28, 28, 40],
        spacing_m: 2e-3,
        cells: (0..28 * 28 * 40).map(|n| label(n / (28 * 28))).collect(),
        structures,
    };
    SceneSource::of_labels("block", &labels)
}

fn other(name: &str) -> Structure {
    let mut structure = Structure::soft(name, 2);
    structure.role = Role::Tissue;
    structure
}

/// The slip is solved in the force loop: the felt force does not wait for the tissue.
#[test]
fn tissue_ticks_that_do_not_take_place_are_not_felt() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let mut insert = |missed: u32| {
            let mut needle = theatre.begin();
            needle.session.go_to(needle.surface + Vector3::z() * 45e-3, 0.05);
            let ticks: Vec<_> = (0..2000)
                .map(|tick| {
                    if tick % 20 == 0 {
                        needle.session.miss_tissue_ticks(missed);
                    }
                    needle.session.tick()
                })
                .collect();
            // ChainMail gives way to its neighbours by a share for each tick, so half the ticks take twice as long.
            needle.session.run(4.0);
            let moved_m = needle.displacement_m();
            theatre.end(needle);
            (ticks, moved_m)
        };
        let (all, all_m) = insert(0);
        for missed in [2, 3] {
            let (some, some_m) = insert(missed);
            let apart = all.iter().zip(&some).map(|(a, b)| {
                let [a, b] = [a, b].map(|t| t.output.wrench.force_n);
                (a - b).norm()
            });
            let apart_n = apart.fold(0.0, f64::max);
            println!(
                "{kind:?}, {missed} of 4 tissue ticks missed: force {apart_n:.4} N apart at most, displacement {:.3} and {:.3} mm",
                all_m * 1e3,
                some_m * 1e3
            );
            assert!(
                apart_n < 0.02 && (all_m - some_m).abs() < 0.1e-3,
                "{apart_n} N, {some_m} m"
            );
        }
    }
}

/// The fastest hand of the envelope: the membrane gives way in a tick, but the force on the hand changes slowly.
#[test]
fn a_puncture_at_full_speed_stays_within_the_slew_limit() {
    for kind in KINDS {
        let mut theatre = Theatre::of(kind);
        let peaks = [0.05, 0.123, 0.28].map(|speed_m_per_s| {
            let mut needle = theatre.begin();
            // The force comes up within half a second after the hand engages.
            needle.go_to(-5e-3, 0.05);
            let ticks = needle.go_to(40e-3, speed_m_per_s);
            let (step_n, peak_n) = (largest_step_n(&ticks), peak_n(&ticks));
            println!(
                "{kind:?}, {:.0} mm/s: peak {peak_n:.2} N, largest step {step_n:.3} N in a tick",
                speed_m_per_s * 1e3
            );
            assert!(step_n <= SLEW_N, "{step_n} N");
            theatre.end(needle);
            peak_n
        });
        // Eq. 9's damping comes on top: 5 N s/m of the hand's speed.
        let most_n = |n: usize| peaks[0] + 5.0 * [0.05, 0.123, 0.28][n];
        assert!(
            (0..3).all(|n| (peaks[0] - 0.1..most_n(n)).contains(&peaks[n])),
            "{peaks:?} N"
        );
    }
}

/// Through the rim of the gland, where a line has little tissue and the body little support.
#[test]
fn a_needle_through_the_rim_leaves_the_gland_at_rest() {
    for kind in KINDS {
        let source = SceneSource::Builtin("paper".to_owned());
        let lattice = source.build().expect("built in").lattice;
        let (low, high) = lattice.bounds_m();
        let half_m = 0.5 * (high[0] - low[0]);
        for inside_m in [1e-3, 2.5e-3] {
            let mut theatre = Theatre::beside_axis(&source, kind, half_m - inside_m);
            let mut needle = theatre.begin();
            let through = needle.go_to(high[2] - low[2] + 10e-3, 0.05);
            let there_m = needle.displacement_m();
            let out = needle.go_to(-5e-3, 0.05);
            let _ = (0..6000).map(|_| needle.session.tick()).count();
            let (peak, left_m, left_n) = (peak_n(&through), needle.displacement_m(), rest_n(&out));
            println!(
                "{kind:?}, {:.1} mm inside the rim: peak {peak:.2} N, through it {:.2} mm, outside {:.4} mm and {left_n:.3} N",
                inside_m * 1e3,
                there_m * 1e3,
                left_m * 1e3
            );
            assert!(
                peak < 8.5 && there_m < 15e-3 && largest_step_n(&through) <= SLEW_N,
                "{peak} N, {there_m} m"
            );
            assert!(left_n.abs() < 0.01 && left_m < 0.05e-3, "{left_n} N, {left_m} m");
            theatre.end(needle);
        }
    }
}

/// Skin of 4 mm on a gland: the second membrane begins before the first has been indented by its 8 mm.
#[test]
fn membranes_closer_than_their_depth_give_way_one_after_the_other() {
    for kind in KINDS {
        let source = block(|k| if k < 2 { 2 } else { 1 }, vec![other("skin")], Beyond::Fat);
        let mut theatre = Theatre::beside_axis(&source, kind, 0.0);
        let mut needle = theatre.begin();
        let ticks = needle.go_to(50e-3, 0.05);
        let forces: Vec<_> = ticks.iter().map(|t| -t.output.wrench.force_n.z).collect();
        let mut falls: Vec<(usize, f64)> = Vec::new();
        for n in 20..forces.len() {
            let fall_n = forces[n - 20] - forces[n];
            if fall_n > 1.0 && falls.last().is_none_or(|(last, _)| n - last > 40) {
                falls.push((n, forces[n - 20]));
            }
        }
        println!(
            "{kind:?}: peak {:.2} N; falls from (ms, N) {falls:.2?}; at rest {:.2} N",
            peak_n(&ticks),
            rest_n(&ticks)
        );
        assert!(falls.len() == 2 && peak_n(&ticks) < 12.0, "{falls:?}");
        assert!(rest_n(&ticks) < 6.0 && largest_step_n(&ticks) <= SLEW_N);
        theatre.end(needle);
    }
}

/// A needle that meets bone stays before it, and the hand feels it.
#[test]
fn bone_on_the_way_is_not_entered() {
    for kind in KINDS {
        let mut bone = other("bone");
        bone.material.fixed = true;
        let source = block(|k| if (15..18).contains(&k) { 2 } else { 1 }, vec![bone], Beyond::Fat);
        let mut theatre = Theatre::beside_axis(&source, kind, 0.0);
        let mut needle = theatre.begin();
        let ticks = needle.go_to(45e-3, 0.05);
        let hand_m = needle.session.true_tip_in_world().z - needle.surface.z;
        let tip_m = ticks.last().expect("ticks").output.depth_m;
        let moved_m = needle.displacement_m();
        println!(
            "{kind:?}: bone at 30 mm: the hand wants 45 and stands at {:.1} mm with {:.2} N, the tip at {:.2} mm; the body is moved by {:.2} mm",
            hand_m * 1e3,
            rest_n(&ticks),
            tip_m * 1e3,
            moved_m * 1e3
        );
        assert!((tip_m - 30e-3).abs() < 0.3e-3, "{tip_m} m");
        // The hand is stronger than the device, which gives its maximum.
        let most_n = needle.session.device_limit_n();
        assert!(
            (rest_n(&ticks) - most_n).abs() < 0.1,
            "{} of {most_n} N",
            rest_n(&ticks)
        );
        assert!(moved_m < 15e-3 && largest_step_n(&ticks) <= SLEW_N, "{moved_m} m");
        theatre.end(needle);
    }
}

/// From fat to a table on all sides the same needle moves less; an unsupported body is refused.
#[test]
fn what_a_body_rests_on_goes_from_nothing_to_a_table() {
    for kind in KINDS {
        let gland = |_: usize| 1;
        let moved_m = [Beyond::Fat, Beyond::Fixed].map(|beyond| {
            let mut theatre = Theatre::beside_axis(&block(gland, Vec::new(), beyond), kind, 0.0);
            let mut needle = theatre.begin();
            let ticks = needle.go_to(40e-3, 0.05);
            let moved_m = needle.displacement_m();
            println!(
                "{kind:?}, {beyond:?} on all sides: {:.2} mm, peak {:.2} N",
                moved_m * 1e3,
                peak_n(&ticks)
            );
            assert!(largest_step_n(&ticks) <= SLEW_N && moved_m < 15e-3);
            theatre.end(needle);
            moved_m
        });
        assert!(moved_m[1] < moved_m[0], "{moved_m:?}");
        let body = LineBody::of_source(&block(gland, Vec::new(), Beyond::Free), kind);
        let body = body.expect("can be solved").expect("has lines");
        let line = body.prepare(1, [28e-3, 28e-3, -5e-3], [0.0, 0.0, 1.0], false, &[], &mut || true);
        let why = line.err().map(|why| why.to_string());
        println!("{kind:?}, nothing on all sides: {why:?}");
        assert!(why.is_some(), "a body that nothing holds has no answer");
    }
}

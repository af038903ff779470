//! Places of the seeds of the default procedure at rest, and how they depend on each number of the needle.

use super::*;
use stylet_shm_schema::ParameterSpec;

/// The needle of `host-ui procedure` in `paper`: five seeds along the axis of the gland.
fn default_procedure() -> NeedleRehearsal {
    let run = needle();
    let scene = stylet_sim::scene::Scene::builtin("paper").unwrap();
    let (low, high) = scene.target_bounds_m();
    let at = |n: usize| low[2] + (0.8 - 0.6 * n as f64 / 4.0) * (high[2] - low[2]);
    NeedleRehearsal {
        drops_m: (0..5).map(|n| [run.entry_m[0], run.entry_m[1], at(n)]).collect(),
        ..run
    }
}

/// Follows a needle; returns its seeds, and where the tip turned before each drop, m: the hand comes as far, and then
/// back to its goal in tissue that sticks.
pub fn seeds_and_turns(stage: &mut Stage, run: &NeedleRehearsal) -> Vec<(SeedPose, f64)> {
    let active = activate(&ParameterSet::default(), &stage.device).expect("valid");
    let lines = stage.lines(run, false, &AtomicBool::new(false)).expect("has a line");
    let mut rig = stage.rig(run, &active).expect("given back");
    rig.take_lines(lines);
    let (mut script, mut turns_m, mut turn_m) = (Script::new(run), Vec::new(), f64::NEG_INFINITY);
    loop {
        rig.tick();
        let tip_m = Vector3::from(rig.state().tip_in_scene_m).z;
        turn_m = match turns_m.len() {
            0 => tip_m.max(turn_m),
            _ => tip_m.min(turn_m),
        };
        if rig.state().seed_count as usize > turns_m.len() {
            turns_m.push(turn_m);
            turn_m = f64::INFINITY;
        }
        if script.advance(&mut rig).expect("goes on") {
            break;
        }
    }
    let seeds = rig.seeds();
    stage.world = Some(rig.into_world());
    seeds.into_iter().zip(turns_m).collect()
}

/// The next seed used to pass the last one: in tissue that sticks, two seeds dropped 7 mm apart came to rest at one
/// place.
#[test]
fn no_two_seeds_of_a_needle_rest_nearer_than_touching() {
    let (mut stage, stop) = (stage(), AtomicBool::new(false));
    stage.seeds_and_forces_alone();
    let mut random = stylet_random::Random(46);
    let mut touching = 0;
    let usual = default_procedure();
    for number in 0..6 {
        let mut run = usual.clone();
        if number > 0 {
            let mut z_m = usual.drops_m[0][2];
            for drop_m in &mut run.drops_m {
                drop_m[2] = z_m;
                z_m -= 2e-3 + 9e-3 * random.unit();
            }
        }
        let mut set = ParameterSet::default();
        set.set(ParameterId::ShaftFriction, 20.0 + 150.0 * random.unit());
        let seeds = stage.rehearse(&run, &set, &stop).expect("goes through").seeds;
        for (deep, next) in seeds.iter().zip(&seeds[1..]) {
            let apart_m = deep.position_m[2] - next.position_m[2];
            // The tissue is at rest to 0.05 mm somewhere.
            assert!(apart_m > stylet_shm_schema::SEED_LENGTH_M - 1e-5, "{apart_m} m");
            touching += u32::from(deep.touches(next));
        }
    }
    println!("{touching} of 24 neighbours touch");
    assert!(touching > 0);
}

/// Compensation drops seeds 0.15 mm apart to find edges. Seeds with a body lay in a column, so every drop seemed to
/// be on an edge.
#[test]
fn points_lie_nearer_to_each_other_than_seeds() {
    let (mut stage, stop) = (stage(), AtomicBool::new(false));
    stage.seeds_and_forces_alone();
    let usual = default_procedure();
    let [first, second] = [0, 2].map(|n| usual.drops_m[n]);
    let [x, y, z] = second;
    let mut apart_m = |as_points: bool| {
        let run = NeedleRehearsal {
            as_points,
            drops_m: vec![first, second, [x, y, z - 0.15e-3]],
            ..usual.clone()
        };
        let rehearsed = stage.rehearse(&run, &ParameterSet::default(), &stop);
        let seeds = rehearsed.expect("goes through").seeds;
        seeds[1].position_m[2] - seeds[2].position_m[2]
    };
    let [points_m, seeds_m] = [true, false].map(&mut apart_m);
    println!("{points_m} and {seeds_m} m apart");
    assert!(
        (0.0..0.5e-3).contains(&points_m) && seeds_m > 4.4e-3,
        "{points_m} {seeds_m}"
    );
}

/// Prints the table of `docs/physics/seeds.md`: `cargo test --profile quick -p stylet-runtime --lib
/// seeds_by_each_number -- --ignored --nocapture`
#[test]
#[ignore = "a measurement of some minutes"]
fn seeds_by_each_number() {
    use ParameterId as P;
    let (mut stage, run, stop) = (stage(), default_procedure(), AtomicBool::new(false));
    let points = NeedleRehearsal {
        as_points: true,
        ..run.clone()
    };
    let mut row = |name: &str, run: &NeedleRehearsal, set: &ParameterSet| {
        let rehearsed = stage.rehearse(run, set, &stop).expect("goes through");
        let pairs = rehearsed.seeds.iter().zip(&run.drops_m);
        let off_mm: Vec<f64> = pairs.map(|(s, d)| (s.position_m[2] - d[2]) * 1e3).collect();
        let touching = rehearsed.seeds.windows(2).filter(|pair| pair[0].touches(&pair[1]));
        let mean_mm = off_mm.iter().map(|mm| mm.abs()).sum::<f64>() / off_mm.len() as f64;
        let each: Vec<String> = off_mm.iter().map(|mm| format!("{mm:+.1}")).collect();
        println!(
            "| {name} | {} | {mean_mm:.1} | {} | {:.1} | {:.2} |",
            each.join(", "),
            touching.count(),
            rehearsed.largest_displacement_m * 1e3,
            rehearsed.peak_force_n
        );
    };
    let varied: [(P, &[f64]); 3] = [
        (P::GlandToughness, &[0.0, 50.0, 164.0, 300.0, 500.0]),
        (P::ShaftFriction, &[0.0, 18.0, 80.0, 140.0, 210.0]),
        (P::MembranePeak, &[2.8, 5.6]),
    ];
    for (id, values) in varied {
        let ParameterSpec {
            key,
            unit,
            display_per_si,
            ..
        } = id.spec();
        for value in values {
            let mut set = ParameterSet::default();
            set.set(id, value / display_per_si);
            row(&format!("`{key}` {value} {unit}"), &run, &set);
        }
    }
    row("points, without a body", &points, &ParameterSet::default());
}

/// A scattered needle of a study met the arch 70 mm before its place. Its script went on, and its seeds lay there.
#[test]
fn a_needle_that_bone_stops_is_no_rehearsal() {
    let mut bone = stylet_sim::scene::Structure::soft("bone", 2);
    bone.material.fixed = true;
    let labels = stylet_sim::scene::Labels {
        dims: [20, 20, 30],
        spacing_m: 2e-3,
        cells: (0..20 * 20 * 30).map(|n| 1 + u8::from(n >= 20 * 20 * 20)).collect(),
        structures: vec![stylet_sim::scene::Structure::soft("gland", 1), bone],
    };
    let source = SceneSource::of_labels("on bone", &labels);
    let mut stage = Stage::build(&source, TissueKind::ChainMail, DeviceInfo::phantom_premium_1_5()).expect("valid");
    let mut to = |deepest_m: f64| {
        let run = NeedleRehearsal {
            entry_m: [20e-3, 20e-3, -10e-3],
            drops_m: vec![[20e-3, 20e-3, deepest_m], [20e-3, 20e-3, 20e-3]],
            ..needle()
        };
        stage.rehearse(&run, &ParameterSet::default(), &AtomicBool::new(false))
    };
    // The tip is half a seed ahead, and bone begins at 40 mm.
    assert!(matches!(to(45e-3), Err(RehearseError::Bone(mm)) if (mm - 7.25).abs() < 0.3));
    assert!(to(35e-3).is_ok());
}

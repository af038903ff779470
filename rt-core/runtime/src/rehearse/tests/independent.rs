//! Places of seeds, forces and motion of the gland against another method: `tests/oracles/seeds_at_rest.py`.

use super::*;
use stylet_hw::{ReplayDevice, Sample};
use stylet_shm_schema::{RefusalCode, SEED_LENGTH_M};

const SEEDS_WITHIN_MM: f64 = 0.2;
const FORCES_WITHIN: f64 = 0.03;
const GLAND_WITHIN: f64 = 0.03;

const SPEED_M_PER_S: f64 = 0.05;
/// Ticks of rest before a drop and after it.
const REST_TICKS: usize = 100;
const BEFORE_M: f64 = 10e-3;
/// Depths on the way in at which forces are compared, m; the turn follows.
const IN_M: [f64; 3] = [10e-3, 20e-3, 30e-3];

/// Friction in N/m and toughness in J/m2.
type Case = [f64; 2];

/// What a needle shows: offsets from plan in mm, deepest first; total and tip force in N on the way in and at the
/// drops; mean displacement of the gland along the needle in mm; displacement of cells in mm at the deepest place.
#[derive(Default)]
struct Shown {
    loose_mm: Vec<f64>,
    strand_mm: Vec<f64>,
    force_n: Vec<f64>,
    tip_n: Vec<f64>,
    mean_mm: f64,
    cells_mm: Vec<[f64; 3]>,
}

/// Returns the numbers of a kept line by case and name, of the finer mesh.
fn kept([friction, toughness]: Case, name: &str) -> Vec<Vec<f64>> {
    let path = stylet_test_kit::repository("tests/oracles/seeds_at_rest.csv");
    let text = std::fs::read_to_string(path).expect("kept");
    let begin = format!("fine,{friction},{toughness},{name},");
    let lines = text.lines().filter_map(|line| line.strip_prefix(&begin));
    let numbers = lines.map(|line| line.split(',').map(|f| f.parse().expect("a number")).collect());
    numbers.collect()
}

/// Moves a needle from rest by a device that goes where it should, whatever the force, and drops the seeds. Returns
/// nothing where one has no room in the gland: the column behind the tip then reaches out of it.
fn moved(stage: &mut Stage, case: Case, strand: bool) -> Option<Shown> {
    let scene = stylet_sim::scene::Scene::builtin("paper").expect("built in");
    let (low_m, high_m) = scene.lattice.bounds_m();
    let length_m = high_m[2] - low_m[2];
    let middle_m = [0, 1].map(|a| 0.5 * (low_m[a] + high_m[a]));
    let planned_m: [f64; 5] = std::array::from_fn(|n| (0.8 - 0.15 * n as f64) * length_m);
    let run = NeedleRehearsal {
        entry_m: [middle_m[0], middle_m[1], low_m[2] - BEFORE_M],
        ..needle()
    };
    let mut set = ParameterSet::default();
    set.set(ParameterId::ShaftFriction, case[0]);
    set.set(ParameterId::GlandToughness, case[1]);

    let (mut samples, mut at_m, mut marks) = (Vec::new(), -BEFORE_M, Vec::new());
    let stand = |samples: &mut Vec<f64>, at_m: f64| samples.extend([at_m; REST_TICKS]);
    stand(&mut samples, at_m);
    let tips_m = planned_m.map(|m| m + 0.5 * SEED_LENGTH_M);
    for &to_m in IN_M.iter().chain(&tips_m) {
        let ticks = ((to_m - at_m).abs() / SPEED_M_PER_S / 1e-3).ceil().max(1.0);
        samples.extend((1..=ticks as u32).map(|n| at_m + (to_m - at_m) * f64::from(n) / ticks));
        at_m = to_m;
        stand(&mut samples, at_m);
        marks.push(samples.len());
        // The tissue loop may take an order four ticks later, and the tip is then still there.
        stand(&mut samples, at_m);
    }
    let tools = samples.iter().map(|m| Sample {
        tip_in_world: Vector3::new(middle_m[0], middle_m[1], low_m[2] + m),
        world_from_tool: nalgebra::UnitQuaternion::identity(),
        buttons: 0,
        sequence: 0,
    });
    let info = DeviceInfo {
        simulated: true,
        ..stage.device
    };
    let device = ReplayDevice::new(info, tools.collect(), 1e-3).expect("finite");

    let active = activate(&set, &stage.device).expect("valid");
    let lines = stage.lines(&run, false, &AtomicBool::new(false)).expect("a line");
    let mut world = stage.world.take().expect("given back");
    world.tissue.return_to_rest();
    world.set_limits(active.limits.clone());
    let mut rig = Rig::with_device(world, &active, &info, Box::new(device));
    rig.take_lines(lines);
    rig.engage();
    let pitch_m = strand.then_some(0.15 * length_m);
    let cells: Vec<u32> = kept(case, "cell")
        .iter()
        .map(|row| {
            let [i, j, k] = [0, 1, 2].map(|n| row[n] as usize);
            scene.lattice.element_of_cell(i, j, k).expect("a cell of the gland")
        })
        .collect();
    let all: Vec<u32> = (0..scene.body.element_count() as u32).collect();
    let mut shown = Shown::default();
    for tick in 1..=samples.len() {
        rig.tick();
        if let Some(refusal) = rig.refusal() {
            assert_eq!(refusal, RefusalCode::TipOutsideTissue, "at {tick}");
            stage.world = Some(rig.into_world());
            return None;
        }
        let Some(mark) = marks.iter().position(|m| *m == tick) else {
            continue;
        };
        let state = rig.line_state().expect("a line");
        shown.tip_n.push(state.tip().force_n);
        shown
            .force_n
            .push(state.shaft_n().iter().sum::<f64>() + state.tip().force_n);
        if mark == IN_M.len() {
            let mut each_m = vec![[0.0; 3]; all.len()];
            rig.deformed().write_displacements(&all, &mut each_m);
            shown.mean_mm = 1e3 * each_m.iter().map(|m| f64::from(m[2])).sum::<f64>() / all.len() as f64;
            each_m.truncate(cells.len());
            rig.deformed().write_displacements(&cells, &mut each_m);
            shown.cells_mm = each_m.iter().map(|m| m.map(|c| 1e3 * f64::from(c))).collect();
        }
        if mark >= IN_M.len() {
            rig.drop_seed(pitch_m);
        }
    }
    // ChainMail takes seconds to come to rest: after one, two seeds were read 0.06 mm nearer than touching.
    let seeds = rig.seeds_at_rest();
    let off_mm = seeds
        .iter()
        .zip(planned_m)
        .map(|(s, m)| 1e3 * (s.position_m[2] - low_m[2] - m));
    match strand {
        true => shown.strand_mm = off_mm.collect(),
        false => {
            // Three of them used to rest at one place where the tip stood still for four drops.
            let touching = |pair: &[SeedPose]| pair[0].position_m[2] - pair[1].position_m[2] > SEED_LENGTH_M - 1e-5;
            assert!(seeds.windows(2).all(touching), "{seeds:?}");
            shown.loose_mm = off_mm.collect();
        }
    }
    stage.world = Some(rig.into_world());
    Some(shown)
}

/// Differences of one case from the other method: of the worst loose seed and of the strand in mm, of the forces over
/// the largest, of the gland's mean displacement and of its cells (RMS) as shares.
#[derive(Clone, Copy, Debug)]
struct Off {
    loose_mm: f64,
    strand_mm: f64,
    force: f64,
    mean: f64,
    cells: f64,
}

impl Off {
    fn of(shown: &Shown, case: Case) -> Off {
        let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let one = |what: &str| kept(case, what).remove(0);
        let force_n = one("force_n");
        let cells = kept(case, "cell");
        let square = |each: &mut dyn Iterator<Item = f64>| each.map(|c| c * c).sum::<f64>().sqrt();
        let pairs = cells.iter().zip(&shown.cells_mm);
        let mut apart = pairs.flat_map(|(k, s)| (0..3).map(move |a| k[3 + a] - s[a]));
        let mut size = cells.iter().flat_map(|k| k[3..6].to_vec());
        Off {
            loose_mm: worst(&one("loose_mm"), &shown.loose_mm),
            strand_mm: worst(&one("strand_mm"), &shown.strand_mm),
            force: worst(&force_n, &shown.force_n) / worst(&force_n, &[0.0; 8]),
            mean: (shown.mean_mm / one("mean_mm")[0] - 1.0).abs(),
            cells: square(&mut apart) / square(&mut size),
        }
    }

    fn meets(&self) -> bool {
        let seeds_mm = self.loose_mm.max(self.strand_mm);
        seeds_mm <= SEEDS_WITHIN_MM && self.force <= FORCES_WITHIN && self.mean.max(self.cells) <= GLAND_WITHIN
    }
}

/// Builds the gland on springs, as the other method has it.
fn on_springs(tissue: TissueKind) -> Stage {
    let source = SceneSource::Builtin("paper".to_owned());
    let source = source.in_layers(Vec::new()).expect("built in");
    Stage::build(&source, tissue, DeviceInfo::phantom_premium_1_5()).expect("built in")
}

/// Compares with the other method; prints a row of the table. Returns nothing where a seed was refused.
fn compare(stage: &mut Stage, name: &str, case: Case) -> Option<Off> {
    let (loose, strand) = (moved(stage, case, false), moved(stage, case, true));
    let (Some(mut shown), Some(strand)) = (loose, strand) else {
        println!("| {name} | {case:?} | refused |");
        return None;
    };
    shown.strand_mm = strand.strand_mm;
    let list = |each: &[f64]| each.iter().map(|v| format!("{v:+.2}")).collect::<Vec<_>>().join(", ");
    let [friction, toughness] = case;
    let cutting_n = 2.0 * stylet_sim::line::NEEDLE_RADIUS_M * toughness + 0.0072;
    let off = Off::of(&shown, case);
    println!(
        "| {name} | {friction} | {cutting_n:.2} | {} | {:.2} | {:.2} | {:.1} | {:.1} | {:.1} |",
        list(&shown.loose_mm),
        off.loose_mm,
        off.strand_mm,
        100.0 * off.force,
        100.0 * off.mean,
        100.0 * off.cells
    );
    println!("force {} N, of the tip {} N", list(&shown.force_n), list(&shown.tip_n));
    println!("strand {} mm, gland {:.3} mm", list(&shown.strand_mm), shown.mean_mm);
    Some(off)
}

#[test]
fn seeds_rest_where_another_method_has_them() {
    let mut stage = on_springs(TissueKind::Fem);
    stage.seeds_and_forces_alone();
    for case in [[18.0, 164.0], [80.0, 164.0], [18.0, 388.0], [80.0, 388.0]] {
        let off = compare(&mut stage, "finite elements", case);
        assert!(off.is_some_and(|off| off.meets()), "{off:?}");
    }
}

/// Prints the table of `docs/physics/needle-line.md`: `make seeds-oracle`.
#[test]
#[ignore = "a measurement"]
fn seeds_of_every_case_by_another_method() {
    for (kind, name) in [
        (TissueKind::Fem, "finite elements"),
        (TissueKind::ChainMail, "ChainMail"),
    ] {
        let mut stage = on_springs(kind);
        stage.seeds_and_forces_alone();
        for toughness in [164.0, 388.0, 1175.4] {
            for friction in [18.0, 80.0, 210.0] {
                compare(&mut stage, name, [friction, toughness]);
            }
        }
    }
}

//! The error that is left for one seed at base, middle and apex, by what it comes from.

use nalgebra::Vector3;
use std::fmt::Write as _;
use std::sync::atomic::AtomicBool;
use stylet_hw::DeviceInfo;
use stylet_procedure::Pace;
use stylet_runtime::rehearse::{Rehearsed, Stage};
use stylet_shm_schema::{NeedleRehearsal, ParameterId, ParameterSet};
use stylet_sim::scene::{Layer, Scene, SceneSource, TissueKind};

/// Of the five seeds of the default procedure: the deepest lies at the base.
const SEEDS: [usize; 3] = [0, 2, 4];

pub fn paper() -> SceneSource {
    SceneSource::Builtin("paper".to_owned())
}

pub fn stage(source: &SceneSource, tissue: TissueKind) -> Stage {
    let mut stage = Stage::build(source, tissue, DeviceInfo::phantom_premium_1_5()).expect("valid");
    stage.seeds_and_forces_alone();
    stage
}

/// The needle of `host-ui procedure` in `paper`: five seeds along the axis of the gland.
fn needle() -> NeedleRehearsal {
    let scene = Scene::builtin("paper").expect("built in");
    let (bounds, (low, high)) = (scene.lattice.bounds_m(), scene.target_bounds_m());
    let [x, y] = [0, 1].map(|a| 0.5 * (bounds.0[a] + bounds.1[a]));
    let at = |n: usize| low[2] + (0.8 - 0.6 * n as f64 / 4.0) * (high[2] - low[2]);
    let pace = Pace::default();
    NeedleRehearsal {
        entry_m: [x, y, bounds.0[2] - 0.01],
        direction: [0.0, 0.0, 1.0],
        insert_m_per_s: 0.05,
        retract_m_per_s: 0.05,
        approach_m_per_s: pace.approach_m_per_s,
        acceleration_m_per_s2: pace.acceleration_m_per_s2,
        retract_to_m: 0.0,
        strand_pitch_m: None,
        stabilising: Vec::new(),
        earlier: Vec::new(),
        as_points: false,
        drops_m: (0..5).map(|n| [x, y, at(n)]).collect(),
    }
}

pub fn default_procedure(stage: &mut Stage, set: &ParameterSet) -> Rehearsed {
    stage
        .rehearse(&needle(), set, &AtomicBool::new(false))
        .expect("goes through")
}

type Places = [Vector3<f64>; 3];

fn places_mm(stage: &mut Stage, run: &NeedleRehearsal, set: &ParameterSet) -> Places {
    let done = stage.rehearse(run, set, &AtomicBool::new(false)).expect("goes through");
    SEEDS.map(|n| 1e3 * Vector3::from(done.seeds[n].position_m))
}

/// Returns half of how far the seeds of two runs are apart.
fn half_mm(one: &Places, other: &Places) -> [f64; 3] {
    std::array::from_fn(|n| 0.5 * (one[n] - other[n]).norm())
}

struct Term {
    what: &'static str,
    how: String,
    mm: [f64; 3],
}

fn terms() -> Vec<Term> {
    let (run, defaults) = (needle(), ParameterSet::default());
    let mut usual = stage(&paper(), TissueKind::ChainMail);
    let mean = places_mm(&mut usual, &run, &defaults);
    let in_source = |source: SceneSource| places_mm(&mut stage(&source, TissueKind::ChainMail), &run, &defaults);
    let mut terms = Vec::new();
    let mut add = |what, how: &str, mm| {
        terms.push(Term {
            what,
            how: how.to_owned(),
            mm,
        });
    };

    let solver_mm = of_second_method();
    add(
        "solver",
        "the worst of five loose seeds beside an independent method (`make seeds-oracle`)",
        [solver_mm; 3],
    );

    let fine = places_mm(&mut stage(&paper(), TissueKind::Fem), &run, &defaults);
    let mesh_mm = half_mm(&mean, &fine).map(|half| 2.0 * half);
    add(
        "mesh",
        "ChainMail's line, solved in at most 8,000 elements, beside that of `fem`",
        mesh_mm,
    );

    let in_fat = |factor: f64| {
        let fat = Layer {
            young_pa: factor * Layer::FAT.young_pa,
            ..Layer::FAT
        };
        in_source(paper().in_layers(vec![fat]).expect("valid"))
    };
    add(
        "surroundings",
        "fat of half and of twice its modulus",
        half_mm(&in_fat(0.5), &in_fat(2.0)),
    );

    let stiffened = |factor: f64| in_source(paper().stiffened(factor).expect("valid"));
    let stiffness_mm = half_mm(&stiffened(1.0 / 1.6), &stiffened(1.6));
    add("stiffness", "of the gland, by a factor of 1.6 either way", stiffness_mm);

    let mut varied = |id: ParameterId, factor: f64| {
        let with = |factor: f64| {
            let mut set = ParameterSet::default();
            set.set(id, factor * id.spec().default);
            set
        };
        let [low, high] = [1.0 / factor, factor].map(|factor| places_mm(&mut usual, &run, &with(factor)));
        half_mm(&low, &high)
    };
    let friction_mm = varied(ParameterId::ShaftFriction, 1.5);
    add("friction", "of the shaft, by a factor of 1.5 either way", friction_mm);
    let tip_mm = varied(ParameterId::GlandToughness, 1.4);
    add("tip", "toughness of the gland, by a factor of 1.4 either way", tip_mm);

    let mut beside = |sign: f64| {
        let mut run = run.clone();
        let (offset, tilt) = (sign * 1e-3, sign * 0.5_f64.to_radians());
        let turned = Vector3::new(tilt.tan(), tilt.tan(), 1.0).normalize();
        let planned = run.drops_m.clone();
        for axis in 0..2 {
            run.entry_m[axis] += offset;
        }
        run.direction = turned.into();
        for (drop, planned) in run.drops_m.iter_mut().zip(planned) {
            let along = planned[2] - run.entry_m[2];
            *drop = (Vector3::from(run.entry_m) + along * turned).into();
        }
        places_mm(&mut usual, &run, &defaults)
    };
    let entry_mm = half_mm(&beside(-1.0), &beside(1.0));
    add(
        "entry",
        "1 mm beside the hole and 0.5 degrees, in both directions across",
        entry_mm,
    );

    let points = NeedleRehearsal {
        as_points: true,
        ..run.clone()
    };
    let mechanics_mm = half_mm(&mean, &places_mm(&mut usual, &points, &defaults));
    add(
        "seed mechanics",
        "half of what a seed's body does: how a column slides is assumed",
        mechanics_mm,
    );
    terms
}

/// Reads the worst seed at the defaults from the table that `make seeds-oracle` fills.
fn of_second_method() -> f64 {
    let page = std::fs::read_to_string(super::docs("physics/needle-line.md")).expect("a page");
    let row = page
        .lines()
        .find(|line| line.starts_with("| 80, 0.22 |"))
        .expect("a row");
    row.split('|')
        .nth(2)
        .and_then(|cell| cell.trim().parse().ok())
        .expect("a number")
}

/// Returns the section of the page.
pub fn section() -> String {
    let mut text = "\
## One seed: the error that is left

The first, third and fifth of the five loose seeds of `host-ui procedure` in `paper`: how far each source of error moves them, in
mm. A source that is varied counts with half of the distance between its two ends, about one standard deviation. The
total is the root of the sum of squares, as if the sources were independent. Loads that no term has, such as swelling and
images, are not in it.

| source | varied | base | middle | apex |
|---|---|---|---|---|
"
    .to_owned();
    let terms = terms();
    for Term { what, how, mm } in &terms {
        let _ = writeln!(text, "| {what} | {how} | {:.2} | {:.2} | {:.2} |", mm[0], mm[1], mm[2]);
    }
    let total = |n: usize| terms.iter().map(|term| term.mm[n].powi(2)).sum::<f64>().sqrt();
    let _ = writeln!(
        text,
        "| **total** | | **{:.1}** | **{:.1}** | **{:.1}** |",
        total(0),
        total(1),
        total(2)
    );
    text
}

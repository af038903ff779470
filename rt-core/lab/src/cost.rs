//! Cost of each part of a scene in a tick, measured on this machine: `rt-core cost --scene NAME`.
//!
//! An insertion at clinical speed is replayed to each part, round by round, so that a noisy machine disturbs all parts
//! alike.

mod probe;

use probe::Pressed;
use std::fmt::Write as _;
use std::time::{Duration, Instant};
use stylet_shm_schema::ProblemList;
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::{Scene, TissueKind};
use stylet_sim::settings::Problem;
use stylet_sim::tissue::fem::FemProblem;
use stylet_sim::tissue::{ChainMailTissue, FemTissue, Held, MaterialPoint, TissueModel, TissueSpec, element_ahead};

/// Tissue ticks of one insertion: 50 mm/s at 200 Hz over 40 mm and back.
const TICKS: usize = 320;
const TICK_S: f64 = 5e-3;
const SPEED_M_PER_S: f64 = 0.05;
/// Depth at which the membrane gives way; from then on the tip passes from element to element.
const PUNCTURE_M: f64 = 8e-3;
const ROUNDS: usize = 3;
const SEEDS: usize = 100;

/// A part that takes longer than this in one round is measured over its first ticks only, and the table says so.
const ROUND_LIMIT: Duration = Duration::from_secs(5);

/// Reason why a scene has no cost.
#[derive(Debug, thiserror::Error)]
pub enum CostError {
    /// Parameters of the tissue that are out of range.
    #[error(transparent)]
    Tissue(ProblemList<Problem>),
    /// The scene has no finite elements.
    #[error(transparent)]
    FiniteElements(#[from] ProblemList<FemProblem>),
}

/// Microseconds of every tick of one part, in each round; finally the minimum for each tick, in order.
struct Part {
    name: String,
    period_us: f64,
    rounds: Vec<Vec<f64>>,
    micros: Vec<f64>,
}

impl Part {
    fn quantile(&self, q: f64) -> f64 {
        self.micros[((self.micros.len() - 1) as f64 * q).round() as usize]
    }
}

/// Returns the table that the command prints.
pub fn table(scene: &Scene) -> Result<String, CostError> {
    let parts = measure(scene)?;
    let mut text = format!(
        "Scene \"{}\": {} elements of {:.3} mm, {} structures, {} surface vertices.\n\
         An insertion at {:.0} mm/s over {:.0} mm and back, {ROUNDS} interleaved rounds; the least of each tick.\n\n",
        scene.name,
        scene.lattice.element_count(),
        scene.lattice.spacing_m * 1e3,
        scene.structures.len(),
        scene.surface.vertex_elements.len(),
        SPEED_M_PER_S * 1e3,
        SPEED_M_PER_S * TICK_S * (TICKS / 2) as f64 * 1e3,
    );
    let _ = writeln!(
        text,
        "{:<52} {:>9} {:>9} {:>9} {:>8}",
        "part", "p50 us", "p99 us", "max us", "of tick"
    );
    for part in &parts {
        let _ = writeln!(
            text,
            "{:<52} {:>9.1} {:>9.1} {:>9.1} {:>7.2}%",
            part.name,
            part.quantile(0.5),
            part.quantile(0.99),
            part.quantile(1.0),
            100.0 * part.quantile(0.5) / part.period_us
        );
    }
    text.push_str("\nA tissue tick lasts 5000 us. What a scene does not use is not run.\n");
    Ok(text)
}

fn measure(scene: &Scene) -> Result<Vec<Part>, CostError> {
    let mut models = models(scene)?;
    let mut parts: Vec<Part> = models.iter().map(|timed| part(&timed.name, TICK_S)).collect();
    let others = [
        "find the element at the tip",
        "poses of 100 seeds",
        "write the surface for the host",
    ];
    parts.extend(others.map(|name| part(name, TICK_S)));
    let script = Script::through(scene);
    let pressed = Pressed::of(scene)?;
    let mut of_probe = pressed.as_ref().map(|pressed| part(&pressed.name(), Pressed::PERIOD_S));
    for round in 1..=ROUNDS {
        for (timed, part) in models.iter_mut().zip(&mut parts) {
            eprintln!("round {round} of {ROUNDS}: {}", part.name.trim_start());
            part.rounds.push(Vec::new());
            play(timed, &script, &mut part.rounds[round - 1], |_, _| ());
        }
        if let (Some(pressed), Some(part)) = (&pressed, &mut of_probe) {
            part.rounds.push(Vec::new());
            pressed.play(&mut part.rounds[round - 1]);
        }
        let first = parts.len() - others.len();
        let [locate, seeds, surface] = &mut parts[first..] else {
            unreachable!("three were added")
        };
        let mut micros = [const { Vec::new() }; 3];
        read_body(scene, &mut models[0], &script, &mut micros);
        for (part, micros) in [locate, seeds, surface].into_iter().zip(micros) {
            part.rounds.push(micros);
        }
    }
    parts.extend(of_probe);
    for part in &mut parts {
        keep_least(part);
    }
    Ok(parts)
}

fn part(name: &str, period_s: f64) -> Part {
    Part {
        name: name.to_owned(),
        period_us: period_s * 1e6,
        rounds: Vec::new(),
        micros: Vec::new(),
    }
}

/// Keeps the least time of each tick among equal rounds, then sorts.
fn keep_least(part: &mut Part) {
    let ticks = part.rounds.iter().map(Vec::len).min().unwrap_or(0);
    let least = |tick: usize| part.rounds.iter().map(|r| r[tick]).fold(f64::INFINITY, f64::min);
    part.micros = (0..ticks).map(least).collect();
    part.micros.sort_by(f64::total_cmp);
    if ticks < TICKS {
        part.name = format!("{} [{ticks} ticks]", part.name);
    }
}

/// A tissue model.
struct Timed {
    name: String,
    model: Box<dyn TissueModel>,
    spec: TissueSpec,
}

/// Returns the models that the scene is timed with.
fn models(scene: &Scene) -> Result<Vec<Timed>, CostError> {
    let limits = TissueParameters::default()
        .validate()
        .map_err(|p| CostError::Tissue(ProblemList(p)))?;
    let mut models = vec![Timed {
        name: "tissue step, as the scene is".to_owned(),
        model: Box::new(ChainMailTissue::new(scene, limits)),
        spec: TissueKind::ChainMail.into(),
    }];
    // In a coarser body the ticks below, in elements of the scene, would differ.
    let elastic = scene.clone().for_tissue(TissueKind::Fem);
    if elastic.coarseness() == 1 {
        let fem = FemTissue::<f32>::new(&elastic)?;
        models.push(Timed {
            name: "  FEM in its place (--tissue fem)".to_owned(),
            model: Box::new(fem),
            spec: TissueKind::Fem.into(),
        });
    }
    Ok(models)
}

/// Place of the tip in each tick, on a straight line through the target.
struct Script {
    tips_m: Vec<[f64; 3]>,
    first: u32,
}

impl Script {
    fn through(scene: &Scene) -> Script {
        let (low, high) = scene.target_bounds_m();
        let middle = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
        let start = [middle[0], middle[1], middle[2] - 0.45 * (high[2] - low[2])];
        let step_m = SPEED_M_PER_S * TICK_S;
        let depth = |tick: usize| step_m * tick.min(TICKS - tick) as f64;
        let lattice = &scene.lattice;
        let cell = start.map(|c| (c / lattice.spacing_m) as usize);
        let first = (cell[2]..lattice.dims[2]).find_map(|k| lattice.element_of_cell(cell[0], cell[1], k));
        Script {
            tips_m: (0..TICKS).map(|t| [start[0], start[1], start[2] + depth(t)]).collect(),
            first: first.unwrap_or(0),
        }
    }
}

/// Plays the insertion as the loop does: the first element is held until the membrane gives, then the one at the tip.
fn play(
    Timed { model, spec, .. }: &mut Timed,
    script: &Script,
    micros: &mut Vec<f64>,
    mut look: impl FnMut(&dyn TissueModel, [f64; 3]),
) {
    let begun = Instant::now();
    model.return_to_rest();
    let mut held = script.first;
    let mut grip_m = model.deformed().position_m(held);
    let mut last = script.tips_m[0];
    for &tip in &script.tips_m {
        let depth = tip[2] - script.tips_m[0][2];
        if depth > PUNCTURE_M
            && let Some(point) = MaterialPoint::locate(&model.deformed(), tip, Some(held))
            && point.element != held
        {
            held = point.element;
            grip_m = model.deformed().position_m(held);
        }
        let step_m = [0, 1, 2].map(|a| tip[a] - last[a]);
        grip_m = [0, 1, 2].map(|a| grip_m[a] + 0.5 * step_m[a]);
        last = tip;
        let now = Held {
            element: held,
            position_m: grip_m,
            patch_m: spec.tip_patch_m,
        };
        let start = Instant::now();
        std::hint::black_box(model.step(Some(now), TICK_S));
        if spec.prepares {
            let body = model.deformed();
            let next = element_ahead(&body, Some(held), tip, step_m).map(|element| Held {
                element,
                position_m: [0, 1, 2].map(|a| body.position_m(element)[a] + 0.5 * step_m[a]),
                patch_m: spec.tip_patch_m,
            });
            model.prepare(next);
        }
        micros.push(start.elapsed().as_secs_f64() * 1e6);
        look(&**model, tip);
        if begun.elapsed() > ROUND_LIMIT {
            return;
        }
    }
}

/// Reads the same values from the body as the loop does after each step.
fn read_body(scene: &Scene, timed: &mut Timed, script: &Script, [locate, seeds, surface]: &mut [Vec<f64>; 3]) {
    let n = scene.lattice.element_count();
    let points: Vec<MaterialPoint> = (0..SEEDS)
        .map(|s| MaterialPoint {
            element: (n * s / SEEDS) as u32,
            local: [0.1, -0.2, 0.3],
        })
        .collect();
    let mut positions_m = vec![[0.0_f32; 3]; scene.surface.vertex_elements.len()];
    let mut hint = None;
    play(timed, script, &mut Vec::new(), |model, tip| {
        let body = model.deformed();
        let timed = |micros: &mut Vec<f64>, work: &mut dyn FnMut()| {
            let start = Instant::now();
            work();
            micros.push(start.elapsed().as_secs_f64() * 1e6);
        };
        timed(locate, &mut || {
            hint = std::hint::black_box(MaterialPoint::locate(&body, tip, hint)).map(|p| p.element);
        });
        timed(seeds, &mut || {
            for point in &points {
                std::hint::black_box(point.position_m(&body));
            }
        });
        timed(surface, &mut || {
            body.write_surface(&scene.surface, &mut positions_m);
            std::hint::black_box(&positions_m);
        });
    });
}

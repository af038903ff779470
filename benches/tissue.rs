//! Tissue step: time of each solver as a ratio within one run, with the constraint violation it leaves beside it.
//!
//! `cargo bench -p stylet-benches`. Rounds are interleaved, so that a noisy machine disturbs all rows alike.

use std::time::Instant;
use stylet_benches::solvers::{Body, PlainQueue, PlainSweep};
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{ChainMail, Held, MaterialPoint, TissueState, largest_violation, step};

/// The loop's tick, and a needle at 50 mm/s.
const TICK_S: f64 = 5e-3;
const STEP_M: f64 = 0.05 * TICK_S;

/// Microseconds of every round, and the worst violation left.
struct Row {
    name: &'static str,
    micros: Vec<f64>,
    violation: f64,
}

impl Row {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            micros: Vec::new(),
            violation: 0.0,
        }
    }

    fn add(&mut self, start: Instant, model: &ChainMail, state: &TissueState) {
        self.micros.push(start.elapsed().as_secs_f64() * 1e6);
        // A look at every link of a large body takes longer than what is measured.
        let looks = model.element_count() < 100_000 || self.micros.len() % 20 == 1;
        if looks {
            self.violation = self.violation.max(largest_violation(model, state));
        }
    }

    /// As `add`, for a textbook's pass.
    fn add_plain(&mut self, start: Instant, body: &Body) {
        self.micros.push(start.elapsed().as_secs_f64() * 1e6);
        if self.micros.len() % 20 == 1 {
            self.violation = self.violation.max(body.largest_violation());
        }
    }

    fn quantile(&mut self, q: f64) -> f64 {
        self.micros.sort_by(f64::total_cmp);
        self.micros[((self.micros.len() - 1) as f64 * q).round() as usize]
    }
}

/// A needle along z, in and out: the surface follows until puncture at 8 mm, then the element at the tip does,
/// less and less, and on the way out by 0.3 (paper eq. 6 with the default parameters).
struct Needle {
    entry: u32,
    entry_m: [f64; 3],
    deepest_m: f64,
    depth_m: f64,
    inwards: bool,
    punctured: bool,
    held: Option<Held>,
}

const PUNCTURE_M: f64 = 8e-3;

impl Needle {
    fn new(scene: &Scene, deepest_m: f64) -> Self {
        let (low, high) = scene.lattice.bounds_m();
        let h = scene.lattice.spacing_m;
        let middle = |a: usize| ((0.5 * (low[a] + high[a]) / h).floor() + 0.5) * h;
        let first = (0..scene.lattice.dims[2])
            .find_map(|k| {
                scene
                    .lattice
                    .element_of_cell((middle(0) / h) as usize, (middle(1) / h) as usize, k)
            })
            .expect("tissue on the needle's way");
        Needle {
            entry: first,
            entry_m: scene.lattice.rest_m(first),
            deepest_m,
            depth_m: 0.0,
            inwards: true,
            punctured: false,
            held: None,
        }
    }

    fn tick(&mut self, model: &ChainMail, state: &TissueState) -> Option<Held> {
        let way = if self.inwards { STEP_M } else { -STEP_M };
        self.depth_m += way;
        let tip = [self.entry_m[0], self.entry_m[1], self.entry_m[2] + self.depth_m];
        let ratio = match (self.inwards, self.punctured) {
            (true, false) => 1.0,
            (true, true) => (-((0.05_f64 - 0.02).powi(2) / 1e-2 + (self.depth_m - PUNCTURE_M).powi(2) / 2e-4)).exp(),
            (false, _) => 0.3,
        };
        if self.punctured {
            // The element now at the tip goes on from where it is.
            let body = state.deformed(model);
            let hint = self.held.map(|h| h.element);
            self.held = MaterialPoint::locate(&body, tip, hint).map(|at| Held {
                element: at.element,
                position_m: body.position_m(at.element),
                patch_m: 0.0,
            });
        } else if self.held.is_none() {
            self.held = Some(Held {
                element: self.entry,
                position_m: self.entry_m,
                patch_m: 0.0,
            });
        }
        if let Some(held) = &mut self.held {
            held.position_m[2] += ratio * way;
        }
        self.punctured |= self.depth_m >= PUNCTURE_M;
        if self.depth_m >= self.deepest_m {
            self.inwards = false;
        }
        if self.depth_m <= 0.0 {
            (self.inwards, self.punctured, self.held) = (true, false, None);
        }
        self.held
    }
}

/// `with_queue`: the textbook's single passes too, for a body of one structure.
fn bench(scene: &Scene, rounds: usize, ticks_a_round: usize, with_queue: bool) {
    let limits = TissueParameters::default().validate().expect("the defaults are valid");
    let model = ChainMail::new(scene, limits);
    let h = scene.lattice.spacing_m;
    let (lower, upper) = scene.lattice.bounds_m();
    let middle = [0, 1, 2].map(|a| ((lower[a] + upper[a]) / 2.0 / h) as usize);
    let element = scene
        .lattice
        .element_of_cell(middle[0], middle[1], middle[2])
        .expect("tissue in the middle");
    let rest = scene.lattice.rest_m(element);
    // Far enough that every element moves.
    let way = [0, 1, 2].map(|a| (upper[a] - lower[a]) / h * [1.0, -1.2, 1.5][a]);
    let far = Held {
        element,
        position_m: [0, 1, 2].map(|a| rest[a] + way[a] * h),
        patch_m: 0.0,
    };

    let at = way.map(|c| c as f32);
    let limits = model.limits().clone();
    let mut plain = with_queue.then(|| {
        let lattice = &scene.lattice;
        (
            Body::at_rest(scene, &limits),
            PlainQueue::new(lattice),
            PlainSweep::new(lattice),
        )
    });
    let mut rows = [
        Row::new("plain queue, one pass, everything moved"),
        Row::new("plain sweep, one pass, everything moved"),
        Row::new("step to the residual, everything moved"),
        Row::new("step to the residual, 50 mm/s needle"),
        Row::new("step with nothing held, at rest"),
        Row::new("needle, and five passes of relaxation"),
    ];
    let elastic = TissueParameters {
        relaxation_iterations: 5,
        ..TissueParameters::default()
    };
    let elastic = ChainMail::new(scene, elastic.validate().expect("valid"));
    let (mut relaxed, mut second_needle) = (TissueState::at_rest(&elastic), Needle::new(scene, 0.04));
    let mut inserted = TissueState::at_rest(&model);
    let mut needle = Needle::new(scene, 0.04);
    let at_rest = TissueState::at_rest(&model);
    let mut state = TissueState::at_rest(&model);
    let (mut passes, mut moved) = (0, 0);
    let (mut most_passes, mut moved_sum) = (0, 0);
    for _ in 0..rounds {
        if let Some((body, queue, sweep)) = &mut plain {
            body.return_to_rest();
            let start = Instant::now();
            queue.run(body, element, at);
            rows[0].add_plain(start, body);
            body.return_to_rest();
            let start = Instant::now();
            sweep.run(body, element, at);
            rows[1].add_plain(start, body);
        }

        state.copy_from(&at_rest);
        let start = Instant::now();
        let report = step(&model, &mut state, Some(far), TICK_S);
        rows[2].add(start, &model, &state);
        (passes, moved) = (report.passes, report.moved);

        for _ in 0..ticks_a_round {
            let held = needle.tick(&model, &inserted);
            let start = Instant::now();
            let report = step(&model, &mut inserted, held, TICK_S);
            rows[3].add(start, &model, &inserted);
            most_passes = most_passes.max(report.passes);
            moved_sum += report.moved as usize;
            assert!(report.converged);
        }

        for _ in 0..ticks_a_round.min(10) {
            let held = second_needle.tick(&elastic, &relaxed);
            let start = Instant::now();
            let report = step(&elastic, &mut relaxed, held, TICK_S);
            rows[5].add(start, &elastic, &relaxed);
            assert!(report.converged);
        }

        state.copy_from(&at_rest);
        let start = Instant::now();
        std::hint::black_box(step(&model, &mut state, None, TICK_S));
        rows[4].add(start, &model, &state);
    }

    println!(
        "{}: {} elements, {rounds} interleaved rounds; violation in elements",
        scene.name,
        scene.lattice.element_count()
    );
    println!(
        "  everything moved: {passes} passes, {moved} moved; needle: at most {most_passes} passes, {} moved on average",
        moved_sum / rows[3].micros.len()
    );
    let bytes = |bytes: usize| bytes as f64 / scene.lattice.element_count() as f64;
    println!(
        "  model {:.1} and state {:.1} bytes an element",
        bytes(model.bytes()),
        bytes(state.bytes())
    );
    println!(
        "{:<42} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11}",
        "", "min us", "p50 us", "p99 us", "p99.9 us", "ratio", "violation"
    );
    let base = rows[if with_queue { 0 } else { 2 }].quantile(0.5);
    for row in rows.iter_mut().filter(|row| !row.micros.is_empty()) {
        let [min, p50, p99, p999] = [0.0, 0.5, 0.99, 0.999].map(|q| row.quantile(q));
        println!(
            "{:<42} {min:>9.1} {p50:>9.1} {p99:>9.1} {p999:>9.1} {:>9.2} {:>11.2e}",
            row.name,
            base / p50,
            row.violation
        );
    }
    assert!(
        rows[2].violation <= 1e-3 && rows[3].violation <= 1e-3,
        "a step left its limits"
    );
}

fn main() {
    let scene = |name| Scene::builtin(name).expect("built in");
    bench(&scene("paper"), 200, 10, true);
    bench(&scene("pelvis"), 40, 50, false);
    bench(&scene("full"), 20, 100, true);
}

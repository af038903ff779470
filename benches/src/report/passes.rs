//! Cost of the textbook's single pass against a step of ours, on a body in which everything moves.

use std::time::Instant;
use stylet_benches::solvers::{Body, PlainQueue};
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{ChainMail, Held, TissueState, step};

/// One solver on one body.
pub struct Passes {
    pub scene: &'static str,
    pub elements: usize,
    pub solver: &'static str,
    pub passes: u32,
    /// Least of the rounds, which are interleaved.
    pub us: f64,
    /// Links outside their limits by at most so many elements.
    pub violation: f64,
}

impl Passes {
    pub fn ns_an_element(&self) -> f64 {
        self.us * 1e3 / (self.elements as f64 * f64::from(self.passes))
    }
}

const ROUNDS: usize = 60;

pub fn measure() -> Vec<Passes> {
    eprintln!("one pass of each solver ...");
    [("paper", ROUNDS), ("full", ROUNDS / 6)]
        .into_iter()
        .flat_map(|(name, rounds)| on(name, rounds))
        .collect()
}

fn on(name: &'static str, rounds: usize) -> Vec<Passes> {
    let scene = Scene::builtin(name).expect("built in");
    let limits = TissueParameters::default().validate().expect("the defaults are valid");
    let lattice = &scene.lattice;
    let (low, high) = lattice.bounds_m();
    let h = lattice.spacing_m;
    let [i, j, k] = [0, 1, 2].map(|a| (0.5 * (low[a] + high[a]) / h) as usize);
    let element = lattice.element_of_cell(i, j, k).expect("tissue in the middle");
    // Far enough that every element moves.
    let way = [0, 1, 2].map(|a| (high[a] - low[a]) / h * [1.0, -1.2, 1.5][a]);
    let rest_m = lattice.rest_m(element);
    let far = Held {
        element,
        position_m: [0, 1, 2].map(|a| rest_m[a] + way[a] * h),
        patch_m: 0.0,
    };
    let at = way.map(|c| c as f32);
    let (mut queue, mut body) = (PlainQueue::new(lattice), Body::at_rest(&scene, &limits));
    let model = ChainMail::new(&scene, limits);
    let at_rest = TissueState::at_rest(&model);
    let mut state = TissueState::at_rest(&model);
    let (mut least, mut passes) = ([f64::INFINITY; 2], 1);
    for _ in 0..rounds {
        body.return_to_rest();
        state.copy_from(&at_rest);
        let mut time = |n: usize, run: &mut dyn FnMut()| {
            let begun = Instant::now();
            run();
            least[n] = least[n].min(begun.elapsed().as_secs_f64() * 1e6);
        };
        time(0, &mut || {
            let moved = queue.run(&mut body, element, at);
            assert_eq!(moved as usize, lattice.element_count(), "a pass over everything");
        });
        time(1, &mut || passes = step(&model, &mut state, Some(far), 5e-3).passes);
    }
    let left = stylet_sim::tissue::largest_violation(&model, &state);
    let rows = [
        ("plain queue, one pass", 1, least[0], body.largest_violation()),
        ("ours, to the residual", passes, least[1], left),
    ];
    rows.map(|(solver, passes, us, violation)| Passes {
        scene: name,
        elements: lattice.element_count(),
        solver,
        passes,
        us,
        violation,
    })
    .into()
}

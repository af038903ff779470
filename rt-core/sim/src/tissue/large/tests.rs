//! Claims about the window: it opens what the linear answer folds, and is that answer where strain is small.

use super::energy::{Nodes, Sides, linear, neo_hookean};
use super::precondition::Laplacian;
use super::*;
use crate::scene::TissueKind;
use crate::simd::Simd;
use crate::tissue::fem::{FemModel, FemSettings, FemState, Material, SolveSettings, step};
use crate::tissue::{Carried, Deformed, Held, least_corner};

mod reference;

/// The gland of `paper` with a patch of 4 mm moved by a millimetre, so many elements behind the surface.
struct Pushed {
    scene: Scene,
    element: u32,
    of_mm: [Vec<f32>; 3],
}

impl Pushed {
    fn new(depth: usize) -> Self {
        let scene = Scene::builtin("paper").expect("built in").for_tissue(TissueKind::Fem);
        let lattice = scene.body.clone();
        let settings = FemSettings::homogeneous(Material::PROSTATE, 2.5e5);
        let model = FemModel::<f32>::new(&lattice, &settings).expect("valid");
        let [low, high] = lattice.occupied();
        let [x, y] = [0, 1].map(|a| (low[a] + high[a]) / 2);
        let first = (0..high[2]).find(|&k| lattice.element_of_cell(x, y, k).is_some());
        let element = first
            .and_then(|k| lattice.element_of_cell(x, y, k + depth))
            .expect("tissue");
        let mut state = FemState::at_rest(&model);
        let mut position_m = lattice.rest_m(element);
        position_m[2] += 1e-3;
        let patch = Held {
            element,
            position_m,
            patch_m: 4e-3,
        };
        let exact = SolveSettings {
            relative_tolerance: 1e-6,
            max_cycles: 100,
        };
        assert!(step(&model, &mut state, Some(patch), &exact).converged);
        Pushed {
            of_mm: [0, 1, 2].map(|a| state.displacement(a).to_vec()),
            scene,
            element,
        }
    }

    fn linear(&self, by_mm: f32) -> [Vec<f32>; 3] {
        self.of_mm.each_ref().map(|u| u.iter().map(|u| u * by_mm).collect())
    }

    fn least(&self, u: &[Vec<f32>; 3]) -> f64 {
        let body = Deformed {
            lattice: &self.scene.body,
            u: u.each_ref().map(Vec::as_slice),
            scale: 1.0,
            carried: Carried::Not,
            reach: 1.0,
        };
        least_corner(&body, self.element)
    }

    /// Corrects by the window, as a tick does it.
    fn corrected(&self, large: &mut LargeStrain, by_mm: f32) -> [Vec<f32>; 3] {
        let mut u = self.linear(by_mm);
        let least = self.least(&u);
        self.unfold(large, &mut u, self.element, least);
        u
    }

    fn unfold(&self, large: &mut LargeStrain, u: &mut [Vec<f32>; 3], element: u32, least: f64) {
        let linear = |e: u32| u.each_ref().map(|u| u[e as usize]);
        large.unfold(&self.scene.body, [&linear, &|_| [0.0; 3]], element, least);
        for (element, moved) in large.moved() {
            for (u, moved) in u.iter_mut().zip(moved) {
                u[element as usize] += moved;
            }
        }
    }
}

fn apart(a: &[Vec<f32>; 3], b: &[Vec<f32>; 3]) -> f32 {
    let axes = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    axes.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// A quarter of a millimetre a tick is a needle at 50 mm/s.
#[test]
fn no_cell_folds_where_a_tip_pushes_tissue_by_10_mm() {
    for depth in [0, 12] {
        let pushed = Pushed::new(depth);
        let mut large = LargeStrain::new(&pushed.scene);
        let (mut before, mut widest, mut least_of_all) = (pushed.linear(0.0), 0.0_f32, f64::INFINITY);
        for tick in 1..=40 {
            let by_mm = 0.25 * tick as f32;
            let u = pushed.corrected(&mut large, by_mm);
            let least = pushed.least(&u);
            let linear = pushed.linear(by_mm);
            widest = widest.max(apart(&u, &before));
            least_of_all = least_of_all.min(least);
            if tick % 4 == 0 {
                println!(
                    "{depth} behind the surface, {by_mm} mm: corner {:.3}, linear {:.3}; {:.3} elements apart",
                    least,
                    pushed.least(&linear),
                    apart(&u, &linear)
                );
            }
            before = u;
        }
        println!("no centre moves by more than {widest:.3} elements in a tick");
        assert!(pushed.least(&pushed.linear(10.0)) < -0.1);
        assert!(least_of_all > -1e-3, "{least_of_all}");
        // Linear tissue moves by 0.18 of an element in each.
        assert!(
            widest < 2.5 * apart(&pushed.linear(0.25), &pushed.linear(0.0)),
            "{widest}"
        );
    }
}

#[test]
fn small_strain_is_left_to_the_linear_answer() {
    let pushed = Pushed::new(12);
    let mut large = LargeStrain::new(&pushed.scene);
    assert!(apart(&pushed.corrected(&mut large, 2.0), &pushed.linear(2.0)) == 0.0);
    let mut off = Vec::new();
    for by_mm in [0.1, 0.2] {
        let mut u = pushed.linear(by_mm);
        large.forget();
        for _ in 0..20 {
            u = pushed.linear(by_mm);
            pushed.unfold(&mut large, &mut u, pushed.element, IN_FULL);
        }
        off.push(apart(&u, &pushed.linear(by_mm)) / (by_mm * 0.73));
    }
    println!("of the displacement: {off:?}");
    // Of second order.
    assert!(off[1] < 0.02 && off[0] < 0.65 * off[1], "{off:?}");
}

#[test]
fn what_is_saved_goes_on_with_the_same_bits() {
    let pushed = Pushed::new(0);
    let mut large = LargeStrain::new(&pushed.scene);
    for tick in 0..20 {
        pushed.corrected(&mut large, 5.0 + 0.1 * tick as f32);
    }
    let mut bytes = vec![0; large.memory_len()];
    large.save(&mut bytes);
    let mut other = LargeStrain::new(&pushed.scene);
    other.load(&bytes);
    let calls = stylet_heap::calls_of_this_thread();
    let mut u = pushed.linear(7.1);
    let begun = stylet_heap::calls_of_this_thread();
    pushed.unfold(&mut large, &mut u, pushed.element, 0.2);
    assert_eq!(stylet_heap::calls_of_this_thread(), begun, "allocates");
    let mut again = pushed.linear(7.1);
    pushed.unfold(&mut other, &mut again, pushed.element, 0.2);
    assert!(calls <= begun && u == again);
    assert!(
        pushed.corrected(&mut LargeStrain::new(&pushed.scene), 7.1) != u,
        "depends on what came before"
    );
}

/// The window moves on by an element; nothing that it knows jumps.
#[test]
fn a_window_that_moves_on_carries_its_answer_along() {
    let pushed = Pushed::new(12);
    let mut large = LargeStrain::new(&pushed.scene);
    let by_mm = 8.0;
    let least = pushed.least(&pushed.linear(by_mm));
    let mut settled = pushed.linear(by_mm);
    for _ in 0..10 {
        settled = pushed.linear(by_mm);
        pushed.unfold(&mut large, &mut settled, pushed.element, least);
    }
    let [i, j, k] = pushed.scene.body.cell(pushed.element);
    let next = pushed.scene.body.element_of_cell(i, j, k + 1).expect("tissue");
    let mut moved = pushed.linear(by_mm);
    pushed.unfold(&mut large, &mut moved, next, least);
    let jump = apart(&moved, &settled);
    println!("{jump} elements");
    // As far as a needle at 70 mm/s moves it in a tick.
    assert!(jump < 0.25, "{jump}");
}

/// The hand rests: the window keeps solving in every tick until it rests as well.
#[test]
fn a_window_under_the_same_loads_goes_on_until_it_rests() {
    let pushed = Pushed::new(12);
    let mut large = LargeStrain::new(&pushed.scene);
    let answers: Vec<_> = (0..60).map(|_| pushed.corrected(&mut large, 9.0)).collect();
    let (first, last) = (apart(&answers[0], &answers[59]), apart(&answers[58], &answers[59]));
    println!("{first} elements in 60 ticks, {last} in the last");
    assert!(first > 0.05 && last < 1e-3, "{first}, {last}");
}

fn random(solver: &Solver, size: f32) -> Nodes {
    let mut random = stylet_random::Random(3);
    std::array::from_fn(|_| (0..solver.grid.len()).map(|_| size * random.signed() as f32).collect())
}

fn block() -> Solver {
    let mut solver = Solver::new();
    for place in solver.grid.places().filter(|p| p.iter().all(|&c| c < 4)) {
        let at = solver.grid.at(place);
        solver.cells.mu.iter_mut().for_each(|mu| mu[at] = 0.125);
        solver.cells.lambda[at] = FIRMEST;
    }
    solver
}

#[test]
fn rotation_causes_no_force_and_small_strain_a_linear_one() {
    let solver = block();
    let (mut out, mut other) = (Sides::new(&solver.grid), Sides::new(&solver.grid));
    let mut turned = solver.now.clone();
    for place in solver.grid.places() {
        let at = solver.grid.at(place);
        let [x, y] = [place[0] as f32, place[1] as f32];
        (turned[0][at], turned[1][at]) = (0.6 * x - 0.8 * y - x, 0.8 * x + 0.6 * y - y);
    }
    let largest = |of: &Nodes| of.iter().flatten().fold(0.0_f32, |a, b| a.max(b.abs()));
    for simd in Simd::all() {
        neo_hookean(simd, &solver.grid, &solver.cells, &turned, &mut out);
        assert!(largest(&out.sum) < 1e-5, "{}", largest(&out.sum));
        linear(simd, &solver.grid, &solver.cells, &turned, &mut out);
        assert!(largest(&out.sum) > 0.1);
        let little = random(&solver, 1e-3);
        neo_hookean(simd, &solver.grid, &solver.cells, &little, &mut out);
        linear(simd, &solver.grid, &solver.cells, &little, &mut other);
        assert!(
            apart(&out.sum, &other.sum) < 0.02 * largest(&other.sum),
            "{}",
            apart(&out.sum, &other.sum) / largest(&other.sum)
        );
    }
}

/// Six times a node less its neighbours gives back what the inverse was taken of.
#[test]
fn the_laplacian_of_its_inverse_is_what_it_was() {
    let solver = Solver::new();
    let grid = &solver.grid;
    let is_inner = |place: &[usize; 3]| place.iter().all(|&c| c > 0 && c < SIDE - 1);
    let mut of = random(&solver, 1.0);
    for place in grid.places().filter(|place| !is_inner(place)) {
        of.iter_mut().for_each(|axis| axis[grid.at(place)] = 0.0);
    }
    for simd in Simd::all() {
        let mut inverse = of.clone();
        Laplacian::new(grid).apply(simd, grid, &mut inverse);
        for (of, inverse) in of.iter().zip(&inverse) {
            for place in grid.places().filter(is_inner) {
                let at = grid.at(place);
                let around = [1, grid.stride, grid.stride * SIDE].map(|step| inverse[at - step] + inverse[at + step]);
                let again = 6.0 * inverse[at] - around.iter().sum::<f32>();
                assert!((again - of[at]).abs() < 1e-5, "{again} for {}", of[at]);
            }
        }
    }
}

/// Forces are a gradient: the work over a closed way is nothing, even through tissue that is folded.
#[test]
fn a_closed_way_takes_no_work() {
    let solver = block();
    let (a, b) = (random(&solver, 0.4), {
        let mut b = random(&solver, 0.4);
        b.rotate_left(1);
        b
    });
    let mut work = 0.0_f64;
    let (mut now, mut out) = (solver.now.clone(), Sides::new(&solver.grid));
    let mut most = 0.0_f64;
    const STEPS: usize = 4000;
    for n in 0..STEPS {
        let t = std::f64::consts::TAU * (n as f64 + 0.5) / STEPS as f64;
        let (sin, cos) = (t.sin(), t.cos());
        let mut step = 0.0;
        for c in 0..3 {
            for at in 0..now[c].len() {
                now[c][at] = cos as f32 * a[c][at] + sin as f32 * b[c][at];
            }
        }
        neo_hookean(Simd::detect(), &solver.grid, &solver.cells, &now, &mut out);
        for c in 0..3 {
            for at in 0..now[c].len() {
                let by = cos * f64::from(b[c][at]) - sin * f64::from(a[c][at]);
                step += f64::from(out.sum[c][at]) * by;
            }
        }
        work += step / STEPS as f64;
        most = most.max(step.abs());
    }
    assert!(work.abs() < 1e-3 * most, "{work} of {most}");
}

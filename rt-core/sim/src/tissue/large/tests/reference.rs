//! Comparison with a neo-Hookean body of another program: `tests/oracles/gland_large_strain.py`.

use super::*;
use crate::scene::Labels;
use crate::tissue::fem::hold_cells;

const ORACLE: &str = include_str!("../../../../../../tests/oracles/large_strain.csv");
const HALF: [usize; 3] = [10, 8, 11];
const CELL_MM: f64 = 2.2;
/// The oracle's patch, and an element of it.
const HELD: [[usize; 2]; 3] = [[9, 11], [7, 9], [2, 4]];
const TIP: [usize; 3] = [10, 8, 3];

/// Solves the oracle's gland by linear elements, its patch moved by a millimetre.
fn gland() -> Pushed {
    let [nx, ny, nz] = HALF.map(|n| 2 * n);
    let is_inside = |n: usize| {
        let cell = [n % nx, n / nx % ny, n / (nx * ny)];
        let square = |a: usize| ((cell[a] as f64 + 0.5 - HALF[a] as f64) / HALF[a] as f64).powi(2);
        (0..3).map(square).sum::<f64>() <= 1.0
    };
    let labels = Labels {
        dims: [nx, ny, nz],
        spacing_m: CELL_MM * 1e-3,
        cells: (0..nx * ny * nz).map(|n| u8::from(is_inside(n))).collect(),
        structures: Vec::new(),
    };
    let scene = Scene::from_labels("oracle", &labels).expect("valid");
    let settings = FemSettings::homogeneous(Material::PROSTATE, 2.5e5);
    let model = FemModel::<f32>::new(&scene.body, &settings).expect("valid");
    let mut state = FemState::at_rest(&model);
    let exact = SolveSettings {
        relative_tolerance: 1e-6,
        max_cycles: 100,
    };
    assert!(hold_cells(&model, &mut state, HELD, [0.0, 0.0, 1e-3], &exact).converged);
    let [i, j, k] = TIP;
    Pushed {
        element: scene.body.element_of_cell(i, j, k).expect("tissue"),
        of_mm: [0, 1, 2].map(|a| state.displacement(a).to_vec()),
        scene,
    }
}

/// Returns RMS and largest distance over what moves by 1 % of the travel, and RMS up to four elements from the tip, in
/// % of the travel.
fn errors(pushed: &Pushed, u: &[Vec<f32>; 3], by_mm: f64, column: usize) -> [f64; 3] {
    let (mut all, mut near, mut worst) = ([0.0; 2], [0.0; 2], 0.0_f64);
    for line in ORACLE.lines().skip(2) {
        let numbers: Vec<f64> = line.split(',').map(|n| n.parse().expect("a number")).collect();
        let cell = [0, 1, 2].map(|a| numbers[a] as usize);
        let there = [0, 1, 2].map(|a| numbers[3 + 3 * column + a]);
        if there.iter().map(|c| c * c).sum::<f64>().sqrt() < 0.01 * by_mm {
            continue;
        }
        let element = pushed
            .scene
            .body
            .element_of_cell(cell[0], cell[1], cell[2])
            .expect("in both");
        let off = |a: usize| CELL_MM * f64::from(u[a][element as usize]) - there[a];
        let square: f64 = (0..3).map(|a| off(a).powi(2)).sum();
        worst = worst.max(square);
        let is_near = (0..3).all(|a| cell[a].abs_diff(TIP[a]) <= 4);
        for sums in [Some(&mut all), is_near.then_some(&mut near)].into_iter().flatten() {
            *sums = [sums[0] + square, sums[1] + 1.0];
        }
    }
    let percent = |[sum, count]: [f64; 2]| 100.0 * (sum / count).sqrt() / by_mm;
    [percent(all), 100.0 * worst.sqrt() / by_mm, percent(near)]
}

#[test]
fn the_window_beats_the_linear_answer_against_neo_hooke() {
    let pushed = gland();
    let mut large = LargeStrain::new(&pushed.scene);
    for tick in 1..=40 {
        let by_mm = 0.25 * tick as f32;
        let u = pushed.corrected(&mut large, by_mm);
        let Some(column) = [4.0, 8.0, 10.0].iter().position(|mm| *mm == by_mm) else {
            continue;
        };
        let linear = errors(&pushed, &pushed.linear(by_mm), f64::from(by_mm), column);
        let corrected = errors(&pushed, &u, f64::from(by_mm), column);
        println!(
            "{by_mm} mm: RMS {:.2} % linear, {:.2} % corrected; worst {:.1}, {:.1} %; near the tip {:.2}, {:.2} %",
            linear[0], corrected[0], linear[1], corrected[1], linear[2], corrected[2]
        );
        assert!((0..3).all(|n| corrected[n] <= linear[n]));
        assert!(
            column == 0 || (0..3).all(|n| corrected[n] < 0.95 * linear[n]),
            "{corrected:?} of {linear:?}"
        );
    }
}

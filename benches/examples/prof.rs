use rt_core::scene::Scene;
use rt_core::tissue::fem::*;
fn main() {
    let scene = Scene::builtin("paper").unwrap();
    let nu: f64 = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(0.45);
    let cycles: u32 = std::env::args().nth(2).and_then(|a| a.parse().ok()).unwrap_or(5);
    let tol: f64 = std::env::args().nth(3).and_then(|a| a.parse().ok()).unwrap_or(1e-30);
    let m = Material {
        poisson_ratio: nu,
        ..Material::PROSTATE
    };
    let model = FemModel::<f32>::new(&scene.lattice, &FemSettings::homogeneous(m, 3e5)).unwrap();
    let l = &scene.lattice;
    let element = l.element_of_cell(53, 31, 80).unwrap();
    let mut p = l.rest_m(element);
    p[2] += 2e-3;
    let mut all = vec![];
    let mut res = 0.0;
    for _ in 0..std::env::args().nth(4).and_then(|a| a.parse().ok()).unwrap_or(60) {
        let mut state = FemState::at_rest(&model);
        let t = std::time::Instant::now();
        let r = step(
            &model,
            &mut state,
            Some(TipPatch {
                element,
                position_m: p,
                edge_m: 4e-3,
            }),
            &SolveSettings {
                relative_tolerance: tol,
                max_cycles: cycles,
            },
        );
        let us = t.elapsed().as_secs_f64() * 1e6 / r.cycles as f64;
        all.push(us);
        res = r.relative_residual;
    }
    all.sort_by(f64::total_cmp);
    println!(
        "min {:.0} p50 {:.0} us/cycle residual {res:e}",
        all[0],
        all[all.len() / 2]
    );
}

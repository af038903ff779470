//! Columns of the paper's gland: what they cost, and that slices give what all at once gives.

use super::*;
use crate::line::{Compliance, Line, StationSettings};
use crate::scene::{Labels, Scene};
use crate::tissue::fem::{FemModel, FemSettings, Integration, Material};

/// Returns the time that this thread ran on a processor, whatever else the machine does.
pub(in crate::line) fn processor_time_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds: f64 = text
        .split_whitespace()
        .next()
        .expect("three numbers")
        .parse()
        .expect("a number");
    nanoseconds * 1e-9
}

pub(in crate::line) fn material(nu: f64) -> Material {
    Material {
        youngs_modulus_pa: 17e3,
        poisson_ratio: nu,
        integration: Integration::MeanDilatation,
    }
}

/// Returns the paper's gland on 20 mm of fat, and a needle along z through the middle of it, from the apex in.
pub(in crate::line) fn paper(spacing_part: f64) -> (BatchModel<f32>, Stations) {
    let lattice = Scene::builtin("paper").expect("built in").lattice;
    let h = lattice.spacing_m;
    let fem = FemModel::<f32>::new(&lattice, &FemSettings::homogeneous(material(0.49), 250e3)).expect("valid");
    let model = BatchModel::new(&fem);
    let first = (0..lattice.dims[2])
        .find(|&k| lattice.element_of_cell(53, 31, k).is_some())
        .expect("in the gland");
    let line = Line::new([53.5 * h, 31.5 * h, first as f64 * h], [0.0, 0.0, 1.0]).expect("a direction");
    let mut settings = StationSettings::of_lattice(h);
    settings.spacing_m *= spacing_part;
    let stations = Stations::along(&model, line, settings, crate::line::MAX_STATIONS);
    (model, stations)
}

#[test]
fn slices_give_what_all_at_once_gives() {
    let labels = Labels {
        dims: [9, 8, 10],
        spacing_m: 1.5e-3,
        cells: vec![1; 720],
        structures: Vec::new(),
    };
    let lattice = Scene::from_labels("test", &labels).expect("valid").lattice;
    let fem = FemModel::<f32>::new(&lattice, &FemSettings::homogeneous(material(0.45), 1e5)).expect("valid");
    let model = BatchModel::new(&fem);
    let line = Line::new([6e-3, 5e-3, 0.0], [0.1, 0.05, 1.0]).expect("a direction");
    let stations = Stations::along(&model, line, StationSettings::of_lattice(1.5e-3), 20);
    assert!(stations.count() >= 9, "{}", stations.count());
    let mut all = ColumnQueue::new(&model, &stations, true, TOLERANCE);
    all.prepare(&model, usize::MAX);
    let mut sliced = ColumnQueue::new(&model, &stations, true, TOLERANCE);
    let mut calls = 0;
    while !sliced.prepare(&model, 3).is_done() {
        calls += 1;
        assert!(calls < 10_000);
    }
    assert_eq!(all.columns().len(), 2 * (stations.count() + stations.across_count()));
    for (a, b) in all.columns().iter().zip(sliced.columns()) {
        assert!(a.residual <= TOLERANCE);
        assert_eq!((a.load, &a.samples_m, &a.field), (b.load, &b.samples_m, &b.field));
    }
    let compliance = Compliance::of_columns(&model, &stations, all.columns()).expect("all columns");
    assert!(conditioning(&compliance) > 1e-3);
}

/// Returns the smallest eigenvalue over the largest, of the shaft's part.
fn conditioning(compliance: &Compliance) -> f64 {
    let stations = compliance.stations;
    let matrix = nalgebra::DMatrix::from_fn(stations, stations, |i, j| compliance.at(i, j));
    let eigenvalues = matrix.symmetric_eigenvalues();
    eigenvalues.min() / eigenvalues.max()
}

/// `cargo test --profile quick -p rt-core --lib times_of_columns -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn times_of_columns() {
    let start = processor_time_s();
    let (model, stations) = paper(1.0);
    println!(
        "model {:.0} ms, {:.1} MB; {} stations",
        1e3 * (processor_time_s() - start),
        model.bytes() as f64 / 1e6,
        stations.count()
    );
    let solve = |loads: usize| {
        let mut state = BatchState::new(&model);
        let weights: Vec<_> = (0..loads)
            .map(|n| stations.load(&stations.shaft[n % stations.count()], 0))
            .collect();
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            let start = processor_time_s();
            for chunk in weights.chunks(LOADS) {
                let loads: Vec<_> = chunk.iter().map(Vec::as_slice).collect();
                state.begin(&model, &loads);
                state.solve(&model, TOLERANCE, 60);
            }
            best = best.min(processor_time_s() - start);
        }
        println!("{loads} columns: {:.0} ms", 1e3 * best);
    };
    [1, 8, 35].into_iter().for_each(solve);
    let start = processor_time_s();
    let mut queue = ColumnQueue::new(&model, &stations, false, TOLERANCE);
    queue.prepare(&model, usize::MAX);
    let [columns, state] = queue.bytes();
    println!(
        "queue of {} axial columns (shaft and tip): {:.0} ms, {:.1} MB and {:.1} MB to solve in",
        queue.columns().len(),
        1e3 * (processor_time_s() - start),
        columns as f64 / 1e6,
        state as f64 / 1e6
    );
    let (mut slowest, mut slices) = (0.0_f64, 0);
    let mut queue = ColumnQueue::new(&model, &stations, false, TOLERANCE);
    loop {
        let start = processor_time_s();
        let is_done = queue.prepare(&model, 1).is_done();
        slowest = slowest.max(processor_time_s() - start);
        slices += 1;
        if is_done {
            break;
        }
    }
    println!("{slices} slices, slowest {:.2} ms", 1e3 * slowest);
    let compliance = Compliance::of_columns(&model, &stations, queue.columns()).expect("all");
    println!("smallest over largest eigenvalue {:.3}", conditioning(&compliance));
    let m = stations.count();
    for n in [0, 1, m / 4, m / 2, m - 1] {
        println!(
            "station {n}: shaft {:.4} m/N ({:.4} of it missing in the lattice), tip {:.5} m/N",
            compliance.at(n, n),
            stations.missing_m_per_n[n],
            compliance.at(m + n, m + n)
        );
    }
}

use super::*;
use crate::scene::{Scene, TissueKind};
use crate::tissue::fem::{FemModel, FemTissue};
use crate::tissue::{ElementField, Shift, TissueModel};

fn paper() -> (Scene, BatchModel<f32>, FemModel<f32>) {
    let scene = Scene::builtin("paper").unwrap();
    let tissue = FemTissue::<f32>::new(&scene).unwrap();
    (scene, BatchModel::new(&tissue.model), tissue.model)
}

/// Returns a small body, whose columns are soon solved.
fn block() -> (Scene, BatchModel<f32>) {
    let labels = crate::scene::Labels {
        dims: [6, 6, 10],
        spacing_m: 2e-3,
        cells: vec![1; 6 * 6 * 10],
        structures: Vec::new(),
    };
    let scene = Scene::from_labels("block", &labels).unwrap();
    let tissue = FemTissue::<f32>::new(&scene).unwrap();
    let body = BatchModel::new(&tissue.model);
    (scene, body)
}

/// Returns the displacement of the body as a whole by the membrane.
fn shift(hand: &HandLine) -> Shift<'static> {
    Shift::of_all([0.0, 0.0, hand.whole_m()])
}

/// Returns a line through the middle of the gland, along its axis.
fn ready(scene: &Scene, body: &BatchModel<f32>) -> ReadyLine {
    let (low, high) = scene.lattice.bounds_m();
    let start_m = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] - 0.01];
    let line = Line::into_body(&scene.lattice, start_m, [0.0, 0.0, 1.0]).unwrap();
    ReadyLine::prepare(
        1,
        body,
        &scene.lattice,
        &|_| Some(LayerKind::Gland),
        line,
        false,
        &[],
        &mut |_| true,
    )
    .unwrap()
}

#[test]
fn a_line_enters_the_body_where_its_first_element_is() {
    let scene = Scene::builtin("paper").unwrap();
    let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
    let inside_m = scene.lattice.rest_m(element);
    let line = Line::into_body(&scene.lattice, inside_m, [0.0, 0.0, 1.0]).unwrap();
    let just = |along_m: f64| {
        let cell = line
            .point_m(along_m, [0.0; 2])
            .map(|c| (c / scene.lattice.spacing_m) as usize);
        scene.lattice.element_of_cell(cell[0], cell[1], cell[2]).is_some()
    };
    assert!(just(1e-6) && !just(-1e-6), "{line:?}");
    assert!(Line::into_body(&scene.lattice, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).is_none());
}

#[test]
fn a_needle_beside_the_line_or_across_it_is_not_on_it() {
    let line = Line::new([0.01, 0.02, 0.03], [0.0, 0.0, 1.0]).unwrap();
    let met = |tip: [f64; 3], direction: [f64; 3]| {
        line.is_met_by(&tip.into(), &Vector3::from(direction).normalize(), BESIDE_M, TILT_RAD)
    };
    assert!(met([0.01, 0.02, -0.05], [0.0, 0.0, 1.0]));
    assert!(met([0.0105, 0.02, 0.0], [0.0, 0.0, 1.0]));
    assert!(!met([0.012, 0.02, 0.0], [0.0, 0.0, 1.0]), "2 mm beside");
    assert!(!met([0.01, 0.02, 0.0], [0.05, 0.0, 1.0]), "3 degrees");
    assert!(!met([0.01, 0.02, 0.0], [0.0, 0.0, -1.0]), "the other way");
}

/// The tissue of the loop is where the needle has it: the element at the tip, moved by the columns, is at the tip.
#[test]
fn the_body_follows_the_loads_of_the_line() {
    let (scene, body, _) = paper();
    let ReadyLine {
        mut hand,
        body: columns,
        ..
    } = ready(&scene, &body);
    let mut tissue = FemTissue::<f32>::new(&scene).unwrap();
    let mut tip_m = 0.0;
    while tip_m < 5e-3 {
        tip_m += 5e-5;
        let answer = hand.step(tip_m, 1e-3);
        assert!(answer.punctured.is_none(), "5 of 8 mm");
    }
    let report = tissue
        .displace(columns.answer.columns(), hand.state().loads_n(), shift(&hand))
        .unwrap();
    assert!(report.converged && report.moved > 19_000, "{report:?}");
    // The tip presses as a patch: at its middle the lattice moves a little more than on the mean over the patch.
    let at_entry = hand
        .line()
        .point_m(5e-4, [0.0; 2])
        .map(|c| (c / scene.lattice.spacing_m) as usize);
    let element = scene
        .lattice
        .element_of_cell(at_entry[0], at_entry[1], at_entry[2])
        .unwrap();
    let moved_m = tissue.deformed().position_m(element)[2] - scene.lattice.rest_m(element)[2];
    assert!((4.5e-3..6.5e-3).contains(&moved_m), "{moved_m} m for 5 mm");
    while tip_m > -1e-3 {
        tip_m -= 5e-5;
        hand.step(tip_m, 1e-3);
    }
    assert!(!hand.is_in_tissue());
    let report = tissue
        .displace(columns.answer.columns(), hand.state().loads_n(), shift(&hand))
        .unwrap();
    assert_eq!((report.moved, report.max_displacement), (0, 0.0));
}

#[test]
fn a_reset_line_answers_like_a_new_one() {
    let (scene, body, _) = paper();
    let mut hand = ready(&scene, &body).hand;
    let new = hand.clone();
    let forces = LayerForces {
        membrane_gain: 0.5,
        ..LayerForces::default()
    };
    hand.set_forces(&forces);
    for n in 0..400 {
        hand.step(5e-5 * f64::from(n), 1e-3);
    }
    assert!(hand.is_in_tissue());
    hand.reset();
    hand.set_forces(&LayerForces::default());
    let mut new = new;
    for n in 0..400 {
        let (a, b) = (
            hand.step(5e-5 * f64::from(n), 1e-3),
            new.step(5e-5 * f64::from(n), 1e-3),
        );
        assert_eq!(a, b);
    }
}

/// Measures the coarser body of the pelvis: `cargo test --profile quick -p stylet-sim --lib a_coarser_pelvis -- --ignored
/// --nocapture`
///
/// The same forces, 2 N of shaft friction along 50 mm and 1.5 N at the tip, act on the body as it ships and on one of
/// all cells.
#[test]
#[ignore = "a measurement of some minutes"]
fn a_coarser_pelvis_beside_one_of_all_cells() {
    let coarse = Scene::builtin("pelvis").unwrap().for_tissue(TissueKind::Fem);
    let full = Scene::builtin("pelvis").unwrap();
    for across_m in [[0.0, 0.0], [0.012, -0.008]] {
        let (low, high) = coarse.target_bounds_m();
        let start_m = [
            0.5 * (low[0] + high[0]) + across_m[0],
            0.5 * (low[1] + high[1]) + across_m[1],
            0.0,
        ];
        let line = Line::into_body(&full.lattice, start_m, [0.0, 0.0, 1.0]).unwrap();
        let depth_m = 0.5 * (low[2] + high[2]) - line.entry_m[2];
        let answer = |scene: &Scene| {
            let begun = std::time::Instant::now();
            let tissue = FemTissue::<f32>::new(scene).unwrap();
            let body = BatchModel::new(&tissue.model);
            let made = begun.elapsed();
            let stations = Stations::along(&body, line, StationSettings::of_lattice(body.spacing_m()), MAX_STATIONS);
            let place_m = |n: usize| (n as f64 + 0.5) * stations.settings.spacing_m;
            let on_shaft: Vec<usize> = (0..stations.count())
                .filter(|&n| (depth_m - 0.05..depth_m).contains(&place_m(n)))
                .collect();
            let mut load = Vec::new();
            let add = |weights: &[(u32, f64)], force_n: f64, load: &mut Vec<_>| {
                let scaled: Vec<_> = weights.iter().map(|&(node, w)| (node, w * force_n)).collect();
                load.extend(stations.load(&scaled, 0));
            };
            on_shaft
                .iter()
                .for_each(|&n| add(&stations.shaft[n], 2.0 / on_shaft.len() as f64, &mut load));
            let shaft = load.clone();
            let at_tip = (depth_m / stations.settings.spacing_m) as usize;
            add(&stations.tip[at_tip], 1.5, &mut load);
            let mut state = crate::tissue::fem::batch::BatchState::new(&body);
            state.begin(&body, &[&load, &shaft]);
            let begun = std::time::Instant::now();
            let progress = loop {
                let progress = state.advance(&body);
                if state.is_whole() && (progress.residual < 1e-4 || progress.iterations > 200) {
                    break progress;
                }
            };
            let solved = begun.elapsed();
            let tip_m = state.sample(0, &stations.load(&stations.tip[at_tip], 0));
            let mut field = ElementField::zeros(body.element_count());
            state.write(&body, 0, &mut field);
            println!(
                "{} elements, {} nodes, {} stations: set up {made:.1?}, eight loads {solved:.1?}, {progress:?}, tip {:.3} mm, {:.0} MB",
                body.element_count(),
                body.node_count(),
                stations.count(),
                tip_m * 1e3,
                body.bytes() as f64 / 1e6
            );
            (field, tip_m)
        };
        let ((near, _), (exact, _)) = (answer(&coarse), answer(&full));
        // Gland and all, by the distance from the tip: what a seed there would be off.
        for (name, least_m, only_target) in [
            ("gland", 0.0, true),
            ("gland, 5 mm off the tip", 5e-3, true),
            ("all", 0.0, false),
        ] {
            let (mut square, mut size, mut worst, mut largest, mut count) = (0.0, 0.0, 0.0_f64, 0.0_f64, 0);
            for element in 0..full.lattice.element_count() as u32 {
                let place_m = full.lattice.rest_m(element);
                let structure = &full.structures[usize::from(full.lattice.structure(element))];
                let from_tip = Vector3::from(place_m) - Vector3::from(line.point_m(depth_m, [0.0; 2]));
                if (only_target && structure.role != crate::scene::Role::Target) || from_tip.norm() < least_m {
                    continue;
                }
                let point = crate::tissue::MaterialPoint::at_rest(&coarse.body, place_m).unwrap();
                let around = coarse.body.neighbours(point.element);
                for c in 0..3 {
                    let at = |e: u32| f64::from(near.0[c][e as usize]);
                    let mut u = at(point.element);
                    for a in 0..3 {
                        let other = around[2 * a + usize::from(point.local[a] > 0.0)];
                        u += f64::from(point.local[a].abs()) * other.map_or(0.0, |e| at(e) - at(point.element));
                    }
                    let v = f64::from(exact.0[c][element as usize]);
                    square += (u - v).powi(2);
                    size += v * v;
                    worst = worst.max((u - v).abs());
                    largest = largest.max(v.abs());
                }
                count += 1;
            }
            println!(
                "   {name}: {count} cells, rms {:.3} mm of {:.3} mm, worst {:.3} mm of {:.3} mm",
                (square / f64::from(count)).sqrt() * 1e3,
                (size / f64::from(count)).sqrt() * 1e3,
                worst * 1e3,
                largest * 1e3
            );
        }
    }
    let source = std::time::Instant::now();
    let tissue = FemTissue::<f32>::new(&coarse).unwrap();
    let body = BatchModel::new(&tissue.model);
    let (low, high) = coarse.target_bounds_m();
    let start_m = [0.5 * (low[0] + high[0]) + 0.012, 0.5 * (low[1] + high[1]) - 0.008, 0.0];
    let line = Line::into_body(&coarse.lattice, start_m, [0.0, 0.0, 1.0]).unwrap();
    let built = source.elapsed();
    let ready = ReadyLine::prepare(
        1,
        &body,
        &coarse.lattice,
        &|_| Some(LayerKind::Gland),
        line,
        false,
        &[],
        &mut |_| true,
    )
    .unwrap();
    let bytes: usize = ready
        .body
        .answer
        .columns()
        .iter()
        .map(crate::tissue::PackedField::bytes)
        .sum();
    println!(
        "body {built:.1?}, line of {} columns {:.1?}, {:.0} MB",
        ready.body.answer.columns().len(),
        source.elapsed() - built,
        bytes as f64 / 1e6
    );
    let mut tissue = tissue;
    let loads: Vec<f64> = (0..ready.body.answer.columns().len())
        .map(|n| if n < 40 { 0.05 } else { 0.0 })
        .collect();
    let mut times_us: Vec<f64> = (0..200)
        .map(|_| {
            let begun = std::time::Instant::now();
            tissue
                .displace(ready.body.answer.columns(), &loads, Shift::default())
                .unwrap();
            begun.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times_us.sort_by(f64::total_cmp);
    println!(
        "a tick of 40 loads: p50 {:.0} us, p99 {:.0} us",
        times_us[100], times_us[198]
    );
}

/// A flight recording holds no columns: they are solved again when it is repeated.
#[test]
fn a_line_that_is_prepared_twice_is_the_same_in_every_bit() {
    let (first, again) = (block(), block());
    let [a, b] = [&first, &again].map(|(scene, body)| ready(scene, body));
    assert!(a.hand.source().is_identical(&b.hand.source()));
    let pairs = a.body.answer.columns().iter().zip(b.body.answer.columns());
    assert!(pairs.clone().count() == 20 && pairs.clone().all(|(a, b)| a.is_identical(b)));
    assert!(a.body.answer.columns()[0].at(0) != [0.0; 3]);
    let other = Line::new(first.0.lattice.rest_m(0), [0.0, 0.0, 1.0]).unwrap();
    let other = ReadyLine::prepare(
        1,
        &first.1,
        &first.0.lattice,
        &|_| Some(LayerKind::Gland),
        other,
        false,
        &[],
        &mut |_| true,
    )
    .unwrap();
    assert!(!a.hand.source().is_identical(&other.hand.source()));
}

/// A flight recording keeps a line as bytes and restores it: the same answers from there on, and no heap call for the
/// copy.
#[test]
fn a_line_is_restored_from_source_and_state_in_every_bit() {
    let (scene, body) = block();
    let mut hand = ready(&scene, &body).hand;
    let mut kept = LineState::with_room();
    for n in 0..300 {
        hand.step(5e-5 * f64::from(n), 1e-3);
    }
    assert!(hand.is_in_tissue());
    let before = stylet_heap::calls_of_this_thread();
    kept.copy_from(hand.state());
    kept.clear();
    kept.copy_from(hand.state());
    assert_eq!(stylet_heap::calls_of_this_thread(), before, "calls of the heap");
    assert_eq!(&kept, hand.state());
    let source = hand.source();
    assert!(source.is_identical(&hand.source()) && source.stations() == 10);
    let mut again = HandLine::of_source(source).expect("a line");
    assert!(again.take_state(&kept));
    for n in 300..500 {
        let tip_m = 5e-5 * f64::from(n.min(700 - n));
        assert_eq!(again.step(tip_m, 1e-3), hand.step(tip_m, 1e-3), "tick {n}");
    }
    assert_eq!(again.state(), hand.state());
}

#[test]
fn a_source_or_a_state_that_is_not_whole_is_refused() {
    let line = Line::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let mut hand = HandLine::uniform(1, line, 4).unwrap();
    assert!(!hand.take_state(&LineState::with_room()));
    let mut source = hand.source();
    assert!(HandLine::of_source(source.clone()).is_ok());
    source.compliance_mut().stations = 5;
    assert!(HandLine::of_source(source).is_err());
}

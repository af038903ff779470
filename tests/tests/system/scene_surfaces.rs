//! Distance of a drawn body from its segmentation: smooth surfaces, and the former ones through the centres of the
//! outermost elements.

use std::collections::HashMap;
use std::time::Instant;
use stylet_host::link::SceneModel;
use stylet_runtime::control::ScenePicture;
use stylet_sim::scene::{Labels, Scene};
use stylet_surfaces::bodies::{Bodies, Segmentation, shown_alone};

type Place = [f64; 3];

fn seen(scene: &Scene) -> SceneModel {
    let picture = ScenePicture::first(scene, 1);
    let (header, words) = picture.parts();
    SceneModel::of_words(header, words).expect("the core's own picture holds together")
}

fn of_lattice(model: &SceneModel) -> Bodies {
    Bodies::of_lattice(Segmentation {
        header: &model.header,
        labels: &model.labels,
        rest_m: &model.rest_m,
        triangles: &model.triangles,
    })
}

/// A surface and its source cells, both in units of cells.
struct Drawn<'a> {
    model: &'a SceneModel,
    triangles: Vec<[Place; 3]>,
    is_in: Vec<bool>,
}

/// Errors in cells, except the volume, which is a relative difference.
#[derive(Debug)]
struct Errors {
    mean: f64,
    hausdorff: f64,
    volume: f64,
}

impl<'a> Drawn<'a> {
    /// Part 0 is the whole body.
    fn of(model: &'a SceneModel, bodies: &Bodies, part: usize) -> Self {
        let grid = model.header.labels;
        let place = |v: u32| {
            let p = bodies.rest_m[v as usize];
            [0, 1, 2].map(|a| (f64::from(p[a]) - grid.origin_m[a]) / grid.spacing_m)
        };
        let members = part.checked_sub(1).map(|n| shown_alone(&model.header)[n].1.clone());
        let is_in = |label: u8| match (&members, label) {
            (_, 0) => false,
            (Some(members), label) => members[usize::from(label) - 1],
            (None, _) => true,
        };
        let triangles = &bodies.triangles[bodies.parts[part].clone()];
        Self {
            model,
            triangles: triangles.iter().map(|t| t.map(place)).collect(),
            is_in: model.labels.iter().map(|l| is_in(*l)).collect(),
        }
    }

    fn has(&self, cell: [i64; 3]) -> bool {
        let dims = self.model.header.labels.dims.map(i64::from);
        (0..3).all(|a| (0..dims[a]).contains(&cell[a]))
            && self.is_in[(cell[0] + dims[0] * (cell[1] + dims[1] * cell[2])) as usize]
    }

    /// Cell, axis and side of each face between inside and outside.
    fn faces(&self) -> Vec<([i64; 3], usize, i64)> {
        let dims = self.model.header.labels.dims.map(i64::from);
        let mut faces = Vec::new();
        for n in (0..self.is_in.len()).filter(|&n| self.is_in[n]) {
            let n = n as i64;
            let cell = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
            for (axis, side) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                let mut beside = cell;
                beside[axis] += side;
                if !self.has(beside) {
                    faces.push((cell, axis, side));
                }
            }
        }
        faces
    }

    fn errors(&self) -> Errors {
        let faces = self.faces();
        let mut faces_of: HashMap<[i64; 3], Vec<(Place, usize)>> = HashMap::new();
        for (cell, axis, side) in &faces {
            let mut middle = cell.map(|c| c as f64);
            middle[*axis] += 0.5 * *side as f64;
            faces_of.entry(*cell).or_default().push((middle, *axis));
        }
        let to_cells = |p: &Place| {
            nearest(p, |cell| {
                let near = faces_of.get(&cell).into_iter().flatten();
                near.map(|(middle, axis)| {
                    let off = |a: usize| ((p[a] - middle[a]).abs() - if a == *axis { 0.0 } else { 0.5 }).max(0.0);
                    off(0).hypot(off(1)).hypot(off(2))
                })
                .fold(f64::INFINITY, f64::min)
            })
        };
        let mut triangles_of: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for (n, triangle) in self.triangles.iter().enumerate() {
            let cell = middle_of(triangle).map(|c| c.round() as i64);
            triangles_of.entry(cell).or_default().push(n);
        }
        let to_drawn = |p: &Place| {
            nearest(p, |cell| {
                let near = triangles_of.get(&cell).into_iter().flatten();
                near.map(|&n| to_triangle(p, &self.triangles[n]))
                    .fold(f64::INFINITY, f64::min)
            })
        };
        let (mut sum, mut area, mut hausdorff) = (0.0, 0.0, 0.0_f64);
        for triangle in &self.triangles {
            let (off, own) = (to_cells(&middle_of(triangle)), length(twice_area(triangle)));
            (sum, area) = (sum + off * own, area + own);
            hausdorff = hausdorff.max(off).max(to_cells(&triangle[0]));
        }
        for middle in faces_of.values().flatten() {
            hausdorff = hausdorff.max(to_drawn(&middle.0));
        }
        let cells = self.is_in.iter().filter(|i| **i).count() as f64;
        let volume: f64 = self
            .triangles
            .iter()
            .map(|[a, b, c]| dot(*a, cross(*b, *c)) / 6.0)
            .sum();
        Errors {
            mean: sum / area,
            hausdorff,
            volume: volume / cells - 1.0,
        }
    }
}

/// Smallest distance to the contents of the surrounding cells; a triangle reaches less than a cell beyond the cell of
/// its centre.
fn nearest(p: &Place, in_cell: impl Fn([i64; 3]) -> f64) -> f64 {
    let within = |reach| around(p, reach).map(&in_cell).fold(f64::INFINITY, f64::min);
    let near = within(1);
    if near <= 0.5 { near } else { near.min(within(3)) }
}

fn around(p: &Place, reach: i64) -> impl Iterator<Item = [i64; 3]> {
    let cell = p.map(|c| c.round() as i64);
    let side = 2 * reach + 1;
    (0..side * side * side).map(move |n| {
        let by = [n % side, n / side % side, n / side / side];
        [0, 1, 2].map(|a| cell[a] + by[a] - reach)
    })
}

fn minus(a: Place, b: Place) -> Place {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Place, b: Place) -> Place {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn length(v: Place) -> f64 {
    dot(v, v).sqrt()
}

fn twice_area([a, b, c]: &[Place; 3]) -> Place {
    cross(minus(*b, *a), minus(*c, *a))
}

fn middle_of([a, b, c]: &[Place; 3]) -> Place {
    [0, 1, 2].map(|i| (a[i] + b[i] + c[i]) / 3.0)
}

fn to_triangle(p: &Place, triangle: &[Place; 3]) -> f64 {
    let normal = twice_area(triangle);
    let is_over = (0..3).all(|i| {
        let [a, b] = [triangle[i], triangle[(i + 1) % 3]];
        dot(cross(minus(b, a), minus(*p, a)), normal) >= 0.0
    });
    if is_over && length(normal) > 0.0 {
        return (dot(minus(*p, triangle[0]), normal) / length(normal)).abs();
    }
    let to_side = |i: usize| {
        let [a, b] = [triangle[i], triangle[(i + 1) % 3]];
        let (along, there) = (minus(b, a), minus(*p, a));
        let share = (dot(along, there) / dot(along, along).max(1e-30)).clamp(0.0, 1.0);
        length([0, 1, 2].map(|i| there[i] - share * along[i]))
    };
    to_side(0).min(to_side(1)).min(to_side(2))
}

/// Drawn surfaces used to pass through the centres of the outermost elements: half an element too small all round, in
/// steps, and a structure one element thick had none.
#[test]
fn what_is_drawn_follows_the_segmentation() {
    println!("part, h in mm: mean mm, Hausdorff mm, volume %: before, after");
    for name in ["paper", "pelvis"] {
        let scene = Scene::builtin(name).expect("built in");
        let model = seen(&scene);
        let (before, after) = (of_lattice(&model), model.bodies());
        assert_eq!(before.parts.len(), after.parts.len());
        // In `pelvis` the body is the skin, which is drawn faintly.
        for part in after.parts.len().min(2) - 1..after.parts.len() {
            let [before, after] = [&before, after].map(|bodies| Drawn::of(&model, bodies, part).errors());
            let h = model.header.spacing_m * 1e3;
            let words = |e: &Errors| format!("{:.3} {:.3} {:+.2}", e.mean * h, e.hausdorff * h, e.volume * 1e2);
            println!("{name} {part}, {h:.3}: {}; {}", words(&before), words(&after));
            // The former surface keeps neither bound.
            assert!(before.mean > 0.2 && before.volume < -0.05, "{name} {part}: {before:?}");
            assert!(after.mean < 0.2 && after.hausdorff < 0.6, "{name} {part}: {after:?}");
            assert!(after.volume.abs() < 5e-3, "{name} {part}: {after:?}");
        }
    }
}

/// Against the original solid, in the paper's grid: a ball as large as the gland, off the centre of a cell.
#[test]
fn a_ball_is_drawn_as_a_ball() {
    const CELLS: usize = 40;
    let (middle, radius) = ([19.3, 19.6, 19.1], 16.2);
    let label = |n: usize| {
        let cell = [n % CELLS, n / CELLS % CELLS, n / CELLS / CELLS];
        let off = [0, 1, 2].map(|a| cell[a] as f64 - middle[a]);
        u8::from(length(off) <= radius)
    };
    let labels = Labels {
        dims: [CELLS; 3],
        spacing_m: 1.3641e-3,
        cells: (0..CELLS * CELLS * CELLS).map(label).collect(),
        structures: Vec::new(),
    };
    let model = seen(&Scene::from_labels("ball", &labels).expect("valid"));
    let origin = model.header.labels.origin_m.map(|o| o / labels.spacing_m - 0.5);
    let off = |bodies: &Bodies| {
        let drawn = Drawn::of(&model, bodies, 0);
        let off = |p: &Place| length([0, 1, 2].map(|a| p[a] + origin[a] - middle[a])) - radius;
        let all: Vec<f64> = drawn.triangles.iter().map(|t| off(&middle_of(t))).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let rms = (all.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
        (mean, rms, all.iter().fold(0.0_f64, |most, o| most.max(o.abs())))
    };
    let (before, after) = (off(&of_lattice(&model)), off(model.bodies()));
    println!("mean, steps (rms), largest, in cells: {before:.3?} before, {after:.3?} after");
    assert!(before.0 < -0.3 && before.1 > 0.1, "{before:?}");
    assert!(after.0.abs() < 0.02 && after.1 < 0.06 && after.2 < 0.3, "{after:?}");
}

/// `cargo test --profile quick -p stylet-tests --test system scene_surfaces::time -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn time_to_make_and_to_move_them() {
    for name in ["paper", "pelvis", "full"] {
        let scene = Scene::builtin(name).expect("built in");
        let model = seen(&scene);
        let start = Instant::now();
        let bodies = model.bodies();
        let made = start.elapsed();
        // Everything moves: the most expensive frame.
        let now_m: Vec<[f32; 3]> = model.rest_m.iter().map(|p| p.map(|c| c * 1.01)).collect();
        let mut out = Vec::new();
        let mut times_us: Vec<f64> = (0..200)
            .map(|_| {
                let start = Instant::now();
                bodies.deformed(&model.rest_m, &now_m, &mut out);
                start.elapsed().as_secs_f64() * 1e6
            })
            .collect();
        times_us.sort_by(f64::total_cmp);
        println!(
            "{name}: made in {made:.1?}; {} vertices and {} triangles, {} and {} before; moved in p50 {:.0} us, p99 {:.0} us",
            bodies.rest_m.len(),
            bodies.triangles.len(),
            model.rest_m.len(),
            model.triangles.len(),
            times_us[100],
            times_us[198],
        );
    }
}

//! Drawn surfaces against the cells that they are made from; `tests/tests/system/scene_surfaces.rs`
//! has whole scenes.

use super::*;
use bytemuck::Zeroable;

const SPACING_M: f64 = 1e-3;

/// Returns a body of one structure, as the core sends it: every cell is an element at the surface.
fn scene(dims: [usize; 3], is_in: impl Fn([usize; 3]) -> bool) -> (SceneHeader, Vec<u8>, Vec<[f32; 3]>) {
    let mut header = SceneHeader::zeroed();
    header.spacing_m = SPACING_M;
    header.structure_count = 1;
    header.labels = GridInfo {
        dims: dims.map(|d| d as u32),
        reserved: 0,
        origin_m: [0.02, -0.01, 0.03],
        spacing_m: SPACING_M,
    };
    let cells =
        || (0..dims.iter().product()).map(|n: usize| [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]]);
    let place = |c: [usize; 3]| [0, 1, 2].map(|a| (header.labels.origin_m[a] + c[a] as f64 * SPACING_M) as f32);
    let labels = cells().map(|c| u8::from(is_in(c))).collect();
    let rest_m = cells().filter(|c| is_in(*c)).map(place).collect();
    (header, labels, rest_m)
}

fn bodies(scene: &(SceneHeader, Vec<u8>, Vec<[f32; 3]>)) -> Bodies {
    Bodies::of(Segmentation {
        header: &scene.0,
        labels: &scene.1,
        rest_m: &scene.2,
        triangles: &[],
    })
}

fn volume_mm3(bodies: &Bodies) -> f64 {
    let corner = |v: u32| bodies.rest_m[v as usize].map(|c| f64::from(c) * 1e3);
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        let cross = [
            b[1] * c[2] - b[2] * c[1],
            b[2] * c[0] - b[0] * c[2],
            b[0] * c[1] - b[1] * c[0],
        ];
        (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]) / 6.0
    };
    bodies.triangles.iter().map(of).sum()
}

/// Asserts that every edge runs once each way.
fn assert_closed(bodies: &Bodies) {
    let edges = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)];
    let mut there: Vec<(u32, u32)> = bodies.triangles.iter().flat_map(|t| edges(*t)).collect();
    let mut back: Vec<(u32, u32)> = there.iter().map(|&(a, b)| (b, a)).collect();
    there.sort_unstable();
    back.sort_unstable();
    assert!(!there.is_empty() && there == back);
}

#[test]
fn a_plate_a_wire_and_a_cell_that_are_one_cell_thick_do_not_vanish() {
    let far = |c: [usize; 3]| c.iter().all(|i| (2..13).contains(i));
    // One cell thick at the seventh cell, along x; x and y; x, y and z.
    for (name, thin) in [("plate", 1), ("wire", 2), ("cell", 3)] {
        let scene = scene([15; 3], |c| far(c) && c[..thin].iter().all(|&i| i == 7));
        let bodies = bodies(&scene);
        assert_eq!(bodies.follows, Follows::Segmentation, "{name}");
        assert_closed(&bodies);
        let cells = scene.1.iter().filter(|&&l| l != 0).count() as f64;
        let share = volume_mm3(&bodies) / cells;
        println!("{name}: {:.0} % of its cells", share * 100.0);
        // Pushed out flat, a single cell overshoots.
        assert!((0.9..1.3).contains(&share), "{name}: {share} of its cells");
    }
}

#[test]
fn vertices_move_with_the_elements_beside_them() {
    let is_in = |c: [usize; 3]| c.iter().map(|&i| (i as f64 - 9.0).powi(2)).sum::<f64>() < 49.0;
    let scene = scene([19; 3], is_in);
    let bodies = bodies(&scene);
    assert_closed(&bodies);
    let mut out = Vec::new();
    bodies.deformed(&scene.2, &scene.2, &mut out);
    assert_eq!(out, bodies.rest_m, "at rest");
    let shifted: Vec<[f32; 3]> = scene.2.iter().map(|p| [p[0] + 2e-3, p[1], p[2] - 1e-3]).collect();
    bodies.deformed(&scene.2, &shifted, &mut out);
    for (now, rest) in out.iter().zip(&bodies.rest_m) {
        let off = [now[0] - rest[0] - 2e-3, now[1] - rest[1], now[2] - rest[2] + 1e-3];
        assert!(off.iter().all(|o| o.abs() < 1e-7), "{off:?}");
    }
    // Stretched by a tenth: the elements lie within a cell of the vertex.
    let stretch = |p: &[f32; 3]| [p[0] * 1.1, p[1], p[2]];
    let stretched: Vec<[f32; 3]> = scene.2.iter().map(stretch).collect();
    bodies.deformed(&scene.2, &stretched, &mut out);
    for (now, rest) in out.iter().zip(&bodies.rest_m) {
        assert!((now[0] - stretch(rest)[0]).abs() < 0.1 * SPACING_M as f32, "{now:?}");
    }
}

/// Guards against holes: a host that gets the label of every second cell only would open thin
/// walls.
#[test]
fn without_every_label_the_lattice_is_drawn() {
    let mut scene = scene([9; 3], |c| c.iter().all(|i| (2..7).contains(i)));
    scene.0.spacing_m = SPACING_M / 2.0;
    assert_eq!(bodies(&scene).follows, Follows::Lattice);
}

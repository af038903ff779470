//! Folds are found where a search over every element finds them.

use super::*;
use crate::scene::{Lattice, Scene, test_bodies};
use crate::tissue::Carried;

fn body<'a>(lattice: &'a Lattice, u: &'a [Vec<f32>; 3]) -> Deformed<'a> {
    Deformed {
        lattice,
        u: u.each_ref().map(Vec::as_slice),
        scale: 1.0,
        carried: Carried::Not,
        reach: 1.0,
    }
}

/// Searches the corners of every element, by its neighbours, in f64.
fn by_search(body: &Deformed, is_near: impl Fn(u32) -> bool) -> f64 {
    let mut least = f64::INFINITY;
    for element in 0..body.lattice.element_count() as u32 {
        let around = body.lattice.neighbours(element);
        let here = body.displacement(element);
        for corner in 0..8 {
            let side = [corner & 1, corner >> 1 & 1, corner >> 2];
            let links = [0, 1, 2].map(|a| {
                let there = around[2 * a + side[a]].filter(|&e| is_near(e))?;
                let sign = if side[a] == 1 { 1.0 } else { -1.0 };
                let u = body.displacement(there);
                let mut link = [0, 1, 2].map(|c| sign * (u[c] - here[c]));
                link[a] += 1.0;
                Some(nalgebra::Vector3::from(link))
            });
            if let ([Some(x), Some(y), Some(z)], true) = (links, is_near(element)) {
                least = least.min(x.dot(&y.cross(&z)));
            }
        }
    }
    least
}

#[test]
fn the_smallest_corner_is_that_of_a_full_search() {
    let lattice = Scene::from_labels("test", &test_bodies::with_hole())
        .expect("valid")
        .lattice;
    let count = lattice.element_count();
    for (round, size) in [0.0_f32, 0.1, 0.3, 0.6].into_iter().enumerate() {
        let u: [Vec<f32>; 3] = std::array::from_fn(|axis| {
            (0..count)
                .map(|e| size * ((e * (axis + 3) + 17 * round) as f32 * 1.7).sin())
                .collect()
        });
        let body = body(&lattice, &u);
        for element in (0..count as u32).step_by(7) {
            let middle = lattice.cell(element);
            let is_near = |e: u32| (0..3).all(|a| lattice.cell(e)[a].abs_diff(middle[a]) <= REACH);
            let wanted = by_search(&body, is_near);
            let wanted = if wanted.is_finite() { wanted } else { 1.0 };
            let found = least_corner(&body, element);
            assert!((found - wanted).abs() < 1e-4, "{element}: {found} {wanted}");
        }
    }
}

/// Pressed together along z the smallest corner is what is left of the length; past zero it is folded.
#[test]
fn tissue_that_is_pressed_through_itself_is_folded() {
    let labels = test_bodies::block([9, 9, 9]);
    let lattice = Scene::from_labels("test", &labels).expect("valid").lattice;
    for part in [0.0, 0.4, 0.99, 1.2] {
        let z = (0..lattice.element_count() as u32).map(|e| -part * lattice.cell(e)[2] as f32);
        let zeros = || vec![0.0; lattice.element_count()];
        let u = [zeros(), zeros(), z.collect()];
        let least = least_corner(&body(&lattice, &u), lattice.element_of_cell(4, 4, 4).expect("there"));
        assert!((least - f64::from(1.0 - part)).abs() < 1e-5, "{least}");
    }
}

//! Claims about the element ahead: it is the one that the tip comes into.

use super::*;
use crate::scene::{Scene, test_bodies};
use crate::tissue::Carried;

/// A body moved as a whole by so many elements, sheared along z.
struct Body {
    scene: Scene,
    u: [Vec<f32>; 3],
}

impl Body {
    fn new(moved: [f32; 3], shear: f32) -> Body {
        let scene = Scene::from_labels("test", &test_bodies::with_hole()).expect("valid");
        let lattice = &scene.lattice;
        let along = |element: u32, axis: usize| {
            moved[axis]
                + if axis == 0 {
                    shear * lattice.cell(element)[2] as f32
                } else {
                    0.0
                }
        };
        let u = [0, 1, 2].map(|axis| (0..lattice.element_count() as u32).map(|e| along(e, axis)).collect());
        Body { scene, u }
    }

    fn deformed(&self) -> Deformed<'_> {
        Deformed {
            lattice: &self.scene.lattice,
            u: self.u.each_ref().map(Vec::as_slice),
            scale: 1.0,
            carried: Carried::Not,
            reach: 20.0,
        }
    }
}

/// Searches by brute force: a thousandth of an element at a time, with nothing known of where the tip was.
fn creeping(body: &Deformed, held: Option<u32>, tip_m: [f64; 3], direction: [f64; 3]) -> Option<u32> {
    let h = body.lattice.spacing_m;
    let place = |n: u32| [0, 1, 2].map(|a| tip_m[a] + f64::from(n) * 1e-3 * h * direction[a]);
    let at = |n| MaterialPoint::locate(body, place(n), None).map(|point| point.element);
    match held {
        None => (0..6000).find_map(at),
        Some(held) => (0..3000).map_while(at).find(|&element| element != held),
    }
}

#[test]
fn element_ahead_is_what_the_tip_comes_into() {
    for (moved, shear) in [([0.0; 3], 0.0), ([1.3, -0.4, 2.2], 0.0), ([0.2, 0.1, 3.0], 0.2)] {
        let body = Body::new(moved, shear);
        let deformed = body.deformed();
        let h = deformed.lattice.spacing_m;
        let mut seen = 0;
        for element in (0..deformed.lattice.element_count() as u32).step_by(17) {
            let tip_m = deformed.position_m(element);
            for direction in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.1, -0.2, 0.97]] {
                // Slow, at the clinical mean, and fast: for these an element lies within a step.
                for step in [0.01, 0.18, 0.45] {
                    let step_m = direction.map(|d: f64| d * step * h);
                    let ahead = element_ahead(&deformed, Some(element), tip_m, step_m);
                    assert_eq!(
                        ahead,
                        creeping(&deformed, Some(element), tip_m, direction),
                        "{element} {direction:?} {step}"
                    );
                    seen += usize::from(ahead.is_some());
                }
            }
        }
        assert!(seen > 100);
    }
}

/// A tick takes the fast tip past an element: the next held one is where it then is.
#[test]
fn fast_tip_passes_over_an_element() {
    let body = Body::new([0.0; 3], 0.0);
    let deformed = body.deformed();
    let lattice = deformed.lattice;
    let [i, j, k] = lattice.cell(0);
    let step_m = [0.0, 0.0, 2.0 * lattice.spacing_m];
    let ahead = element_ahead(&deformed, Some(0), lattice.rest_m(0), step_m);
    assert_eq!(ahead, lattice.element_of_cell(i, j, k + 2));
}

#[test]
fn first_contact_is_seen_from_outside() {
    let body = Body::new([0.0; 3], 0.0);
    let deformed = body.deformed();
    let lattice = deformed.lattice;
    let h = lattice.spacing_m;
    let (low, _) = lattice.bounds_m();
    for aside in [0.5, 1.2, 2.9] {
        let from = [low[0] + aside * h, low[1] + 1.5 * h, low[2] - 3.0 * h];
        let ahead = element_ahead(&deformed, None, from, [0.0, 0.0, 0.18 * h]);
        assert_eq!(ahead, creeping(&deformed, None, from, [0.0, 0.0, 1.0]));
        assert!(ahead.is_some());
        assert_eq!(
            element_ahead(&deformed, None, from, [0.0, 0.0, -0.18 * h]),
            None,
            "going away"
        );
    }
    let far = [low[0] + h, low[1] + h, low[2] - 50.0 * h];
    assert_eq!(element_ahead(&deformed, None, far, [0.0, 0.0, 0.18 * h]), None);
}

#[test]
fn no_way_leads_nowhere() {
    let body = Body::new([0.0; 3], 0.0);
    let deformed = body.deformed();
    let tip_m = deformed.position_m(100);
    for step_m in [[0.0; 3], [f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [1e300; 3]] {
        for held in [None, Some(100), Some(u32::MAX)] {
            assert!(element_ahead(&deformed, held, tip_m, step_m).is_none_or(|e| held.is_none() && e == 100));
        }
    }
    assert_eq!(
        element_ahead(&deformed, Some(100), [f64::NAN; 3], [0.0, 0.0, 1e-4]),
        None
    );
}

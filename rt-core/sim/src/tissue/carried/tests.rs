use super::*;
use crate::scene::{Labels, Structure};
use crate::tissue::{Deformed, ElementField};

/// Returns a block of 16 x 16 x 16 cells; the two lowest layers are fixed.
fn held_scene() -> (Scene, Arc<Lattice>) {
    let mut bone = Structure::soft("bone", 2);
    bone.material.fixed = true;
    let labels = Labels {
        dims: [16; 3],
        spacing_m: 1e-3,
        cells: (0..16 * 16 * 16).map(|n| if n < 2 * 16 * 16 { 2 } else { 1 }).collect(),
        structures: vec![Structure::soft("tissue", 1), bone],
    };
    let scene = Scene::from_labels("held", &labels).expect("two structures");
    let coarse = Arc::new(scene.lattice.coarser());
    (scene, coarse)
}

fn affine(place_m: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = place_m;
    [
        1e-3 + 0.02 * x - 0.01 * z,
        -5e-4 + 0.03 * y,
        2e-3 + 0.05 * z - 0.02 * x + 0.01 * y,
    ]
}

fn packed(coarse: &Lattice, at: impl Fn([f64; 3]) -> [f64; 3]) -> PackedField {
    let mut field = ElementField::zeros(coarse.element_count());
    for element in 0..coarse.element_count() as u32 {
        let u = at(coarse.rest_m(element));
        for (axis, u) in field.0.iter_mut().zip(u) {
            axis[element as usize] = u as f32;
        }
    }
    let mut packed = PackedField::zeros(coarse.element_count());
    packed.pack(&field);
    packed
}

fn off(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max)
}

/// Between centres of the coarser body's elements an affine field is found again, and at the surface half a coarse
/// element farther out nothing else than what is nearest.
#[test]
fn an_affine_field_is_interpolated_exactly() {
    let (scene, coarse) = held_scene();
    let half = packed(&coarse, |place_m| affine(place_m).map(|c| 0.5 * c));
    let elements = coarse.element_count() as u32;
    let mut field = CarriedField::new(&scene, coarse);
    assert!(field.is_at_rest());
    field.set(Carry {
        columns: &[half.clone(), half],
        loads_n: &[3.0, -1.0],
        ..Carry::NOT
    });
    let mut seen = [0; 3];
    for element in 0..scene.lattice.element_count() as u32 {
        let place_m = scene.lattice.rest_m(element);
        let found = field.at_m(&scene.lattice, element);
        let cell = scene.lattice.cell(element);
        let (bound_m, kind) = if cell[2] < 2 {
            assert_eq!(found, [0.0; 3], "{cell:?} is fixed");
            continue;
        } else if cell.iter().all(|c| (1..15).contains(c)) {
            (3e-7, 0)
        } else {
            // Half a cell beyond the last centre, on up to three sides, in a field of at most 8 % of strain.
            (0.5e-3 * 0.08 + 3e-7, 1)
        };
        seen[kind] += 1;
        let off_m = off(found, affine(place_m));
        assert!(off_m <= bound_m, "{cell:?}: {off_m}");
        let size_m = found.iter().map(|c| c * c).sum::<f64>().sqrt();
        assert!(size_m <= Carried::Field(&field).largest_m(scene.lattice.spacing_m) * (1.0 + 1e-6));
    }
    assert!(seen[0] > 2000 && seen[1] > 1000, "{seen:?}");
    let by_m = [1e-3, 0.0, -2e-3];
    let part = 0..elements / 2;
    let shift = Shift {
        by_m,
        elements: std::slice::from_ref(&part),
    };
    field.set(Carry { shift, ..Carry::NOT });
    let moved = |element: u32| field.at_m(&scene.lattice, element);
    assert!(off(moved(1500), by_m) < 1e-9, "{:?}", moved(1500));
    let last = scene.lattice.element_count() as u32 - 1;
    assert_eq!(moved(last), [0.0; 3], "another part");
    field.set(Carry::NOT);
    assert!(field.is_at_rest() && field.at_m(&scene.lattice, 3000) == [0.0; 3]);
}

#[test]
fn a_saved_field_is_restored_in_every_bit() {
    let (scene, coarse) = held_scene();
    let mut field = CarriedField::new(&scene, coarse.clone());
    field.set(Carry {
        columns: &[packed(&coarse, affine)],
        loads_n: &[0.7],
        ..Carry::NOT
    });
    let mut memory = vec![0; field.memory_len()];
    field.save(&mut memory);
    let mut other = CarriedField::new(&scene, coarse);
    other.load(&memory[1..]);
    assert!(other.is_at_rest());
    other.load(&memory);
    for element in 0..scene.lattice.element_count() as u32 {
        let [a, b] = [&field, &other].map(|field| field.at_m(&scene.lattice, element));
        assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
    }
    assert!(!other.is_at_rest());
}

/// The surface of a body that is carried, and displaced by itself besides: each vertex goes with its element, and bone
/// stays.
#[test]
fn a_carried_surface_goes_with_what_carries_it() {
    let (scene, coarse) = held_scene();
    let columns = [packed(&coarse, affine)];
    let mut field = CarriedField::new(&scene, coarse);
    field.set(Carry {
        columns: &columns,
        loads_n: &[1.0],
        ..Carry::NOT
    });
    let own: Vec<f32> = (0..scene.lattice.element_count())
        .map(|e| (e % 7) as f32 * 0.1)
        .collect();
    let body = Deformed {
        lattice: &scene.lattice,
        u: [&own, &own, &own],
        scale: 1.0,
        carried: Carried::Field(&field),
        reach: 1.0,
    };
    let mut places = vec![[0.0; 3]; scene.surface.vertex_elements.len()];
    body.write_surface(&scene.surface, &mut places);
    let mut inside = 0;
    for ((place, rest_m), &element) in places
        .iter()
        .zip(&scene.surface.rest_m)
        .zip(&scene.surface.vertex_elements)
    {
        let cell = scene.lattice.cell(element);
        let own_m = scene.lattice.spacing_m * f64::from(own[element as usize]);
        let moved = [0, 1, 2].map(|a| f64::from(place[a]) - f64::from(rest_m[a]) - own_m);
        if cell[2] < 2 {
            assert!(off(moved, [0.0; 3]) < 1e-8, "bone is moved: {moved:?}");
        } else {
            // At the rim half a coarse element beyond the last centre, in 8 % of strain.
            assert!(off(moved, affine(scene.lattice.rest_m(element))) < 0.09e-3, "{cell:?}");
            inside += 1;
        }
    }
    assert!(inside > 1000, "{inside}");
}

/// The surface of a scene whose body has elements of twice the edge goes with the element around each vertex.
#[test]
fn a_surface_goes_with_the_coarser_element_around_it() {
    let fine = held_scene().0;
    let mut scene = fine.clone();
    scene = scene.with_body(fine.lattice.element_count() / 2);
    assert_eq!(scene.coarseness(), 2);
    let u: Vec<f32> = (0..scene.body.element_count()).map(|e| e as f32 * 1e-3).collect();
    let body = Deformed {
        lattice: &scene.body,
        u: [&u, &u, &u],
        scale: 1.0,
        carried: Carried::Not,
        reach: 1.0,
    };
    let mut places = vec![[0.0; 3]; scene.surface.vertex_elements.len()];
    body.write_surface(&scene.surface, &mut places);
    for ((place, rest_m), &element) in places
        .iter()
        .zip(&scene.surface.rest_m)
        .zip(&scene.surface.vertex_elements)
    {
        let [i, j, k] = scene.lattice.cell(element).map(|c| c / 2);
        let around = scene.body.element_of_cell(i, j, k).expect("in the body");
        let expected_m = scene.body.spacing_m * f64::from(u[around as usize]);
        let moved_m = [0, 1, 2].map(|a| f64::from(place[a]) - f64::from(rest_m[a]));
        assert!(off(moved_m, [expected_m; 3]) < 1e-8, "{moved_m:?} for {expected_m}");
    }
}

use super::*;
use crate::scene::{Labels, Structure};
use crate::tissue::ElementField;

/// A block of 16 x 16 x 16 cells; the two lowest layers are fixed.
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

/// Between centres of the coarser body's elements an affine field is found again, and at the surface half a coarse element
/// farther out nothing else than what is nearest.
#[test]
fn an_affine_field_is_interpolated_exactly_and_what_is_fixed_stays() {
    let (scene, coarse) = held_scene();
    let half = packed(&coarse, |place_m| affine(place_m).map(|c| 0.5 * c));
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
    field.set(Carry {
        whole_m: [1e-3, 0.0, -2e-3],
        ..Carry::NOT
    });
    assert!(off(field.at_m(&scene.lattice, 3000), [1e-3, 0.0, -2e-3]) < 1e-9);
    field.set(Carry::NOT);
    assert!(field.is_at_rest() && field.at_m(&scene.lattice, 3000) == [0.0; 3]);
}

#[test]
fn a_saved_field_is_the_same_in_every_bit_and_another_length_changes_nothing() {
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

//! Map from the elements of the solution to the displaced elements, which may be coarser.

use crate::scene::Lattice;
use crate::tissue::ElementField;

/// Map from each small element to the one that it lies in.
pub(super) struct ElementMap {
    elements: usize,
    /// Large element of each small one; empty where both are the same.
    of: Vec<u32>,
    /// One over how many lie in each.
    shares: Vec<f32>,
}

impl ElementMap {
    /// Maps the elements of `from` to those of `to`, whose edge is some times as long.
    pub fn new(from: &Lattice, to: &Lattice) -> Self {
        let elements = to.element_count();
        let times = (to.spacing_m / from.spacing_m).round() as usize;
        if times <= 1 {
            return ElementMap {
                elements,
                of: Vec::new(),
                shares: Vec::new(),
            };
        }
        let mut counts = vec![0_u32; elements];
        let within = |element: usize| {
            let [i, j, k] = from.cell(element as u32).map(|c| c / times);
            to.element_of_cell(i, j, k).unwrap_or(u32::MAX)
        };
        let of: Vec<u32> = (0..from.element_count()).map(within).collect();
        for &at in &of {
            if let Some(count) = counts.get_mut(at as usize) {
                *count += 1;
            }
        }
        ElementMap {
            elements,
            of,
            shares: counts.into_iter().map(|count| 1.0 / count.max(1) as f32).collect(),
        }
    }

    /// Returns the number of displaced elements.
    pub fn elements(&self) -> usize {
        self.elements
    }

    /// Averages the small elements in each large one: returns `field`, or the mean in `room`.
    pub fn mean<'a>(&self, field: &'a ElementField, room: &'a mut ElementField) -> &'a ElementField {
        if self.of.is_empty() {
            return field;
        }
        for (to, from) in room.0.iter_mut().zip(&field.0) {
            to.fill(0.0);
            for (&at, &moved) in self.of.iter().zip(from) {
                if let Some(sum) = to.get_mut(at as usize) {
                    *sum += moved;
                }
            }
            for (sum, share) in to.iter_mut().zip(&self.shares) {
                *sum *= share;
            }
        }
        room
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::TissueKind;

    /// A body that turns and stretches: the middle of an element moves as its cells do on average.
    #[test]
    fn an_element_moves_as_what_is_in_it() {
        let scene = Scene::builtin("pelvis").expect("built in");
        let coarse = scene.clone().for_lines(TissueKind::ChainMail).expect("has lines").body;
        let onto = ElementMap::new(&scene.lattice, &coarse);
        let moved = |at: [f64; 3]| [0.1 * at[1] - 0.02 * at[0], 0.05 * at[2], 0.3 * at[0]].map(|u| u as f32);
        let mut field = ElementField::zeros(scene.lattice.element_count());
        let mut middles = vec![([0.0; 3], 0); coarse.element_count()];
        for element in 0..scene.lattice.element_count() {
            let at = scene.lattice.rest_m(element as u32);
            for (axis, u) in moved(at).into_iter().enumerate() {
                field.0[axis][element] = u;
            }
            let of = coarse.element_at_rest(at).expect("every cell is in one") as usize;
            middles[of].0 = [0, 1, 2].map(|a| middles[of].0[a] + at[a]);
            middles[of].1 += 1;
        }
        let mut room = ElementField::zeros(onto.elements());
        let mean = onto.mean(&field, &mut room);
        for (element, (sum, count)) in middles.into_iter().enumerate() {
            assert!(count > 0, "element {element} is empty");
            let wanted = moved(sum.map(|c| c / f64::from(count)));
            for (axis, wanted) in mean.0.iter().zip(wanted) {
                assert!((axis[element] - wanted).abs() < 1e-7, "element {element}");
            }
        }
        let same = ElementMap::new(&coarse, &coarse);
        assert!(std::ptr::eq(same.mean(&field, &mut room), &field));
    }
}

//! Needle insertions, as the tissue meets them: which element is held where, tick by tick.
//!
//! The script knows nothing of the model, so every model gets the same.

use crate::bodies::PATCH_M;
use stylet_sim::scene::{Lattice, Scene};
use stylet_sim::tissue::Held;

/// 200 Hz.
pub const TICK_S: f64 = 5e-3;

/// One insertion: push, rest, pull half the way back, rest; or push and pass on through the tissue.
#[derive(Clone, Copy, Debug)]
pub struct Insertion {
    pub name: &'static str,
    /// Place where the tip takes hold, from the middle of the body.
    pub start_mm: [f64; 3],
    pub direction: [f64; 3],
    pub travel_m: f64,
    pub speed_m_per_s: f64,
    /// Set where the tip passes from element to element after the push, each carried less far.
    pub passes_on: bool,
}

/// Straight in, slowly, and half the way back.
const SLOWLY: Insertion = Insertion {
    name: "",
    start_mm: [0.0; 3],
    direction: [0.0, 0.0, 1.0],
    travel_m: 5e-3,
    speed_m_per_s: 0.05,
    passes_on: false,
};

/// Insertion by which spacings are compared.
pub const MIDDLE: Insertion = Insertion {
    name: "middle, 5 mm",
    start_mm: [0.0, 0.0, -6.0],
    ..SLOWLY
};

/// Insertions that are measured in the gland.
pub const GLAND: [Insertion; 4] = [
    Insertion {
        name: "base, 7 mm",
        start_mm: [-5.0, -3.0, 6.0],
        travel_m: 7e-3,
        ..SLOWLY
    },
    Insertion {
        name: "oblique, 4 mm",
        start_mm: [4.0, 5.0, -8.0],
        direction: [-0.342_020_143_325_668_7, 0.0, 0.939_692_620_785_908_4],
        travel_m: 4e-3,
        ..SLOWLY
    },
    Insertion {
        name: "fast, 5 mm",
        start_mm: [0.0, -5.0, 0.0],
        speed_m_per_s: 0.28,
        ..SLOWLY
    },
    Insertion {
        name: "passing on",
        start_mm: [-3.0, 3.0, -8.0],
        travel_m: 4e-3,
        passes_on: true,
        ..SLOWLY
    },
];

/// Ticks of rest after the push and after the way back.
const REST_TICKS: usize = 12;
/// Share by which elements are carried less once the tip passes on.
const CARRIED: f64 = 0.8;
/// Elements of the path that the tip passes.
const PASSED_M: f64 = 12e-3;

impl Insertion {
    /// Returns the held element of each tick, in `scene`.
    pub fn script(&self, scene: &Scene) -> Vec<Held> {
        let lattice = &scene.lattice;
        let first = self.element_along(lattice, 0.0);
        let step_m = self.speed_m_per_s * TICK_S;
        let push = (self.travel_m / step_m).ceil() as usize;
        let held = |element: u32, way_m: f64| Held {
            element,
            position_m: [0, 1, 2].map(|a| lattice.rest_m(element)[a] + way_m * self.direction[a]),
            patch_m: PATCH_M,
        };
        let mut script: Vec<Held> = (1..=push)
            .map(|n| held(first, (n as f64 * step_m).min(self.travel_m)))
            .collect();
        script.extend((0..REST_TICKS).map(|_| held(first, self.travel_m)));
        if self.passes_on {
            let ticks = (PASSED_M / step_m) as usize;
            script.extend((1..=ticks).map(|n| {
                let along_m = n as f64 * step_m;
                let passed = (along_m / lattice.spacing_m).floor();
                let carried = self.travel_m * CARRIED.powf(passed * lattice.spacing_m / 2.5e-3);
                held(self.element_along(lattice, along_m), carried)
            }));
        } else {
            script.extend((1..=push / 2).map(|n| held(first, self.travel_m - n as f64 * step_m)));
            script.extend((0..REST_TICKS).map(|_| held(first, self.travel_m - (push / 2) as f64 * step_m)));
        }
        script
    }

    /// Returns five places around the path, where seeds would lie.
    pub fn seeds(&self, scene: &Scene) -> Vec<u32> {
        let aside = [[3.0, 0.0], [0.0, 5.0], [-8.0, 0.0], [0.0, -3.0], [5.0, 5.0]];
        let beside = aside.iter().enumerate().filter_map(|(n, [x, y])| {
            let along = 4.0 * n as f64 - 4.0;
            let place = [self.start_mm[0] + x, self.start_mm[1] + y, self.start_mm[2] + along];
            element_at(&scene.lattice, place)
        });
        beside.collect()
    }

    /// Returns the element on the straight path so far from its start; the last one inside the body beyond its end.
    fn element_along(&self, lattice: &Lattice, along_m: f64) -> u32 {
        let place = |along_m: f64| [0, 1, 2].map(|a| self.start_mm[a] + along_m * 1e3 * self.direction[a]);
        let mut along_m = along_m;
        loop {
            if let Some(element) = element_at(lattice, place(along_m)) {
                return element;
            }
            assert!(along_m > 0.0, "{} starts outside the body", self.name);
            along_m -= 0.5 * lattice.spacing_m;
        }
    }
}

/// Returns the element at a place given in mm from the middle of the body.
fn element_at(lattice: &Lattice, from_middle_mm: [f64; 3]) -> Option<u32> {
    let (low, high) = lattice.bounds_m();
    let cell = [0, 1, 2].map(|a| (0.5 * (low[a] + high[a]) + 1e-3 * from_middle_mm[a]) / lattice.spacing_m);
    let [i, j, k] = cell.map(|c| c.max(0.0) as usize);
    lattice.element_of_cell(i, j, k)
}

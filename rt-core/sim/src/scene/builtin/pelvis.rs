//! Anatomy around the gland in a man on his back: the paper's future work, drawn by formula.
//!
//! Metres from the middle of the gland: x to the patient's left or right (the scene is the same both ways), y from
//! posterior to anterior, z from the perineum, where needles come in, to the bladder. Sizes without a source are
//! assumed.

use super::paper::PAPER_GLAND;
use super::shape::{Bounds, Rod, Rounded, Tube};
use super::{DIMS, SPACING_M, draw};
use crate::limits::AxisLimits;
use crate::scene::{Labels, Material, Role, SceneProblem, Structure, Surroundings};
use stylet_anatomy::Beyond;

const GLAND: u8 = 1;
const CAPSULE: u8 = 2;
const URETHRA: u8 = 3;
const RECTAL_WALL: u8 = 4;
const BLADDER_WALL: u8 = 5;
const BLADDER_CONTENT: u8 = 6;
const PUBIC_ARCH: u8 = 7;
const PERINEUM: u8 = 8;
const FAT: u8 = 9;

/// The face towards -z, among those of [`Surroundings`].
const TOWARDS_SKIN: usize = 4;

/// Sizes and places; the gland itself is the paper's.
#[derive(Clone, Debug)]
pub(super) struct Pelvis {
    /// Skin: nothing is drawn outside.
    pub envelope: Rounded,
    /// Skin and muscle of the perineum are so deep.
    pub perineum_m: f64,
    pub urethra: Urethra,
    pub bladder: Rounded,
    pub bladder_wall_m: f64,
    pub rectum: Tube,
    pub rectal_wall_m: f64,
    /// Symphysis and the two rami.
    pub pubic_arch: [Rod; 3],
}

/// A tube about the parabola `y = lowest_m + curvature_per_m z^2`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Urethra {
    pub radius_m: f64,
    pub lowest_m: f64,
    pub curvature_per_m: f64,
    /// Stretch from the pelvic floor to the bladder.
    pub along_m: [f64; 2],
}

impl Urethra {
    fn middle_y_m(&self, z: f64) -> f64 {
        self.lowest_m + self.curvature_per_m * z * z
    }

    fn contains(&self, [x, y, z]: [f64; 3]) -> bool {
        let [low, high] = self.along_m;
        (low..=high).contains(&z) && x.hypot(y - self.middle_y_m(z)) <= self.radius_m
    }

    fn bounds_m(&self) -> Bounds {
        let [low, high] = self.along_m;
        let highest = self.middle_y_m(low).max(self.middle_y_m(high));
        let r = self.radius_m;
        [[-r, self.lowest_m - r, low], [r, highest + r, high]]
    }
}

impl Default for Pelvis {
    fn default() -> Self {
        // 110 deg between the rami as seen along the needle, 70 deg in their own plane: a wide arch, which lets
        // needles pass below it (on MRI Zheng 2018 shows 52 deg in the plane of the rami).
        let below_symphysis_m = [0.0, 31e-3, -8e-3];
        let ramus = |side: f64| Rod {
            ends_m: [below_symphysis_m, [side * 36e-3, 5.8e-3, -52.7e-3]],
            radius_m: 6e-3,
        };
        Pelvis {
            envelope: Rounded {
                centre_m: [0.0, 0.0, 9e-3],
                half_m: [50e-3, 41e-3, 75e-3],
                exponent: 5,
            },
            perineum_m: 12e-3,
            urethra: Urethra {
                // 7 mm across.
                radius_m: 3.5e-3,
                lowest_m: 2e-3,
                // The two halves meet at about 35 deg at the middle of the gland.
                curvature_per_m: 7.2,
                along_m: [-44e-3, 26.4e-3],
            },
            // 84 cc with its wall, 50 cc of them urine: partly filled, as for an implant.
            bladder: Rounded {
                centre_m: [0.0, 8e-3, 49e-3],
                half_m: [32e-3, 24e-3, 26e-3],
                exponent: 2,
            },
            // Men: 3.3 mm (Hakenberg 2000).
            bladder_wall_m: 3.5e-3,
            // Nearly empty; behind the gland by the thickness of the fascia.
            rectum: Tube {
                centre_m: [0.0, -27.6e-3],
                half_m: [15e-3, 9.5e-3],
                along_m: [-42e-3, 84e-3],
                round_end_m: 12e-3,
            },
            rectal_wall_m: 3.5e-3,
            pubic_arch: [
                Rod {
                    ends_m: [below_symphysis_m, [0.0, 33e-3, 22e-3]],
                    radius_m: 7e-3,
                },
                ramus(-1.0),
                ramus(1.0),
            ],
        }
    }
}

impl Pelvis {
    /// Draws it, or says which structures do not fit into the volume.
    pub fn labels(&self) -> Result<Labels, Vec<SceneProblem>> {
        let problems = self.outside();
        if !problems.is_empty() {
            return Err(problems);
        }
        let content = self.bladder.inside(self.bladder_wall_m);
        let lumen = self.rectum.inside(self.rectal_wall_m);
        let perineum_below_m = self.envelope.bounds_m()[0][2] + self.perineum_m;
        Ok(draw(structures(), |cell| {
            let place_m = cell.map(|c| c * SPACING_M);
            if !self.envelope.contains(place_m) || lumen.contains(place_m) {
                0
            } else if content.contains(place_m) {
                BLADDER_CONTENT
            } else if self.urethra.contains(place_m) {
                URETHRA
            } else if PAPER_GLAND.contains(cell) {
                if at_rim(cell) { CAPSULE } else { GLAND }
            } else if self.bladder.contains(place_m) {
                BLADDER_WALL
            } else if self.pubic_arch.iter().any(|bone| bone.contains(place_m)) {
                PUBIC_ARCH
            } else if self.rectum.contains(place_m) {
                RECTAL_WALL
            } else if place_m[2] < perineum_below_m {
                PERINEUM
            } else {
                FAT
            }
        }))
    }

    fn outside(&self) -> Vec<SceneProblem> {
        let arch = self.pubic_arch.iter().map(|bone| ("pubic arch", bone.bounds_m()));
        let others = [
            ("fat", self.envelope.bounds_m()),
            ("urethra", self.urethra.bounds_m()),
            ("bladder wall", self.bladder.bounds_m()),
            ("rectal wall", self.rectum.bounds_m()),
        ];
        let mut problems = Vec::new();
        for (structure, [low_m, high_m]) in others.into_iter().chain(arch) {
            for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate() {
                let half_m = 0.5 * DIMS[axis] as f64 * SPACING_M;
                // Written so that a bound that is not a number is outside.
                if !(low_m[axis] >= -half_m && high_m[axis] <= half_m) {
                    problems.push(SceneProblem::Outside {
                        structure: structure.to_owned(),
                        axis: name,
                        reach_m: [low_m[axis], high_m[axis]],
                        volume_m: [-half_m, half_m],
                    });
                }
            }
        }
        problems
    }
}

/// Returns whether one of the 18 cells that share a face or an edge with a cell of the gland is outside it: the capsule
/// is as thin as elements allow that are still linked to each other all the way round.
fn at_rim(cell: [f64; 3]) -> bool {
    (0..27).any(|n| {
        let step = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
        let is_corner = !step.contains(&0);
        let beside = [0, 1, 2].map(|a| cell[a] + f64::from(step[a]));
        !is_corner && !PAPER_GLAND.contains(beside)
    })
}

/// Returns the structures. Softer ones have wider limits; the gland takes those that the operator sets.
fn structures() -> Vec<Structure> {
    let limits = |min_stretch, max_stretch, shear_deg| {
        let axis = AxisLimits {
            min_stretch,
            max_stretch,
            shear_deg,
        };
        Some([axis; 3])
    };
    let row = |name: &str, label, role, limits, young_pa, poisson| Structure {
        name: name.to_owned(),
        label,
        role,
        material: Material {
            limits,
            fixed: false,
            young_pa,
            poisson,
            surroundings: Surroundings::FAT,
        },
    };
    let mut arch = row("pubic arch", PUBIC_ARCH, Role::Tissue, None, 300e6, 0.3);
    arch.material.fixed = true;
    // Needles come in through skin; beyond the other faces of the volume the body continues.
    let mut perineum = row("perineum", PERINEUM, Role::Tissue, limits(0.6, 1.65, 25.0), 15e3, 0.49);
    perineum.material.surroundings.0[TOWARDS_SKIN] = Beyond::Free;
    // Nothing is in the rectum.
    let mut rectal_wall = row(
        "rectal wall",
        RECTAL_WALL,
        Role::Spare,
        limits(0.65, 1.55, 23.0),
        20e3,
        0.49,
    );
    rectal_wall.material.surroundings = Surroundings::all(Beyond::Free);
    vec![
        // 17 kPa: Ahn 2010.
        row("gland", GLAND, Role::Target, None, 17e3, 0.49),
        // Assumed: fibrous, some three times as stiff as the gland.
        row("capsule", CAPSULE, Role::Target, limits(0.75, 1.35, 18.0), 50e3, 0.49),
        // Assumed: muscle.
        row("urethra", URETHRA, Role::Spare, limits(0.7, 1.45, 20.0), 30e3, 0.49),
        // Assumed: muscle, relaxed.
        rectal_wall,
        // Assumed: muscle, relaxed.
        row(
            "bladder wall",
            BLADDER_WALL,
            Role::Spare,
            limits(0.65, 1.55, 23.0),
            20e3,
            0.49,
        ),
        // Assumed: urine as a solid that is soft and hardly changes its volume.
        row(
            "bladder content",
            BLADDER_CONTENT,
            Role::Tissue,
            limits(0.5, 1.9, 26.565),
            1e3,
            0.499,
        ),
        // Apparent modulus of cancellous bone: 0.1 to 0.5 GPa, Goldstein 1987. Fixed, as the table holds the pelvis.
        arch,
        // Assumed: skin and muscle together.
        perineum,
        // 3.25 kPa: Samani 2007 (breast fat).
        row("fat", FAT, Role::Tissue, limits(0.5, 1.9, 26.565), 3.25e3, 0.49),
    ]
}

#[cfg(test)]
mod tests;

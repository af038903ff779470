//! Irregular glands with urethra, rectum and, in some, a pubic arch in the way: twelve fixed ones,
//! and any number of random ones.

use crate::plan::anatomy::{Body, ball};
use crate::plan::{Anatomy, PITCH_M, Template};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use stylet_anatomy::PatientFrame;

const MIDDLE_M: [f64; 3] = [0.05, 0.05, 0.08];

/// Gland; x to the patient's left, y anterior, z into the body.
#[derive(Clone, Copy)]
pub struct Gland {
    pub number: usize,
    pub cc: f64,
    /// True for a gland that was not used while the search was tuned.
    pub is_kept_aside: bool,
    /// Height of the symphysis above the gland, mm; the rami go down from there.
    pub arch_mm: Option<f64>,
    /// Relative width, height and length.
    shape: [f64; 3],
    /// Amplitude of its surface's bumps, as a share of the radius.
    bumps: [f64; 3],
    /// Curvature of the urethra, 1/m.
    bend_per_m: f64,
}

const fn gland(
    number: usize,
    cc: f64,
    is_kept_aside: bool,
    arch_mm: Option<f64>,
    shape: [f64; 3],
    bumps: [f64; 3],
    bend_per_m: f64,
) -> Gland {
    Gland {
        number,
        cc,
        is_kept_aside,
        arch_mm,
        shape,
        bumps,
        bend_per_m,
    }
}

pub const GLANDS: [Gland; 12] = [
    gland(1, 25.0, false, None, [1.25, 0.9, 1.0], [0.05, 0.03, 0.02], 0.0),
    gland(2, 28.0, true, None, [1.2, 0.95, 1.05], [0.03, 0.06, 0.03], 4.0),
    gland(3, 31.0, false, Some(7.0), [1.3, 0.9, 1.0], [0.04, 0.04, 0.04], 2.0),
    gland(4, 34.0, false, None, [1.15, 1.0, 1.0], [0.06, 0.02, 0.05], 5.0),
    gland(5, 37.0, true, None, [1.3, 0.85, 1.1], [0.05, 0.05, 0.02], 3.0),
    gland(6, 40.0, false, Some(6.0), [1.25, 0.95, 0.95], [0.03, 0.05, 0.05], 0.0),
    gland(7, 43.0, false, None, [1.2, 0.9, 1.15], [0.07, 0.03, 0.03], 6.0),
    gland(8, 46.0, false, None, [1.3, 1.0, 0.9], [0.04, 0.06, 0.04], 3.0),
    gland(9, 49.0, true, Some(7.0), [1.25, 0.9, 1.05], [0.05, 0.04, 0.05], 2.0),
    gland(10, 52.0, false, None, [1.2, 0.95, 1.1], [0.06, 0.05, 0.02], 4.0),
    gland(11, 56.0, false, Some(5.0), [1.3, 0.95, 1.0], [0.03, 0.03, 0.06], 0.0),
    gland(12, 60.0, true, None, [1.25, 1.0, 1.05], [0.05, 0.05, 0.04], 5.0),
];

pub const TEMPLATE: Template = Template {
    middle_m: [MIDDLE_M[0], MIDDLE_M[1], -0.01],
    columns: [-1.0, 0.0, 0.0],
    rows: [0.0, 1.0, 0.0],
    inwards: [0.0, 0.0, 1.0],
    pitch_m: PITCH_M,
};

/// Returns a ball of radius 1, each of its points moved.
fn deformed(name: &str, to_m: impl Fn([f64; 3]) -> [f64; 3]) -> Body {
    let unit = ball("unit", [0.0; 3], [1.0; 3]);
    let (points, triangles) = unit.surface();
    let points_m: Vec<[f64; 3]> = points.iter().map(|p| to_m(p.map(f64::from))).collect();
    let corners: Vec<[usize; 3]> = triangles.iter().map(|t| t.map(|i| i as usize)).collect();
    Body::new(name, &points_m, &corners).expect("as closed as a ball")
}

/// Returns a rod with flat ends from one place to another, about `[across, along]` m thick.
fn rod(name: &str, from_m: [f64; 3], to_m: [f64; 3], half_m: [f64; 2], bend_per_m: f64) -> Body {
    let axis = nalgebra::Vector3::from([0, 1, 2].map(|a| (to_m[a] - from_m[a]) / 2.0));
    let u = axis.cross(&nalgebra::Vector3::new(0.1, 1.0, 0.2)).normalize();
    let v = axis.normalize().cross(&u);
    let centre = nalgebra::Vector3::from([0, 1, 2].map(|a| (from_m[a] + to_m[a]) / 2.0));
    deformed(name, |p| {
        let across = p[0].hypot(p[1]);
        let out = (across / 0.35).min(1.0) / across.max(1e-9);
        let at = centre + axis * p[2] + u * (p[0] * out * half_m[0]) + v * (p[1] * out * half_m[1]);
        let z = at.z - centre.z;
        [at.x, at.y + bend_per_m * z * z, at.z]
    })
}

/// Ranges of volumes and other parameters of random glands, cc: those of the twelve.
const VOLUMES_CC: [f64; 2] = [25.0, 60.0];
const SHAPES: [[f64; 2]; 3] = [[1.15, 1.3], [0.85, 1.0], [0.9, 1.15]];
const BUMPS: [f64; 2] = [0.02, 0.07];
const BENDS_PER_M: [f64; 2] = [0.0, 6.0];
const ARCHES_MM: [f64; 2] = [5.0, 7.0];

/// Draws four glands, one from each quarter of the volumes, from a random seed alone; one of three
/// has a pubic arch in the way. Their numbers continue those of the twelve.
pub fn drawn(random_seed: u64) -> [Gland; 4] {
    let mut random = ChaCha8Rng::seed_from_u64(random_seed);
    let mut within = |[low, high]: [f64; 2]| {
        let unit = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    };
    std::array::from_fn(|n| {
        let [least, most] = VOLUMES_CC;
        let cc = (least + (most - least) / 4.0 * (n as f64 + within([0.0, 1.0]))).round();
        let has_arch = within([0.0, 3.0]) < 1.0;
        let arch_mm = within(ARCHES_MM);
        let shape = SHAPES.map(&mut within);
        let bumps = [BUMPS; 3].map(&mut within);
        let bend_per_m = within(BENDS_PER_M);
        let number = GLANDS.len() + 4 * (random_seed as usize - 1) + n + 1;
        gland(number, cc, true, has_arch.then_some(arch_mm), shape, bumps, bend_per_m)
    })
}

impl Gland {
    pub fn anatomy(&self) -> Anatomy {
        let bumped = |u: [f64; 3], half_m: f64| {
            let [a, b, c] = self.bumps;
            let side = u[1].atan2(u[0]);
            let out = 1.0 + a * (2.0 * side + 1.0).cos() * (1.0 - u[2] * u[2]) + b * u[2] * (3.0 - u[1]) / 3.0
                - c * (3.0 * side).sin() * (1.0 - u[2] * u[2])
                // Flat behind, where the rectum is.
                - 0.08 * (-u[1]).max(0.0).powi(3);
            [0, 1, 2].map(|i| MIDDLE_M[i] + u[i] * half_m * self.shape[i] * out)
        };
        let first = deformed("first", |u| bumped(u, 0.02));
        let cc = first.structure(1.5e-3).volume_m3() * 1e6;
        let half_m = 0.02 * (self.cc / cc).cbrt();
        let target = deformed("prostate", |u| bumped(u, half_m));
        let (low, high) = target.bounds_m();
        let [x, y, _] = MIDDLE_M;
        let urethra = rod(
            "urethra",
            [x, y + 2e-3, low[2] - 0.01],
            [x, y + 2e-3, high[2] + 0.01],
            [3e-3, 3e-3],
            self.bend_per_m,
        );
        let rectum_y = low[1] - 1e-3 - 11e-3;
        let rectum = rod(
            "rectum",
            [x, rectum_y, low[2] - 0.02],
            [x, rectum_y, high[2] + 0.02],
            [15e-3, 11e-3],
            0.0,
        );
        let bone = self.arch_mm.map_or_else(Vec::new, |above_mm| {
            let (top, z) = (high[1] + above_mm * 1e-3, low[2]);
            let ramus = |side: f64| {
                let from_m = [x, top, z - 2e-3];
                rod(
                    "pubic arch",
                    from_m,
                    [x + side * 36e-3, top - 25e-3, z - 40e-3],
                    [6e-3, 6e-3],
                    0.0,
                )
            };
            vec![ramus(-1.0), ramus(1.0)]
        });
        Anatomy {
            target,
            spared: vec![urethra, rectum],
            bone,
            lower_m: [0.0; 3],
            upper_m: [0.1, 0.1, 0.16],
            patient: PatientFrame::default(),
        }
    }
}

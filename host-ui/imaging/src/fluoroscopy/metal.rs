//! Attenuation in seeds and needles: path length of rays through cylinders, in closed form.

use super::CArm;
use crate::body::{Metal, NEEDLE_RADIUS_M, SEED_LENGTH_M, SEED_RADIUS_M};
use crate::xray::{SILVER_PER_M, SOFT_PER_M, STEEL_PER_M, TITANIUM_PER_M};
use nalgebra::Vector3;

/// Thickness of a seed's wall and of its welded ends, m, as in a 6711.
pub const WALL_M: f64 = 0.05e-3;
pub const WELD_M: f64 = 0.4e-3;
/// Radius and length of the silver core, m.
pub const CORE_RADIUS_M: f64 = 0.25e-3;
pub const CORE_LENGTH_M: f64 = 3.0e-3;

/// Straight cylinder with flat ends.
pub struct Cylinder {
    pub middle_m: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub radius_m: f64,
    pub length_m: f64,
    /// Attenuation beyond that of the soft tissue in its place, per m.
    pub per_m: f64,
}

impl Cylinder {
    /// Returns the path length of a ray inside, m; `along` is a unit vector.
    fn way_m(&self, source_m: Vector3<f64>, along: Vector3<f64>) -> f64 {
        let from = source_m - self.middle_m;
        let (at, per) = (from.dot(&self.axis), along.dot(&self.axis));
        let half_m = 0.5 * self.length_m;
        // Between the ends.
        let (mut first, mut last) = if per.abs() < 1e-12 {
            if at.abs() > half_m {
                return 0.0;
            }
            (f64::MIN, f64::MAX)
        } else {
            let ends = [(-half_m - at) / per, (half_m - at) / per];
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        };
        // Within the wall.
        let (across, start) = (along - self.axis * per, from - self.axis * at);
        let (a, b) = (across.norm_squared(), across.dot(&start));
        let c = start.norm_squared() - self.radius_m * self.radius_m;
        if a < 1e-18 {
            return if c < 0.0 { (last - first).max(0.0) } else { 0.0 };
        }
        let root = b * b - a * c;
        if root <= 0.0 {
            return 0.0;
        }
        first = first.max((-b - root.sqrt()) / a);
        last = last.min((-b + root.sqrt()) / a);
        (last - first).max(0.0)
    }
}

/// Models seeds as a shell of titanium with silver in it, needles with their stylet as solid steel.
pub fn cylinders(metal: &Metal) -> Vec<Cylinder> {
    let soft = f64::from(SOFT_PER_M);
    let of_seed = metal.seeds.iter().flat_map(move |seed| {
        [
            (SEED_RADIUS_M, SEED_LENGTH_M, TITANIUM_PER_M - soft),
            (SEED_RADIUS_M - WALL_M, SEED_LENGTH_M - 2.0 * WELD_M, -TITANIUM_PER_M),
            (CORE_RADIUS_M, CORE_LENGTH_M, SILVER_PER_M),
        ]
        .map(|(radius_m, length_m, per_m)| Cylinder {
            middle_m: seed.middle_m,
            axis: seed.axis,
            radius_m,
            length_m,
            per_m,
        })
    });
    let of_needle = metal.needles.iter().flat_map(|needle| {
        needle.points_m.windows(2).filter_map(move |ends| {
            let way = ends[1] - ends[0];
            Some(Cylinder {
                middle_m: (ends[0] + ends[1]) * 0.5,
                axis: way.try_normalize(1e-9)?,
                radius_m: NEEDLE_RADIUS_M,
                length_m: way.norm(),
                per_m: STEEL_PER_M - soft,
            })
        })
    });
    of_seed.chain(of_needle).collect()
}

/// Number of rays along each edge of a pixel.
const RAYS: u32 = 3;

/// Returns the attenuation in metal of each pixel, beyond that of the tissue in its place. It is
/// the mean of nine transmitted rays, so that seeds of a pixel's width do not jump from pixel to
/// pixel.
pub fn losses(arm: &CArm, metal: &Metal) -> Vec<f32> {
    let [wide, high] = arm.pixels;
    let mut of_ray = vec![0.0_f64; 0];
    let mut losses = vec![0.0_f32; wide as usize * high as usize];
    let all = cylinders(metal);
    let boxes: Vec<[u32; 4]> = all.iter().map(|one| seen_in(arm, one)).collect();
    let source_m = arm.source_m();
    let [right, up] = arm.right_up();
    let step_m = arm.pixel_m() / f64::from(RAYS);
    for row in 0..high {
        let in_row: Vec<usize> = (0..all.len())
            .filter(|&n| (boxes[n][1]..boxes[n][3]).contains(&row))
            .collect();
        if in_row.is_empty() {
            continue;
        }
        for column in 0..wide {
            let here: Vec<usize> = in_row
                .iter()
                .copied()
                .filter(|&n| (boxes[n][0]..boxes[n][2]).contains(&column))
                .collect();
            if here.is_empty() {
                continue;
            }
            of_ray.clear();
            let middle_m = arm.place_of(column, row);
            for ray in 0..RAYS * RAYS {
                let off = |n: u32| (f64::from(n) - f64::from(RAYS / 2)) * step_m;
                let end_m = middle_m + right * off(ray % RAYS) + up * off(ray / RAYS);
                let along = (end_m - source_m).normalize();
                let loss = |&n: &usize| all[n].per_m * all[n].way_m(source_m, along);
                of_ray.push((-here.iter().map(loss).sum::<f64>()).exp());
            }
            let mean = of_ray.iter().sum::<f64>() / of_ray.len() as f64;
            losses[row as usize * wide as usize + column as usize] = -mean.ln() as f32;
        }
    }
    losses
}

/// Returns the columns and rows, end exclusive, in which a cylinder can be seen.
fn seen_in(arm: &CArm, one: &Cylinder) -> [u32; 4] {
    let half = one.axis * (0.5 * one.length_m);
    let ends = [one.middle_m - half, one.middle_m + half].map(|end| arm.pixel_of(end));
    // Its nearest point is at most its length closer to the source than its centre, which magnifies
    // by at most a fifth.
    let margin = 2.0 + 5.0 * one.radius_m / arm.pixel_m() * arm.source_to_detector_m / arm.source_to_isocentre_m;
    let (low, high) = (ends[0].inf(&ends[1]), ends[0].sup(&ends[1]));
    let clamp = |v: f64, count: u32| v.clamp(0.0, f64::from(count)) as u32;
    let [wide, tall] = arm.pixels;
    [
        clamp((low.x - margin).floor(), wide),
        clamp((low.y - margin).floor(), tall),
        clamp((high.x + margin).ceil(), wide),
        clamp((high.y + margin).ceil(), tall),
    ]
}

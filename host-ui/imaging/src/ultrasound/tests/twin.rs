//! The same echoes in double precision, each from its own sum over places, with the material point
//! by Newton's method.

use super::{block, field, plane, scanner};
use crate::ultrasound::beams::{Grid, powers as of_neighbours};
use crate::ultrasound::{Plane, Settings, View};
use crate::{Metal, Tissue};
use nalgebra::{Matrix3, Vector2, Vector3};
use stylet_surfaces::field::Field;

/// Returns the place at rest of the tissue that is now at a place.
fn rest_m(field: &Field, place_m: Vector3<f64>) -> Vector3<f64> {
    const H_M: f64 = 1e-6;
    let mut rest = place_m;
    for _ in 0..20 {
        let miss = rest + field.displacement_m(rest) - place_m;
        let column = |axis: usize| {
            let mut step = Vector3::zeros();
            step[axis] = H_M;
            (field.displacement_m(rest + step) - field.displacement_m(rest - step)) / (2.0 * H_M)
        };
        let jacobian = Matrix3::identity() + Matrix3::from_columns(&[column(0), column(1), column(2)]);
        rest -= jacobian.lu().solve(&miss).expect("no folded tissue");
    }
    rest
}

struct Twin {
    plane: Plane,
    grid: Grid,
    field: Field,
}

impl Twin {
    fn scatterer(cell: [i64; 3]) -> Vector2<f64> {
        let [x, y, z] = cell.map(|c| c as i32 as u32);
        let row = y.wrapping_mul(0x27D4_EB2F) ^ z.wrapping_mul(0x1656_67B1);
        let mut h = row.wrapping_add(x.wrapping_mul(0x9E37_79B1));
        for (shift, factor) in [(16, 0x85EB_CA6B), (13, 0xC2B2_AE35), (16, 1)] {
            h = (h ^ (h >> shift)).wrapping_mul(factor);
        }
        let part = |word: u32| f64::from(word as u16 as i16) / 32767.0 * 1.5_f64.sqrt();
        Vector2::new(part(h), part(h >> 16))
    }

    fn scattering(&self, rest_m: Vector3<f64>) -> Vector2<f64> {
        let at = [0, 1, 2].map(|a| rest_m[a] / self.grid.scatterers_m[a]);
        let (mut sum, mut power) = (Vector2::zeros(), 0.0);
        for corner in 0..8_usize {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            let cell = [0, 1, 2].map(|a| at[a].floor() as i64 + step[a] as i64);
            let weight: f64 = (0..3).map(|a| 1.0 - (at[a] - cell[a] as f64).abs()).product();
            sum += Self::scatterer(cell) * weight;
            power += weight * weight;
        }
        sum / power.sqrt()
    }

    fn place_m(&self, line: i64, sample: i64) -> Vector3<f64> {
        let plane = &self.plane;
        let half = plane.probe.half(plane.view);
        let across = half * (2.0 * line as f64 / f64::from(self.grid.lines - 1) - 1.0);
        let r = plane.probe.radius_m + self.depth_m(sample);
        // Identity pose: right is -x across the probe and z along it.
        match plane.view {
            View::Transverse => Vector3::new(-r * across.sin(), r * across.cos(), 0.0),
            View::Sagittal => Vector3::new(0.0, r, across),
        }
    }

    fn depth_m(&self, sample: i64) -> f64 {
        self.plane.depth_m * sample as f64 / f64::from(self.grid.samples - 1)
    }

    fn echo(&self, line: i64, sample: i64) -> Vector2<f64> {
        let place = self.place_m(line, sample);
        let thick_m = self.plane.probe.thickness_at_m(self.depth_m(sample));
        let last = self.grid.slices - 1;
        let (mut sum, mut power) = (Vector2::zeros(), 0.0);
        for slice in 0..=last {
            let e = 4.0 * f64::from(slice) / f64::from(last) - 2.0;
            let weight = (-0.5 * e * e).exp();
            let beside = place + self.plane.normal() * (e * thick_m);
            sum += self.scattering(rest_m(&self.field, beside)) * weight;
            power += weight * weight;
        }
        sum / power.sqrt()
    }

    fn level_db(&self, line: i64, sample: i64) -> f64 {
        let probe = &self.plane.probe;
        let depth_m = self.depth_m(sample);
        let r_m = match self.plane.view {
            View::Transverse => probe.radius_m + depth_m,
            View::Sagittal => 1.0,
        };
        let pitch = 2.0 * probe.half(self.plane.view) / f64::from(self.grid.lines - 1) * r_m;
        let wide = probe.lateral_at_m(depth_m) / pitch;
        let long = probe.axial_m / self.depth_m(1);
        let reach = [(3.0 * long).ceil() as i64, (2.7 * wide).ceil() as i64];
        let (mut sum, mut powers) = (Vector2::zeros(), [0.0; 2]);
        for l in -reach[1]..=reach[1] {
            let across = (-0.5 * (l as f64 / wide).powi(2)).exp();
            powers[1] += across * across;
            for k in -reach[0]..=reach[0] {
                let along = (-0.5 * (k as f64 / long).powi(2)).exp();
                sum += self.echo(line + l, sample + k) * (across * along);
            }
        }
        for k in -reach[0]..=reach[0] {
            powers[0] += (-(k as f64 / long).powi(2)).exp();
        }
        let neighbours = f64::from(of_neighbours(&self.plane, self.grid)[sample as usize]);
        10.0 * (sum.norm_squared() / powers[0] / powers[1] / neighbours).log10()
    }
}

#[test]
fn the_shader_matches_a_slow_sum_in_double_precision() {
    let mut scanner = scanner();
    let body = block([Tissue::new(Tissue::SOFT.brightness, 0.0, 1.63); 3], |_| 1);
    let field = field(|p| Vector3::new(0.05 * p.y, 2e-3 - 0.1 * p.y + 0.04 * p.z, 0.1 * p.x + 1e-3));
    scanner.set_body(&body, &field);
    for view in View::ALL {
        let plane = plane(view);
        let settings = Settings {
            tgc_db_per_cm: 0.0,
            texture_db: 0.0,
            ..Settings::default()
        };
        scanner.picture(&plane, &settings, &Metal::default());
        let levels = scanner.levels_db();
        let grid = Grid::of(&plane);
        let twin = Twin {
            plane,
            grid,
            field: field.clone(),
        };
        let mut worst_db: f64 = 0.0;
        for (line, sample) in [
            (40, 30),
            (61, 250),
            (90, 111),
            (97, 300),
            (133, 180),
            (150, 77),
            (101, 9),
        ] {
            let slow_db = twin.level_db(line, sample);
            let fast_db = f64::from(levels[sample as usize * grid.lines as usize + line as usize]);
            // A level of -20 dB is the small difference of large echoes.
            let least = 10_f64.powf(-20.0 / 20.0);
            let amplitudes = [slow_db, fast_db].map(|db| 10_f64.powf(db / 20.0) + least);
            worst_db = worst_db.max((20.0 * (amplitudes[0] / amplitudes[1]).log10()).abs());
        }
        println!("{}: {worst_db:.3} dB at most", view.name());
        assert!(worst_db < 0.5, "{worst_db}");
    }
}

//! The field of displacements as a texture, and the material point at a place.

use half::f16;
use nalgebra::Vector3;
use stylet_shm_schema::GridInfo;

/// Smallest visible displacement (m).
pub const SEEN_M: f32 = 5e-6;
/// Iterations of the fixed point that finds the material point; with tissue stretched to 1.75 the
/// last is a hundredth of the first.
pub const STEPS: u32 = 8;

/// Displacements on a grid over the body at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Field {
    /// Grid of the field.
    pub info: GridInfo,
    /// Displacement of each node, x fastest.
    pub displacements_m: Vec<[f32; 3]>,
    /// True if no displacement is visible.
    pub at_rest: bool,
}

impl Field {
    /// Creates a field; `None` unless there is one displacement for each node.
    pub fn of(info: GridInfo, displacements_m: &[[f32; 3]]) -> Option<Self> {
        let fits = info.node_count() == Some(displacements_m.len()) && info.dims.iter().all(|&d| d > 0);
        fits.then(|| Self {
            info,
            at_rest: displacements_m.iter().flatten().all(|c| c.abs() < SEEN_M),
            displacements_m: displacements_m.to_vec(),
        })
    }

    /// Creates a field without displacement.
    pub fn rest(info: GridInfo) -> Self {
        Self {
            displacements_m: vec![[0.0; 3]; info.node_count().unwrap_or(0)],
            info,
            at_rest: true,
        }
    }

    /// Interpolates linearly between nodes; beyond the outermost, holds their displacement.
    pub fn displacement_m(&self, rest: Vector3<f64>) -> Vector3<f64> {
        let dims = self.info.dims.map(|d| d as usize);
        if self.displacements_m.len() != dims.iter().product::<usize>() || dims.contains(&0) {
            return Vector3::zeros();
        }
        let axis = |a: usize| {
            let at = ((rest[a] - self.info.origin_m[a]) / self.info.spacing_m).clamp(0.0, (dims[a] - 1) as f64);
            let low = (at as usize).min(dims[a].saturating_sub(2));
            (low, at - low as f64)
        };
        let [(x, fx), (y, fy), (z, fz)] = [axis(0), axis(1), axis(2)];
        let mut sum = Vector3::zeros();
        for corner in 0..8_usize {
            let by = [corner & 1, corner >> 1 & 1, corner >> 2];
            let share = |f: f64, b: usize| if b == 1 { f } else { 1.0 - f };
            let weight = share(fx, by[0]) * share(fy, by[1]) * share(fz, by[2]);
            let at = |low: usize, b: usize, n: usize| (low + b).min(n - 1);
            let node = at(x, by[0], dims[0]) + dims[0] * (at(y, by[1], dims[1]) + dims[1] * at(z, by[2], dims[2]));
            sum += weight * Vector3::from(self.displacements_m[node]).map(f64::from);
        }
        sum
    }

    /// Returns the place at rest of the tissue that is now at `place`, like the shader.
    pub fn rest_of_m(&self, place: Vector3<f64>) -> Vector3<f64> {
        let mut rest = place;
        for _ in 0..STEPS {
            rest = place - self.displacement_m(rest);
        }
        rest
    }

    /// Writes four halves for each node, the last 0, for a texture.
    pub fn texels(&self, out: &mut Vec<[u16; 4]>) {
        out.clear();
        let node = |d: &[f32; 3]| [texel(d[0]), texel(d[1]), texel(d[2]), f16::ZERO].map(f16::to_bits);
        out.extend(self.displacements_m.iter().map(node));
    }
}

/// Returns a displacement for a texture; NaN becomes zero.
fn texel(metres: f32) -> f16 {
    if metres.is_nan() {
        return f16::ZERO;
    }
    f16::from_f32(metres.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_hold_displacements_to_11_bits() {
        for metres in [0.0, 1e-3, -4.2e-3, 0.0313] {
            assert!((texel(metres).to_f32() - metres).abs() <= metres.abs() / 2048.0);
        }
        assert_eq!((texel(1e9), texel(-1e9)), (f16::MAX, f16::MIN));
        assert_eq!(texel(f32::NAN), f16::ZERO);
    }

    fn linear(stretch: f64) -> Field {
        let info = GridInfo {
            dims: [5, 6, 7],
            reserved: 0,
            origin_m: [0.01, 0.0, -0.01],
            spacing_m: 0.005,
        };
        let mut field = Field::rest(info);
        field.at_rest = false;
        for (n, d) in field.displacements_m.iter_mut().enumerate() {
            let at = [n % 5, n / 5 % 6, n / 30];
            let x = info.origin_m[0] + at[0] as f64 * info.spacing_m;
            let z = info.origin_m[2] + at[2] as f64 * info.spacing_m;
            *d = [(stretch * x + 0.2 * z) as f32, 0.001, (-0.3 * z) as f32];
        }
        field
    }

    #[test]
    fn a_linear_field_is_interpolated_exactly_and_undone() {
        for stretch in [-0.45, 0.1, 0.6] {
            let field = linear(stretch);
            let rest = Vector3::new(0.021, 0.013, 0.008);
            let by = field.displacement_m(rest);
            let expected = Vector3::new(stretch * rest.x + 0.2 * rest.z, 0.001, -0.3 * rest.z);
            assert!((by - expected).norm() < 1e-8, "{by} against {expected}");
            let found = field.rest_of_m(rest + by);
            assert!((found - rest).norm() < 0.5e-3, "{} mm off", (found - rest).norm() * 1e3);
        }
    }

    #[test]
    fn outside_the_grid_the_nearest_nodes_count() {
        let field = linear(0.1);
        let far = field.displacement_m(Vector3::new(-1.0, 0.0, 0.0));
        let near = field.displacement_m(Vector3::new(0.01, 0.0, 0.0));
        assert!((far - near).norm() < 1e-9);
    }
}

//! The scene of the paper, drawn by formula: a prostate of 49 cc in the paper's grid.

use super::draw;
use crate::scene::Labels;

/// A gland along z, in elements: apex at low z, base at high z, posterior at low y.
pub(super) struct Gland {
    half_width: f64,
    half_height_anterior: f64,
    /// Half height of the posterior side, less than anterior: the side towards the rectum is flat.
    half_height_posterior: f64,
    half_length: f64,
    /// Share by which the base is wider than the middle, and the apex narrower.
    taper: f64,
    /// 2 is an ellipse; more is boxier.
    exponent: f64,
}

pub(super) const PAPER_GLAND: Gland = Gland {
    half_width: 18.27,
    half_height_anterior: 15.05,
    half_height_posterior: 11.49,
    half_length: 17.33,
    taper: 0.16,
    exponent: 2.2,
};

impl Gland {
    /// Returns whether the gland contains a point, counted from its centre in elements.
    pub fn contains(&self, [x, y, z]: [f64; 3]) -> bool {
        let along = z / self.half_length;
        let left = 1.0 - along.abs().powf(self.exponent);
        if left <= 0.0 {
            return false;
        }
        let scale = 1.0 + self.taper * along;
        let half_height = if y < 0.0 {
            self.half_height_posterior
        } else {
            self.half_height_anterior
        };
        let across = (x / (scale * self.half_width)).abs().powf(self.exponent)
            + (y / (scale * half_height)).abs().powf(self.exponent);
        across <= left
    }
}

pub(super) fn labels() -> Labels {
    draw(Vec::new(), |from_middle| u8::from(PAPER_GLAND.contains(from_middle)))
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;

    fn within(actual: usize, paper: usize, fraction: f64) -> bool {
        (actual as f64 - paper as f64).abs() <= fraction * paper as f64
    }

    #[test]
    fn paper_scene_has_the_paper_s_numbers() {
        let scene = Scene::builtin("paper").expect("built in");
        let elements = scene.lattice.element_count();
        let on_surface = scene.surface.body_elements;
        let triangles = scene.surface.triangles.len();
        println!("elements {elements}, surface {on_surface}, triangles {triangles}");
        assert_eq!(scene.lattice.dims, [107, 62, 176]);
        assert!(within(elements, 19_304, 0.01), "{elements} elements");
        assert!(within(on_surface, 2_999, 0.1), "{on_surface} on surface");
        assert!(within(triangles, 6_397, 0.1), "{triangles} triangles");
        assert!((scene.lattice.volume_m3() - 49e-6).abs() < 0.5e-6);
    }

    #[test]
    fn paper_gland_is_narrow_at_the_apex_and_flat_behind() {
        let lattice = Scene::builtin("paper").expect("built in").lattice;
        let area = |k: usize| {
            let rows = (0..lattice.dims[1]).flat_map(|j| lattice.row(j, k));
            rows.map(|run| run.len).sum::<u32>()
        };
        assert!(area(88 - 12) < area(88 + 11), "apex narrower than base");
        let (low, high) = lattice.bounds_m();
        let middle = |axis: usize| 0.5 * lattice.dims[axis] as f64 * lattice.spacing_m;
        assert!((low[0] + high[0] - 2.0 * middle(0)).abs() < 1e-9, "centred in x");
        assert!(middle(1) - low[1] < high[1] - middle(1), "posterior flatter");
    }
}

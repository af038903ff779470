//! Uniforms of the three-dimensional picture's shader.

use super::camera::Camera;
use super::orientation::scene_from_patient;
use super::state::ViewState;
use crate::shown::Shown;
use crate::theme;
use bytemuck::{Pod, Zeroable};
use egui::Color32;

const LIGHT: [f32; 4] = [-0.48, 0.78, -0.40, 0.0];

/// Same layout as `Scene` in `scene.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SceneUniform {
    pub clip_from_scene: [[f32; 4]; 4],
    pub eye_m: [f32; 4],
    pub light: [f32; 4],
    pub surface: [f32; 4],
    pub look: [f32; 4],
    /// Normal and offset of the plane in front of which surfaces are cut away; a normal of zero
    /// cuts nothing.
    pub section: [f32; 4],
}

/// Returns the plane through the cursor whose near side is cut away.
pub fn section(camera: &Camera, view: &ViewState, shown: &Shown) -> [f32; 4] {
    let (Some(orientation), Some(scene)) = (view.section, &shown.scene) else {
        return [0.0; 4];
    };
    let normal = scene_from_patient(scene).column(orientation.across()).map(|c| c as f32);
    let cursor = view.cursor_m.map(|c| c as f32);
    let normal = if (camera.eye_m() - cursor).dot(&normal) < 0.0 {
        -normal
    } else {
        normal
    };
    [normal.x, normal.y, normal.z, normal.dot(&cursor)]
}

/// Returns a uniform without colours.
pub fn uniform(camera: &Camera, aspect: f32) -> SceneUniform {
    let eye = camera.eye_m();
    let length = LIGHT.iter().map(|c| c * c).sum::<f32>().sqrt();
    SceneUniform {
        clip_from_scene: camera.clip_from_scene(aspect).into(),
        eye_m: [eye.x, eye.y, eye.z, 1.0],
        light: LIGHT.map(|c| c / length),
        surface: [1.0; 4],
        look: [0.0; 4],
        section: [0.0; 4],
    }
}

/// Returns the uniform of a surface that is displaced from its vertices, m.
pub fn shifted(of: SceneUniform, by_m: [f64; 3]) -> SceneUniform {
    let by = by_m.map(|c| c as f32);
    let mut shifted = of;
    for row in 0..4 {
        shifted.clip_from_scene[3][row] += (0..3).map(|a| of.clip_from_scene[a][row] * by[a]).sum::<f32>();
    }
    for (a, by) in by.into_iter().enumerate() {
        shifted.eye_m[a] -= by;
        shifted.section[3] -= of.section[a] * by;
    }
    shifted
}

/// Returns the uniform of one surface.
pub fn tint(whole: SceneUniform, color: Color32, opacity: f32, section: [f32; 4]) -> SceneUniform {
    SceneUniform {
        surface: theme::rgba(color, opacity),
        look: [1.0, 0.25 * (1.0 - opacity), 0.0, 0.0],
        section,
        ..whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the place on the screen, and the distance before the section.
    fn seen(of: &SceneUniform, at: [f32; 3]) -> [f32; 5] {
        let at = [at[0], at[1], at[2], 1.0];
        let clip: [f32; 4] = std::array::from_fn(|row| (0..4).map(|a| of.clip_from_scene[a][row] * at[a]).sum());
        let before = (0..3).map(|a| of.section[a] * at[a]).sum::<f32>() - of.section[3];
        [clip[0], clip[1], clip[2], clip[3], before]
    }

    #[test]
    fn shifted_surfaces_are_cut_in_place() {
        let camera = Camera::looking_at([0.03, 0.04, 0.05], 0.05);
        let whole = tint(uniform(&camera, 1.5), Color32::RED, 0.5, [0.6, 0.0, 0.8, 0.05]);
        let moved = shifted(whole, [0.003, -0.002, 0.004]);
        for at in [[0.0, 0.0, 0.0], [0.02, 0.05, 0.01]] {
            let there = [at[0] + 0.003, at[1] - 0.002, at[2] + 0.004];
            let (one, other) = (seen(&moved, at), seen(&whole, there));
            let off = one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-5, "{one:?} {other:?}");
        }
        assert_eq!(moved.eye_m[0], whole.eye_m[0] - 0.003);
    }
}

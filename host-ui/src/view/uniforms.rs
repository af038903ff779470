//! What the shader of the three-dimensional picture is given.

use super::camera::Camera;
use super::orientation::{Orientation, scene_from_patient};
use super::state::ViewState;
use crate::shown::Shown;
use crate::theme;
use bytemuck::{Pod, Zeroable};
use egui::Color32;
use nalgebra::Vector3;

const LIGHT: [f32; 4] = [-0.48, 0.78, -0.40, 0.0];

/// As `Scene` in `scene.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SceneUniform {
    pub clip_from_scene: [[f32; 4]; 4],
    pub eye_m: [f32; 4],
    pub light: [f32; 4],
    pub surface: [f32; 4],
    pub look: [f32; 4],
    /// Normal and offset of the plane in front of which surfaces are cut away; a normal of zero cuts nothing.
    pub section: [f32; 4],
}

/// The plane through the cursor whose near side is cut away.
pub fn section(camera: &Camera, view: &ViewState, shown: &Shown) -> [f32; 4] {
    let (Some(orientation), Some(scene)) = (view.section, &shown.scene) else {
        return [0.0; 4];
    };
    let axis = match orientation {
        Orientation::Axial => Vector3::z(),
        Orientation::Sagittal => Vector3::x(),
        Orientation::Coronal => Vector3::y(),
    };
    let normal = (scene_from_patient(scene) * axis).map(|c| c as f32);
    let cursor = view.cursor_m.map(|c| c as f32);
    let normal = if (camera.eye_m() - cursor).dot(&normal) < 0.0 {
        -normal
    } else {
        normal
    };
    [normal.x, normal.y, normal.z, normal.dot(&cursor)]
}

/// Without colours.
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

/// Of one surface.
pub fn tint(whole: SceneUniform, color: Color32, opacity: f32, section: [f32; 4]) -> SceneUniform {
    SceneUniform {
        surface: theme::rgba(color, opacity),
        look: [1.0, 0.25 * (1.0 - opacity), 0.0, 0.0],
        section,
        ..whole
    }
}

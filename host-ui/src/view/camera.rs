//! An orbiting camera: position of the eye, and projection of scene points onto the picture.

use nalgebra::{Matrix4, Perspective3, Point3, Vector3, Vector4};

const FIELD_OF_VIEW_RAD: f32 = 0.55;
const NEAREST_M: f32 = 0.01;
const FARTHEST_M: f32 = 5.0;
/// Largest pitch, short of the pole, where "up" is undefined.
const STEEPEST_RAD: f32 = 1.5;

/// Orbiting camera. `yaw` turns about +y, `pitch` lifts the eye; at zero the eye looks along +x and
/// +z points right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub target_m: [f32; 3],
    pub yaw_rad: f32,
    pub pitch_rad: f32,
    pub distance_m: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self::looking_at([0.03; 3], 0.05)
    }
}

impl Camera {
    /// Creates the initial view: a whole body of this radius, needle from the left.
    pub fn looking_at(target_m: [f32; 3], radius_m: f32) -> Self {
        Self {
            target_m,
            yaw_rad: 0.5,
            pitch_rad: 0.32,
            distance_m: (radius_m * 4.7).clamp(NEAREST_M, FARTHEST_M),
        }
    }

    /// Turns the view along `forward` (scene frame), at the same distance.
    pub fn look_along(&mut self, forward: Vector3<f32>) {
        let Some(f) = forward.try_normalize(1e-6) else { return };
        self.pitch_rad = (-f.y).asin().clamp(-STEEPEST_RAD, STEEPEST_RAD);
        if f.x.hypot(f.z) > 1e-3 {
            self.yaw_rad = f.z.atan2(f.x);
        }
    }

    /// Returns the ray from the eye through a place on the picture (0 to 1 from the upper left), a
    /// unit vector.
    pub fn ray(&self, aspect: f32, [x, y]: [f32; 2]) -> Vector3<f32> {
        let (right, up) = self.right_and_up();
        let half = (0.5 * FIELD_OF_VIEW_RAD).tan();
        let (across, along) = ((2.0 * x - 1.0) * half * aspect, (1.0 - 2.0 * y) * half);
        (self.forward() + right * across + up * along).normalize()
    }

    pub fn orbit(&mut self, turn_rad: [f32; 2]) {
        self.yaw_rad = (self.yaw_rad + turn_rad[0]) % std::f32::consts::TAU;
        self.pitch_rad = (self.pitch_rad + turn_rad[1]).clamp(-STEEPEST_RAD, STEEPEST_RAD);
    }

    /// Moves the target. `shift` is in heights of the picture, so that the target follows the
    /// pointer.
    pub fn pan(&mut self, shift: [f32; 2]) {
        let per_height = self.height_at_target_m();
        let (right, up) = self.right_and_up();
        let moved = (right * -shift[0] + up * shift[1]) * per_height;
        let target = Vector3::from(self.target_m) + moved;
        self.target_m = target.map(|c| c.clamp(-FARTHEST_M, FARTHEST_M)).into();
    }

    pub fn zoom(&mut self, factor: f32) {
        self.distance_m = (self.distance_m / factor).clamp(NEAREST_M, FARTHEST_M);
    }

    /// Returns the height of the picture in m at the distance of the target.
    pub fn height_at_target_m(&self) -> f32 {
        2.0 * self.distance_m * (0.5 * FIELD_OF_VIEW_RAD).tan()
    }

    pub fn eye_m(&self) -> Vector3<f32> {
        Vector3::from(self.target_m) - self.forward() * self.distance_m
    }

    pub fn forward(&self) -> Vector3<f32> {
        let (sy, cy) = self.yaw_rad.sin_cos();
        let (sp, cp) = self.pitch_rad.sin_cos();
        Vector3::new(cy * cp, -sp, sy * cp)
    }

    pub fn right_and_up(&self) -> (Vector3<f32>, Vector3<f32>) {
        let forward = self.forward();
        let right = forward.cross(&Vector3::y()).normalize();
        (right, right.cross(&forward))
    }

    /// Returns the projection, with depth 0 to 1 as in wgpu.
    pub fn clip_from_scene(&self, aspect: f32) -> Matrix4<f32> {
        let near = self.distance_m * 0.05;
        let far = self.distance_m * 8.0 + 1.0;
        let gl = Perspective3::new(aspect.max(0.01), FIELD_OF_VIEW_RAD, near, far).to_homogeneous();
        #[rustfmt::skip]
        let half_depth = Matrix4::new(
            1.0, 0.0, 0.0, 0.0,
            0.0, 1.0, 0.0, 0.0,
            0.0, 0.0, 0.5, 0.5,
            0.0, 0.0, 0.0, 1.0,
        );
        let eye = Point3::from(self.eye_m());
        let view = Matrix4::look_at_rh(&eye, &Point3::from(Vector3::from(self.target_m)), &Vector3::y());
        half_depth * gl * view
    }

    /// Returns the place on the picture, 0 to 1 from the upper left; `None` behind the eye.
    pub fn project(&self, aspect: f32, point_m: [f32; 3]) -> Option<[f32; 2]> {
        let [x, y, z] = point_m;
        let clip = self.clip_from_scene(aspect) * Vector4::new(x, y, z, 1.0);
        (clip.w > 1e-6).then(|| [0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn target_is_in_the_middle_and_z_points_right() {
        let camera = Camera::looking_at([0.01, 0.02, 0.03], 0.05);
        let [x, y] = camera.project(1.5, [0.01, 0.02, 0.03]).expect("in front");
        assert!((x - 0.5).abs() < 1e-4 && (y - 0.5).abs() < 1e-4);
        let [right, _] = camera.project(1.5, [0.01, 0.02, 0.04]).expect("in front");
        assert!(right > x);
        let [_, above] = camera.project(1.5, [0.01, 0.03, 0.03]).expect("in front");
        assert!(above < y);
    }

    #[test]
    fn a_ray_goes_through_the_place_that_it_is_seen_at() {
        let mut camera = Camera::looking_at([0.01, 0.02, 0.03], 0.05);
        camera.orbit([0.3, -0.2]);
        let point = Vector3::new(0.03, 0.01, 0.05);
        let at = camera.project(1.4, point.into()).expect("in front");
        let ray = camera.ray(1.4, at);
        let to_point = point - camera.eye_m();
        assert!((to_point.normalize() - ray).norm() < 1e-4, "{ray}");
    }

    #[test]
    fn looking_along_an_axis_looks_along_it() {
        let mut camera = Camera::default();
        for axis in [Vector3::z(), Vector3::x(), -Vector3::z(), Vector3::new(0.6, -0.5, 0.6)] {
            camera.look_along(axis);
            assert!((camera.forward() - axis.normalize()).norm() < 1e-5, "{axis}");
        }
        camera.look_along(-Vector3::y());
        assert!(camera.forward().y < -0.99);
        camera.look_along(Vector3::zeros());
        assert!(camera.forward().iter().all(|c| c.is_finite()));
    }

    #[test]
    fn dragging_never_gives_nan() {
        let mut camera = Camera::default();
        for _ in 0..1000 {
            camera.orbit([3.0, 3.0]);
            camera.zoom(0.1);
            camera.pan([100.0, -100.0]);
        }
        assert!(camera.clip_from_scene(1.0).iter().all(|c| c.is_finite()));
        assert!(camera.distance_m <= FARTHEST_M);
    }
}

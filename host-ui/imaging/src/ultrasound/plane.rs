//! Geometry of a probe: direction and width of its beams, and projection into the picture.

use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use std::f64::consts::FRAC_PI_2;
use stylet_anatomy::Organ;
use stylet_shm_schema::{SceneHeader, SecondState};

/// Pose of the probe: centre of its array on its axis, the axis, and direction of its middle beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Centre of the array, on the axis of the probe, scene frame, m.
    pub middle_m: Vector3<f64>,
    /// Unit vector along the axis, into the patient.
    pub axis: Vector3<f64>,
    /// Unit vector along the middle beam, perpendicular to the axis: it turns with the probe.
    pub up: Vector3<f64>,
}

/// Distance from the probe's centre to the target in a scene without a rectum, m.
const BEHIND_M: f64 = 15e-3;

impl Pose {
    /// Returns the probe on its stepper, not yet moved. It lies along the patient's axis through
    /// the centre of the rectum, or behind the target without a rectum; its array is at the centre
    /// of the target.
    pub fn of_scene(scene: &SceneHeader) -> Self {
        let frame = scene.patient();
        let [across, axis, up] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
            .map(|d| Vector3::from(frame.scene_from_patient_direction(d)));
        let middle = |low: [f64; 3], high: [f64; 3]| (Vector3::from(low) + Vector3::from(high)) * 0.5;
        let target = middle(scene.target_lower_m, scene.target_upper_m);
        let half = (Vector3::from(scene.target_upper_m) - Vector3::from(scene.target_lower_m)) * 0.5;
        let is_rectum = |name: &str| Organ::Rectum.is_mentioned_in(name) || Organ::RectalWall.is_mentioned_in(name);
        let rectum = scene.structures().iter().find(|s| is_rectum(&s.name.read()));
        let behind_m = half.component_mul(&up.abs()).norm() + BEHIND_M;
        let place = rectum.map_or(target - up * behind_m, |s| middle(s.lower_m, s.upper_m));
        let from_target = place - target;
        Self {
            middle_m: target + up * from_target.dot(&up) + across * from_target.dot(&across),
            axis,
            up,
        }
    }

    /// Returns the pose after a turn about the axis, from the patient's right over anterior to the
    /// left, and a move along it.
    pub fn moved(&self, way_m: f64, turn_rad: f64) -> Self {
        let (sin, cos) = turn_rad.sin_cos();
        Self {
            middle_m: self.middle_m + self.axis * way_m,
            axis: self.axis,
            up: self.up * cos + self.axis.cross(&self.up) * sin,
        }
    }

    /// Returns the probe in a hand, from the frame of the tool: its axis is +z of that frame,
    /// towards the tip, and its middle beam +y. So a probe that is held straight looks along the
    /// scene's y.
    pub fn of_tool(tip_m: Vector3<f64>, scene_from_tool: &UnitQuaternion<f64>, probe: &Probe) -> Self {
        let axis = scene_from_tool * Vector3::z();
        Self {
            middle_m: tip_m - axis * probe.behind_tip_m,
            axis,
            up: scene_from_tool * Vector3::y(),
        }
    }

    /// Returns the probe in the hand that holds the second device; `None` before its first tick.
    pub fn of_second(second: &SecondState) -> Option<Self> {
        let [i, j, k, w] = second.world_from_tool;
        let scene_from_tool = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6)?;
        let tip_m = Vector3::from(second.tip_in_scene_m);
        (second.tick > 0).then(|| Self::of_tool(tip_m, &scene_from_tool, &Probe::default()))
    }

    /// Returns the probe in the second hand; on its stepper, not yet moved, in a run without one.
    pub fn now(scene: &SceneHeader, second: Option<&SecondState>) -> Self {
        second
            .and_then(Self::of_second)
            .unwrap_or_else(|| Self::of_scene(scene))
    }

    /// Returns the foremost point of the probe, m.
    pub fn tip_m(&self, probe: &Probe) -> Vector3<f64> {
        self.middle_m + self.axis * probe.behind_tip_m
    }

    /// Returns the move along the axis of another pose (m), and the turn about it (rad): the
    /// arguments of [`Pose::moved`].
    pub fn way_and_turn(&self, from: &Self) -> (f64, f64) {
        let aside = from.axis.cross(&from.up);
        let turn_rad = self.up.dot(&aside).atan2(self.up.dot(&from.up));
        ((self.middle_m - from.middle_m).dot(&from.axis), turn_rad)
    }
}

/// Plane of the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Across the probe: a sector about its axis.
    Transverse,
    /// Along the probe: parallel beams.
    Sagittal,
}

impl View {
    /// Both planes.
    pub const ALL: [Self; 2] = [Self::Transverse, Self::Sagittal];

    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Transverse => "Transverse",
            Self::Sagittal => "Sagittal",
        }
    }
}

/// Dimensions of a probe, and spread of its beams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Distance from its axis to its surface, m.
    pub radius_m: f64,
    /// Distance from its tip back to the centre of both arrays, m.
    pub behind_tip_m: f64,
    /// Half the angle of the sector, rad.
    pub half_angle: f64,
    /// Half the length of the sagittal array, m.
    pub half_length_m: f64,
    /// Centre frequency, MHz.
    pub mhz: f64,
    /// Standard deviation of a point's echo along the beam, m.
    pub axial_m: f64,
    /// Standard deviation across the beam near the probe, m.
    pub lateral_m: f64,
    /// Growth of that deviation with depth, used where it is larger.
    pub lateral_per_depth: f64,
    /// Standard deviation across the plane at the focus of the lens, m.
    pub thickness_m: f64,
    /// Depth of that focus, m.
    pub focus_m: f64,
    /// Change of depth that widens the plane by the square root of two, m.
    pub focal_depth_m: f64,
}

/// Speed of sound that a scanner assumes, m/s.
const SOUND_M_PER_S: f64 = 1540.0;
/// Full width at half maximum of a Gaussian in standard deviations.
pub const FWHM: f64 = 2.354_820_045;

impl Default for Probe {
    /// Returns the default probe: 7 MHz, 20 mm thick. Across the beam the width at half maximum is
    /// the wavelength times the f-number (3.5, then depth over an aperture of 12 mm). Along it the
    /// width is 0.3 mm, and the plane is 2 mm thick at 25 mm. The arrays end where the half ball of
    /// the tip begins. The sizes are assumed, see `docs/imaging.md`.
    fn default() -> Self {
        let mhz = 7.0;
        let wavelength_m = SOUND_M_PER_S / (mhz * 1e6);
        Self {
            radius_m: 10e-3,
            behind_tip_m: 42.5e-3,
            half_angle: 80_f64.to_radians(),
            half_length_m: 32.5e-3,
            mhz,
            axial_m: 0.3e-3 / FWHM,
            lateral_m: 3.5 * wavelength_m / FWHM,
            lateral_per_depth: wavelength_m / 12e-3 / FWHM,
            thickness_m: 2e-3 / FWHM,
            focus_m: 25e-3,
            focal_depth_m: 25e-3,
        }
    }
}

impl Probe {
    /// Returns the standard deviation of the beam across the plane, m.
    pub fn thickness_at_m(&self, depth_m: f64) -> f64 {
        self.thickness_m * (1.0 + ((depth_m - self.focus_m) / self.focal_depth_m).powi(2)).sqrt()
    }

    /// Returns the standard deviation of a point's echo across the beam, m.
    pub fn lateral_at_m(&self, depth_m: f64) -> f64 {
        self.lateral_m.max(self.lateral_per_depth * depth_m)
    }

    /// Returns half the fan: an angle of the sector (rad), a length of parallel beams (m).
    pub fn half(&self, view: View) -> f64 {
        match view {
            View::Transverse => self.half_angle,
            View::Sagittal => self.half_length_m,
        }
    }
}

/// The plane of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Pose of the probe.
    pub pose: Pose,
    /// Plane of the probe.
    pub view: View,
    /// The probe.
    pub probe: Probe,
    /// Depth of view, from the surface of the probe, m.
    pub depth_m: f64,
    /// Pixels of the picture.
    pub pixels: [u32; 2],
}

/// Place in the coordinates of the beams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InBeams {
    /// Beam: an angle from the middle beam (rad), or a distance along the probe (m).
    pub across: f64,
    /// Depth from the surface of the probe, m.
    pub depth_m: f64,
    /// Distance before or behind the plane, m.
    pub off_plane_m: f64,
}

impl Plane {
    /// Returns the unit vector to the right of the picture: the patient's left, or superior.
    pub fn right(&self) -> Vector3<f64> {
        match self.view {
            View::Transverse => self.pose.axis.cross(&self.pose.up),
            View::Sagittal => self.pose.axis,
        }
    }

    /// Returns the unit vector across the plane.
    pub fn normal(&self) -> Vector3<f64> {
        self.right().cross(&self.pose.up)
    }

    /// Returns the distance between neighbours among this number of beams, m.
    pub(super) fn pitch_m(&self, lines: u32, depth_m: f64) -> f64 {
        let per_half = 2.0 * self.probe.half(self.view) / f64::from(lines - 1);
        match self.view {
            View::Transverse => per_half * (self.probe.radius_m + depth_m),
            View::Sagittal => per_half,
        }
    }

    /// Returns the beam coordinates of a scene point.
    pub fn in_beams(&self, place_m: Vector3<f64>) -> InBeams {
        let from = place_m - self.pose.middle_m;
        let (x, y) = (from.dot(&self.right()), from.dot(&self.pose.up));
        let (across, r) = match self.view {
            View::Transverse => (x.atan2(y), x.hypot(y)),
            View::Sagittal => (x, y),
        };
        InBeams {
            across,
            depth_m: r - self.probe.radius_m,
            off_plane_m: from.dot(&self.normal()),
        }
    }

    /// Returns the size of a pixel, m, at which all of the fan is visible.
    pub fn m_per_pixel(&self) -> f64 {
        let high_m = self.probe.radius_m + self.depth_m;
        let wide_m = match self.view {
            View::Transverse => 2.0 * high_m * self.probe.half_angle.sin().max(0.1),
            View::Sagittal => 2.0 * self.probe.half_length_m,
        };
        (wide_m / f64::from(self.pixels[0])).max(high_m / f64::from(self.pixels[1]))
    }

    /// Returns the height of the lower edge. The axis of the probe is at the lower edge of the
    /// picture; a smaller fan is centred.
    pub fn lowest_m(&self) -> f64 {
        let high_m = self.probe.radius_m + self.depth_m;
        0.5 * (high_m - f64::from(self.pixels[1]) * self.m_per_pixel())
    }

    /// Returns the part of the picture that the fan covers: x and y from its left and upper edge,
    /// width and height, pixels.
    pub(super) fn covered(&self) -> [u32; 4] {
        let near_m = self.probe.radius_m;
        let far_m = near_m + self.depth_m;
        let (half_m, least_m) = match self.view {
            // Its ends are lowest at the probe, or at the depth where they pass below the axis.
            View::Transverse => {
                let half = self.probe.half_angle;
                (
                    far_m * half.min(FRAC_PI_2).sin(),
                    (near_m * half.cos()).min(far_m * half.cos()),
                )
            }
            View::Sagittal => (self.probe.half_length_m, near_m),
        };
        let scale = self.m_per_pixel();
        let [wide, high] = self.pixels.map(f64::from);
        let row = |y_m: f64| high - (y_m - self.lowest_m()) / scale;
        let span = |from: f64, to: f64, all: f64| {
            let (from, to) = ((from - 1.0).floor().clamp(0.0, all), (to + 1.0).ceil().clamp(0.0, all));
            [from as u32, (to - from) as u32]
        };
        let [x, width] = span(0.5 * wide - half_m / scale, 0.5 * wide + half_m / scale, wide);
        let [y, height] = span(row(far_m), row(least_m), high);
        [x, y, width, height]
    }

    /// Projects a scene point onto the plane and returns its pixel, from the left and upper edge of
    /// the picture.
    pub fn pixel_of(&self, place_m: Vector3<f64>) -> Vector2<f64> {
        let from = place_m - self.pose.middle_m;
        let scale = self.m_per_pixel();
        let [wide, high] = self.pixels.map(f64::from);
        let (x, y) = (from.dot(&self.right()), from.dot(&self.pose.up));
        Vector2::new(0.5 * wide + x / scale, high - (y - self.lowest_m()) / scale)
    }

    /// Returns where a straight line through a place crosses the plane, scene frame, m; `None` if
    /// it runs along it. The holes of a template are drawn so.
    pub fn crossing_m(&self, place_m: Vector3<f64>, direction: Vector3<f64>) -> Option<Vector3<f64>> {
        let (off_plane_m, per) = (self.in_beams(place_m).off_plane_m, direction.dot(&self.normal()));
        (per.abs() > 0.2).then(|| place_m - direction * (off_plane_m / per))
    }

    /// Returns the pixel of that crossing.
    pub fn crossing(&self, place_m: Vector3<f64>, direction: Vector3<f64>) -> Option<Vector2<f64>> {
        self.crossing_m(place_m, direction)
            .map(|place_m| self.pixel_of(place_m))
    }

    /// Returns the place in the plane under a place in the picture.
    pub fn place_of(&self, pixel: Vector2<f64>) -> Vector3<f64> {
        let scale = self.m_per_pixel();
        let [wide, high] = self.pixels.map(f64::from);
        let (x, y) = (
            (pixel.x - 0.5 * wide) * scale,
            (high - pixel.y) * scale + self.lowest_m(),
        );
        self.pose.middle_m + self.right() * x + self.pose.up * y
    }
}

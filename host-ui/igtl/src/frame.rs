//! The needle's frame as a transform in RAS and mm, and back; the frame of the probe's picture.

use nalgebra::{Vector2, Vector3};
use stylet_anatomy::PatientFrame;
use stylet_imaging::ultrasound::{FWHM, Plane};

const MM_PER_M: f64 = 1000.0;
/// Tolerance for lengths and angles of the axes of a rigid body.
const AXES_OFF: f64 = 1e-3;

pub fn place_mm(patient: &PatientFrame, in_scene_m: [f64; 3]) -> [f32; 3] {
    patient.patient_from_scene(in_scene_m).map(|m| (m * MM_PER_M) as f32)
}

/// Returns the columns of the needle's frame in RAS: the third axis points along the needle, the
/// origin is the tip.
pub fn needle(patient: &PatientFrame, tip_in_scene_m: [f64; 3], direction_in_scene: [f64; 3]) -> [[f32; 3]; 4] {
    let along = Vector3::from(unit(patient.patient_from_scene_direction(direction_in_scene)));
    // Any axis that is not nearly parallel fixes the roll, which the needle lacks.
    let aside = if along.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let second = along.cross(&aside).normalize();
    let [first, second, along] = [second.cross(&along), second, along].map(|axis| axis.map(|x| x as f32).into());
    [first, second, along, place_mm(patient, tip_in_scene_m)]
}

/// Returns the columns of a picture's matrix in RAS: the ways to the next column and row of pixels
/// and through the beam's thickness at its focus, and the centre of all pixels.
pub fn picture(patient: &PatientFrame, plane: &Plane) -> [[f32; 3]; 4] {
    let pixel_mm = plane.m_per_pixel() * MM_PER_M;
    let thickness_mm = plane.probe.thickness_m * FWHM * MM_PER_M;
    let way = |direction: Vector3<f64>, mm: f64| {
        let in_patient = patient.patient_from_scene_direction(direction.into());
        in_patient.map(|c| (c * mm) as f32)
    };
    let [wide, high] = plane.pixels.map(f64::from);
    let middle_m = plane.place_of(Vector2::new(0.5 * wide, 0.5 * high));
    [
        way(plane.right(), pixel_mm),
        way(-plane.pose.up, pixel_mm),
        // Right, down and this one are right-handed.
        way(-plane.normal(), thickness_mm),
        place_mm(patient, middle_m.into()),
    ]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let unit = Vector3::from(v).try_normalize(0.0);
    unit.unwrap_or_else(Vector3::z).into()
}

/// Tool of a hand, in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Foremost point, m.
    pub tip_m: [f64; 3],
    /// Unit vector along it, towards the tip.
    pub direction: [f64; 3],
    /// Unit vector of its second axis: the middle beam of a probe.
    pub up: [f64; 3],
}

/// Reads a transform of the same form; `None` unless its axes are those of a rigid body.
pub fn tool(patient: &PatientFrame, columns: &[[f32; 3]; 4]) -> Option<Tool> {
    let [x, y, z, origin_mm] = columns.map(|column| Vector3::from(column.map(f64::from)));
    let is = |value: f64, expected: f64| (value - expected).abs() <= AXES_OFF;
    let have_length_one = [x, y, z].iter().all(|axis| is(axis.norm(), 1.0));
    let stand_on_each_other = [(x, y), (y, z), (z, x)].iter().all(|(a, b)| is(a.dot(b), 0.0));
    let is_rigid = have_length_one && stand_on_each_other && x.cross(&y).dot(&z) > 0.0;
    is_rigid.then(|| Tool {
        tip_m: patient.scene_from_patient((origin_mm / MM_PER_M).into()),
        direction: unit(patient.scene_from_patient_direction(z.into())),
        up: unit(patient.scene_from_patient_direction(y.into())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_imaging::ultrasound::{Pose, Probe, View};

    #[test]
    fn the_needle_s_frame_is_right_handed_in_mm() {
        for direction in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.3, -0.4, 0.866]] {
            let [x, y, z, tip] = needle(&PatientFrame::default(), [0.01, -0.02, 0.03], direction);
            let wide = |v: [f32; 3]| Vector3::from(v.map(f64::from));
            let third = wide(x).cross(&wide(y));
            assert!((0..3).all(|a| (third[a] - f64::from(z[a])).abs() < 1e-6));
            assert!((0..3).all(|a| (f64::from(z[a]) - unit(direction)[a]).abs() < 1e-6));
            assert_eq!(tip, [10.0, -20.0, 30.0]);
        }
    }

    #[test]
    fn a_pixel_s_place_is_in_the_patient_where_the_plane_has_it() {
        let turned = PatientFrame::of_wire(&[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.2, -0.3]);
        let pose = Pose {
            middle_m: Vector3::new(0.01, -0.02, 0.03),
            axis: Vector3::new(0.0, 0.6, 0.8),
            up: Vector3::new(0.0, 0.8, -0.6),
        };
        for view in View::ALL {
            let plane = Plane {
                pose,
                view,
                probe: Probe::default(),
                depth_m: 60e-3,
                pixels: [64, 48],
            };
            let [column, row, slice, middle] = picture(&turned, &plane).map(|c| Vector3::from(c.map(f64::from)));
            for [i, j] in [[0.0, 0.0], [63.0, 0.0], [10.0, 47.0]] {
                let shown_mm = middle + column * (i - 31.5) + row * (j - 23.5);
                let place_m = plane.place_of(Vector2::new(i + 0.5, j + 0.5));
                let off_mm = shown_mm - Vector3::from(turned.patient_from_scene(place_m.into())) * MM_PER_M;
                assert!(off_mm.norm() < 1e-3, "{view:?}: {off_mm}");
            }
            assert!(column.cross(&row).dot(&slice) > 0.0);
            assert!((slice.norm() - 2.0).abs() < 1e-6, "2 mm at the focus");
        }
    }

    #[test]
    fn a_needle_comes_back_from_its_transform_in_a_turned_patient() {
        let turned = PatientFrame::of_wire(&[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.2, -0.3]);
        let (tip_m, direction) = ([0.01, -0.02, 0.03], unit([0.3, -0.4, 0.866]));
        let columns = needle(&turned, tip_m, direction);
        let its = tool(&turned, &columns).expect("rigid");
        let is = |a: [f64; 3], b: [f64; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-6);
        assert!(is(its.tip_m, tip_m) && is(its.direction, direction), "{its:?}");
        // The second axis in RAS is the second column; the patient is turned by a right angle about
        // superior.
        let second = columns[1].map(f64::from);
        assert!(is(its.up, turned.scene_from_patient_direction(second)), "{its:?}");
    }
}

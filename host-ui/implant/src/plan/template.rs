//! The template: 13 x 13 holes for needles, columns A to M, rows 1 to 13.

use crate::patient::{Box3, patient_axis};
use nalgebra::Vector3;
use stylet_shm_schema::SceneHeader;

/// Number of holes along a side.
pub const HOLES: u8 = 13;
/// Distance between two holes, m.
pub const PITCH_M: f64 = 5e-3;
/// Distance of the template from the body.
const CLEARANCE_M: f64 = 0.010;

/// Hole; A1 is at the patient's right, posterior.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hole {
    column: u8,
    row: u8,
}

impl Hole {
    /// Creates a hole from column and row, counted from 0.
    pub fn new(column: u8, row: u8) -> Option<Self> {
        (column < HOLES && row < HOLES).then_some(Self { column, row })
    }

    /// Returns the middle hole, G7.
    pub fn middle() -> Self {
        Self {
            column: HOLES / 2,
            row: HOLES / 2,
        }
    }

    /// Returns the hole offset by columns and rows; `None` beyond the edge.
    pub fn offset_by(self, [columns, rows]: [i8; 2]) -> Option<Self> {
        let column = self.column.checked_add_signed(columns)?;
        let row = self.row.checked_add_signed(rows)?;
        Self::new(column, row)
    }

    /// Returns every hole, row by row.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..HOLES).flat_map(|row| (0..HOLES).map(move |column| Self { column, row }))
    }

    /// Returns the column, counted from 0 at A.
    pub fn column(self) -> u8 {
        self.column
    }

    /// Returns the row, counted from 0.
    pub fn row(self) -> u8 {
        self.row
    }
}

impl std::fmt::Display for Hole {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", char::from(b'A' + self.column), self.row + 1)
    }
}

/// Error of a text that names no hole.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is not a hole; holes go from A1 to M13")]
pub struct NotAHole(String);

impl std::str::FromStr for Hole {
    type Err = NotAHole;

    fn from_str(text: &str) -> Result<Self, NotAHole> {
        let mut letters = text.trim().chars();
        let column = letters.next().map(|c| c.to_ascii_uppercase()).filter(char::is_ascii);
        let column = column.and_then(|c| (c as u8).checked_sub(b'A'));
        let row = letters.as_str().parse::<u8>().ok().and_then(|r| r.checked_sub(1));
        let hole = column.zip(row).and_then(|(c, r)| Self::new(c, r));
        hole.ok_or_else(|| NotAHole(text.to_owned()))
    }
}

/// Place of the holes, scene frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Template {
    /// Middle hole, G7, scene frame, m.
    pub middle_m: [f64; 3],
    /// Unit vector along the columns, from A to M.
    pub columns: [f64; 3],
    /// Unit vector along the rows, from 1 to 13.
    pub rows: [f64; 3],
    /// Unit vector into the patient.
    pub inwards: [f64; 3],
    /// Distance between two holes, m.
    pub pitch_m: f64,
}

impl Template {
    /// Places a template before the perineum, its middle hole before the centre of the target.
    pub fn before(scene: &SceneHeader) -> Self {
        let inwards = patient_axis(scene, 2, Vector3::z());
        let left = -patient_axis(scene, 0, Vector3::x());
        let across = |v: Vector3<f64>| (v - inwards * v.dot(&inwards)).try_normalize(1e-3);
        let columns = across(left).or_else(|| across(Vector3::x())).unwrap_or_else(Vector3::y);
        // Right-handed: left and anterior, seen from the perineum.
        let rows = inwards.cross(&-columns);
        let middle = Box3::of(scene.target_lower_m, scene.target_upper_m).middle();
        let below = Box3::of(scene.lower_m, scene.upper_m).way_out_m(middle, -inwards);
        Self {
            middle_m: (middle - inwards * (below + CLEARANCE_M)).into(),
            columns: columns.into(),
            rows: rows.into(),
            inwards: inwards.into(),
            pitch_m: PITCH_M,
        }
    }

    /// Returns the place of a hole, scene frame, m.
    pub fn hole_m(&self, hole: Hole) -> [f64; 3] {
        let middle = f64::from(HOLES / 2);
        let [u, v] = [hole.column, hole.row].map(|n| (f64::from(n) - middle) * self.pitch_m);
        [0, 1, 2].map(|a| self.middle_m[a] + self.columns[a] * u + self.rows[a] * v)
    }

    /// Returns the hole nearest to the line from a point along the template's axis; `None` if no
    /// hole is near.
    pub fn nearest(&self, point_m: [f64; 3]) -> Option<Hole> {
        let off = Vector3::from(point_m) - Vector3::from(self.middle_m);
        let count = |axis: [f64; 3]| (off.dot(&Vector3::from(axis)) / self.pitch_m).round() + f64::from(HOLES / 2);
        let (u, v) = (count(self.columns), count(self.rows));
        let fits = |n: f64| (0.0..f64::from(HOLES)).contains(&n);
        (fits(u) && fits(v)).then_some(Hole {
            column: u as u8,
            row: v as u8,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    pub fn scene() -> SceneHeader {
        let mut scene = SceneHeader::zeroed();
        (scene.lower_m, scene.upper_m) = ([0.0; 3], [0.1, 0.1, 0.2]);
        (scene.target_lower_m, scene.target_upper_m) = ([0.02, 0.02, 0.08], [0.06, 0.06, 0.12]);
        scene.patient_from_scene = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        scene
    }

    #[test]
    fn holes_are_named_as_they_are_read() {
        for (name, column, row) in [("A1", 0, 0), ("M13", 12, 12), ("g7", 6, 6)] {
            let hole: Hole = name.parse().unwrap();
            assert_eq!((hole.column, hole.row), (column, row));
            assert_eq!(hole.to_string(), name.to_uppercase());
        }
        for wrong in ["", "A", "A0", "A14", "N1", "7G", "é1", "A1b", "A-1"] {
            assert!(wrong.parse::<Hole>().is_err(), "{wrong}");
        }
        assert_eq!(Hole::all().count(), 169);
    }

    #[test]
    fn the_first_hole_is_right_and_posterior() {
        let template = Template::before(&scene());
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(template.hole_m("G7".parse().unwrap()), [0.04, 0.04, -0.01]));
        // RAS: x to the right, y anterior.
        assert!(near(template.hole_m("A1".parse().unwrap()), [0.07, 0.01, -0.01]));
        assert!(near(template.hole_m("M13".parse().unwrap()), [0.01, 0.07, -0.01]));
    }

    #[test]
    fn each_hole_is_its_own_nearest_hole() {
        let template = Template::before(&scene());
        for hole in Hole::all() {
            let mut place = template.hole_m(hole);
            (place[0], place[2]) = (place[0] + 1.9e-3, place[2] + 0.1);
            assert_eq!(template.nearest(place), Some(hole));
        }
        assert_eq!(template.nearest([0.075, 0.04, 0.0]), None);
    }
}

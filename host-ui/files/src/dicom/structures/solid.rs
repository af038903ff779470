//! The body inside the contours of one structure, queried point by point: dose counts in it as
//! drawn, independent of overlaps.

use super::super::super::element::short;
use super::super::super::frame::VoxelFrame;
use super::planes::{Polygon, axes_of, flat, height_m};
use super::raster::slabs;
use super::{Contoured, SAME_PLANE_M, StructureSet};
use crate::error::{ContentError, invalid};
use nalgebra::{Matrix3, Vector3};

/// Body in RAS, m.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Name of the structure.
    pub name: String,
    /// Axes, one a column; the third is across the planes.
    axes: Matrix3<f64>,
    planes: Vec<Plane>,
    /// Lower corner of a box around it.
    pub lower_m: [f64; 3],
    /// Upper corner of a box around it.
    pub upper_m: [f64; 3],
}

#[derive(Clone, Debug)]
struct Plane {
    from_m: f64,
    to_m: f64,
    polygons: Vec<Polygon>,
}

impl StructureSet {
    /// Returns every structure as a body, in the planes of its contours.
    pub fn solids(&self) -> Result<Vec<Solid>, ContentError> {
        let usual_m = self.plane_distance_m()?;
        self.structures.iter().map(|s| Solid::of(s, usual_m)).collect()
    }
}

impl Solid {
    /// Creates the body of a structure, whose planes may lie in any direction; `usual_m` is the
    /// thickness of a single plane.
    pub fn of(structure: &Contoured, usual_m: f64) -> Result<Self, ContentError> {
        let axes = axes_of(structure.normal()?);
        let off_m = structure.contours.iter().flat_map(|contour| {
            let height_m = height_m(contour, &axes);
            contour.iter().map(move |p| (axes.column(2).dot(p) - height_m).abs())
        });
        let off_m = off_m.fold(0.0, f64::max);
        if off_m > 10.0 * SAME_PLANE_M {
            return Err(invalid!(
                "{}: a contour is {:.2} mm off the planes of its others; draw all of a structure in one direction",
                short(&structure.name),
                off_m * 1e3
            ));
        }
        let (heights, polygons): (Vec<f64>, Vec<_>) = flat(&structure.contours, &axes).into_iter().unzip();
        let planes = slabs(&heights, usual_m).into_iter().zip(polygons);
        let planes: Vec<Plane> = planes
            .map(|([from_m, to_m], polygons)| Plane { from_m, to_m, polygons })
            .collect();
        let (lower_m, upper_m) = bounds(&axes, &planes);
        Ok(Self {
            name: structure.name.clone(),
            axes,
            planes,
            lower_m,
            upper_m,
        })
    }

    /// Like [`Solid::of`]; `single_m` is the thickness of a structure of one plane.
    pub fn across(structure: &Contoured, single_m: f64) -> Result<Self, ContentError> {
        let own_m = structure.plane_distance_m()?;
        Self::of(structure, if own_m.is_finite() { own_m } else { single_m })
    }

    /// Returns the lowest and the highest indices of voxels that the box around it reaches.
    pub fn extent(&self, frame: &VoxelFrame) -> [[f64; 3]; 2] {
        let of_box = [self.lower_m, self.upper_m];
        let corners = (0..8).map(|n| frame.index_of(Vector3::from([0, 1, 2].map(|a| of_box[n >> a & 1][a]))));
        corners.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], at| {
            [
                [0, 1, 2].map(|a| low[a].min(at[a])),
                [0, 1, 2].map(|a| high[a].max(at[a])),
            ]
        })
    }

    /// Returns whether a place (RAS, m) lies inside.
    pub fn contains(&self, place_m: [f64; 3]) -> bool {
        let at = self.axes.transpose() * Vector3::from(place_m);
        // The last plane that begins below.
        let next = self.planes.partition_point(|p| p.from_m <= at.z);
        let plane = next.checked_sub(1).map(|i| &self.planes[i]).filter(|p| at.z < p.to_m);
        plane.is_some_and(|p| {
            p.polygons
                .iter()
                .filter(|polygon| encloses(polygon, [at.x, at.y]))
                .count()
                % 2
                == 1
        })
    }
}

/// Returns whether a ray to the right crosses an odd number of edges.
pub fn encloses(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let next = polygon.iter().cycle().skip(1);
    let crossed = |(a, b): (&[f64; 2], &[f64; 2])| {
        (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    };
    polygon.iter().zip(next).filter(|&edge| crossed(edge)).count() % 2 == 1
}

fn bounds(axes: &Matrix3<f64>, planes: &[Plane]) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for plane in planes {
        for corner in plane.polygons.iter().flatten() {
            for height in [plane.from_m, plane.to_m] {
                let place = axes * Vector3::new(corner[0], corner[1], height);
                (low, high) = (low.inf(&place), high.sup(&place));
            }
        }
    }
    (low.into(), high.into())
}

//! The smallest volume that three links of an element span, of displacements around a place.

/// Number of elements to each side that are examined: the patch that a tip presses, and those before it.
pub(super) const REACH: usize = 4;
const WIDTH: usize = 2 * REACH + 1;

type Point = [f32; 3];
/// Places of element centres along z, y, x, in elements; not a number where no element is.
type Places = [[[Point; WIDTH]; WIDTH]; WIDTH];

/// Returns the smallest volume that three links span, one along each axis, over that at rest, of displacements in
/// elements over [`WIDTH`] elements along each axis; `None` where there is none. 1 where no three links meet. Does not
/// allocate.
pub(super) fn least_corner_of(displacement: impl Fn([usize; 3]) -> Option<[f32; 3]>) -> f64 {
    let mut places = [[[[f32::NAN; 3]; WIDTH]; WIDTH]; WIDTH];
    for (k, plane) in places.iter_mut().enumerate() {
        for (j, line) in plane.iter_mut().enumerate() {
            for (i, place) in line.iter_mut().enumerate() {
                if let Some(u) = displacement([i, j, k]) {
                    *place = [i as f32 + u[0], j as f32 + u[1], k as f32 + u[2]];
                }
            }
        }
    }
    let mut least = f32::INFINITY;
    for k in 0..WIDTH - 1 {
        for j in 0..WIDTH - 1 {
            for i in 0..WIDTH - 1 {
                let corner = least_of_cell(&places, [i, j, k]);
                least = if corner < least { corner } else { least };
            }
        }
    }
    if least < f32::INFINITY { f64::from(least) } else { 1.0 }
}

/// Returns the smallest volume over the eight corners of the cell between eight centres; not a number, or that of those
/// present, where some are missing.
fn least_of_cell(places: &Places, [i, j, k]: [usize; 3]) -> f32 {
    let at = |a: usize, b: usize, c: usize| places[k + c][j + b][i + a];
    let between = |to: Point, from: Point| [0, 1, 2].map(|c| to[c] - from[c]);
    let along_x = |b, c| between(at(1, b, c), at(0, b, c));
    let along_y = |a, c| between(at(a, 1, c), at(a, 0, c));
    let along_z = |a, b| between(at(a, b, 1), at(a, b, 0));
    let x = [[along_x(0, 0), along_x(0, 1)], [along_x(1, 0), along_x(1, 1)]];
    let y = [[along_y(0, 0), along_y(0, 1)], [along_y(1, 0), along_y(1, 1)]];
    let z = [[along_z(0, 0), along_z(0, 1)], [along_z(1, 0), along_z(1, 1)]];
    let mut least = f32::INFINITY;
    for corner in 0..8 {
        let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let volume = determinant(x[b][c], y[a][c], z[a][b]);
        least = if volume < least { volume } else { least };
    }
    least
}

fn determinant(a: Point, b: Point, c: Point) -> f32 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

//! The outline of the gland in one transverse plane, in polar coordinates about its middle.

use super::spline::Periodic;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::{PI, TAU};

/// Number of directions in which an outline has a radius, evenly about its centre.
pub const DIRECTIONS: usize = 96;
/// Smallest area of an outline, m².
const LEAST_M2: f64 = 1e-6;
/// Smallest difference to half a turn in the angle between neighbouring points, rad.
const LEAST_RAD: f64 = 1e-3;
/// Number of points that determine an ellipse.
const OF_ELLIPSE: usize = 5;
/// Iterations of the stretch; an ellipse is off by a thousandth of its radius after three, and by
/// 10⁻⁵ after six.
const ROUNDS: usize = 6;

/// Closed line that every ray from its centre crosses once.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Centre: to the right and up in the plane, m.
    pub middle_m: Vector2<f64>,
    /// Distances from the centre, one for each of `DIRECTIONS`, from the right over up, m.
    pub radii_m: Vec<f64>,
}

/// Returns the unit vector of a direction.
fn direction(n: usize) -> Vector2<f64> {
    let (sine, cosine) = (n as f64 / DIRECTIONS as f64 * TAU).sin_cos();
    Vector2::new(cosine, sine)
}

/// Centre, and the stretch that turns a disc of radius 1 about it into the ellipse with the moments
/// of an outline.
#[derive(Clone, Copy)]
struct Stretch {
    middle_m: Vector2<f64>,
    of_disc: Matrix2<f64>,
}

impl Stretch {
    /// Returns the smooth outline through the points: after the stretch to a disc, the logarithm of
    /// the radius is a periodic spline of the angle. `None` if the points do not surround the
    /// centre.
    fn outline(&self, points: &[Vector2<f64>]) -> Option<Outline> {
        let back = self.of_disc.try_inverse()?;
        let polar = |point: &Vector2<f64>| {
            let on_disc = back * (point - self.middle_m);
            (on_disc.y.atan2(on_disc.x), on_disc.norm().max(1e-3).ln())
        };
        let spline = Periodic::through(points.iter().map(polar).collect())?;
        if spline.widest_gap() > PI - LEAST_RAD {
            return None;
        }
        let radius_m = |n: usize| {
            let on_disc = back * direction(n);
            spline.at(on_disc.y.atan2(on_disc.x)).exp() / on_disc.norm()
        };
        let outline = Outline {
            middle_m: self.middle_m,
            radii_m: (0..DIRECTIONS).map(radius_m).collect(),
        };
        outline.radii_m.iter().all(|r| r.is_finite()).then_some(outline)
    }

    /// Returns the stretch of an outline's area: its centre, and twice the root of its second
    /// moments. `None` for almost no area.
    fn of(outline: &Outline) -> Option<Self> {
        // In polar coordinates about the centre each direction is a thin triangle.
        let per = TAU / DIRECTIONS as f64;
        let (mut area_m2, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for (n, r) in outline.radii_m.iter().enumerate() {
            let out = direction(n);
            area_m2 += r.powi(2) / 2.0 * per;
            first += out * (r.powi(3) / 3.0 * per);
            second += out * out.transpose() * (r.powi(4) / 4.0 * per);
        }
        if area_m2 < LEAST_M2 {
            return None;
        }
        let off = first / area_m2;
        let moments = second / area_m2 - off * off.transpose();
        Some(Self {
            middle_m: outline.middle_m + off,
            of_disc: 2.0 * moments.cholesky()?.l(),
        })
    }
}

impl Outline {
    /// Returns the smooth line through these points, in any order; `None` for fewer than three, or
    /// if they enclose nothing. Five points or more of an ellipse give that ellipse.
    pub fn through(points_m: &[[f64; 2]]) -> Option<Self> {
        let points: Vec<Vector2<f64>> = points_m.iter().map(|p| Vector2::from(*p)).collect();
        let middle_m = points.iter().sum::<Vector2<f64>>() / points.len().max(1) as f64;
        let square_m2 = points.iter().map(|p| (p - middle_m).norm_squared()).sum::<f64>() / points.len().max(1) as f64;
        if square_m2 < LEAST_M2 {
            return None;
        }
        let first = Stretch {
            middle_m,
            of_disc: Matrix2::identity() * square_m2.sqrt(),
        };
        let mut outline = first.outline(&points)?;
        let rounds = if points.len() < OF_ELLIPSE { 1 } else { ROUNDS };
        for _ in 1..rounds {
            match Stretch::of(&outline).and_then(|stretch| stretch.outline(&points)) {
                Some(better) => outline = better,
                None => break,
            }
        }
        Stretch::of(&outline).is_some().then_some(outline)
    }

    /// Returns the points of the line, to the right and up in the plane, m.
    pub fn points_m(&self) -> impl Iterator<Item = Vector2<f64>> + '_ {
        let point = |(n, radius_m): (usize, &f64)| self.middle_m + direction(n) * *radius_m;
        self.radii_m.iter().enumerate().map(point)
    }

    /// Returns this number of its points, evenly about the centre.
    pub fn some_points_m(&self, count: usize) -> Vec<[f64; 2]> {
        let all: Vec<Vector2<f64>> = self.points_m().collect();
        (0..count).map(|n| all[n * DIRECTIONS / count.max(1)].into()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_M: [f64; 2] = [0.024, 0.018];

    fn point(deg: f64) -> [f64; 2] {
        let (sine, cosine) = deg.to_radians().sin_cos();
        [0.01 + HALF_M[0] * cosine, HALF_M[1] * sine - 0.02]
    }

    /// Returns the largest distance from the ellipse, as a share of its radius.
    fn off(outline: &Outline) -> f64 {
        let off = |p: Vector2<f64>| (((p.x - 0.01) / HALF_M[0]).hypot((p.y + 0.02) / HALF_M[1]) - 1.0).abs();
        outline.points_m().map(off).fold(0.0, f64::max)
    }

    #[test]
    fn six_clicks_in_any_order_are_the_ellipse_that_they_lie_on() {
        let clicked = [200.0, 10.0, 130.0, 75.0, 320.0, 260.0].map(point);
        let outline = Outline::through(&clicked).expect("six points");
        assert!((outline.middle_m - Vector2::new(0.01, -0.02)).norm() < 1e-6);
        assert!(off(&outline) < 1e-4, "{} of the radius", off(&outline));
        assert!(off(&Outline::through(&clicked[..5]).expect("five points")) < 0.02);
        // Too few for an ellipse: something round through them.
        let four = Outline::through(&[30.0, 110.0, 200.0, 300.0].map(point)).expect("four points");
        assert!(off(&four) < 0.25, "{}", off(&four));
        assert!(Outline::through(&clicked[..2]).is_none());
        assert!(Outline::through(&[[0.0; 2]; 6]).is_none(), "they enclose nothing");
        let line = [0.0, 1.0, 2.0, 3.0, 4.0].map(|n| [n * 5e-3, n * 2e-3]);
        assert!(Outline::through(&line).is_none(), "they lie on a line");
    }

    /// Tests a gland with a flat back: the line still goes through its clicks.
    #[test]
    fn the_outline_goes_through_its_clicks() {
        let clicked: Vec<[f64; 2]> = [10.0, 70.0, 130.0, 190.0, 230.0, 270.0, 310.0]
            .map(point)
            .map(|[x, y]| [x, y.max(-0.032)])
            .to_vec();
        let outline = Outline::through(&clicked).expect("seven points");
        let all: Vec<Vector2<f64>> = outline.points_m().collect();
        for click in clicked {
            let nearest = |p: &Vector2<f64>| (p - Vector2::from(click)).norm();
            let least = all.iter().map(nearest).fold(f64::INFINITY, f64::min);
            // Half the distance of two of its points.
            assert!(least < 1.0e-3, "{least} m");
        }
    }
}

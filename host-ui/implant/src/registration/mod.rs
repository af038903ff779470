//! The frame of found seeds, fitted to that of the plan: a rotation and a shift, with the seeds
//! paired one to one.
//!
//! Nearest pairs and the fit to them (Kabsch) alternate from several rotations; from the best one,
//! the pairs are those of least total square. An outlying pair does not pull the frame: a seed may
//! have been lost, or have migrated.

mod assign;

pub(crate) use assign::least_cost;

use crate::pairing;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// Initial rotations about each axis.
const STARTS_DEG: [f64; 4] = [-24.0, -12.0, 12.0, 24.0];
const ROUNDS: usize = 40;
/// Distance, in medians, beyond which pairs are excluded from the fit.
const FAR: f64 = 3.0;
/// Distance below which pairs always count, m.
const NEAR_M: f64 = 3e-3;
/// Fewest seeds that define a rotation.
const FEWEST: usize = 4;

/// Error of too few planned or found seeds for a rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a fit of frames needs {FEWEST} seeds or more on both sides, and there are {0} and {1}")]
pub struct FitError(usize, usize);

/// Transform from found to plan: `planned = rotation * found + shift`.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidFit {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Shift, in m.
    pub shift_m: Vector3<f64>,
    /// Found seed for each planned one.
    pub pairs: Vec<Option<usize>>,
    /// Distance of each pair after the fit, in m, in the order of the plan.
    pub residuals_m: Vec<f64>,
    /// Number of pairs in the fit.
    pub counted: usize,
    /// Extent of the found seeds over that of the plan, by their pairs: more than 1 in a swollen gland.
    pub stretch: f64,
}

impl RigidFit {
    /// Fits found places to those of a plan, m.
    pub fn of(planned_m: &[[f64; 3]], found_m: &[[f64; 3]]) -> Result<Self, FitError> {
        if planned_m.len() < FEWEST || found_m.len() < FEWEST {
            return Err(FitError(planned_m.len(), found_m.len()));
        }
        let planned: Vec<Vector3<f64>> = planned_m.iter().map(|p| Vector3::from(*p)).collect();
        let found: Vec<Vector3<f64>> = found_m.iter().map(|p| Vector3::from(*p)).collect();
        let turns = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()]
            .into_iter()
            .flat_map(|axis| STARTS_DEG.into_iter().map(move |deg| turn(&axis, deg)));
        let nearest = |moved: &[Vector3<f64>]| {
            let moved: Vec<[f64; 3]> = moved.iter().map(|p| (*p).into()).collect();
            pairing::nearest(planned_m, &moved)
        };
        let optimal = |moved: &[Vector3<f64>]| {
            let cost = |p: usize, f: usize| (planned[p] - moved[f]).norm_squared();
            least_cost(planned.len(), moved.len(), &cost)
        };
        let starts = std::iter::once(Matrix3::identity()).chain(turns);
        let fits = starts.map(|rotation| {
            let shift_m = middle(&planned) - rotation * middle(&found);
            alternate(&planned, &found, (rotation, shift_m), &nearest)
        });
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, frame)| frame);
        let start = best.unwrap_or((Matrix3::identity(), Vector3::zeros()));
        let (_, (rotation, shift_m)) = alternate(&planned, &found, start, &optimal);
        let moved: Vec<Vector3<f64>> = found.iter().map(|p| rotation * p + shift_m).collect();
        let pairs = optimal(&moved);
        let places = pairs_of(&planned, &moved, &pairs);
        let counted = near(&places);
        Ok(Self {
            rotation,
            shift_m,
            residuals_m: places.iter().map(|(p, f)| (p - f).norm()).collect(),
            counted: counted.len(),
            stretch: stretch(&counted),
            pairs,
        })
    }

    /// Returns a found place in the frame of the plan, m.
    pub fn place_m(&self, found_m: [f64; 3]) -> [f64; 3] {
        (self.rotation * Vector3::from(found_m) + self.shift_m).into()
    }

    /// Returns a found direction in the frame of the plan.
    pub fn direction(&self, found: [f64; 3]) -> [f64; 3] {
        (self.rotation * Vector3::from(found)).into()
    }

    /// Returns the angle of the rotation, in degrees.
    pub fn turn_deg(&self) -> f64 {
        // By sine and cosine: rounding can take the cosine of the identity beyond 1, for which no
        // angle exists, and near it the angle loses its digits.
        let r = &self.rotation;
        let twice_sine = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12).norm();
        twice_sine.atan2(r.trace() - 1.0).to_degrees()
    }

    /// Returns mean, root mean square and largest residual, m.
    pub fn residual_figures_m(&self) -> [f64; 3] {
        let count = self.residuals_m.len().max(1) as f64;
        let mean = self.residuals_m.iter().sum::<f64>() / count;
        let square = self.residuals_m.iter().map(|r| r * r).sum::<f64>() / count;
        [
            mean,
            square.sqrt(),
            self.residuals_m.iter().copied().fold(0.0, f64::max),
        ]
    }
}

type Frame = (Matrix3<f64>, Vector3<f64>);
type Places = Vec<(Vector3<f64>, Vector3<f64>)>;
type Pairing<'a> = &'a dyn Fn(&[Vector3<f64>]) -> Vec<Option<usize>>;

/// Alternates pairs and fits until both are stable; returns the mean square of the pairs, and the
/// frame.
fn alternate(planned: &[Vector3<f64>], found: &[Vector3<f64>], start: Frame, pairing: Pairing) -> (f64, Frame) {
    let (mut frame, mut before) = (start, Vec::new());
    let mut square = f64::INFINITY;
    for _ in 0..ROUNDS {
        let moved: Vec<Vector3<f64>> = found.iter().map(|p| frame.0 * p + frame.1).collect();
        let pairs = pairing(&moved);
        let places = pairs_of(planned, &moved, &pairs);
        square = places.iter().map(|(p, f)| (p - f).norm_squared()).sum::<f64>() / places.len().max(1) as f64;
        let (rotation, shift_m) = kabsch(&near(&places));
        frame = (rotation * frame.0, rotation * frame.1 + shift_m);
        let rests = (rotation - Matrix3::identity()).norm() < 1e-9 && shift_m.norm() < 1e-9;
        if rests && pairs == before {
            break;
        }
        before = pairs;
    }
    (square, frame)
}

fn pairs_of(planned: &[Vector3<f64>], moved: &[Vector3<f64>], pairs: &[Option<usize>]) -> Places {
    let place = |(p, f): (&Vector3<f64>, &Option<usize>)| Some((*p, moved[(*f)?]));
    planned.iter().zip(pairs).filter_map(place).collect()
}

/// Returns the pairs without outliers.
fn near(places: &Places) -> Places {
    let mut distances: Vec<f64> = places.iter().map(|(p, f)| (p - f).norm()).collect();
    distances.sort_by(f64::total_cmp);
    let most = (FAR * distances.get(distances.len() / 2).copied().unwrap_or(0.0)).max(NEAR_M);
    places.iter().copied().filter(|(p, f)| (p - f).norm() <= most).collect()
}

/// Returns the rotation and shift that bring the second of each pair nearest to the first (Kabsch,
/// Acta Cryst. A32, 922, 1976).
fn kabsch(places: &Places) -> Frame {
    let (to, from) = middles(places);
    let spread: Matrix3<f64> = places.iter().map(|(p, f)| (f - from) * (p - to).transpose()).sum();
    let svd = spread.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return (Matrix3::identity(), to - from);
    };
    let v = v_t.transpose();
    let sign = (v * u.transpose()).determinant().signum();
    let rotation = v * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * u.transpose();
    (rotation, to - rotation * from)
}

fn stretch(places: &Places) -> f64 {
    let (to, from) = middles(places);
    let (inner, square) = places.iter().fold((0.0, 0.0), |(inner, square), (p, f)| {
        (inner + (p - to).dot(&(f - from)), square + (p - to).norm_squared())
    });
    inner / square.max(f64::MIN_POSITIVE)
}

fn middles(places: &Places) -> (Vector3<f64>, Vector3<f64>) {
    let count = places.len().max(1) as f64;
    let sum = places
        .iter()
        .fold((Vector3::zeros(), Vector3::zeros()), |(a, b), (p, f)| (a + p, b + f));
    (sum.0 / count, sum.1 / count)
}

fn middle(places: &[Vector3<f64>]) -> Vector3<f64> {
    places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64
}

fn turn(axis: &Unit<Vector3<f64>>, deg: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(axis, deg.to_radians()).into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns strands with seeds every 10 mm, which fit onto themselves shifted by one seed almost
    /// as well.
    fn plan() -> Vec<[f64; 3]> {
        let holes = [
            (-15.0, -10.0),
            (-15.0, 5.0),
            (-5.0, 12.0),
            (0.0, -12.0),
            (6.0, 11.0),
            (15.0, -8.0),
            (16.0, 4.0),
            (5.0, 0.0),
        ];
        let seeds = |(n, (x, y)): (usize, (f64, f64))| {
            let count = 3 + n % 3;
            (0..count).map(move |s| [x, y, 10.0 * s as f64 - 5.0 * (count as f64 - 1.0)].map(|v| v * 1e-3))
        };
        holes.into_iter().enumerate().flat_map(seeds).collect()
    }

    #[test]
    fn a_moved_implant_is_fitted_despite_errors_and_losses() {
        let planned = plan();
        let rotation = turn(&Unit::new_normalize(Vector3::new(1.0, -0.4, 0.7)), 14.0);
        let shift = Vector3::new(0.021, -0.034, 0.113);
        let error = |n: usize| Vector3::from([0.4, 1.3, 2.9].map(|f: f64| 1.2e-3 * (n as f64 * 7.1 * f).sin()));
        let mut found: Vec<[f64; 3]> = planned
            .iter()
            .enumerate()
            .map(|(n, p)| (rotation.transpose() * (Vector3::from(*p) + error(n) - shift)).into())
            .collect();
        // One was lost, one has migrated.
        found.remove(5);
        found[9][1] += 0.06;
        found.reverse();
        let fit = RigidFit::of(&planned, &found).unwrap();
        assert!(
            (fit.rotation.transpose() * rotation - Matrix3::identity()).norm() < 0.06,
            "{}",
            fit.rotation
        );
        assert!((fit.turn_deg() - 14.0).abs() < 2.0, "{}", fit.turn_deg());
        assert_eq!(fit.pairs.iter().flatten().count(), planned.len() - 1);
        let [mean, _, worst] = fit.residual_figures_m();
        assert!(mean < 4e-3 && worst > 0.05, "{mean} {worst}");
        assert!((fit.stretch - 1.0).abs() < 0.03, "{}", fit.stretch);
        assert!(fit.counted >= planned.len() - 3);
    }

    /// Checks that the extent of the seeds shows the edema.
    #[test]
    fn a_swollen_implant_shows_its_stretch() {
        let planned = plan();
        let found: Vec<[f64; 3]> = planned.iter().map(|p| p.map(|v| 1.1 * v + 0.01)).collect();
        let fit = RigidFit::of(&planned, &found).unwrap();
        assert!((fit.stretch - 1.1).abs() < 1e-6, "{}", fit.stretch);
        assert!(RigidFit::of(&planned, &found[..3]).is_err());
    }

    /// Guards against "NaN" degrees on the page when day 30 lay as planned.
    #[test]
    fn small_and_zero_rotations_have_exact_angles() {
        let planned = plan();
        let mut fit = RigidFit::of(&planned, &planned).unwrap();
        assert!(fit.turn_deg() < 1e-6, "{}", fit.turn_deg());
        // The rounding error of a product of rotations.
        fit.rotation = Matrix3::identity() * (1.0 + 4.0 * f64::EPSILON);
        assert_eq!(fit.turn_deg(), 0.0);
        for deg in [1e-7, 0.3, 90.0, 179.0] {
            fit.rotation = turn(&Vector3::y_axis(), deg);
            assert!((fit.turn_deg() / deg - 1.0).abs() < 1e-6, "{deg}: {}", fit.turn_deg());
        }
    }
}

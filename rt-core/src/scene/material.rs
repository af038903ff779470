//! What a structure may be made of: stiffness that exists, and limits under which no cell folds over.

use super::{SceneProblem, Structure};
use crate::tissue::AxisLimits;

/// Largest Poisson's ratio that the solvers take: 0.5 would need a pressure of its own.
pub(super) const MAX_POISSON: f64 = 0.499;
/// Above bone and steel, a number that is most likely in the wrong unit.
const MAX_YOUNG_PA: f64 = 1e12;
/// Angles are given to a thousandth of a degree; the paper's 26.565 deg lie on the edge of the condition below.
const FOLD_TOLERANCE: f64 = 1e-4;

/// Everything wrong with the material of one structure.
pub(super) fn problems_of(structure: &Structure) -> Vec<SceneProblem> {
    let mut found = Problems {
        structure: &structure.name,
        found: Vec::new(),
    };
    let material = &structure.material;
    let young_pa = material.young_pa;
    found.unless(
        young_pa > 0.0 && young_pa <= MAX_YOUNG_PA,
        "young_pa",
        young_pa,
        "above 0 and at most 1e12 Pa",
    );
    let poisson = material.poisson;
    found.unless(
        (0.0..=MAX_POISSON).contains(&poisson),
        "poisson",
        poisson,
        "from 0 to 0.499",
    );
    if let Some(limits) = &material.limits {
        for (axis, limits) in ["x", "y", "z"].into_iter().zip(limits) {
            found.axis(axis, limits);
        }
        found.folds(limits.map(|axis| axis.shear_deg));
    }
    found.found
}

struct Problems<'a> {
    structure: &'a str,
    found: Vec<SceneProblem>,
}

impl Problems<'_> {
    fn unless(&mut self, holds: bool, what: &str, value: f64, limit: &'static str) {
        if !holds {
            self.found.push(SceneProblem::Material {
                structure: self.structure.to_owned(),
                what: what.to_owned(),
                value,
                limit,
            });
        }
    }

    fn axis(&mut self, axis: &str, limits: &AxisLimits) {
        let (min, max) = (limits.min_stretch, limits.max_stretch);
        let name = |what: &str| format!("{what} along {axis}");
        self.unless(
            min > 0.0 && min <= 1.0,
            &name("min_stretch"),
            min,
            "above 0 and at most 1",
        );
        self.unless((1.0..=100.0).contains(&max), &name("max_stretch"), max, "from 1 to 100");
        if min > max {
            self.unless(false, &name("min_stretch"), min, "at most max_stretch");
        }
        let shear = limits.shear_deg;
        self.unless(
            (0.0..90.0).contains(&shear),
            &name("shear_deg"),
            shear,
            "from 0 to below 90",
        );
    }

    /// Eq. 1 for each pair of axes; then the same for all three: three links sheared against each other by the
    /// tangents t span a volume of at least 1 - (tx ty + ty tz + tz tx) - 2 tx ty tz.
    fn folds(&mut self, shear_deg: [f64; 3]) {
        if !shear_deg.iter().all(|angle| (0.0..90.0).contains(angle)) {
            return;
        }
        let before = self.found.len();
        for (a, b, axes) in [(0, 1, "x and y"), (1, 2, "y and z"), (2, 0, "z and x")] {
            let sum = shear_deg[a] + shear_deg[b];
            let what = format!("sum of shear_deg along {axes}");
            self.unless(sum < 90.0, &what, sum, "below 90 (eq. 1), or cells fold over");
        }
        if self.found.len() > before {
            return;
        }
        let [x, y, z] = shear_deg.map(|angle| angle.to_radians().tan());
        let folded = x * y + y * z + z * x + 2.0 * x * y * z;
        self.unless(
            folded <= 1.0 + FOLD_TOLERANCE,
            "tx ty + ty tz + tz tx + 2 tx ty tz of the tangents of its shear_deg",
            folded,
            "at most 1 (eq. 1 in three dimensions), or cells fold over",
        );
    }
}

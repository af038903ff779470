//! Validation of a structure's material: stiffness that exists, and limits under which no cell folds over.

use super::problem::SceneProblem;
use super::structure::Structure;
use crate::limits::{AxisLimits, folding};

/// Largest Poisson's ratio, the same for who writes a scene.
pub(super) const MAX_POISSON: f64 = stylet_anatomy::Material::MAX_POISSON;
/// Above bone and steel, a number that is most likely in the wrong unit.
const MAX_YOUNG_PA: f64 = 1e12;

/// Returns everything wrong with the material of one structure.
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

/// Finds a corner that folds where three links of different structures meet: the widest angle along each axis must not
/// fold it. Structures under the operator's limits are not counted; those are not known here.
pub(super) fn folding_between(structures: &[Structure]) -> Option<SceneProblem> {
    let own = structures
        .iter()
        .filter(|s| !s.material.fixed)
        .filter_map(|s| s.material.limits.as_ref());
    let angles: Vec<[f64; 3]> = own.map(|l| l.each_ref().map(|axis| axis.shear_deg)).collect();
    let widest = [0, 1, 2].map(|a| angles.iter().map(|angle| angle[a]).fold(0.0, f64::max));
    let is_reported_already = angles
        .iter()
        .any(|&angle| folding(angle).is_nan() || folding(angle) > 1.0);
    (!is_reported_already && folding(widest) > 1.0).then(|| SceneProblem::Material {
        structure: "all structures together".to_owned(),
        what: "tx ty + ty tz + tz tx + 2 tx ty tz of the widest shear_deg along each axis".to_owned(),
        value: folding(widest),
        limit: "at most 1 (eq. 1 in three dimensions), or cells between structures fold over",
    })
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

    /// Checks eq. 1 in three dimensions, which implies eq. 1 for each pair of axes.
    fn folds(&mut self, shear_deg: [f64; 3]) {
        if shear_deg.iter().all(|angle| (0.0..90.0).contains(angle)) {
            self.unless(
                folding(shear_deg) <= 1.0,
                "tx ty + ty tz + tz tx + 2 tx ty tz of the tangents of its shear_deg",
                folding(shear_deg),
                "at most 1 (eq. 1 in three dimensions), or cells fold over",
            );
        }
    }
}

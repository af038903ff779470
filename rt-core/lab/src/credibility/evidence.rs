//! Evidence by the categories of the FDA's guidance and the factors of ASME V&V 40, present and missing.

use serde::Serialize;

/// One of the eight categories of "Assessing the Credibility of Computational Modeling and Simulation in Medical Device
/// Submissions" (FDA, November 2023).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Category {
    pub number: u32,
    pub name: &'static str,
    /// Evidence, each with its place in the repository.
    pub there: &'static [(&'static str, &'static str)],
    /// Empty if nothing is known to be missing.
    pub missing: &'static str,
}

/// One credibility factor of ASME V&V 40-2018.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Factor {
    pub activity: &'static str,
    pub name: &'static str,
    pub what: &'static str,
}

pub const CATEGORIES: &[Category] = &[
    Category {
        number: 1,
        name: "Code verification results",
        there: &[
            (
                "finite elements against kept solutions of another solver, a dense solver, closed forms",
                "rt-core/sim/src/tissue/fem/tests",
            ),
            (
                "needle line against Kelvin, Hetenyi and the cantilever",
                "rt-core/sim/src/line",
            ),
            (
                "dose against an independent evaluation of TG-43U1, histograms against closed forms",
                "tests/dose/src",
            ),
            (
                "readers under a fuzzer and a corpus of damaged files",
                "tests/files/src/corpus.rs",
            ),
        ],
        missing: "The independent solutions were made by this project's authors with other programs, not by a third party.",
    },
    Category {
        number: 2,
        name: "Model calibration evidence",
        there: &[(
            "every parameter with unit, limits and its source in the literature",
            "shm-schema/settings/src/table.rs",
        )],
        missing: "Parameters come from publications. None was fitted to measurements of this project.",
    },
    Category {
        number: 3,
        name: "Bench test validation results",
        there: &[("times of the loops on this PC", "rt-core latency")],
        missing: "No force or displacement was compared with a needle in a phantom.",
    },
    Category {
        number: 4,
        name: "In vivo validation results",
        there: &[],
        missing: "None.",
    },
    Category {
        number: 5,
        name: "Population-based validation results",
        there: &[(
            "studies of thousands of simulated insertions beside published forces and shifts",
            "docs/study.md",
        )],
        missing: "Simulated populations were compared with published figures, not with data of a population.",
    },
    Category {
        number: 6,
        name: "Emergent model behavior",
        there: &[
            (
                "the gland moves until its membrane gives way; force drops at puncture and turns on reversal",
                "tests/physics/src/needle.rs",
            ),
            (
                "seeds end off plan by the motion of the gland",
                "tests/tests/system/insertion.rs",
            ),
        ],
        missing: "",
    },
    Category {
        number: 7,
        name: "Model plausibility",
        there: &[
            ("equations, their sources and their limits", "docs/physics.md"),
            ("decisions with the reasons for and against", "docs/adr"),
        ],
        missing: "The tissue is linear and elastic; large strain, pressure of blood and bleeding are left out.",
    },
    Category {
        number: 8,
        name: "Calculation verification and UQ results using COU simulations",
        there: &[
            (
                "speed against error of every model at three spacings, distance from the converged solution",
                "benches/runs",
            ),
            (
                "hard cases of every model, those that are not met included",
                "docs/stability.md",
            ),
            (
                "half the tick and half the spacing in the contact of the needle",
                "rt-core/sim/src/line/contact/tests.rs",
            ),
            (
                "uncertainty of placement carried to dose metrics",
                "host-ui/dose/src/perturb",
            ),
        ],
        missing: "The distance to the continuum is not part of the reported error; parameters are varied in studies, not in every run.",
    },
];

const CODE: &str = "Verification: code";
const CALCULATION: &str = "Verification: calculation";
const MODEL: &str = "Validation: computational model";
const COMPARATOR: &str = "Validation: comparator";
const ASSESSMENT: &str = "Validation: assessment";
const APPLICABILITY: &str = "Applicability";

pub const FACTORS: &[Factor] = &[
    Factor {
        activity: CODE,
        name: "Software quality assurance",
        what: "Tests of every requirement run on each change; walls between crates are tests; each fixed bug has its test.",
    },
    Factor {
        activity: CODE,
        name: "Numerical code verification",
        what: "Against independent solutions and closed forms (category 1); the order of convergence is not estimated for every element.",
    },
    Factor {
        activity: CALCULATION,
        name: "Discretization error",
        what: "Three spacings against the converged solution on each lattice (category 8).",
    },
    Factor {
        activity: CALCULATION,
        name: "Numerical solver error",
        what: "Residual of each step bounded and reported; single against double precision.",
    },
    Factor {
        activity: CALCULATION,
        name: "Use error",
        what: "Every input is validated with all problems named; reports hold command, settings and digests of programs.",
    },
    Factor {
        activity: MODEL,
        name: "Model form",
        what: "Two tissue models answer the same sessions and are compared with each other.",
    },
    Factor {
        activity: MODEL,
        name: "Model inputs",
        what: "Sources in the table of parameters; sensitivity by studies; no calibration of this project's own.",
    },
    Factor {
        activity: COMPARATOR,
        name: "Test samples",
        what: "None: there is no physical comparator yet.",
    },
    Factor {
        activity: COMPARATOR,
        name: "Test conditions",
        what: "None: there is no physical comparator yet.",
    },
    Factor {
        activity: ASSESSMENT,
        name: "Equivalency of input parameters",
        what: "Published insertions are repeated with their speed, needle and depth where the publication gives them.",
    },
    Factor {
        activity: ASSESSMENT,
        name: "Output comparison",
        what: "Ranges of force and shift beside published ones; no rigorous comparison with uncertainty of both sides.",
    },
    Factor {
        activity: APPLICABILITY,
        name: "Relevance of the quantities of interest",
        what: "Force at the hand, puncture, shift and dose are those that the trainee and the researcher see.",
    },
    Factor {
        activity: APPLICABILITY,
        name: "Relevance of the validation activities to the COU",
        what: "Published data are of phantoms, animals and patients other than the scenes; a user must judge the distance.",
    },
];

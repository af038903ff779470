//! Hazards: sources of harm, situations, and harms.

use serde::Serialize;

/// Hazard in the words of ISO 14971: hazard, situation, harm.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Hazard {
    pub id: &'static str,
    pub hazard: &'static str,
    pub situation: &'static str,
    pub harm: &'static str,
}

pub const HAZARDS: &[Hazard] = &[
    Hazard {
        id: "HAZ-01",
        hazard: "force above what the device or the hand can bear",
        situation: "the model or its parameters ask for it, or a value is no number",
        harm: "bruised hand, damaged device",
    },
    Hazard {
        id: "HAZ-02",
        hazard: "force that goes on after a failure",
        situation: "a loop stops, a program crashes, the tissue is late",
        harm: "the hand is pushed by an old force",
    },
    Hazard {
        id: "HAZ-03",
        hazard: "vibration of the rendered contact",
        situation: "stiff tissue, late ticks, a loose or a tight grip",
        harm: "the hand is shaken; the operator learns a false feel",
    },
    Hazard {
        id: "HAZ-04",
        hazard: "hot motors",
        situation: "a large force is held for long",
        harm: "damaged device, loss of force",
    },
    Hazard {
        id: "HAZ-05",
        hazard: "force and motion of tissue that are not those of the model",
        situation: "an error of code or of the solution",
        harm: "a wrong habit, a wrong conclusion of a study",
    },
    Hazard {
        id: "HAZ-06",
        hazard: "wrong dose",
        situation: "an error in kernel, grid, histogram or source data",
        harm: "a wrong lesson about a plan, a wrong conclusion of a study",
    },
    Hazard {
        id: "HAZ-07",
        hazard: "wrong place",
        situation: "an image is read with another orientation or spacing, or frames of reference are confused",
        harm: "needle, gland and dose do not belong together",
    },
    Hazard {
        id: "HAZ-08",
        hazard: "invalid data",
        situation: "a damaged or hostile file, a faulty host in shared memory",
        harm: "a crash with force on, or a figure made of nonsense",
    },
    Hazard {
        id: "HAZ-09",
        hazard: "records that are lost, altered or not repeatable",
        situation: "a slow disk, an edited report, a result that depends on timing",
        harm: "evidence that does not show what it says",
    },
    Hazard {
        id: "HAZ-10",
        hazard: "use as a medical device",
        situation: "a plan or dose of Stylet reaches a treatment",
        harm: "a patient is treated by figures that nobody has validated",
    },
];

//! A needle that holds a patch of tissue and slips by eq. 6, as off its line: the patch of each tick, and the converged
//! answer to it.

use stylet_sim::needle::{NeedleParameters, Phase, transmission};
use stylet_sim::scene::Lattice;
use stylet_sim::tissue::Held;
use stylet_sim::tissue::fem::{self, FemModel, FemState, SolveSettings};
use stylet_sim::tissue::{Carried, Deformed, element_ahead};

/// Period of the tissue loop.
pub const PERIOD_S: f64 = 5e-3;
/// Edge of the patch that the loop holds with finite elements.
pub const PATCH_M: f64 = 4e-3;
/// Insertion at the average speed in patients; 123 and 280 mm/s are the mean maximum and the maximum.
pub const STRAIGHT: Way = Way {
    direction: [0.0, 0.0, 1.0],
    speed_m_per_s: 0.05,
};
/// Ticks of the approach before the needle meets the gland.
const APPROACH: usize = 10;

/// Patch held in one tick, and the one that the tip reaches next on a straight path.
pub struct PatchTick {
    /// Present patch.
    pub held: Option<Held>,
    /// Patch that work ahead prepares.
    pub next: Option<Held>,
    /// Displacement of the held patch from rest.
    pub by_m: f64,
}

/// Path of a needle through the gland.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// Unit vector.
    pub direction: [f64; 3],
    /// Speed along it.
    pub speed_m_per_s: f64,
}

/// From before the apex to `depth_m` in it: the tissue follows up to puncture, then as paper eq. 6 says.
pub fn insertion(lattice: &Lattice, way: Way, depth_m: f64) -> Vec<PatchTick> {
    let Way {
        direction,
        speed_m_per_s,
    } = way;
    let needle = NeedleParameters::default();
    let (low, high) = lattice.bounds_m();
    let at = |t: f64, start: [f64; 3]| [0, 1, 2].map(|a| start[a] + t * direction[a]);
    let mut entry = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
    while element_at(lattice, at(-1e-4, entry)).is_some() {
        entry = at(-1e-4, entry);
    }
    let step_m = speed_m_per_s * PERIOD_S;
    let patch = |element: u32, by_m: f64| Held {
        element,
        position_m: at(by_m, lattice.rest_m(element)),
        patch_m: PATCH_M,
    };
    // The loop's prediction, not the script's future. The body moves with the patch: relative to it, at rest.
    let still = vec![0.0; lattice.element_count()];
    let rest = Deformed {
        lattice,
        u: [&still, &still, &still],
        scale: 1.0,
        carried: Carried::Not,
        reach: 1.0,
    };
    let ahead = |rest_m: f64, now: Option<u32>, by_m: f64| {
        let next = element_ahead(&rest, now, at(rest_m, entry), direction.map(|d| d * step_m));
        next.map(|element| patch(element, by_m))
    };
    let mut ticks = Vec::new();
    for n in (1..=APPROACH).rev() {
        ticks.push(PatchTick {
            held: None,
            next: ahead(-(n as f64) * step_m, None, step_m),
            by_m: 0.0,
        });
    }
    let mut by_m = 0.0;
    for n in 1..=(depth_m / step_m) as usize {
        let tip_m = n as f64 * step_m;
        let phase = if tip_m <= needle.puncture_depth_m {
            Phase::Contraction
        } else {
            Phase::Penetration
        };
        let follows_m = step_m * transmission(phase, speed_m_per_s, tip_m, &needle);
        by_m += follows_m;
        let Some(element) = element_at(lattice, at(tip_m - by_m, entry)) else {
            break;
        };
        ticks.push(PatchTick {
            held: Some(patch(element, by_m)),
            next: ahead(tip_m - by_m, Some(element), by_m + follows_m),
            by_m,
        });
    }
    ticks
}

fn element_at(lattice: &Lattice, place_m: [f64; 3]) -> Option<u32> {
    let [i, j, k] = place_m.map(|c| (c / lattice.spacing_m).floor() as usize);
    lattice.element_of_cell(i, j, k)
}

/// Converged body after a tick.
pub struct Solved {
    /// Displacement of every element along x, y, z, in elements.
    pub displacement: [Vec<f32>; 3],
    /// Force of the tip on the tissue.
    pub tip_force_n: [f64; 3],
}

/// Solves the body after each tick to the end in f64.
///
/// # Panics
///
/// If a tick does not converge.
pub fn converged(model: &FemModel<f64>, ticks: &[PatchTick], settings: &SolveSettings) -> Vec<Solved> {
    let mut state = FemState::at_rest(model);
    let solved = ticks.iter().map(|tick| {
        let report = fem::step(model, &mut state, tick.held, settings);
        assert!(report.converged, "{report:?}");
        Solved {
            displacement: [0, 1, 2].map(|a| state.displacement(a).to_vec()),
            tip_force_n: report.tip_force_n,
        }
    });
    solved.collect()
}

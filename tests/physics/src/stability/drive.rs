//! Drives a tissue model through a script and checks every tick: finite, unfolded, residual, at rest.

use stylet_sim::tissue::{Deformed, Held, HeldOutcome, TissueModel};

/// Observations over a whole run.
#[derive(Clone, Debug)]
pub struct Seen {
    pub finite: bool,
    /// Smallest corner volume of an element, relative to rest; not above zero is folded.
    pub least_corner: f64,
    pub worst_residual: f64,
    pub unconverged: u32,
    pub refused: u32,
    pub limited: u32,
    /// Largest displacement of an element, in elements.
    pub farthest: f64,
    /// Largest growth of that displacement from one tick to the next while nothing was held, in elements.
    pub grew_free: f64,
}

/// Takes `ticks` steps; calls `held` before each.
pub fn drive(
    model: &mut dyn TissueModel,
    ticks: u32,
    dt_s: f64,
    mut held: impl FnMut(u32, &Deformed) -> Option<Held>,
) -> Seen {
    let mut seen = Seen {
        finite: true,
        least_corner: f64::INFINITY,
        worst_residual: 0.0,
        unconverged: 0,
        refused: 0,
        limited: 0,
        farthest: 0.0,
        grew_free: 0.0,
    };
    let mut before = farthest(&model.deformed());
    for tick in 0..ticks {
        let now = held(tick, &model.deformed());
        let report = model.step(now, dt_s);
        let body = model.deformed();
        let after = farthest(&body);
        if now.is_none() {
            seen.grew_free = seen.grew_free.max(after - before);
        }
        before = after;
        let refused = report.held == HeldOutcome::Refused;
        seen.finite &= after.is_finite() && (refused || report.residual.is_finite());
        seen.farthest = seen.farthest.max(after);
        if !refused {
            seen.worst_residual = seen.worst_residual.max(report.residual);
            seen.unconverged += u32::from(!report.converged);
        }
        seen.refused += u32::from(refused);
        seen.limited += u32::from(report.held == HeldOutcome::Limited);
        if tick % 8 == 0 || tick + 1 == ticks {
            seen.least_corner = seen.least_corner.min(least_corner(&body));
        }
    }
    seen
}

/// Returns the largest displacement of an element; infinite if one is not finite.
pub fn farthest(body: &Deformed) -> f64 {
    let elements = 0..body.lattice.element_count() as u32;
    let lengths = elements.map(|e| body.displacement(e).iter().map(|c| c * c).sum::<f64>().sqrt());
    lengths.fold(
        0.0,
        |most: f64, u| if u.is_finite() { most.max(u) } else { f64::INFINITY },
    )
}

/// Returns the smallest corner volume of an element over all eight corners: that spanned by its links to three
/// neighbours, one along each axis.
fn least_corner(body: &Deformed) -> f64 {
    let mut least = f64::INFINITY;
    for element in 0..body.lattice.element_count() as u32 {
        let around = body.lattice.neighbours(element);
        let here = body.displacement(element);
        for corner in 0..8 {
            let side = [corner & 1, corner >> 1 & 1, corner >> 2];
            let links = [0, 1, 2].map(|a| {
                let there = body.displacement(around[2 * a + side[a]]?);
                let sign = if side[a] == 1 { 1.0 } else { -1.0 };
                let mut link = [0, 1, 2].map(|c| sign * (there[c] - here[c]));
                link[a] += 1.0;
                Some(link)
            });
            if let [Some(x), Some(y), Some(z)] = links {
                least = least.min(determinant(x, y, z));
            }
        }
    }
    least
}

fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

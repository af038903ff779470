//! ChainMail on the path of a session with nothing left to do in any tick: the columns of the coarser body solved
//! to the end, and limits met as far as f32 has them. Shipped models are compared with that, in addition to the
//! comparison with finite elements.

use crate::error::{Field, field};
use crate::twin::{Twin, TwinSettings, default_forces};
use stylet_sim::limits::TissueParameters;
use stylet_sim::line::{HandLine, StationSettings};
use stylet_sim::scene::{SceneSource, TissueKind};
use stylet_sim::tissue::{Carry, ChainMailTissue, Held, MaterialPoint, Shift, TissueModel, TissueSpec, least_corner};

/// Steps of one tick at most, each as many passes as what ships has for a tick.
const MOST_STEPS: u32 = 20;
/// Ticks' worth of large strain near the tip at most: it rests by then.
const MOST_CALLS: usize = 60;
/// The finest tolerance that limits are met to, in elements.
const FINEST: f64 = 1e-4;

/// The converged twin of a ChainMail session.
pub struct OwnTwin {
    /// Its line: contact, friction and membranes, as in the force loop.
    pub line: Twin,
    tissue: ChainMailTissue,
    period_s: f64,
}

impl OwnTwin {
    /// Runs next to a line that ships.
    ///
    /// # Panics
    ///
    /// If the scene's ChainMail has no lines.
    pub fn of(source: &SceneSource, like: &HandLine, tolerance: f64, period_s: f64) -> Self {
        let scene = source.build().expect("built in").for_tissue(TissueKind::ChainMail);
        let coarse = scene.clone().for_lines(TissueKind::ChainMail).expect("has lines");
        let settings = TwinSettings {
            stations: StationSettings::of_lattice(coarse.body.spacing_m),
            most: like.source().stations(),
            tolerance,
            whole_of: None,
        };
        let mut line = Twin::of::<f64>(&coarse, like, settings);
        line.hand.reset();
        line.hand.set_forces(&default_forces());
        let limits = TissueParameters {
            residual_tolerance: FINEST,
            ..TissueParameters::default()
        };
        OwnTwin {
            line,
            tissue: ChainMailTissue::new(&scene, limits.validate().expect("valid")),
            period_s,
        }
    }

    /// Advances the tissue loop by one tick, after the line has had those of the force loop: until nothing is left to
    /// move, and large strain near the tip until it rests. The first step recovers by the period.
    pub fn step(&mut self) {
        let held = held(&self.tissue, &self.line.hand);
        let axis = self.line.hand.line().axes[0];
        self.tissue.carry(Carry {
            columns: self.line.columns(),
            loads_n: self.line.hand.state().loads_n(),
            shift: Shift::of_all(axis.map(|c| c * self.line.hand.whole_m())),
            fields: &[],
        });
        for step in 0..MOST_STEPS {
            let report = self.tissue.step(held, if step == 0 { self.period_s } else { 0.0 });
            if report.converged && report.passes == 0 {
                break;
            }
        }
        if let Some(Held { element, .. }) = held {
            let least = least_corner(&self.tissue.deformed(), element);
            for _ in 0..MOST_CALLS {
                if !self.tissue.unfold(element, least) {
                    break;
                }
            }
        }
    }

    /// Returns the displacements now, m.
    pub fn field(&self) -> Field {
        field(&self.tissue.deformed())
    }
}

/// Returns what the tissue loop holds: the material at the tip, at its place on the line.
fn held(tissue: &ChainMailTissue, hand: &HandLine) -> Option<Held> {
    let (line, along_m) = (hand.line(), hand.state().tip().material_m);
    if !hand.is_in_tissue() || !along_m.is_finite() {
        return None;
    }
    let body = &tissue.model.lattice();
    let element = MaterialPoint::at_rest(body, line.point_m(along_m.max(0.0), [0.0; 2]))?.element;
    let (rest_m, by_m) = (body.rest_m(element), hand.tip_displacement_m());
    Some(Held {
        element,
        position_m: [0, 1, 2].map(|a| rest_m[a] + by_m * line.axes[0][a]),
        patch_m: TissueSpec::from(TissueKind::ChainMail).tip_patch_m,
    })
}

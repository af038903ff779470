//! Model of a needle on its line: built once, never changed.

use super::compliance::Compliance;
use super::prony::PronyTerm;
use crate::settings::{Problem, Problems};
use crate::simd::Simd;

/// Stations of one line at most.
pub const MAX_STATIONS: usize = 128;
/// Layers of one line at most.
pub const MAX_LAYERS: usize = 16;
/// Stations that the tip's load may be spread over.
const MAX_TIP_STATIONS: f64 = 24.0;

/// Tissue from one place on the line to the next layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLayer {
    /// Beginning along the line at rest, from the entry.
    pub from_m: f64,
    /// Force at which its membrane gives way; 0 for tissue without one.
    pub puncture_force_n: f64,
    /// Largest distance that the membrane may be pushed from rest; it gives way at whichever comes first. Infinite to
    /// go by force alone.
    pub puncture_depth_m: f64,
    /// Force at the tip that separates tissue, N; none in a track. The wedge of [`Compliance::wedge_n`] comes on top.
    pub cutting_force_n: f64,
    /// Friction for each metre of shaft.
    pub shaft_friction_n_per_m: f64,
}

impl Default for LineLayer {
    /// Offers no resistance.
    fn default() -> Self {
        LineLayer {
            from_m: 0.0,
            puncture_force_n: 0.0,
            puncture_depth_m: f64::INFINITY,
            cutting_force_n: 0.0,
            shaft_friction_n_per_m: 0.0,
        }
    }
}

/// Settings of the needle line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineSettings {
    /// Rate term: force for each metre of shaft and metre per second of slip; 0 is off.
    pub viscous_n_s_per_m2: f64,
    /// Relaxation; terms of no strength are off.
    pub prony: [PronyTerm; 2],
    /// Forces by sets of stations that stick, with sweeps where that fails; else by sweeps alone, as a twin to compare
    /// with.
    pub by_sets: bool,
    /// Sweeps of the solver at most.
    pub sweeps: u32,
    /// Largest distance of a place that sticks from where it sticks.
    pub tolerance_m: f64,
}

impl Default for LineSettings {
    fn default() -> Self {
        LineSettings {
            viscous_n_s_per_m2: 0.0,
            prony: [PronyTerm::default(); 2],
            by_sets: true,
            sweeps: 60,
            tolerance_m: 2e-9,
        }
    }
}

/// A setting that cannot be used.
pub type LineProblem = Problem;

/// Compliance and layers of one line.
#[derive(Clone, Debug)]
pub struct LineModel {
    pub(super) compliance: Compliance,
    pub(super) layers: Vec<LineLayer>,
    /// Friction of each station for each metre of it.
    pub(super) friction_n_per_m: Vec<f64>,
    pub(super) settings: LineSettings,
    /// Instructions for the solver.
    pub(super) simd: Simd,
}

impl LineModel {
    /// Layers in order of depth, the first from the entry on.
    pub fn new(
        compliance: Compliance,
        layers: &[LineLayer],
        settings: LineSettings,
    ) -> Result<LineModel, Vec<LineProblem>> {
        let mut problems = Problems::default();
        let c = &compliance;
        problems.range("line.stations", c.stations as f64, 1.0, MAX_STATIONS as f64);
        problems.range("line.spacing_m", c.spacing_m, 1e-5, 1e-1);
        problems.range(
            "line.tip_length_m / spacing_m",
            c.tip_length_m / c.spacing_m,
            0.0,
            MAX_TIP_STATIONS,
        );
        problems.range("line.layers", layers.len() as f64, 0.0, MAX_LAYERS as f64);
        for layer in layers {
            problems.range("layer.from_m", layer.from_m, -1.0, 10.0);
            problems.range("layer.puncture_force_n", layer.puncture_force_n, 0.0, 100.0);
            problems.range("layer.cutting_force_n", layer.cutting_force_n, 0.0, 100.0);
            problems.range("layer.shaft_friction_n_per_m", layer.shaft_friction_n_per_m, 0.0, 1e4);
            problems.range("layer.puncture_depth_m", layer.puncture_depth_m, 1e-6, f64::INFINITY);
        }
        problems.range("line.viscous_n_s_per_m2", settings.viscous_n_s_per_m2, 0.0, 1e6);
        for term in settings.prony {
            problems.range("prony.strength", term.strength, 0.0, 10.0);
            problems.range("prony.time_s", term.time_s, 1e-3, 1e5);
        }
        let is_definite = c.has_whole_tip()
            && (0..2 * c.stations).all(|n| c.at(n, n) > 0.0 && c.rows.row(n).iter().all(|v| v.is_finite()));
        problems.range(
            "line.compliance is positive",
            f64::from(u8::from(is_definite)),
            1.0,
            1.0,
        );
        problems.finish()?;
        let friction = |n: usize| mean_friction(layers, n as f64 * c.spacing_m, (n + 1) as f64 * c.spacing_m);
        Ok(LineModel {
            friction_n_per_m: (0..c.stations).map(friction).collect(),
            layers: layers.to_vec(),
            settings,
            compliance,
            simd: Simd::detect(),
        })
    }

    /// Sets other forces for the layers that `layer` knows, by number; their beginnings stay. Does not allocate.
    pub fn set_layers(&mut self, layer: impl Fn(usize) -> Option<LineLayer>) {
        for (n, slot) in self.layers.iter_mut().enumerate() {
            if let Some(new) = layer(n) {
                *slot = LineLayer {
                    from_m: slot.from_m,
                    ..new
                };
            }
        }
        let spacing_m = self.compliance.spacing_m;
        for (n, friction) in self.friction_n_per_m.iter_mut().enumerate() {
            *friction = mean_friction(&self.layers, n as f64 * spacing_m, (n + 1) as f64 * spacing_m);
        }
    }

    /// Sets the creep of the tissue; terms out of range are ignored. Does not allocate.
    pub fn set_prony(&mut self, terms: [PronyTerm; 2]) {
        let is_usable = |t: &PronyTerm| (0.0..=10.0).contains(&t.strength) && (1e-3..=1e5).contains(&t.time_s);
        if terms.iter().all(is_usable) {
            self.settings.prony = terms;
        }
    }

    /// Returns the displacement of the stations by the loads on them.
    pub fn compliance(&self) -> &Compliance {
        &self.compliance
    }

    /// Returns the settings that it was made with.
    pub fn settings(&self) -> &LineSettings {
        &self.settings
    }

    /// Returns the length of the line in the body.
    pub fn length_m(&self) -> f64 {
        self.compliance.stations as f64 * self.compliance.spacing_m
    }

    /// Returns the layer at a place of the material, if there is tissue.
    pub(super) fn layer_at(&self, place_m: f64) -> Option<&LineLayer> {
        if !(0.0..self.length_m()).contains(&place_m) {
            return None;
        }
        self.layers.iter().rev().find(|layer| layer.from_m <= place_m)
    }
}

/// Returns the mean over a stretch of the line.
fn mean_friction(layers: &[LineLayer], from_m: f64, to_m: f64) -> f64 {
    let ends = layers.iter().skip(1).map(|l| l.from_m).chain([f64::INFINITY]);
    let part = |(layer, end_m): (&LineLayer, f64)| {
        let length_m = (end_m.min(to_m) - layer.from_m.max(from_m)).max(0.0);
        layer.shaft_friction_n_per_m * length_m / (to_m - from_m)
    };
    layers.iter().zip(ends).map(part).sum()
}

//! The solver in each number type, compiled in this crate: generic functions are compiled again by every crate that calls them.

use super::batch::{BatchModel, BatchState, NodeWeight, Progress};
use super::material::{FemProblem, FemSettings};
use super::model::FemModel;
use super::solve::{self, FemReport, SolveSettings, TipPatch};
use super::state::FemState;
use crate::scene::Lattice;
use std::sync::Arc;

/// What takes a compiler long.
pub trait Compiled: Sized {
    fn model(
        lattice: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: &dyn Fn([f64; 3]) -> bool,
    ) -> Result<FemModel<Self>, Vec<FemProblem>>;
    fn at_rest(model: &FemModel<Self>) -> FemState<Self>;
    fn step(
        model: &FemModel<Self>,
        state: &mut FemState<Self>,
        held: Option<TipPatch>,
        settings: &SolveSettings,
    ) -> FemReport;
    fn prepare(model: &FemModel<Self>, state: &mut FemState<Self>, next: Option<TipPatch>, settings: &SolveSettings);
    fn strain_energy_j(state: &mut FemState<Self>, model: &FemModel<Self>) -> f64;
    fn batch_model(model: &FemModel<Self>) -> BatchModel<Self>;
    fn batch_state(model: &BatchModel<Self>) -> BatchState<Self>;
    fn begin(state: &mut BatchState<Self>, model: &BatchModel<Self>, loads: &[&[NodeWeight]]);
    fn advance(state: &mut BatchState<Self>, model: &BatchModel<Self>) -> Progress;
}

macro_rules! compiled {
    ($($t:ty),*) => {$(
        impl Compiled for $t {
            fn model(
                lattice: &Arc<Lattice>,
                settings: &FemSettings,
                is_fixed: &dyn Fn([f64; 3]) -> bool,
            ) -> Result<FemModel<$t>, Vec<FemProblem>> {
                FemModel::of_lattice(lattice, settings, is_fixed)
            }

            fn at_rest(model: &FemModel<$t>) -> FemState<$t> {
                FemState::of_model(model)
            }

            fn step(
                model: &FemModel<$t>,
                state: &mut FemState<$t>,
                held: Option<TipPatch>,
                settings: &SolveSettings,
            ) -> FemReport {
                solve::step_held(model, state, held, settings)
            }

            fn prepare(
                model: &FemModel<$t>,
                state: &mut FemState<$t>,
                next: Option<TipPatch>,
                settings: &SolveSettings,
            ) {
                solve::prepare_next(model, state, next, settings);
            }

            fn strain_energy_j(state: &mut FemState<$t>, model: &FemModel<$t>) -> f64 {
                state.grip.strain_energy_j(model)
            }

            fn batch_model(model: &FemModel<$t>) -> BatchModel<$t> {
                BatchModel::of_model(model)
            }

            fn batch_state(model: &BatchModel<$t>) -> BatchState<$t> {
                BatchState::of_model(model)
            }

            fn begin(state: &mut BatchState<$t>, model: &BatchModel<$t>, loads: &[&[NodeWeight]]) {
                state.take_up(model, loads);
            }

            fn advance(state: &mut BatchState<$t>, model: &BatchModel<$t>) -> Progress {
                state.do_slice(model)
            }
        }
    )*};
}
compiled!(f32, f64);

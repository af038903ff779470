//! The solver in each number type, compiled in this crate: generic functions are compiled again by every crate that
//! calls them.

use super::batch::{BatchModel, BatchState, NodeWeight, Progress};
use super::material::{FemProblem, FemSettings};
use super::model::FemModel;
use super::real::Real;
use super::solve::{self, FemReport, SolveSettings, TipPatch};
use super::state::FemState;
use crate::scene::Lattice;
use std::sync::Arc;

/// A number type with a solver compiled for it.
pub trait Compiled: Real {
    /// Makes a model as [`FemModel::coarser`], with fixed nodes as in [`FemModel::with_fixed_nodes`].
    fn model(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: &dyn Fn([f64; 3]) -> bool,
    ) -> Result<FemModel<Self>, Vec<FemProblem>>;
    /// Calls [`FemState::at_rest`].
    fn at_rest(model: &FemModel<Self>) -> FemState<Self>;
    /// Calls [`step`].
    fn step(
        model: &FemModel<Self>,
        state: &mut FemState<Self>,
        held: Option<TipPatch>,
        settings: &SolveSettings,
    ) -> FemReport;
    /// Calls [`prepare`].
    fn prepare(model: &FemModel<Self>, state: &mut FemState<Self>, next: Option<TipPatch>, settings: &SolveSettings);
    /// Calls [`FemState::strain_energy_j`].
    fn strain_energy_j(state: &mut FemState<Self>, model: &FemModel<Self>) -> f64;
    /// Calls [`BatchModel::new`].
    fn batch_model(model: &FemModel<Self>) -> BatchModel<Self>;
    /// Calls [`BatchState::new`].
    fn batch_state(model: &BatchModel<Self>) -> BatchState<Self>;
    /// Calls [`BatchState::begin`].
    fn begin(state: &mut BatchState<Self>, model: &BatchModel<Self>, loads: &[&[NodeWeight]]);
    /// Calls [`BatchState::advance`].
    fn advance(state: &mut BatchState<Self>, model: &BatchModel<Self>) -> Progress;
}

macro_rules! compiled {
    ($($t:ty),*) => {$(
        impl Compiled for $t {
            fn model(
                lattice: &Lattice,
                of: &Arc<Lattice>,
                settings: &FemSettings,
                is_fixed: &dyn Fn([f64; 3]) -> bool,
            ) -> Result<FemModel<$t>, Vec<FemProblem>> {
                FemModel::of_lattice(lattice, of, settings, is_fixed)
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

impl<T: Compiled> FemModel<T> {
    /// Makes the body of a lattice, or returns every problem with the settings.
    pub fn new(lattice: &Arc<Lattice>, settings: &FemSettings) -> Result<Self, Vec<FemProblem>> {
        Self::with_fixed_nodes(lattice, settings, |_| false)
    }

    /// Makes it with more fixed nodes: those for whose place in the scene frame (m) `is_fixed` holds.
    pub fn with_fixed_nodes(
        lattice: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: impl Fn([f64; 3]) -> bool,
    ) -> Result<Self, Vec<FemProblem>> {
        T::model(lattice, lattice, settings, &is_fixed)
    }

    /// Makes the body of `lattice` in the elements of `of`, a lattice some times [`Lattice::coarser`] than it: each as
    /// stiff as the cells in it are on average, also where part of it is no tissue.
    pub fn coarser(lattice: &Lattice, of: &Arc<Lattice>, settings: &FemSettings) -> Result<Self, Vec<FemProblem>> {
        T::model(lattice, of, settings, &|_| false)
    }
}

impl<T: Compiled> FemState<T> {
    /// Returns the body at rest.
    pub fn at_rest(model: &FemModel<T>) -> Self {
        T::at_rest(model)
    }

    /// Returns the elastic energy, in body and springs.
    pub fn strain_energy_j(&mut self, model: &FemModel<T>) -> f64 {
        T::strain_energy_j(self, model)
    }
}

/// Brings the body to equilibrium with the held patch, as far as `settings` allow. No patch: at rest.
///
/// What cannot be followed is refused and changes nothing; so is a state of another model.
pub fn step<T: Compiled>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    held: Option<TipPatch>,
    settings: &SolveSettings,
) -> FemReport {
    T::step(model, state, held, settings)
}

/// Does a piece of work on the answer to a patch that may be held soon, where the last step took no cycle: both
/// together cost no more than a step with one cycle. Changes no answer.
pub fn prepare<T: Compiled>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    next: Option<TipPatch>,
    settings: &SolveSettings,
) {
    T::prepare(model, state, next, settings);
}

impl<T: Compiled> BatchModel<T> {
    /// Makes the same body. Parts that nothing keeps in place do not move here: a load on them has no answer.
    pub fn new(model: &FemModel<T>) -> Self {
        T::batch_model(model)
    }
}

impl<T: Compiled> BatchState<T> {
    /// Makes room for eight answers.
    pub fn new(model: &BatchModel<T>) -> Self {
        T::batch_state(model)
    }

    /// Begins at most eight loads; those past the eighth are ignored, as are nodes that do not move.
    pub fn begin(&mut self, model: &BatchModel<T>, loads: &[&[NodeWeight]]) {
        T::begin(self, model, loads);
    }

    /// Does one slice of work; its cost is that of one pass over one level.
    pub fn advance(&mut self, model: &BatchModel<T>) -> Progress {
        T::advance(self, model)
    }
}

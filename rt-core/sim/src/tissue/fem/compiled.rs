//! The solver in each number type, compiled in this crate: generic functions are compiled again by every crate that
//! calls them, which takes a while where they step or build a body.

use super::batch::{BatchModel, BatchState, Progress, condensed};
use super::material::{FemProblem, FemSettings};
use super::model::FemModel;
use super::real::Real;
use super::solve::{self, FemReport, SolveSettings};
use super::state::FemState;
use crate::scene::{Lattice, Layer};
use crate::tissue::Held;
use std::sync::Arc;
use stylet_settings::ProblemList;

/// Declares a trait of these functions with one type, and implements it for each number type by functions of this
/// crate.
macro_rules! compiled {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty = $by:expr;)*) => {
        /// A number type with a solver compiled for it; its functions are called by those of the same arguments.
        pub trait Compiled: Real {
            $(
                #[doc(hidden)]
                fn $name($($argument: $type),*) -> $result;
            )*
        }

        compiled!(@ f32 => $(fn $name($($argument: $type),*) -> $result = $by;)*);
        compiled!(@ f64 => $(fn $name($($argument: $type),*) -> $result = $by;)*);
    };
    (@ $t:ty => $(fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty = $by:expr;)*) => {
        impl Compiled for $t {
            $(fn $name($($argument: $type),*) -> $result {
                $by($($argument),*)
            })*
        }
    };
}

compiled! {
    fn model(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: &dyn Fn([f64; 3]) -> bool
    ) -> Result<FemModel<Self>, ProblemList<FemProblem>> = FemModel::of_lattice;
    fn step(
        model: &FemModel<Self>,
        state: &mut FemState<Self>,
        held: Option<Held>,
        settings: &SolveSettings
    ) -> FemReport = solve::step_held;
    fn prepare(
        model: &FemModel<Self>,
        state: &mut FemState<Self>,
        next: Option<Held>,
        settings: &SolveSettings
    ) -> () = solve::prepare_next;
    fn layered(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        layers: &[Layer]
    ) -> Result<FemModel<Self>, ProblemList<FemProblem>> = FemModel::of_layered;
    fn batch_model(model: &FemModel<Self>) -> BatchModel<Self> = condensed;
    fn advance(state: &mut BatchState<Self>, model: &BatchModel<Self>) -> Progress = BatchState::do_slice;
}

impl<T: Compiled> FemModel<T> {
    /// Makes the body of a lattice, or returns every problem with the settings.
    pub fn new(lattice: &Arc<Lattice>, settings: &FemSettings) -> Result<Self, ProblemList<FemProblem>> {
        Self::with_fixed_nodes(lattice, settings, |_| false)
    }

    /// Makes it with more fixed nodes: those for whose place in the scene frame (m) `is_fixed` holds.
    pub fn with_fixed_nodes(
        lattice: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: impl Fn([f64; 3]) -> bool,
    ) -> Result<Self, ProblemList<FemProblem>> {
        T::model(lattice, lattice, settings, &is_fixed)
    }

    /// Makes the body of `lattice` in the elements of `of`, a lattice some times [`Lattice::coarser`] than it: each as
    /// stiff as the cells in it are on average, also where part of it is no tissue.
    pub fn coarser(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
    ) -> Result<Self, ProblemList<FemProblem>> {
        T::model(lattice, of, settings, &|_| false)
    }

    /// Makes the same in layers, the innermost first, whose outside is fixed. They lie on the faces that rest on fat;
    /// if there are none, springs of `foundation_pa_per_m` do.
    pub fn in_layers(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        layers: &[Layer],
    ) -> Result<Self, ProblemList<FemProblem>> {
        T::layered(lattice, of, settings, layers)
    }
}

/// Brings the body to equilibrium with the held patch, as far as `settings` allow. No patch: at rest.
///
/// What cannot be followed is refused and changes nothing; so is a state of another model.
pub fn step<T: Compiled>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    held: Option<Held>,
    settings: &SolveSettings,
) -> FemReport {
    T::step(model, state, held, settings)
}

/// Does a piece of work on the answer to a patch that may be held soon, where the last step took no cycle: both
/// together cost no more than a step with one cycle. Changes no answer.
pub fn prepare<T: Compiled>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    next: Option<Held>,
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
    /// Does one slice of work; its cost is that of one pass over one level.
    pub fn advance(&mut self, model: &BatchModel<T>) -> Progress {
        T::advance(self, model)
    }
}

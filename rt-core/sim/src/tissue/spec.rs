//! Specification of a tissue model: what a run must know of it before there is a body.

use super::fem::FemProblem;
use super::{ChainMailTissue, FemTissue, TissueModel};
use crate::limits::Limits;
use crate::scene::{Scene, TissueKind};
use std::error::Error;
use std::sync::Arc;
use stylet_settings::ProblemList;

/// Reason why a tissue model cannot be set up.
#[derive(Clone, Debug, thiserror::Error)]
pub enum TissueError {
    /// Materials that the finite elements cannot have.
    #[error(transparent)]
    FiniteElements(#[from] ProblemList<FemProblem>),
    /// Error of a model from another crate.
    #[error(transparent)]
    Other(Arc<dyn Error + Send + Sync>),
}

/// Constructor of a model of `scene.body`, at rest.
pub type BuildTissue = fn(scene: &Scene, limits: &Limits) -> Result<Box<dyn TissueModel>, TissueError>;

/// Specification of a tissue model. A crate that has its own makes one with [`new`](Self::new), and hands it to the
/// runtime as the built-in ones are.
#[derive(Clone, Copy, Debug)]
pub struct TissueSpec {
    /// Name of a built-in model, by which flight recordings know it; a run of another model is not recorded.
    pub built_in: Option<TissueKind>,
    /// Number of elements above which a body is made coarser.
    pub most_elements: usize,
    /// Number of elements at most of the body in which needles' lines are solved for; `None` where needles slip by
    /// speed.
    pub most_line_elements: Option<usize>,
    /// Set where [`TissueModel::displace`] answers a line's loads; the body is carried by them otherwise.
    pub adds_columns: bool,
    /// Edge of the tissue that moves as one piece with the tip, m; 0 for one element.
    pub tip_patch_m: f64,
    /// Set where [`TissueModel::prepare`] does anything: only then need the loop predict where the tip goes.
    pub prepares: bool,
    /// Constructor.
    pub build: BuildTissue,
}

impl TissueSpec {
    /// Specifies a model for any number of elements, whose needles slip by speed.
    pub const fn new(build: BuildTissue) -> Self {
        Self {
            built_in: None,
            most_elements: usize::MAX,
            most_line_elements: None,
            adds_columns: false,
            tip_patch_m: 0.0,
            prepares: false,
            build,
        }
    }

    /// Returns whether needles go along lines.
    pub fn has_lines(&self) -> bool {
        self.most_line_elements.is_some()
    }
}

impl From<TissueKind> for TissueSpec {
    fn from(kind: TissueKind) -> Self {
        let spec = match kind {
            TissueKind::ChainMail => Self {
                most_line_elements: Some(ChainMailTissue::MOST_LINE_ELEMENTS),
                ..Self::new(|scene, limits| Ok(Box::new(ChainMailTissue::new(scene, limits.clone()))))
            },
            TissueKind::Paper => {
                Self::new(|scene, limits| Ok(Box::new(ChainMailTissue::as_printed(scene, limits.clone()))))
            }
            TissueKind::Fem => Self {
                // A tick of 200 Hz and some seconds for a needle's line allow no more.
                most_elements: 60_000,
                most_line_elements: Some(60_000),
                adds_columns: true,
                // The force on a single node goes to zero with the spacing.
                tip_patch_m: 4e-3,
                prepares: true,
                ..Self::new(|scene, _| Ok(Box::new(FemTissue::<f32>::new(scene)?)))
            },
        };
        Self {
            built_in: Some(kind),
            ..spec
        }
    }
}

impl Scene {
    /// Returns the same scene with as coarse a body as that tissue needs.
    pub fn for_tissue(self, tissue: impl Into<TissueSpec>) -> Scene {
        self.with_body(tissue.into().most_elements)
    }

    /// Returns the same scene with the finite elements that needles' lines are solved for in, where `tissue` has lines.
    pub fn for_lines(self, tissue: impl Into<TissueSpec>) -> Option<Scene> {
        let most = tissue.into().most_line_elements?;
        Some(self.with_body(most))
    }
}

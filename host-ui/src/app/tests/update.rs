//! States of a plan that is updated on the live picture, made by hand.

use super::fixture::many_needles;
use crate::app::App;
use crate::planner::{Drawn, JobProgress};
use crate::settings::Layout;
use crate::view::state::Tool;
use std::sync::Arc;
use stylet_implant::intraoperative::{Contour, Doses, Marks, Reviewed, SeedsFrom, Solid, Update};
use stylet_implant::plan::optimise::Figures;
use stylet_shm_schema::SeedPose;

/// Returns figures far beyond their limits.
fn figures() -> Figures {
    Figures {
        v100: 45.6,
        d90: 188.8,
        v150: 98.7,
        v200: 88.8,
        urethra_d10: Some(288.8),
        urethra_d30: Some(277.7),
        rectum_d2cc: Some(188.8),
    }
}

/// Shows 12 of 24 needles inserted and five planes contoured, with this tool.
pub fn drawing(app: &mut App, tool: Tool) {
    app.shown = many_needles(24, 12);
    (app.settings.layout, app.middle.view.tool) = (Layout::Probe, Some(tool));
    let pose = |n: usize| SeedPose {
        position_m: [0.051, 0.05, 0.072 - 0.01 * n as f64],
        axis: [0.0, 0.0, 1.0],
        dropped_at_m: [0.05, 0.05, 0.07 - 0.01 * n as f64],
    };
    app.shown.seeds = (0..48).map(pose).collect();
    let ring = |radius_m: f64| [[radius_m, 0.0], [0.0, radius_m], [-radius_m, 0.0], [0.0, -radius_m]];
    let contour = (0..5).fold(Contour::default(), |c, n| c.with_all(f64::from(n) * 5e-3, &ring(0.02)));
    let review = &mut app.shown.planning.review;
    review.solid = Solid::of(&contour).ok().map(Arc::new);
    review.drawn = Drawn {
        contour,
        marks_m: vec![[0.05; 3]; 47],
    };
    review.volume_m3 = Some(123.4e-6);
    review.doses = Some(Doses {
        now: figures(),
        continued: figures(),
    });
    let mark = |n: usize| (n < 36).then_some((n, 1.5e-3));
    review.marks = Marks {
        of_seeds: (0..48).map(mark).collect(),
        without_seed: (36..47).collect(),
    };
    review.is_assessing = true;
    review.can_withdraw = true;
}

/// Shows the search for a new plan of the remaining needles.
pub fn searching(app: &mut App) {
    drawing(app, Tool::Contour);
    app.shown.planning.job = Some(JobProgress {
        what: "Replanning the remaining needles".to_owned(),
        share: Some(0.45),
    });
}

/// Shows an update that waits for a decision.
pub fn deciding(app: &mut App) {
    drawing(app, Tool::Contour);
    let Some(implant) = app.shown.planning.implant.clone() else {
        return;
    };
    let doses = Doses {
        now: figures(),
        continued: figures(),
    };
    app.shown.planning.review.update = Some(Arc::new(Reviewed {
        update: Update {
            plan: implant.plan.clone(),
            begun: 12,
            doses,
            updated: figures(),
        },
        lying: 48,
        seeds_from: SeedsFrom::Marks,
        agreement: None,
        marked: [36, 11],
        residuals_m: None,
        left: [[12, 123], [11, 112]],
        accepted: false,
    }));
}

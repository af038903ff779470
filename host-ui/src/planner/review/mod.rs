//! The drawing on the live picture while needles go in, and the update of the plan based on it.

mod assess;

use super::Planner;
use super::jobs::{JobMessage, Reporter};
use assess::{Assessed, Moment};
use nalgebra::Vector3;
use std::sync::Arc;
use stylet_base::job::{Job, JobUpdate};
use stylet_host::link::{SceneModel, Snapshot};
use stylet_imaging::ultrasound::Pose;
use stylet_implant::intraoperative::{
    Contour, Doses, Marks, Outline, Reviewed, SeedsFrom, Solid, Transverse, proposed_at,
};
use stylet_implant::plan::History;
use stylet_shm_schema::SceneId;

/// Distance within which a click selects a mark, m.
const SAME_PLACE_M: f64 = 0.2e-3;

/// Drawing on the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Edge of the gland.
    pub contour: Contour,
    /// Visible positions of seeds, scene frame, m.
    pub marks_m: Vec<[f64; 3]>,
}

/// Change of the drawing. Positions in a plane are to the right and up, m; a plane is given by its
/// place along the axis of the probe, m.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Adds a click in the plane.
    Add {
        at_m: f64,
        point_m: [f64; 2],
    },
    /// Moves a click that is being dragged; `is_first` at the start of the drag.
    Move {
        at_m: f64,
        number: usize,
        to_m: [f64; 2],
        is_first: bool,
    },
    /// Removes a click.
    Remove {
        at_m: f64,
        number: usize,
    },
    /// Converts the proposed outline of a plane into clicks.
    TakeOver {
        at_m: f64,
    },
    /// Marks a seed, scene frame, m.
    Mark([f64; 3]),
    /// Moves a mark that is being dragged.
    MoveMark {
        number: usize,
        to_m: [f64; 3],
        is_first: bool,
    },
    /// Removes a mark.
    RemoveMark(usize),
    /// Clears the drawing.
    Clear,
    Undo,
    Redo,
}

/// Number of clicks that replace a proposed outline.
const TAKEN_OVER: usize = 8;

/// State of the review, for one scene.
#[derive(Default)]
pub(super) struct Review {
    shown: ReviewShown,
    scene: Option<SceneId>,
    history: History<Drawn>,
    /// Moment of the last assessment, of the one in progress, and of one that failed.
    assessed: Option<Moment>,
    assessing: Option<(Moment, Job<Result<Assessed, String>>)>,
    failed: Option<Moment>,
}

/// State of the review that a frame shows.
#[derive(Clone, Default)]
pub struct ReviewShown {
    /// Planes across the probe; `None` before a scene.
    pub frame: Option<Transverse>,
    /// Drawing of the operator.
    pub drawn: Drawn,
    /// Contoured gland; `None` while it has too few planes.
    pub solid: Option<Arc<Solid>>,
    /// Choice of the seeds for the dose.
    pub seeds_from: SeedsFrom,
    /// Dose of the placed seeds at the last assessment, and the marks by their seeds.
    pub doses: Option<Doses>,
    /// Volume of the contoured gland, m³.
    pub volume_m3: Option<f64>,
    /// Marks by their seeds.
    pub marks: Marks,
    /// True while an assessment runs.
    pub is_assessing: bool,
    /// Reason why nothing can be assessed.
    pub trouble: Option<String>,
    /// Update that waits for a decision.
    pub update: Option<Arc<Reviewed>>,
    /// True if the last update was accepted and can be withdrawn.
    pub can_withdraw: bool,
    /// Updates so far, accepted or not.
    pub reviewed: Vec<Reviewed>,
}

impl ReviewShown {
    /// Returns the outline in a plane, and whether it goes through clicks of that plane; otherwise
    /// the other planes propose it.
    pub fn outline_at(&self, at_m: f64) -> Option<(Outline, bool)> {
        let clicks = self.drawn.contour.at(at_m);
        if let Some(own) = clicks.and_then(|clicks| Outline::through(&clicks.points_m)) {
            return Some((own, true));
        }
        let proposed = match &self.solid {
            Some(solid) => solid.at(at_m),
            None => proposed_at(&self.drawn.contour, at_m),
        };
        Some((proposed?, false))
    }
}

impl Review {
    pub(super) fn shown(&self, can_withdraw: bool) -> ReviewShown {
        ReviewShown {
            is_assessing: self.assessing.is_some(),
            can_withdraw,
            ..self.shown.clone()
        }
    }

    fn edit(&mut self, edit: Edit) {
        let now = self.history.now().clone();
        let contour = &now.contour;
        let with_contour = |contour: Contour| Drawn { contour, ..now.clone() };
        let with_marks = |marks_m: Vec<[f64; 3]>| Drawn { marks_m, ..now.clone() };
        let (next, is_step) = match edit {
            Edit::Undo => return self.step(History::undo),
            Edit::Redo => return self.step(History::redo),
            Edit::Clear => (Drawn::default(), true),
            Edit::Add { at_m, point_m } => (with_contour(contour.with(at_m, point_m)), true),
            Edit::Move {
                at_m,
                number,
                to_m,
                is_first,
            } => (with_contour(contour.with_moved(at_m, number, to_m)), is_first),
            Edit::Remove { at_m, number } => (with_contour(contour.without(at_m, number)), true),
            Edit::TakeOver { at_m } => match proposed_at(contour, at_m) {
                Some(outline) => (
                    with_contour(contour.with_all(at_m, &outline.some_points_m(TAKEN_OVER))),
                    true,
                ),
                None => return,
            },
            Edit::Mark(place_m) => (with_marks([&now.marks_m[..], &[place_m]].concat()), true),
            Edit::MoveMark { number, to_m, is_first } => {
                let mut marks_m = now.marks_m.clone();
                let Some(mark) = marks_m.get_mut(number) else { return };
                *mark = to_m;
                (with_marks(marks_m), is_first)
            }
            Edit::RemoveMark(number) => {
                let mut marks_m = now.marks_m.clone();
                if number < marks_m.len() {
                    marks_m.remove(number);
                }
                (with_marks(marks_m), true)
            }
        };
        match is_step {
            true => self.history.put(next),
            false => self.history.replace(next),
        }
        self.redraw();
    }

    /// Begins another implantation; the drawing stays.
    pub(super) fn restart(&mut self) {
        self.shown.reviewed.clear();
        self.shown.update = None;
    }

    fn step(&mut self, step: fn(&mut History<Drawn>) -> bool) {
        if step(&mut self.history) {
            self.redraw();
        }
    }

    fn redraw(&mut self) {
        self.shown.drawn = self.history.now().clone();
        self.shown.solid = Solid::of(&self.shown.drawn.contour).ok().map(Arc::new);
        // It was made for another contour.
        self.shown.update = None;
    }
}

impl Planner {
    /// Changes the drawing on the picture.
    pub fn draw(&mut self, edit: Edit) {
        self.review.edit(edit);
    }

    /// Chooses the seeds for the dose of a moment.
    pub fn set_seeds_from(&mut self, seeds_from: SeedsFrom) {
        (self.review.shown.seeds_from, self.review.shown.update) = (seeds_from, None);
    }

    /// Returns the updates of the plan in this scene.
    pub fn reviewed(&self) -> &[Reviewed] {
        &self.review.shown.reviewed
    }

    /// Takes the data that arrived since the last frame; assesses the drawing if it, the plan or
    /// the seeds have changed.
    pub fn take_review(&mut self, scene: &Arc<SceneModel>, snapshot: &Snapshot) {
        if self.review.scene != Some(scene.header.id()) {
            let pose = Pose::of_scene(&scene.header);
            let frame = Transverse {
                origin_m: pose.middle_m,
                right: pose.axis.cross(&pose.up),
                up: pose.up,
                along: pose.axis,
            };
            self.review = Review {
                scene: Some(scene.header.id()),
                shown: ReviewShown {
                    frame: Some(frame),
                    ..ReviewShown::default()
                },
                ..Review::default()
            };
        }
        self.take_assessed();
        let Some(moment) = self.moment(snapshot) else { return };
        let review = &self.review;
        let mut known = review.assessed.iter().chain(&review.failed);
        if known.any(|of| of.is_as(&moment)) || review.assessing.is_some() {
            return;
        }
        let Some(outlines) = self.planning.outlines.clone() else {
            return;
        };
        let (scene, snapshot) = (scene.clone(), snapshot.clone());
        let of = moment.clone();
        let job = Job::begin("assessment", move |messages, _| {
            let found = of.assess(&outlines.anatomy, &scene, &snapshot);
            let _ = messages.send(found.map_err(|why| why.to_string()));
        });
        self.review.assessing = Some((moment, job));
    }

    fn take_assessed(&mut self) {
        let review = &mut self.review;
        let found = match review.assessing.as_ref().map(|(_, job)| job.poll()) {
            None | Some(JobUpdate::Pending) => return,
            Some(JobUpdate::Message(found)) => found,
            Some(JobUpdate::Ended) => Err("The dose could not be computed.".to_owned()),
        };
        let moment = review.assessing.take().map(|(moment, _)| moment);
        match found {
            Ok(found) => {
                (review.assessed, review.failed, review.shown.trouble) = (moment, None, None);
                (review.shown.doses, review.shown.volume_m3) = (Some(found.doses), Some(found.volume_m3));
                review.shown.marks = found.marks;
            }
            Err(why) => (review.failed, review.shown.trouble) = (moment, Some(why)),
        }
    }

    /// Returns the moment to assess; `None` without a plan, a seed or a contoured gland.
    fn moment(&self, snapshot: &Snapshot) -> Option<Moment> {
        let review = &self.review;
        let (plan, solid, frame) = (self.plan()?, review.shown.solid.clone()?, review.shown.frame?);
        Moment::of(
            plan,
            (&self.planning.progress, &self.compensated),
            (solid, frame),
            (review.history.now(), review.shown.seeds_from),
            snapshot,
        )
    }

    /// Starts to replan the remaining needles around the seeds in the tissue.
    pub fn update(&mut self, scene: Option<&Arc<SceneModel>>, snapshot: Option<&Snapshot>) {
        let (Some(scene), Some(snapshot)) = (scene, snapshot) else {
            return;
        };
        let moment = self.moment(snapshot);
        let (scene, snapshot) = (scene.clone(), snapshot.clone());
        self.review.shown.update = None;
        self.begin_job("Replanning the remaining needles", move |_, outlines| {
            let moment = moment.ok_or("Contour the gland in three planes first, with a seed in the tissue.")?;
            Ok(move |reporter: &Reporter<'_>| {
                let report = |share| reporter.report(share);
                let found = moment.update(&outlines.anatomy, &scene, &snapshot, &report)?;
                Ok(JobMessage::Update(Box::new(found)))
            })
        });
    }

    pub(super) fn take_update(&mut self, found: Reviewed) {
        // Needles may have been inserted since.
        if found.update.begun != self.planning.progress.begun() {
            let why = "A needle was inserted during planning; update the plan again.";
            self.refuse(why);
            return;
        }
        self.review.shown.update = Some(Arc::new(found));
    }

    /// Accepts the pending update or rejects it; either is recorded for the debrief.
    pub fn decide(&mut self, accept: bool) {
        let Some(proposed) = self.review.shown.update.take() else {
            return;
        };
        if accept {
            match self.can_be(proposed.update.plan.clone()) {
                Ok(plan) => self.put(plan),
                Err(why) => {
                    self.refuse(why);
                    self.review.shown.update = Some(proposed);
                    return;
                }
            }
        }
        self.review.shown.reviewed.push(Reviewed {
            accepted: accept,
            ..Reviewed::clone(&proposed)
        });
    }

    /// Withdraws the last update and restores the plan before it.
    pub fn withdraw_update(&mut self) {
        if self.can_withdraw() {
            self.undo();
            if let Some(last) = self.review.shown.reviewed.last_mut() {
                last.accepted = false;
            }
        }
    }

    pub(super) fn can_withdraw(&self) -> bool {
        let is_last = |last: &Reviewed| last.accepted && last.update.begun == self.planning.progress.begun();
        self.review.shown.reviewed.last().is_some_and(is_last) && self.history.as_ref().is_some_and(History::can_undo)
    }
}

fn is_near(a: [f64; 3], b: [f64; 3]) -> bool {
    (Vector3::from(a) - Vector3::from(b)).norm() < SAME_PLACE_M
}

#[cfg(test)]
mod tests;

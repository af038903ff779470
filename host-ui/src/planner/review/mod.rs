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
    scene: Option<SceneId>,
    frame: Option<Transverse>,
    history: History<Drawn>,
    solid: Option<Arc<Solid>>,
    seeds_from: SeedsFrom,
    /// Last assessment, and the one in progress.
    assessed: Option<(Moment, Arc<Assessed>)>,
    assessing: Option<(Moment, Job<Result<Assessed, String>>)>,
    trouble: Option<(Moment, String)>,
    proposed: Option<Arc<Reviewed>>,
    reviewed: Vec<Reviewed>,
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
        let assessed = self.assessed.as_ref().map(|(_, assessed)| assessed);
        ReviewShown {
            frame: self.frame,
            drawn: self.history.now().clone(),
            solid: self.solid.clone(),
            seeds_from: self.seeds_from,
            doses: assessed.map(|a| a.doses),
            volume_m3: assessed.map(|a| a.volume_m3),
            marks: assessed.map_or_else(Marks::default, |a| a.marks.clone()),
            is_assessing: self.assessing.is_some(),
            trouble: self.trouble.as_ref().map(|(_, why)| why.clone()),
            update: self.proposed.clone(),
            can_withdraw,
            reviewed: self.reviewed.clone(),
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
        self.reviewed.clear();
        self.proposed = None;
    }

    fn step(&mut self, step: fn(&mut History<Drawn>) -> bool) {
        if step(&mut self.history) {
            self.redraw();
        }
    }

    fn redraw(&mut self) {
        self.solid = Solid::of(&self.history.now().contour).ok().map(Arc::new);
        // It was made for another contour.
        self.proposed = None;
    }
}

impl Planner {
    /// Changes the drawing on the picture.
    pub fn draw(&mut self, edit: Edit) {
        self.review.edit(edit);
    }

    /// Chooses the seeds for the dose of a moment.
    pub fn set_seeds_from(&mut self, seeds_from: SeedsFrom) {
        (self.review.seeds_from, self.review.proposed) = (seeds_from, None);
    }

    /// Returns the updates of the plan in this scene.
    pub fn reviewed(&self) -> &[Reviewed] {
        &self.review.reviewed
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
                frame: Some(frame),
                ..Review::default()
            };
        }
        self.take_assessed();
        let Some(moment) = self.moment(snapshot) else { return };
        let review = &mut self.review;
        let is_known = review.assessed.as_ref().is_some_and(|(of, _)| of.is_as(&moment))
            || review.trouble.as_ref().is_some_and(|(of, _)| of.is_as(&moment));
        if is_known || review.assessing.is_some() {
            return;
        }
        let Some(outlines) = self.outlines.clone() else { return };
        let (scene, snapshot) = (scene.clone(), snapshot.clone());
        let of = moment.clone();
        let job = Job::begin("assessment", move |messages, _| {
            let found = of.assess(&outlines.anatomy, &scene, &snapshot);
            let _ = messages.send(found.map_err(|why| why.to_string()));
        });
        self.review.assessing = Some((moment, job));
    }

    fn take_assessed(&mut self) {
        let Some((moment, job)) = &self.review.assessing else {
            return;
        };
        let moment = moment.clone();
        match job.poll() {
            JobUpdate::Pending => return,
            JobUpdate::Message(Ok(found)) => {
                self.review.assessed = Some((moment, Arc::new(found)));
                self.review.trouble = None;
            }
            JobUpdate::Message(Err(why)) => self.review.trouble = Some((moment, why)),
            JobUpdate::Ended => self.review.trouble = Some((moment, "the dose could not be computed".to_owned())),
        }
        self.review.assessing = None;
    }

    /// Returns the moment to assess; `None` without a plan, a seed or a contoured gland.
    fn moment(&self, snapshot: &Snapshot) -> Option<Moment> {
        let review = &self.review;
        let (plan, solid, frame) = (self.plan()?, review.solid.clone()?, review.frame?);
        Moment::of(
            plan,
            (&self.progress, &self.compensated),
            (solid, frame),
            (review.history.now(), review.seeds_from),
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
        self.review.proposed = None;
        self.begin_job("Replanning the remaining needles", move |_, outlines| {
            let moment = moment.ok_or("contour the gland in three planes first, with a seed in the tissue")?;
            Ok(move |reporter: &Reporter<'_>| {
                let report = |share| reporter.report(share);
                let found = moment.update(&outlines.anatomy, &scene, &snapshot, &report)?;
                Ok(JobMessage::Update(Box::new(found)))
            })
        });
    }

    pub(super) fn take_update(&mut self, found: Reviewed) {
        // Needles may have been inserted since.
        if found.update.begun != self.progress.begun() {
            let why = "A needle was inserted during planning; update the plan again.";
            self.refuse(why);
            return;
        }
        self.review.proposed = Some(Arc::new(found));
    }

    /// Accepts the pending update or rejects it; either is recorded for the debrief.
    pub fn decide(&mut self, accept: bool) {
        let Some(proposed) = self.review.proposed.take() else {
            return;
        };
        if accept {
            match self.can_be(proposed.update.plan.clone()) {
                Ok(plan) => self.put(plan),
                Err(why) => {
                    self.refuse(why);
                    self.review.proposed = Some(proposed);
                    return;
                }
            }
        }
        self.review.reviewed.push(Reviewed {
            accepted: accept,
            ..Reviewed::clone(&proposed)
        });
    }

    /// Withdraws the last update and restores the plan before it.
    pub fn withdraw_update(&mut self) {
        if self.can_withdraw() {
            self.undo();
            if let Some(last) = self.review.reviewed.last_mut() {
                last.accepted = false;
            }
        }
    }

    pub(super) fn can_withdraw(&self) -> bool {
        let is_last = |last: &Reviewed| last.accepted && last.update.begun == self.progress.begun();
        self.review.reviewed.last().is_some_and(is_last) && self.history.as_ref().is_some_and(History::can_undo)
    }
}

fn is_near(a: [f64; 3], b: [f64; 3]) -> bool {
    (Vector3::from(a) - Vector3::from(b)).norm() < SAME_PLACE_M
}

#[cfg(test)]
mod tests;

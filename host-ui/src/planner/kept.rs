//! Plans that are kept: a copy of the present one next to the core's shared memory, and those set aside in the window.
//!
//! A window that was closed or killed finds the copy again during the same run of the core. It is deleted with the core.

use super::{NeedleProgress, Note, Planner};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use stylet_anatomy::PatientFrame;
use stylet_base::job::{Job, JobUpdate};
use stylet_base::{input, write_whole};
use stylet_implant::plan::{Compensation, History, ImplantPlan, Needle, file};
use stylet_shm_schema::SceneId;

/// Largest size of a file; a larger one is not a plan of ours.
const MOST_BYTES: u64 = 4 << 20;

/// Plan, and the compensation of its needles.
pub struct KeptPlan {
    /// The plan.
    pub plan: ImplantPlan,
    /// Rehearsed needles with their compensation.
    pub compensated: Vec<(Needle, Compensation)>,
    /// Needles that were inserted.
    pub progress: NeedleProgress,
}

/// Plan out of use, with its history, compensation and progress.
pub(super) struct Aside {
    of_scene: Option<(String, [f64; 3])>,
    body: Option<(u64, u64)>,
    history: History<ImplantPlan>,
    compensated: Vec<(Needle, Compensation)>,
    progress: NeedleProgress,
}

#[derive(Serialize, Deserialize)]
struct Stored {
    plan: String,
    /// Compensation by number of the needle.
    compensated: Vec<(usize, Compensation)>,
    progress: NeedleProgress,
}

/// Returns the file for a scene of a run of the core.
pub fn path_of(folder: &Path, scene: SceneId) -> PathBuf {
    folder.join(format!("plan-{:016x}-{}.json", scene.session_id, scene.generation))
}

impl KeptPlan {
    /// Writes the copy. If that fails, the plan is only not found again; nothing else is lost.
    pub fn write(&self, path: &Path, frames: &PatientFrame) {
        let Ok(plan) = file::to_text(&self.plan, frames) else {
            return;
        };
        let number = |needle: &Needle| self.plan.needles.iter().position(|n| n == needle);
        let compensated = self.compensated.iter();
        let compensated = compensated.filter_map(|(needle, done)| Some((number(needle)?, done.clone())));
        let stored = Stored {
            plan,
            compensated: compensated.collect(),
            progress: self.progress.clone(),
        };
        if let Ok(bytes) = serde_json::to_vec(&stored) {
            let _kept = write_whole(path, &bytes);
        }
    }

    /// Reads the copy, if it is complete.
    pub fn read(path: &Path, frames: &PatientFrame) -> Option<Self> {
        let stored: Stored = serde_json::from_slice(&input::read(path, MOST_BYTES).ok()?).ok()?;
        let plan = file::from_text(&stored.plan, frames).ok()?;
        let needle = |(number, done): (usize, Compensation)| Some((plan.needles.get(number)?.clone(), done));
        let compensated = stored.compensated.into_iter().filter_map(needle).collect();
        Some(Self {
            plan,
            compensated,
            progress: stored.progress,
        })
    }
}

impl Planner {
    /// Sets the folder in which plans are kept and looked for while needles are inserted.
    #[must_use]
    pub fn keeping_in(self, folder: PathBuf) -> Self {
        Self {
            kept_in: Some(folder),
            ..self
        }
    }

    /// Takes a plan that another window of this run of the core has begun to insert.
    pub(super) fn take_kept(&mut self) {
        let (Some(folder), Some(outlines)) = (&self.kept_in, &self.planning.outlines) else {
            return;
        };
        if self.looked.as_ref().is_none_or(|(scene, _)| *scene != outlines.scene) {
            let (path, frames) = (path_of(folder, outlines.scene), outlines.frames);
            let job = Job::begin("kept plan", move |messages, _| {
                if let Some(kept) = KeptPlan::read(&path, &frames) {
                    let _ = messages.send(kept);
                }
            });
            self.looked = Some((outlines.scene, job));
        }
        let Some((_, job)) = &self.looked else { return };
        if let JobUpdate::Message(kept) = job.poll()
            && self.history.is_none()
        {
            self.put(kept.plan);
            (self.compensated, self.planning.progress) = (kept.compensated, kept.progress);
            self.message = Some(Note::done("The plan of this implant was restored.".to_owned()));
        }
    }

    /// Writes the plan for another window, on a separate thread, or deletes a discarded one; one after the other.
    pub(super) fn write_kept(&mut self) {
        let writes = |job: &Job<()>| matches!(job.poll(), JobUpdate::Pending);
        if !self.to_keep || self.keeping.as_ref().is_some_and(writes) {
            return;
        }
        let (Some(folder), Some(outlines)) = (&self.kept_in, &self.planning.outlines) else {
            return;
        };
        self.to_keep = false;
        let (path, frames) = (path_of(folder, outlines.scene), outlines.frames);
        let kept = self.plan().map(|plan| KeptPlan {
            plan: plan.clone(),
            compensated: self.compensated.clone(),
            progress: self.planning.progress.clone(),
        });
        self.keeping = Some(Job::begin("keep plan", move |_, _| match kept {
            Some(kept) => kept.write(&path, &frames),
            // Usually there is no file.
            None => drop(std::fs::remove_file(&path)),
        }));
    }

    /// Puts the plan aside.
    pub(super) fn set_aside(&mut self) {
        let Some(history) = self.history.take() else { return };
        self.aside.retain(|aside| aside.of_scene != self.of_scene);
        self.aside.push(Aside {
            of_scene: self.of_scene.clone(),
            body: self.body,
            history,
            compensated: std::mem::take(&mut self.compensated),
            progress: std::mem::take(&mut self.planning.progress),
        });
    }

    /// Returns whether there is no plan, and one of this scene was set aside.
    pub(super) fn can_restore(&self) -> bool {
        self.history.is_none() && self.aside.iter().any(|aside| aside.of_scene == self.of_scene)
    }

    /// Restores the plan of this scene that was set aside, as it was; returns whether there was one.
    pub fn restore(&mut self) -> bool {
        if !self.can_restore() {
            return false;
        }
        let of_scene = self.of_scene.clone();
        if let Some(at) = self.aside.iter().position(|aside| aside.of_scene == of_scene) {
            let aside = self.aside.swap_remove(at);
            (self.history, self.body) = (Some(aside.history), aside.body);
            (self.compensated, self.planning.progress) = (aside.compensated, aside.progress);
            self.message = Some(Note::done("The plan was restored.".to_owned()));
            self.to_keep = true;
            self.change();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_implant::plan::Drops;
    use stylet_implant::plan::compensate::edges::Sensitive;

    #[test]
    fn a_plan_is_found_again_with_its_compensation() {
        let mut planner = super::super::tests::planner();
        let plan = planner.plan().expect("a plan").clone();
        planner.begin_needle(0, 0);
        planner.take_lost(&[1]);
        let done = Compensation {
            drops: Drops::as_planned(&plan.needles[1]),
            before_m: None,
            after_m: vec![[1e-4, 0.0, 0.0]; plan.needles[1].seeds.len()],
            rehearsals: 3,
            for_edges: 1,
            sensitive: vec![Sensitive {
                seed: 0,
                moves_m: Some(2e-3),
            }],
        };
        let frames = PatientFrame::default();
        let scene = SceneId {
            session_id: 7,
            generation: 2,
        };
        let path = path_of(&std::env::temp_dir(), scene).with_extension(std::process::id().to_string());
        let kept = KeptPlan {
            compensated: vec![(plan.needles[1].clone(), done.clone())],
            plan: plan.clone(),
            progress: planner.progress().clone(),
        };
        kept.write(&path, &frames);
        let found = KeptPlan::read(&path, &frames).expect("found");
        assert_eq!(found.plan.needles.len(), plan.needles.len());
        assert_eq!(found.compensated.len(), 1);
        assert_eq!(found.compensated[0].1, done);
        assert_eq!(found.progress, *planner.progress());
        std::fs::write(&path, b"{}").expect("written");
        assert!(
            KeptPlan::read(&path, &frames).is_none(),
            "an incomplete plan is not used"
        );
        let _removed = std::fs::remove_file(&path);
    }
}

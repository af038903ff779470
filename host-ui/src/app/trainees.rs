//! Several trainees in one window: which is followed, and debriefs into the folder of a class.

use super::{App, refusal};
use crate::action::TraineeAction;
use crate::planner::Planner;
use crate::shown::all_errors;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stylet_host::link::Link;
use stylet_host::moments::STOPPED;
use stylet_host::roster::{Glance, Roster, Trainee};
use stylet_implant::class;
use stylet_shm_schema::{Mark, Request};

/// Seeds still move with the tissue for so long after the needle is out.
const RESTS_AFTER: Duration = Duration::from_secs(3);

/// The list of a window, and where its debriefs go.
pub(super) struct Trainees {
    roster: Option<Roster>,
    all: Vec<Trainee>,
    pub(super) glances: Vec<Glance>,
    pub(super) followed: Option<usize>,
    /// Folder of the class.
    class: Option<PathBuf>,
    /// Who sits here, where there is no list.
    name: String,
    /// The present implant is done since then.
    done: Option<Instant>,
    /// It was seen while seeds of its plan were missing, and its debrief is not written yet.
    is_begun: bool,
}

impl Trainees {
    pub(super) fn new(all: Vec<Trainee>, class: Option<PathBuf>, name: String) -> Self {
        Self {
            roster: (!all.is_empty()).then(|| Roster::start(all.clone())),
            followed: (!all.is_empty()).then_some(0),
            all,
            glances: Vec::new(),
            class,
            name,
            done: None,
            is_begun: false,
        }
    }

    /// Whose debriefs are written.
    fn name(&self) -> &str {
        let followed = self.followed.and_then(|number| self.all.get(number));
        followed.map_or(&self.name, |trainee| &trainee.name)
    }

    pub(super) fn folder(&self) -> Option<PathBuf> {
        Some(class::folder_of(self.class.as_ref()?, self.name()))
    }
}

impl App {
    pub(super) fn take_trainees(&mut self) {
        if let Some(roster) = &self.trainees.roster {
            self.trainees.glances = roster.glances();
        }
        if self.trainees.class.is_some() && !self.watches() {
            self.write_when_done();
        }
    }

    /// Once each implant: every planned seed was dropped, and the needle is out.
    fn write_when_done(&mut self) {
        let rows = all_errors(&self.shown);
        if rows.is_empty() || !self.shown.is_live() {
            return;
        }
        let is_whole = rows.iter().all(|(_, row)| row.placed.is_some());
        // What was done before this window was there is not its own.
        self.trainees.is_begun |= !is_whole;
        if !is_whole || self.shown.is_in_tissue() {
            self.trainees.done = None;
            return;
        }
        let since = *self.trainees.done.get_or_insert_with(Instant::now);
        if since.elapsed() >= RESTS_AFTER
            && std::mem::take(&mut self.trainees.is_begun)
            && let Some(folder) = self.trainees.folder()
        {
            self.save_debrief_as(folder);
        }
    }

    pub(super) fn act_on_trainees(&mut self, action: TraineeAction) {
        match action {
            TraineeAction::Follow(number) => self.follow(number),
            TraineeAction::Stop(number) => self.stop_trainee(number),
            TraineeAction::StopAll => (0..self.trainees.all.len()).for_each(|number| self.stop_trainee(number)),
        }
    }

    /// Nothing of one trainee's is taken for another's.
    fn follow(&mut self, number: usize) {
        let Some(trainee) = self.trainees.all.get(number).cloned() else {
            return;
        };
        if self.trainees.followed == Some(number) {
            return;
        }
        if self.run.is_some() || self.watches() {
            self.shown.note = Some(refusal(
                "Stop the needles or close the recording first, then follow another.".to_owned(),
            ));
            return;
        }
        self.trainees.followed = Some(number);
        (self.trainees.done, self.trainees.is_begun) = (None, false);
        self.shown.instance = trainee.instance.name().to_owned();
        self.planner = Planner::default().keeping_in(PathBuf::from(trainee.instance.root()));
        self.change_link(|_| Link::new(trainee.instance));
    }

    fn stop_trainee(&mut self, number: usize) {
        if self.trainees.followed == Some(number) {
            self.stop_run();
            let text = STOPPED.to_owned();
            self.send("Mark", &Request::Mark(Mark { text, before_s: 0.0 }));
        } else if !self.trainees.roster.as_ref().is_some_and(|roster| roster.stop(number)) {
            self.shown.note = Some(refusal(
                "The hand could not be stopped: too many requests wait.".to_owned(),
            ));
        }
    }
}

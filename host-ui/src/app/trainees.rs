//! Several trainees in one window: the followed one, the state of each, and debriefs into the
//! folder of a class.

use super::App;
use super::debrief::{Delivered, folder_of};
use crate::action::TraineeAction;
use crate::planner::Planner;
use crate::shown::all_errors;
use std::collections::VecDeque;
use std::path::PathBuf;
use stylet_host::link::{Link, LinkStatus};
use stylet_host::roster::{self, Glance, Trainee};
use stylet_implant::received::ReceivedProcedure;
use stylet_shm_schema::flags;
use web_time::{Duration, Instant};

/// Time for which seeds still move with the tissue after the needle is out.
const RESTS_AFTER: Duration = Duration::from_secs(3);
/// Period of snapshots of a trainee who is not followed: they only locate the seeds, and nothing is
/// drawn.
const SEEDS_EVERY: Duration = Duration::from_millis(250);

/// End of a procedure, reported once, and only if this window has seen its beginning.
#[derive(Default)]
struct Ending {
    /// Time since which every planned seed is in, and the needle is out.
    done: Option<Instant>,
    /// True from the first sight of an incomplete plan until its debrief is written.
    is_begun: bool,
}

impl Ending {
    /// Returns whether a debrief is due now.
    fn take(&mut self, is_whole: bool, is_in_tissue: bool) -> bool {
        // A procedure that was complete before this window opened does not count.
        self.is_begun |= !is_whole;
        if !is_whole || is_in_tissue {
            self.done = None;
            return false;
        }
        let since = *self.done.get_or_insert_with(Instant::now);
        since.elapsed() >= RESTS_AFTER && std::mem::take(&mut self.is_begun)
    }
}

/// State of one trainee in this window.
struct Seat {
    link: Link,
    heard: ReceivedProcedure,
    ending: Ending,
}

/// List of a window's trainees, and destination of their debriefs.
pub(super) struct Trainees {
    all: Vec<Trainee>,
    pub(super) glances: Vec<Glance>,
    pub(super) followed: Option<usize>,
    /// Folder of the class.
    class: Option<PathBuf>,
    /// Name of the operator here, if there is no list.
    name: String,
    /// End of this window's own implant.
    ending: Ending,
    /// Trainees in the order of the list.
    seats: Vec<Seat>,
    /// Trainees whose debriefs are to be written.
    due: VecDeque<usize>,
}

impl Trainees {
    pub(super) fn new(all: Vec<Trainee>, class: Option<PathBuf>, name: String) -> Self {
        Self {
            followed: (!all.is_empty()).then_some(0),
            seats: all.iter().map(Seat::new).collect(),
            all,
            glances: Vec::new(),
            class,
            name,
            ending: Ending::default(),
            due: VecDeque::new(),
        }
    }

    /// Returns the folder for the debrief of the trainee shown.
    pub(super) fn folder(&self) -> Option<PathBuf> {
        let followed = self.followed.and_then(|number| self.all.get(number));
        self.folder_of(followed.map_or(&self.name, |trainee| &trainee.name))
    }

    fn folder_of(&self, name: &str) -> Option<PathBuf> {
        Some(roster::folder_of(self.class.as_ref()?, name))
    }
}

impl Seat {
    fn new(trainee: &Trainee) -> Self {
        Self {
            link: Link::with_snapshots_every(trainee.instance.clone(), SEEDS_EVERY),
            heard: ReceivedProcedure::default(),
            ending: Ending::default(),
        }
    }

    /// Returns whether a debrief is due.
    fn take(&mut self) -> bool {
        self.link.poll();
        let records = self.link.take_records();
        let _second = self.link.take_second_records();
        self.heard.take(&self.link, &records);
        let in_tissue = flags::IN_CONTACT | flags::PUNCTURED;
        let state = self.link.state().filter(|_| self.link.status() == LinkStatus::Live);
        // A silent core ends nothing.
        state.is_some_and(|s| {
            let is_whole = self.heard.is_whole();
            self.heard.prescribed().is_some() && self.ending.take(is_whole, s.flags & in_tissue != 0)
        })
    }
}

impl App {
    pub(super) fn take_trainees(&mut self) {
        let list = &mut self.trainees;
        for (number, seat) in list.seats.iter_mut().enumerate() {
            if seat.take() && list.class.is_some() {
                list.due.push_back(number);
            }
        }
        let seats = list.all.iter().zip(&list.seats);
        list.glances = seats.map(|(trainee, seat)| Glance::of(trainee, &seat.link)).collect();
        if self.trainees.seats.is_empty() && self.trainees.class.is_some() && !self.watches() {
            self.write_when_done();
        }
        if self.debrief.is_none()
            && let Some(number) = self.trainees.due.pop_front()
        {
            self.debrief_trainee(number);
        }
    }

    /// Writes a debrief once for each implant: every planned seed was dropped, and the needle is
    /// out.
    fn write_when_done(&mut self) {
        let rows = all_errors(&self.shown);
        if rows.is_empty() || !self.shown.is_live() {
            return;
        }
        let is_whole = rows.iter().all(|(_, row)| row.placed.is_some());
        if self.trainees.ending.take(is_whole, self.shown.is_in_tissue())
            && let Some(folder) = self.trainees.folder()
        {
            self.save_debrief_as(folder);
        }
    }

    /// Writes a debrief from this window's data, into the folder of the class or a new one.
    pub(super) fn debrief_trainee(&mut self, number: usize) {
        let list = &self.trainees;
        let (Some(seat), Some(trainee)) = (list.seats.get(number), list.all.get(number)) else {
            return;
        };
        let own = || folder_of(&format!("debrief-{}", trainee.name));
        let folder = list.folder_of(&trainee.name).unwrap_or_else(own);
        let mut planned = seat.heard.prescribed().unwrap_or_default();
        if planned.strength_u == 0.0 {
            planned.strength_u = self.settings.seed_strength_u;
        }
        let delivered = Delivered::of_heard(&seat.link, &seat.heard, planned, Some(&trainee.name));
        self.write_debrief(delivered, folder);
    }

    pub(super) fn act_on_trainees(&mut self, action: TraineeAction) {
        match action {
            TraineeAction::Follow(number) => self.follow(number),
            TraineeAction::Stop(number) => self.stop_trainee(number),
            TraineeAction::Debrief(number) => self.debrief_trainee(number),
            TraineeAction::StopAll => (0..self.trainees.all.len()).for_each(|number| self.stop_trainee(number)),
        }
    }

    /// Follows another trainee, discarding everything that belongs to the previous one.
    fn follow(&mut self, number: usize) {
        let Some(trainee) = self.trainees.all.get(number).cloned() else {
            return;
        };
        if self.trainees.followed == Some(number) {
            return;
        }
        if self.run.is_some() || self.watches() {
            self.refuse("Stop the needles or close the recording before you follow another trainee.");
            return;
        }
        self.trainees.followed = Some(number);
        self.shown.instance = trainee.instance.name().to_owned();
        self.planner = Planner::default();
        self.change_link(|_| Link::new(trainee.instance));
    }

    fn stop_trainee(&mut self, number: usize) {
        if self.trainees.followed == Some(number) {
            self.stop_run();
        }
        let Some(seat) = self.trainees.seats.get_mut(number) else {
            return;
        };
        if let Err(why) = roster::stop(&mut seat.link) {
            self.refuse(format!("The hand could not be stopped: {why}"));
        }
    }
}

//! State replayed to each new bridge: the newest of each state, and the last events and answers.

use super::outbox::Outbox;
use std::collections::VecDeque;
use std::os::fd::OwnedFd;
use std::rc::Rc;
use stylet_shm_schema::*;
use stylet_wall::packet::{BoardSize, Kind};

/// State replayed to each new bridge.
pub struct Kept {
    pub state: Rc<OwnedFd>,
    pub second_state: Option<Rc<OwnedFd>>,
    pub snapshots: Option<(BoardSize, Rc<OwnedFd>)>,
    pub session: Option<Session>,
    pub scene: Option<(Box<SceneHeader>, Rc<OwnedFd>)>,
    pub parameters: Option<ParametersInForce>,
    pub plan: Option<PlanInForce>,
    pub events: VecDeque<Event>,
    pub replies: VecDeque<Reply>,
    pub rehearsals: VecDeque<Box<Rehearsal>>,
}

impl Kept {
    /// Sends everything to a new bridge.
    pub fn tell(&self, outbox: &mut Outbox) {
        outbox.put(Kind::State, &[], Some(&self.state));
        if let Some(board) = &self.second_state {
            outbox.put(Kind::SecondState, &[], Some(board));
        }
        if let Some(session) = &self.session {
            outbox.put(Kind::Session, bytemuck::bytes_of(session), None);
        }
        self.tell_scene(outbox);
        if let Some(parameters) = &self.parameters {
            outbox.put(Kind::Parameters, bytemuck::bytes_of(parameters), None);
        }
        if let Some(plan) = &self.plan {
            outbox.put(Kind::Plan, bytemuck::bytes_of(plan), None);
        }
        for event in &self.events {
            outbox.put(Kind::Event, bytemuck::bytes_of(event), None);
        }
        for rehearsal in &self.rehearsals {
            outbox.put(Kind::Rehearsal, bytemuck::bytes_of(&**rehearsal), None);
        }
        for reply in &self.replies {
            outbox.put(Kind::Reply, bytemuck::bytes_of(reply), None);
        }
    }

    /// Sends the running scene and its snapshot board.
    pub fn tell_scene(&self, outbox: &mut Outbox) {
        if let Some((size, board)) = &self.snapshots {
            outbox.put(Kind::Snapshots, bytemuck::bytes_of(size), Some(board));
        }
        if let Some((header, words)) = &self.scene {
            outbox.put(Kind::Scene, bytemuck::bytes_of(&**header), Some(words));
        }
    }
}

/// Keeps the last `most`.
pub fn keep<T>(queue: &mut VecDeque<T>, value: T, most: usize) {
    if queue.len() >= most {
        queue.pop_front();
    }
    queue.push_back(value);
}

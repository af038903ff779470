//! Takes a scene from the host's request until it runs.

use super::answers::Asker;
use super::picture::{ScenePicture, snapshot_len};
use super::{Control, upload};
use crate::background::Task;
use crate::rt::exchange::{Ticket, TissueOrder};
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_anatomy::PatientFrame;
use stylet_shm_schema::{BUILTIN_SCENES, Event, EventKind, ProblemList, Refusal, RefusalCode, Text, UploadHeader};
use stylet_sim::active::activate;
use stylet_sim::scene::{Scene, SceneSource};
use stylet_wall::kind::Kind;

/// A requested scene.
pub(super) struct Wanted {
    ticket: Ticket,
    name: String,
    patient: PatientFrame,
}

type BuiltScene = (Box<Scene>, SceneSource);

/// A scene from the order to the tissue loop until it runs.
pub(super) struct NextScene {
    ticket: Ticket,
    picture: ScenePicture,
    source: Arc<SceneSource>,
}

/// The running scene, as sent to hosts, and the one that follows it.
pub(super) struct RunningScene {
    picture: ScenePicture,
    loading: Option<(Wanted, Task<Result<BuiltScene, Refusal>>)>,
    next: Option<NextScene>,
}

impl RunningScene {
    pub(super) fn new(picture: ScenePicture) -> Self {
        Self {
            picture,
            loading: None,
            next: None,
        }
    }

    pub(super) fn generation(&self) -> u64 {
        self.picture.header.generation
    }
}

impl Control {
    pub(super) fn load_builtin(&mut self, ticket: Ticket, number: u32) -> Result<(), Refusal> {
        let name = *BUILTIN_SCENES.get(number as usize).ok_or(RefusalCode::UnknownScene)?;
        let wanted = Wanted {
            ticket,
            name: name.to_owned(),
            patient: PatientFrame::default(),
        };
        self.load(wanted, || {
            let source = SceneSource::Builtin(name.to_owned());
            let built = source.build();
            let scene = built.map_err(|why| Refusal::new(RefusalCode::SceneNotBuilt, why.to_string()))?;
            Ok((scene, source))
        })
    }

    pub(super) fn take_volume(&mut self, header: &UploadHeader, cells: &[u8]) {
        let asker: Asker = (header.host_id, header.command_id);
        let read = upload::labels(header, cells).and_then(|labels| Ok((labels, upload::layers(header)?)));
        let (labels, layers) = match read {
            Ok(both) => both,
            Err(why) => {
                let refusal = Refusal::new(RefusalCode::InvalidVolume, why.to_string());
                return self.link.refuse_invalid(asker, &refusal);
            }
        };
        let (ticket, name) = (self.link.answers.ticket(asker), header.name.read());
        let wanted = Wanted {
            ticket,
            name: name.clone(),
            patient: PatientFrame::of_wire(&header.patient_from_scene),
        };
        let loading = self.load(wanted, move || {
            let scene = Scene::from_labels(&name, &labels)
                .map_err(|problems| Refusal::new(RefusalCode::InvalidVolume, ProblemList(problems).to_string()))?;
            let source = SceneSource::of_labels(&name, &labels).in_layers(layers.clone());
            let source = source.map_err(|why| Refusal::new(RefusalCode::InvalidVolume, why.to_string()))?;
            Ok((Scene { layers, ..scene }, source))
        });
        if let Err(refusal) = loading {
            self.link.answer(ticket, Err(&refusal));
        }
    }

    /// Builds a scene on a separate thread, one at a time; the running scene stays until the next one is ready.
    fn load(
        &mut self,
        wanted: Wanted,
        build: impl FnOnce() -> Result<(Scene, SceneSource), Refusal> + Send + 'static,
    ) -> Result<(), Refusal> {
        if self.scene.next.is_some() || self.scene.loading.is_some() {
            return Err(RefusalCode::SceneLoading.into());
        }
        let work = move |_: &AtomicBool| build().map(|(scene, source)| (Box::new(scene), source));
        let failed = |_| Refusal::new(RefusalCode::Internal, "no thread could be started to load the scene");
        self.scene.loading = Some((
            wanted,
            Task::spawn("scene-loader", self.link.wall.work(), work).map_err(failed)?,
        ));
        Ok(())
    }

    pub(super) fn take_loaded(&mut self) {
        let loaded = self.scene.loading.take_if(|(_, task)| task.is_finished());
        if let Some((wanted, task)) = loaded {
            let ticket = wanted.ticket;
            let built = task.result().unwrap_or(Err(RefusalCode::Internal.into()));
            if let Err(refusal) = built.and_then(|scene| self.order_scene(wanted, scene)) {
                self.link.answer(ticket, Err(&refusal));
            }
        }
    }

    /// Orders a built scene from the tissue loop.
    fn order_scene(&mut self, wanted: Wanted, (scene, source): BuiltScene) -> Result<(), Refusal> {
        // Changes already ordered reach the tissue loop before the scene does.
        let active = activate(&self.parameters.with(&[]), &self.device)?;
        let (generation, session_id) = (self.scene.generation() + 1, self.link.session.session_id);
        let mut world = World::new(*scene, self.tissue, active.limits, generation)
            .map_err(|why| Refusal::new(RefusalCode::SceneNotBuilt, why.to_string()))?;
        let mut picture = ScenePicture::of(&world.scene, session_id, generation, wanted.patient);
        picture.header.name = Text::new(&wanted.name);
        world.migration = active.migration;
        let board = self.link.wall.make_board(snapshot_len(&world.scene));
        let failed =
            |why: std::io::Error| Refusal::new(RefusalCode::SceneNotBuilt, format!("no memory to show it: {why}"));
        world.shown = Some(board.map_err(failed)?);
        let source = Arc::new(source);
        let order = TissueOrder::World {
            ticket: wanted.ticket,
            tape: Box::new(TissueTape::new(&world, Arc::clone(&source))),
            world: Box::new(world),
        };
        if self.loops.tissue_orders.push(order).is_err() {
            let why = "too many requests at once; load the scene again";
            return Err(Refusal::new(RefusalCode::TooManyRequests, why));
        }
        self.scene.next = Some(NextScene {
            ticket: wanted.ticket,
            picture,
            source,
        });
        Ok(())
    }

    /// Takes up the next scene, if the tissue loop runs it from `tick` on by that ticket.
    pub(super) fn take_up_scene(&mut self, ticket: Ticket, tick: u64) {
        let Some(next) = self.scene.next.take_if(|next| next.ticket == ticket) else {
            return;
        };
        self.scene.picture = next.picture;
        self.lines.change_scene(Arc::clone(&next.source));
        if let Some(probe) = &mut self.probe {
            probe.change_scene(Arc::clone(&next.source));
        }
        self.rehearsals.change_scene(next.source);
        self.scene.picture.show(self.link.wall.as_mut());
        self.plan = bytemuck::Zeroable::zeroed();
        self.plan.session_id = self.link.session.session_id;
        self.link.wall.keep(Kind::Plan, &self.plan);
        self.link.event(Event {
            code: self.scene.generation() as u32,
            tick,
            text: Text::new(&self.scene.picture.header.name.read()),
            ..self.link.event_now(EventKind::SceneLoaded)
        });
    }
}

//! Takes a scene from the host's request until it runs.

use super::answers::Asker;
use super::link::EventDetails;
use super::loader::{Loaded, Wanted};
use super::picture::{ScenePicture, snapshot_board};
use super::{Control, RunningScene, upload};
use crate::rt::exchange::{Ticket, TissueOrder};
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use std::sync::Arc;
use stylet_anatomy::PatientFrame;
use stylet_shm_schema::{BUILTIN_SCENES, EventKind, Refusal, RefusalCode, Text, UploadHeader};
use stylet_sim::active::activate;
use stylet_sim::scene::{Scene, SceneSource};

impl RunningScene {
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
        let labels = match upload::labels(header, cells) {
            Ok(labels) => labels,
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
            let source = SceneSource::of_labels(&name, &labels);
            let scene = Scene::from_labels(&name, &labels).map_err(|problems| {
                let lines: Vec<_> = problems.iter().map(ToString::to_string).collect();
                Refusal::new(RefusalCode::InvalidVolume, lines.join("\n"))
            })?;
            Ok((scene, source))
        });
        if let Err(refusal) = loading {
            self.link.answer(ticket, Err(&refusal));
        }
    }

    fn load(
        &mut self,
        wanted: Wanted,
        build: impl FnOnce() -> Result<(Scene, SceneSource), Refusal> + Send + 'static,
    ) -> Result<(), Refusal> {
        if self.scene.next.is_some() {
            return Err(RefusalCode::SceneLoading.into());
        }
        self.loader.begin(wanted, build)
    }

    pub(super) fn take_loaded(&mut self) {
        if let Some(loaded) = self.loader.take() {
            let ticket = loaded.wanted.ticket;
            if let Err(refusal) = self.order_scene(loaded) {
                self.link.answer(ticket, Err(&refusal));
            }
        }
    }

    /// Orders a built scene from the tissue loop.
    fn order_scene(&mut self, Loaded { wanted, scene }: Loaded) -> Result<(), Refusal> {
        let (scene, source) = scene?;
        // Changes already ordered reach the tissue loop before the scene does.
        let active = activate(&self.parameters.with(&[]), &self.device)?;
        let (generation, session_id) = (self.scene.generation() + 1, self.link.session.session_id);
        let mut world = World::new(*scene, self.tissue, active.limits, generation)
            .map_err(|why| Refusal::new(RefusalCode::SceneNotBuilt, why.to_string()))?;
        let mut picture = ScenePicture::of(&world.scene, session_id, generation, wanted.patient);
        picture.header.name = Text::new(&wanted.name);
        world.migration = active.migration;
        let (writer, snapshots) = snapshot_board(&world.scene)
            .map_err(|why| Refusal::new(RefusalCode::SceneNotBuilt, format!("no memory to show it: {why}")))?;
        world.shown = Some(writer);
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
        self.scene.next = Some((picture, source, snapshots));
        Ok(())
    }

    /// Records that the tissue loop runs the next scene from `tick` on.
    pub(super) fn scene_taken_up(&mut self, generation: u64, tick: u64) {
        if let Some((picture, source, snapshots)) = self.scene.next.take() {
            self.scene.picture = picture;
            self.lines.change_scene(Arc::clone(&source));
            if let Some(probe) = &mut self.probe {
                probe.change_scene(Arc::clone(&source));
            }
            self.rehearsals.change_scene(source);
            self.scene.picture.show(&mut self.link.wall, Some(snapshots));
            self.plan = bytemuck::Zeroable::zeroed();
            self.plan.session_id = self.link.session.session_id;
            self.link.wall.plan(self.plan);
        }
        let name = self.scene.picture.header.name.read();
        self.link.event(
            EventKind::SceneLoaded,
            EventDetails {
                code: generation as u32,
                tick,
                text: &name,
                ..EventDetails::now()
            },
        );
    }
}

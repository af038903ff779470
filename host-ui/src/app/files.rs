//! Files of the scene, and those that are chosen in a dialog.

use super::App;
use crate::action::{Action, PlanAction, StructuresAction, WatchAction};
use crate::dialog::Purpose;
use crate::loader::Loaded;
use crate::panel::structures::StructureTable;
#[cfg(not(target_family = "wasm"))]
use crate::panel::workflow::Progress;
use crate::recent;
use crate::shown::LoadState;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_files::{Image, LabelVolume, Tissue, Voxels};
use stylet_host::core_args::SceneChoice;
use stylet_shm_schema::{SceneHeader, SceneId};

/// Files of the scene, from their names to the core.
#[derive(Default)]
pub(super) struct SceneFiles {
    pub label: Option<u8>,
    /// Scene from the command line, until it is read.
    pub first_scene: Option<SceneChoice>,
    pub first_image: Option<PathBuf>,
    pub uploading: Option<(u64, String)>,
    /// True from the sending of a scene until it runs: its needle begins outside.
    pub begins_outside: bool,
    pub going_outside: Going,
    /// Table of the structures of the file that was read last, until the core has them.
    pub structures: Option<StructureTable>,
    /// File that is being read or sent as the next scene, and file of the present scene if this
    /// window sent it.
    pub scene_to_come: Option<SentScene>,
    pub scene_file: Option<SentScene>,
    /// Image to show once the scene of this name is loaded.
    pub image_to_come: Option<(Image, String)>,
}

/// Way of the needle out of a scene that was loaded, until the operator does something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Going {
    #[default]
    No,
    Due,
    Sent,
}

/// File that this window reads and sends as a scene.
#[derive(Clone, Default)]
pub(super) struct SentScene {
    pub path: PathBuf,
    /// Name of the scene, once it is read.
    pub name: String,
    /// Scene that the core had when this one was sent.
    pub after: Option<SceneId>,
    /// Its structures, if a person named them in the window.
    pub structures: Vec<Tissue>,
}

impl SceneFiles {
    /// Gives the file to come the structures of the last scene, if it is the same file: another core gets it again.
    fn name_as_before(&mut self) {
        if let (Some(to_come), Some(before)) = (&mut self.scene_to_come, &self.scene_file)
            && to_come.path == before.path
        {
            to_come.structures.clone_from(&before.structures);
        }
    }

    /// Returns the file to come with its structures, if they were named before.
    fn known_structures(&self) -> Option<(PathBuf, Vec<Tissue>)> {
        let file = self.scene_to_come.as_ref().filter(|file| !file.structures.is_empty())?;
        Some((file.path.clone(), file.structures.clone()))
    }
}

impl SentScene {
    /// Returns whether a scene of the core is this one: of its name, and the next after the one before.
    ///
    /// The name alone does not tell: files of two patients are often called alike.
    pub fn is(&self, scene: &SceneHeader) -> bool {
        let next = self.after.is_some_and(|after| {
            let generation = after.generation + 1;
            scene.id() == SceneId { generation, ..after }
        });
        next && scene.name.read() == self.name
    }
}

impl App {
    pub(super) fn pick_file(&mut self, purpose: Purpose) {
        let beside = match purpose {
            Purpose::Scene | Purpose::Image | Purpose::Recording => &self.workflow.scene_path,
            _ => &self.workflow.plan.path,
        };
        self.dialogs.begin(purpose, beside);
    }

    /// Returns the action for the file of a dialog that was closed.
    pub(super) fn picked_file(&mut self) -> Option<Action> {
        let (purpose, picked) = self.dialogs.poll()?;
        let path = match picked {
            Ok(path) => path?,
            Err(why) => {
                self.refuse(format!("{}: {why}", purpose.title()));
                return None;
            }
        };
        let typed = path.display().to_string();
        Some(match purpose {
            Purpose::Scene => {
                self.workflow.scene_path = typed;
                Action::LoadScene(path)
            }
            Purpose::Image => Action::LoadImage(path),
            Purpose::Recording => Action::Watch(WatchAction::File(path)),
            Purpose::ImportPlan => {
                self.workflow.plan.path = typed;
                Action::Plan(PlanAction::Import(path))
            }
            Purpose::SavePlan | Purpose::SaveTable | Purpose::SaveRtPlan => {
                self.workflow.plan.path = typed;
                // The desktop's dialog asked.
                self.workflow.plan.own_file = Some(path.clone());
                Action::Plan(PlanAction::Export(path))
            }
        })
    }

    /// Shows the labels of the file that was read as a table.
    pub(super) fn name_structures(&mut self, voxels: Arc<Voxels>, image: Option<PathBuf>) {
        self.shown.load = LoadState::Idle;
        let file = self.files.scene_to_come.as_ref();
        self.files.structures = file.map(|file| StructureTable::of(file.path.clone(), voxels, image));
    }

    pub(super) fn act_on_structures(&mut self, action: StructuresAction) {
        let Some(table) = &mut self.files.structures else {
            return;
        };
        match action {
            StructuresAction::Use => {
                let (voxels, image, structures) = (table.voxels.clone(), table.image.clone(), table.structures());
                self.files.scene_to_come = Some(SentScene {
                    path: table.path.clone(),
                    structures: structures.clone(),
                    ..SentScene::default()
                });
                self.loader.begin_structures(&table.path, voxels, structures, image);
            }
            StructuresAction::Save => {
                if let Some(path) = table.save() {
                    recent::remember(&mut self.settings.recent, path, false);
                }
            }
            StructuresAction::Close => self.files.structures = None,
        }
    }

    /// Returns the action for a dropped file. A folder is an image series; while the plan's step is
    /// open, a file that is not a volume is a plan.
    #[cfg(not(target_family = "wasm"))]
    pub(super) fn dropped_file(&self, ctx: &egui::Context) -> Option<Action> {
        let path = ctx.input(|i| {
            i.raw
                .dropped_files
                .iter()
                .map(|f| f.path().to_owned())
                .find(|p| !p.as_os_str().is_empty())
        })?;
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
            return Some(Action::Watch(WatchAction::File(path)));
        }
        if path.is_dir() {
            return Some(Action::LoadImage(path));
        }
        let is_plan = ["toml", "csv", "dcm"]
            .iter()
            .any(|ending| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)));
        Some(match is_plan && self.workflow.is_open(Progress::Plan) {
            true => Action::Plan(PlanAction::Import(path)),
            false => Action::LoadScene(path),
        })
    }
}

impl App {
    /// Takes the file that was read, or reads the one from the command line.
    pub(super) fn take_scene_file(&mut self) {
        if self.shown.is_live()
            && let Some(scene) = self.files.first_scene.take()
        {
            match scene {
                SceneChoice::File(path) => {
                    let image = self.files.first_image.take();
                    self.load(&path, image);
                    self.files.name_as_before();
                }
                SceneChoice::BuiltIn(number) => self.load_builtin(number),
            }
        }
        match self.loader.poll() {
            None => {}
            Some(Err(why)) => self.shown.load = LoadState::Refused(why.to_string()),
            Some(Ok(Loaded::Scene(volume, image))) => {
                self.files.image_to_come = image.map(|image| (image, volume.name.clone()));
                if let Some(file) = &mut self.files.scene_to_come {
                    file.name.clone_from(&volume.name);
                    file.after = self.link.scene().map(|scene| scene.header.id());
                }
                self.upload(&volume);
            }
            Some(Ok(Loaded::Image(image))) => self.take_image(image),
            Some(Ok(Loaded::Labels(voxels, image))) => match self.files.known_structures() {
                Some((path, structures)) => self.loader.begin_structures(&path, voxels, structures, image),
                None => self.name_structures(voxels, image),
            },
        }
        if let Some((what, share)) = self.loader.at() {
            self.shown.load = LoadState::Reading(what, share);
        }
    }

    pub(super) fn load(&mut self, path: &Path, image: Option<PathBuf>) {
        if !self.shown.load.is_busy() {
            recent::remember(&mut self.settings.recent, absolute(path), false);
            self.files.scene_to_come = Some(SentScene {
                path: path.to_owned(),
                ..SentScene::default()
            });
            self.loader.begin_scene(path, self.files.label, image);
        }
    }

    pub(super) fn load_image(&mut self, path: &Path) {
        if !self.shown.load.is_busy() {
            recent::remember(&mut self.settings.recent, absolute(path), true);
            self.loader.begin_image(path, self.scene_file());
        }
    }

    /// Takes an image of the present scene's patient.
    fn take_image(&mut self, image: Image) {
        let Some(scene) = &self.shown.scene else {
            self.shown.load = LoadState::Refused(format!("{}: its scene is no longer loaded", image.name));
            return;
        };
        let [low, high] = [scene.target_lower_m, scene.target_upper_m];
        let middle_m = [0, 1, 2].map(|a| (low[a] + high[a]) / 2.0);
        match image.covers(&scene.patient(), middle_m) {
            Ok(()) => {
                let name = scene.name.read();
                self.show_image(image, &name);
            }
            Err(why) => self.shown.load = LoadState::Refused(format!("{}: {why}", image.name)),
        }
    }

    pub(super) fn show_image(&mut self, image: Image, scene: &str) {
        let mut text = format!(
            "{} is shown in the slices, black at {}, white at {}",
            image.name, image.range[0], image.range[1]
        );
        if let Some(warning) = &image.frame.warning {
            text = format!("{text} ({warning})");
        }
        self.shown.load = match self.middle.show_image(image, scene) {
            Ok(()) => LoadState::Loaded(text),
            Err(why) => LoadState::Refused(why.to_string()),
        };
    }

    fn upload(&mut self, volume: &LabelVolume) {
        let mut name = volume.name.clone();
        for warning in &volume.warnings {
            name = format!("{name} ({warning})");
        }
        self.shown.load = match self.link.upload(volume) {
            Err(e) => LoadState::Refused(e.to_string()),
            Ok(id) => {
                let text = format!("sending {}", volume.name);
                self.files.uploading = Some((id, name));
                self.files.begins_outside = true;
                LoadState::Sending(text)
            }
        };
    }
}

/// Returns the path in absolute form.
fn absolute(path: &Path) -> String {
    std::path::absolute(path)
        .unwrap_or_else(|_| path.to_owned())
        .display()
        .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::Text;

    /// The file of a scene used to be known by its name: after another window had loaded `rs.dcm` of another patient,
    /// plans and studies were written with the patient and the contours of the own `rs.dcm`.
    #[test]
    fn a_scene_of_the_same_name_is_not_the_own_one() {
        let mut scene = SceneHeader {
            session_id: 7,
            generation: 3,
            name: Text::new("rs.dcm"),
            ..SceneHeader::default()
        };
        let own = SentScene {
            path: "p1/rs.dcm".into(),
            name: "rs.dcm".to_owned(),
            after: Some(SceneId {
                session_id: 7,
                generation: 2,
            }),
            ..SentScene::default()
        };
        assert!(own.is(&scene));
        scene.generation = 4;
        assert!(!own.is(&scene), "loaded by another window");
        (scene.session_id, scene.generation) = (8, 3);
        assert!(!own.is(&scene), "of another core");
        (scene.session_id, scene.name) = (7, Text::new("other.dcm"));
        assert!(!own.is(&scene));
        assert!(!SentScene { after: None, ..own }.is(&scene));
    }
}

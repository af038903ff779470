//! Reads scenes and images on a separate thread, so that a large or broken file never delays a
//! frame.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_base::job::{Job, JobUpdate};
use stylet_files::agreed;
use stylet_files::dicom::Shared;
use stylet_files::{self as files, FileError, Image, LabelVolume, Progress, Tissue, Voxels, scene};

/// Result of reading a file.
pub enum Loaded {
    /// Scene, and the image that its scene file names.
    Scene(Box<LabelVolume>, Option<Image>),
    Image(Image),
    /// Labels whose structures a person names first, and the image to show with them.
    Labels(Arc<Voxels>, Option<PathBuf>),
}

/// Error of a file that could not be read.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file was refused, with the reason.
    #[error(transparent)]
    File(#[from] FileError),
    /// The thread ended without a result.
    #[error("{}: the reader ended before the file was read", .0.display())]
    Ended(PathBuf),
}

type Outcome = Result<Loaded, LoadError>;

struct Reading {
    path: PathBuf,
    progress: Progress,
    job: Job<Outcome>,
}

/// One file at a time.
#[derive(Default)]
pub struct Loader {
    reading: Option<Reading>,
}

impl Loader {
    /// Starts to read a scene. `image` replaces the image that a scene file names.
    pub fn begin_scene(&mut self, path: &Path, label: Option<u8>, image: Option<PathBuf>) {
        self.begin(path, move |path, progress| scene_of(path, label, image, progress));
    }

    /// Starts to make a scene of these structures of a volume that was read; other labels are left out.
    pub fn begin_structures(
        &mut self,
        path: &Path,
        voxels: Arc<Voxels>,
        structures: Vec<Tissue>,
        image: Option<PathBuf>,
    ) {
        self.begin(path, move |path, progress| {
            let name = files::bytes::file_name(path);
            let volume = LabelVolume::from_tissues(&voxels, structures, name, progress);
            scene_with(path, volume.map_err(|why| FileError::of(path, why))?, image, progress)
        });
    }

    /// Starts to read an image, which must be of the patient of the scene's file.
    pub fn begin_image(&mut self, path: &Path, scene_file: Option<PathBuf>) {
        self.begin(path, move |path, progress| {
            image_of(path, scene_file.as_deref(), progress).map(Loaded::Image)
        });
    }

    fn begin(
        &mut self,
        path: &Path,
        read: impl FnOnce(&Path, &Progress) -> Result<Loaded, FileError> + Send + 'static,
    ) {
        let progress = Progress::default();
        let (owned, reported) = (path.to_owned(), progress.clone());
        let job = Job::begin("file reader", move |answer, interrupt| {
            let outcome = read(&owned, &reported.ended_by(interrupt.clone()));
            // The window may have closed; the answer is then dropped.
            let _ = answer.send(outcome.map_err(LoadError::from));
        });
        let path = path.to_owned();
        self.reading = Some(Reading { path, progress, job });
    }

    /// Returns file and stage of the reading, and the completed share of the stage.
    pub fn at(&self) -> Option<(String, f32)> {
        let reading = self.reading.as_ref()?;
        let (stage, share) = reading.progress.at();
        Some((
            format!("{}: {}", files::bytes::file_name(&reading.path), stage.name()),
            share,
        ))
    }

    /// Cancels the reading; its thread ends soon.
    pub fn cancel(&mut self) {
        self.reading = None;
    }

    /// Reports each result once; a reader that ended without one is an error too.
    pub fn poll(&mut self) -> Option<Outcome> {
        let reading = self.reading.as_ref()?;
        let outcome = match reading.job.poll() {
            JobUpdate::Pending => return None,
            JobUpdate::Message(outcome) => outcome,
            JobUpdate::Ended => Err(LoadError::Ended(reading.path.clone())),
        };
        self.reading = None;
        Some(outcome)
    }
}

fn image_of(path: &Path, scene_file: Option<&Path>, progress: &Progress) -> Result<Image, FileError> {
    let notes = agreed(&[scene_file, Some(path)], Shared::Frame)?.notes;
    let mut image = Image::read(path, progress)?;
    let notes = image
        .frame
        .warning
        .take()
        .into_iter()
        .chain(notes.into_iter().map(|(_, note)| note));
    image.frame.warning = Some(notes.collect::<Vec<_>>().join("; ")).filter(|notes| !notes.is_empty());
    Ok(image)
}

fn scene_of(path: &Path, label: Option<u8>, image: Option<PathBuf>, progress: &Progress) -> Result<Loaded, FileError> {
    if label.is_some() {
        return scene_with(path, files::read(path, label, progress)?, image, progress);
    }
    if scene::is_scene(path) {
        let (scene, volume) = scene::load(path, progress)?;
        let named = scene.image.map(|file| path.with_file_name(file));
        return scene_with(path, volume, image.or(named), progress);
    }
    let voxels = files::read_voxels(path, progress)?;
    if voxels.present().len() > 1 {
        return Ok(Loaded::Labels(Arc::new(voxels), image));
    }
    let volume = LabelVolume::from_voxels(&voxels, None, files::bytes::file_name(path), progress);
    scene_with(path, volume.map_err(|why| FileError::of(path, why))?, image, progress)
}

fn scene_with(
    path: &Path,
    volume: LabelVolume,
    image: Option<PathBuf>,
    progress: &Progress,
) -> Result<Loaded, FileError> {
    let Some(file) = image else {
        return Ok(Loaded::Scene(Box::new(volume), None));
    };
    let image = image_of(&file, Some(path), progress)?;
    image
        .covers(&volume.patient, volume.middle_m())
        .map_err(|why| FileError::of(&file, why))?;
    Ok(Loaded::Scene(Box::new(volume), Some(image)))
}

//! Saved probe answers that took minutes to solve: one file per scene and tissue.
//!
//! Layout: `MAGIC`, SHA-256 of scene and answers, answers (postcard). Nothing is used before the digest is verified;
//! answers of another wall and non-finite numbers are refused.

#[cfg(not(target_family = "wasm"))]
use crate::environment::user_folder;
use crate::pieces;
use sha2::{Digest, Sha256};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use stylet_sim::probe::{PADS_APART_M, ProbeShape, SolvedProbe};
use stylet_sim::scene::Scene;

/// Ends in the version of the layout and of the solution method.
const MAGIC: [u8; 8] = *b"STYLPRB3";
const DIGEST: usize = 32;
/// In finite elements of 2.7 mm the answers of `pelvis` take 380 MB.
const MOST_BYTES: u64 = 1 << 30;

/// Reason why a file is not used.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    /// It could not be read or written.
    #[error("{path}: {why}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        why: io::Error,
    },
    /// The file was written for another scene, or is damaged.
    #[error("{0}: damaged, or of another scene or version: solve again ('rt-core probe --again'), or remove it")]
    Other(PathBuf),
}

/// Returns `$XDG_CACHE_HOME/stylet/probes`, by default under `~/.cache`; `None` for a user without a home.
#[cfg(not(target_family = "wasm"))]
pub fn default_folder() -> Option<PathBuf> {
    Some(user_folder("XDG_CACHE_HOME", ".cache")?.join("stylet/probes"))
}

/// Returns the file of a scene and its probe.
pub fn path(folder: &Path, scene: &Scene, shape: &ProbeShape) -> PathBuf {
    let digest = digest_of(scene, shape);
    let number = digest[..8].iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    folder.join(format!("{number}.probe"))
}

/// Reads the scene's answers; `None` if none are saved.
pub fn read(path: &Path, scene: &Scene, shape: &ProbeShape) -> Result<Option<SolvedProbe>, KeptError> {
    let other = || KeptError::Other(path.to_owned());
    let io = |why| KeptError::Io {
        path: path.to_owned(),
        why,
    };
    match fs::metadata(path) {
        Err(why) if why.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(why) => return Err(io(why)),
        Ok(found) if !found.is_file() || found.len() > MOST_BYTES => return Err(other()),
        Ok(_) => {}
    }
    let bytes = pieces::read(path).map_err(io)?;
    let (magic, rest) = bytes.split_at_checked(MAGIC.len()).ok_or_else(other)?;
    let (digest, answers) = rest.split_at_checked(DIGEST).ok_or_else(other)?;
    if magic != MAGIC || digest != joined(scene, shape, answers) {
        return Err(other());
    }
    postcard::from_bytes(answers).map(Some).map_err(|_| other())
}

/// Saves the answers atomically.
pub fn write(path: &Path, scene: &Scene, shape: &ProbeShape, solved: &SolvedProbe) -> Result<(), KeptError> {
    let io = |why| KeptError::Io {
        path: path.to_owned(),
        why,
    };
    let answers = postcard::to_allocvec(solved).map_err(|why| io(io::Error::other(why)))?;
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(io)?;
    pieces::write(path, &[&MAGIC, &joined(scene, shape, &answers), &answers]).map_err(io)
}

fn joined(scene: &Scene, shape: &ProbeShape, answers: &[u8]) -> [u8; DIGEST] {
    Sha256::new()
        .chain_update(digest_of(scene, shape))
        .chain_update(answers)
        .finalize()
        .into()
}

/// Digest of everything that the answers follow from.
fn digest_of(scene: &Scene, shape: &ProbeShape) -> [u8; DIGEST] {
    let mut digest = Sha256::new()
        .chain_update(MAGIC)
        .chain_update(env!("CARGO_PKG_VERSION"))
        .chain_update(shape.radius_m.to_le_bytes())
        .chain_update(PADS_APART_M.to_le_bytes())
        .chain_update(scene.body.spacing_m.to_le_bytes())
        .chain_update(scene.lattice.spacing_m.to_le_bytes());
    for element in 0..scene.lattice.element_count() as u32 {
        for coordinate in scene.lattice.cell(element) {
            digest.update((coordinate as u32).to_le_bytes());
        }
        digest.update([scene.lattice.structure(element)]);
    }
    // Names and materials; no scene holds any that cannot be serialised.
    digest.update(postcard::to_allocvec(&(&scene.structures, &scene.layers)).unwrap_or_default());
    digest.finalize().into()
}

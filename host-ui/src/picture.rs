//! The window as a PNG file, written in the background.

use eframe::icon_data::IconDataExt;
use egui::{ColorImage, IconData};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{SystemTime, UNIX_EPOCH};
use stylet_base::{WriteError, write_whole};

/// Folder for pictures, below the folder in which the program was started.
const FOLDER: &str = "out/pictures";

/// Error of a picture that could not be saved.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The pixels could not be encoded as PNG.
    #[error("the picture cannot be encoded: {0}")]
    Encode(String),
    /// The folder of the pictures could not be created.
    #[error("{FOLDER}: the folder for pictures cannot be created: {0}")]
    Folder(io::Error),
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// File of a picture, or the reason why there is none.
type Saved = Result<PathBuf, PictureError>;

/// Pictures that are being written.
pub struct Pictures {
    done: Sender<Saved>,
    saved: Receiver<Saved>,
}

impl Default for Pictures {
    fn default() -> Self {
        let (done, saved) = channel();
        Self { done, saved }
    }
}

impl Pictures {
    /// Requests the next frame, which a separate thread writes.
    pub fn request(&self, ctx: &egui::Context) {
        let done = self.done.clone();
        ctx.request_screenshot(move |image| {
            let writer = std::thread::Builder::new().name("picture".to_owned());
            // Without a thread there is no picture; the window may also have closed, and the answer is then dropped.
            let _spawned = writer.spawn(move || done.send(save(&image, Path::new(FOLDER))));
        });
    }

    /// Returns each picture once.
    pub fn poll(&self) -> Option<Saved> {
        self.saved.try_recv().ok()
    }
}

/// Returns the bytes of a PNG file; four bytes for each pixel.
pub fn png_of(rgba: Vec<u8>, [width, height]: [u32; 2]) -> Result<Vec<u8>, PictureError> {
    let icon = IconData { rgba, width, height };
    icon.to_png_bytes().map_err(PictureError::Encode)
}

fn save(image: &ColorImage, folder: &Path) -> Saved {
    let rgba = image.pixels.iter().flat_map(|p| p.to_array()).collect();
    let png = png_of(rgba, image.size.map(|side| side as u32))?;
    std::fs::create_dir_all(folder).map_err(PictureError::Folder)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let path = folder.join(format!("stylet-{}.png", now.as_millis()));
    write_whole(&path, &png)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_a_png_of_the_same_pixels() {
        let folder = std::env::temp_dir().join(format!("stylet-picture-{}", std::process::id()));
        let mut image = ColorImage::filled([3, 2], egui::Color32::from_rgb(10, 20, 30));
        image.pixels[4] = egui::Color32::from_rgb(200, 100, 50);
        let path = save(&image, &folder).expect("written");
        let png = std::fs::read(&path).expect("there");
        let read = eframe::icon_data::from_png_bytes(&png).expect("a PNG");
        assert_eq!((read.width, read.height), (3, 2));
        assert_eq!(&read.rgba[16..20], &[200, 100, 50, 255]);
        std::fs::remove_dir_all(&folder).expect("ours");
        assert!(save(&image, Path::new("/proc/nowhere")).is_err());
    }
}

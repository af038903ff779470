//! Reading for a command: a long one shows its progress on the terminal.

use super::bytes::file_name;
use super::progress::Progress;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use stylet_base::format::printable;
use stylet_base::progress_bar::ShareBar;

/// Period of the checks, and duration below which a reading shows nothing.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Runs a reading of `path`; a long one shows its stage and share on standard error.
pub fn watched<T>(path: &Path, read: impl FnOnce(&Progress) -> T) -> T {
    watched_by(read, |progress| {
        let mut bar = ShareBar::new();
        let name = printable(&file_name(path));
        move || {
            let (stage, share) = progress.at();
            bar.show(&format!("{name}: {}", stage.name()), share);
        }
    })
}

/// Runs a reading while the function from `look` is called periodically on another thread.
fn watched_by<T, L: FnMut()>(read: impl FnOnce(&Progress) -> T, look: impl FnOnce(Progress) -> L + Send) -> T {
    let progress = Progress::default();
    let seen = progress.clone();
    std::thread::scope(|scope| {
        let (reads, ended) = channel::<()>();
        // Without a thread the file is still read.
        let _watches = std::thread::Builder::new()
            .name("progress".to_owned())
            .spawn_scoped(scope, move || {
                let mut look = look(seen);
                while ended.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                    look();
                }
            });
        let result = read(&progress);
        drop(reads);
        result
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stage;
    use std::sync::Mutex;

    /// Guards against commands that read files for many seconds in silence.
    #[test]
    fn only_a_long_reading_shows_progress() {
        let seen = Mutex::new(Vec::new());
        let look = |progress: Progress| {
            let seen = &seen;
            move || seen.lock().unwrap().push(progress.at())
        };
        assert_eq!(watched_by(|_| 7, look), 7);
        assert!(seen.lock().unwrap().is_empty());
        watched_by(
            |progress| {
                progress.report(Stage::Voxels, 1, 4).unwrap();
                while seen.lock().unwrap().len() < 2 {
                    std::thread::sleep(Duration::from_millis(5));
                }
            },
            look,
        );
        assert_eq!(seen.lock().unwrap()[0], (Stage::Voxels, 0.25));
    }
}

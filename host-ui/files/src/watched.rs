//! Reading for a command: while it takes long, the terminal shows how far it is.

use super::bytes::file_name;
use super::progress::Progress;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use stylet_base::format::printable;
use stylet_base::progress_bar::ShareBar;

/// Shorter readings show nothing, and the others are looked at so often.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Carries out a reading of `path`; standard error shows its stage and share while it takes long.
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

/// `look` makes what is called again and again on a thread of its own until the reading ends.
fn watched_by<T, L: FnMut()>(read: impl FnOnce(&Progress) -> T, look: impl FnOnce(Progress) -> L + Send) -> T {
    let progress = Progress::default();
    let seen = progress.clone();
    std::thread::scope(|scope| {
        let (reads, ended) = channel::<()>();
        // Without a thread the file is read all the same.
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

    /// The commands read files of many seconds without a word.
    #[test]
    fn a_long_reading_is_seen_while_it_lasts_and_a_short_one_is_not() {
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

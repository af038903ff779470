//! Remarks on files, on the terminal.

use std::path::Path;
use stylet_base::format::printable;

/// Prints notes about a file to standard error.
pub fn report(path: &Path, notes: &[String]) {
    for note in notes {
        eprintln!("note: {}: {}", path.display(), printable(note));
    }
}

//! Command lines of several programs: their man pages and completions, commands that another
//! program carries out, and output that nobody reads.

#![warn(missing_docs)]

mod completion;
mod hand_over;
mod page;
#[cfg(test)]
mod tests;

use clap::{Args, Command};
use std::io;
use std::path::{Path, PathBuf};
use stylet_write::{WriteError, write_whole};

pub use hand_over::{HandOverError, Product, hand_over, list};

/// Lets a command end silently once its output is no longer read, as `head` expects; by default Rust panics. Call it
/// before any thread starts.
pub fn end_with_reader() {
    // SAFETY: the default action runs no code of ours, and no other thread has started.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_DFL) };
}

/// The subcommand that writes them.
#[derive(Args, Debug)]
pub struct ManualArgs {
    /// Folder to write into, laid out as /usr/share: man/man1, bash-completion, zsh, fish
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Failure to write the pages.
#[derive(Debug, thiserror::Error)]
pub enum ManualError {
    /// A page could not be rendered.
    #[error("the pages cannot be put together ({0})")]
    Render(#[from] io::Error),
    /// The folder of a file cannot be made.
    #[error("{}: the folder cannot be made ({source}); give another with --out", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ManualArgs {
    /// Writes every page and completion of `program` and prints their number.
    ///
    /// # Errors
    /// If the folder cannot be made or written.
    pub fn run(&self, program: Command) -> Result<(), ManualError> {
        let name = program.get_name().to_owned();
        let files = files(program)?;
        for (path, text) in &files {
            write(&self.out.join(path), text)?;
        }
        println!(
            "{name}: {} man pages and shell completions in {}",
            files.len(),
            self.out.display()
        );
        Ok(())
    }
}

fn write(path: &Path, text: &[u8]) -> Result<(), ManualError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|source| ManualError::Folder {
            folder: folder.to_owned(),
            source,
        })?;
    }
    Ok(write_whole(path, text)?)
}

/// Returns every page and completion of a program: the path below a folder such as `/usr/share`, and the text.
///
/// # Errors
/// None in practice: the texts are rendered in memory.
///
/// ```
/// let program = clap::Command::new("needle").about("Drives a needle").subcommand(clap::Command::new("stop"));
/// let files = stylet_manual::files(program).unwrap();
/// let paths: Vec<_> = files.iter().map(|(path, _)| path.to_str().unwrap()).collect();
/// assert!(paths.contains(&"man/man1/needle-stop.1") && paths.contains(&"bash-completion/completions/needle"));
/// ```
pub fn files(program: Command) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut files = page::pages(program.clone())?;
    files.extend(completion::scripts(program));
    Ok(files)
}

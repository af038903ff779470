//! A source file: the TG-43 tables of a seed.

use std::path::Path;
use stylet_base::input;
use stylet_dose::Source;
use stylet_files::FileError;

/// Largest size of a source file.
const MAX_BYTES: u64 = 1 << 20;

/// Reads and checks a source file; the error lists every problem in it. A name without a file is the
/// model of a source of the program.
pub fn read_source(path: &Path) -> Result<Source, FileError> {
    if !path.exists() {
        return named(path);
    }
    let text = input::read_text(path, MAX_BYTES).map_err(|why| FileError::of(path, why))?;
    Source::parse(&text).map_err(|why| FileError::of(path, why.to_string()))
}

/// Returns the file of a source of the program that a path without a file names by its model.
pub fn file_of_program(path: &Path) -> Option<&'static str> {
    path.to_str().filter(|_| !path.exists()).and_then(Source::file_of)
}

fn named(path: &Path) -> Result<Source, FileError> {
    Source::named(&path.to_string_lossy())
        .map_err(|why| FileError::of(path, format!("there is no such file; check the path ({why})")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_of_the_program_is_named_by_its_model() {
        let source = read_source(Path::new("IAI-125A")).unwrap();
        assert_eq!((source.model.as_str(), source.nuclide.as_str()), ("IAI-125A", "I-125"));
        let unknown = read_source(Path::new("6712")).unwrap_err().to_string();
        assert!(unknown.contains("6711, IAI-125A, 200"), "{unknown}");
    }

    #[test]
    fn an_absent_source_is_refused_with_its_path() {
        let absent = read_source(Path::new("/nowhere/source.toml")).unwrap_err().to_string();
        assert!(
            absent.contains("/nowhere/source.toml") && absent.contains("check the path"),
            "{absent}"
        );
    }
}

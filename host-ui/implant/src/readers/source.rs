//! A source file: the TG-43 tables of a seed.

use std::path::Path;
use stylet_base::input;
use stylet_dose::Source;
use stylet_files::FileError;

/// Largest size of a source file.
const MAX_BYTES: u64 = 1 << 20;

/// Reads and checks a source file; the error lists every problem in it.
pub fn read_source(path: &Path) -> Result<Source, FileError> {
    let text = input::read_text(path, MAX_BYTES).map_err(|why| FileError::of(path, why))?;
    Source::parse(&text).map_err(|why| FileError::of(path, why.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_source_is_refused_with_its_path() {
        let absent = read_source(Path::new("/nowhere/source.toml")).unwrap_err().to_string();
        assert!(
            absent.contains("/nowhere/source.toml") && absent.contains("check the path"),
            "{absent}"
        );
    }
}

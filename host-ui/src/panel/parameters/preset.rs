//! Parameters as a file (TOML), in display units.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use stylet_base::input::{InputError, read_text};
use stylet_base::{WriteError, write_whole};
use stylet_shm_schema::{PARAMETERS, ParameterSet};

/// Largest size of a preset.
const MAX_BYTES: u64 = 64 << 10;

/// Error of a preset that could not be saved or loaded.
#[derive(Debug, thiserror::Error)]
pub enum PresetError {
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The file could not be read.
    #[error("{}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: InputError,
    },
    /// Its content is invalid, with one problem a line.
    #[error("{}: {problems}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Every problem.
        problems: String,
    },
}

/// Writes a set of parameters.
pub fn save(path: &Path, set: &ParameterSet) -> Result<(), PresetError> {
    Ok(write_whole(path, text(set).as_bytes())?)
}

/// Returns place in the table and SI value of each parameter in the file.
pub fn load(path: &Path) -> Result<Vec<(usize, f64)>, PresetError> {
    let text = read_text(path, MAX_BYTES).map_err(|source| PresetError::Read {
        path: path.to_owned(),
        source,
    })?;
    read(&text).map_err(|problems| PresetError::Invalid {
        path: path.to_owned(),
        problems,
    })
}

fn text(set: &ParameterSet) -> String {
    let mut text = "# Parameters of Stylet, in the units behind the values.\n".to_owned();
    for spec in &PARAMETERS {
        let value = set.get(spec.id) * spec.display_per_si;
        // Twelve digits: a conversion of units leaves only rounding behind them.
        let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} = {rounded:?} # {}", spec.key, spec.unit);
    }
    text
}

/// Reads a preset; returns every problem, one a line.
fn read(text: &str) -> Result<Vec<(usize, f64)>, String> {
    let table: toml::Table = text.parse().map_err(|e| format!("it is not TOML: {e}"))?;
    let (mut values, mut problems) = (Vec::new(), Vec::new());
    take("", &table, &mut values, &mut problems);
    if values.is_empty() && problems.is_empty() {
        problems.push("it contains no parameter".to_owned());
    }
    if problems.is_empty() {
        Ok(values)
    } else {
        Err(problems.join("\n"))
    }
}

fn take(prefix: &str, table: &toml::Table, values: &mut Vec<(usize, f64)>, problems: &mut Vec<String>) {
    for (name, value) in table {
        let key = if prefix.is_empty() {
            name.clone()
        } else {
            format!("{prefix}.{name}")
        };
        if let toml::Value::Table(inner) = value {
            take(&key, inner, values, problems);
            continue;
        }
        let Some(index) = PARAMETERS.iter().position(|p| p.key == key) else {
            problems.push(format!("{key} is not a parameter"));
            continue;
        };
        let number = match value {
            toml::Value::Float(f) => Some(*f),
            toml::Value::Integer(i) => Some(*i as f64),
            _ => None,
        };
        let spec = &PARAMETERS[index];
        let Some(si) = number.map(|n| n / spec.display_per_si) else {
            problems.push(format!("{key} must be a number, in {}", spec.unit));
            continue;
        };
        match spec.problem(si) {
            Some(problem) => problems.push(problem.to_string()),
            None => values.push((index, si)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::ParameterId;

    #[test]
    fn saved_presets_load_equal() {
        let mut set = ParameterSet::default();
        set.set(ParameterId::PunctureDepth, 6.5e-3);
        set.set(ParameterId::ShearHorizontal, 20.0_f64.to_radians());
        let path = std::env::temp_dir().join(format!("stylet-preset-{}.toml", std::process::id()));
        save(&path, &set).expect("written");
        let written = std::fs::read_to_string(&path).expect("there");
        assert!(written.contains("needle.puncture_depth = 6.5 # mm"), "{written}");
        for (index, value) in load(&path).expect("its own file") {
            let expected = set.values[index];
            assert!(
                (value - expected).abs() <= 1e-9 * expected.abs(),
                "{}",
                PARAMETERS[index].key
            );
        }
        std::fs::remove_file(&path).expect("ours");
    }

    #[test]
    fn a_bad_preset_lists_every_problem() {
        let why = read("needle.puncture_depth = 1000.0\nneedle.nothing = 1\nforce.scale = \"much\"").expect_err("bad");
        assert_eq!(why.lines().count(), 3, "{why}");
        for part in [
            "needle.puncture_depth = 1000",
            "needle.nothing",
            "force.scale must be a number",
        ] {
            assert!(why.contains(part), "{why}");
        }
        assert!(read("not toml").is_err() && read("").is_err());
        assert!(load(Path::new("/dev/zero")).is_err());
    }
}

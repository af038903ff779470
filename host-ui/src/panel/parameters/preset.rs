//! Parameters as a file (TOML) in the units that a person reads.

use std::fmt::Write;
use std::path::Path;
use stylet_shm_schema::{PARAMETERS, ParameterSet};

/// A larger file is no preset.
const MAX_BYTES: u64 = 64 << 10;

pub fn save(path: &Path, set: &ParameterSet) -> Result<(), String> {
    std::fs::write(path, text(set)).map_err(|e| format!("{}: it cannot be written: {e}", path.display()))
}

/// Place in the table and SI value of each parameter in the file.
pub fn load(path: &Path) -> Result<Vec<(usize, f64)>, String> {
    let told = |why: String| format!("{}: {why}", path.display());
    let about = std::fs::metadata(path).map_err(|e| told(format!("it cannot be opened: {e}")))?;
    // A device would never end.
    if !about.is_file() {
        return Err(told("it is no file".to_owned()));
    }
    let size = about.len();
    if size > MAX_BYTES {
        return Err(told(format!("it has {size} bytes; a preset has a few thousand")));
    }
    let text = std::fs::read_to_string(path).map_err(|e| told(format!("it cannot be read: {e}")))?;
    read(&text).map_err(told)
}

fn text(set: &ParameterSet) -> String {
    let mut text = "# Parameters of Stylet, in the units behind the values.\n".to_owned();
    for spec in &PARAMETERS {
        let value = set.get(spec.id) * spec.display_per_si;
        // Twelve digits: what a change of units leaves behind them is rounding.
        let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} = {rounded:?} # {}", spec.key, spec.unit);
    }
    text
}

/// Every problem, one a line.
fn read(text: &str) -> Result<Vec<(usize, f64)>, String> {
    let table: toml::Table = text.parse().map_err(|e| format!("it is not TOML: {e}"))?;
    let (mut values, mut problems) = (Vec::new(), Vec::new());
    take("", &table, &mut values, &mut problems);
    if values.is_empty() && problems.is_empty() {
        problems.push("it holds no parameter".to_owned());
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
            problems.push(format!("{key} is no parameter"));
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
    fn what_was_saved_is_loaded_again() {
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
    fn a_bad_file_gives_every_problem_and_no_value() {
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

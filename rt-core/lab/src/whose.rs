//! Operator, site and device of a measurement: command-line options, with defaults from a file of the site.

use crate::disk::{self, DiskError};
use crate::sign::{self, SignError};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Operator, site and device; fields without a value are missing in the report.
#[derive(Args, Clone, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Whose {
    /// Who measures; stands in the report
    #[arg(long, value_name = "NAME")]
    pub operator: Option<String>,
    /// Where; stands in the report
    #[arg(long, value_name = "NAME")]
    pub site: Option<String>,
    /// Serial number of the haptic device; stands in the report
    #[arg(long, value_name = "SERIAL")]
    pub device_serial: Option<String>,
    /// Sign the report with this SSH key (ssh-keygen -t ed25519 makes one); the signature is report.json.sig
    #[serde(skip_serializing)]
    #[arg(long, value_name = "KEY")]
    pub sign: Option<PathBuf>,
}

/// Whose measurement it is.
#[derive(Args, Clone, Debug, Default)]
pub struct WhoseArgs {
    #[command(flatten)]
    given: Whose,
    /// TOML file with defaults of these options: operator, site, device_serial, sign
    #[arg(long, value_name = "FILE")]
    site_file: Option<PathBuf>,
}

/// The options or the site's file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WhoseError {
    #[error("the site's file: {0}")]
    Disk(#[from] DiskError),
    #[error("{}: {source}\nexpected: operator, site, device_serial and sign, each with a text in quotes", .path.display())]
    Format {
        path: PathBuf,
        source: Box<toml::de::Error>,
    },
    #[error("--{name}: {found:?} is not a name; expected 1 to {LONGEST} characters on one line")]
    Name { name: &'static str, found: String },
    #[error(transparent)]
    Sign(#[from] SignError),
}

/// Most characters of a name.
const LONGEST: usize = 200;

impl WhoseArgs {
    /// Merges options with defaults; a key is checked before anything is measured.
    pub fn read(&self) -> Result<Whose, WhoseError> {
        let defaults = self.site_file.as_deref().map(of_site).transpose()?.unwrap_or_default();
        let given = self.given.clone();
        let whose = Whose {
            operator: given.operator.or(defaults.operator),
            site: given.site.or(defaults.site),
            device_serial: given.device_serial.or(defaults.device_serial),
            sign: given.sign.or(defaults.sign),
        };
        let names = [
            ("operator", &whose.operator),
            ("site", &whose.site),
            ("device-serial", &whose.device_serial),
        ];
        for (name, value) in names {
            let bad =
                |v: &&String| v.trim().is_empty() || v.chars().count() > LONGEST || v.chars().any(char::is_control);
            if let Some(found) = value.as_ref().filter(bad) {
                let found = found.chars().take(LONGEST).collect();
                return Err(WhoseError::Name { name, found });
            }
        }
        if let Some(key) = &whose.sign {
            sign::ready(key)?;
        }
        Ok(whose)
    }
}

fn of_site(path: &Path) -> Result<Whose, WhoseError> {
    let text = disk::read_text(path)?;
    let mut whose: Whose = toml::from_str(&text).map_err(|source| WhoseError::Format {
        path: path.to_owned(),
        source: Box::new(source),
    })?;
    // A key's path is relative to the file.
    let folder = path.parent().unwrap_or(Path::new("."));
    whose.sign = whose.sign.map(|key| folder.join(key));
    Ok(whose)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_win_over_the_file_and_wrong_ones_are_named() {
        let file = std::env::temp_dir().join(format!("stylet-site-{}.toml", std::process::id()));
        std::fs::write(&file, "operator = \"A. Meyer\"\nsite = \"Room 3\"\n").expect("written");
        let args = WhoseArgs {
            given: Whose {
                site: Some("Room 4".to_owned()),
                ..Whose::default()
            },
            site_file: Some(file.clone()),
        };
        let whose = args.read().expect("all are names");
        assert_eq!(
            (whose.operator.as_deref(), whose.site.as_deref()),
            (Some("A. Meyer"), Some("Room 4"))
        );
        std::fs::write(&file, "oprator = \"A. Meyer\"\n").expect("written");
        let why = args.read().expect_err("no such key").to_string();
        assert!(why.contains("oprator") && why.contains("device_serial"), "{why}");
        std::fs::remove_file(&file).expect("removed");
        let why = args.read().expect_err("no such file").to_string();
        assert!(why.contains("cannot read"), "{why}");
        let empty = WhoseArgs {
            given: Whose {
                operator: Some("\n".to_owned()),
                ..Whose::default()
            },
            site_file: None,
        };
        assert!(empty.read().expect_err("no name").to_string().contains("--operator"));
    }
}

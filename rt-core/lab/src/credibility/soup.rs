//! Software of unknown provenance, in the words of IEC 62304: every package of both programs, with its licence.

use crate::provenance;
use serde::Serialize;

/// A package, as locked.
#[derive(Clone, Debug, Serialize)]
pub struct Package {
    pub name: String,
    pub version: String,
    /// Licence as declared by its author; `not known` if its sources were missing when this program was built.
    pub licence: String,
    pub of: &'static str,
    pub known_anomalies: Vec<&'static str>,
}

/// Third-party packages in `rt-core` or `host-ui`.
pub fn packages() -> Vec<Package> {
    let list = include_str!(concat!(env!("OUT_DIR"), "/packages.txt"));
    list.lines().filter_map(package).collect()
}

/// Reads a line `name version programs licence`.
fn package(line: &str) -> Option<Package> {
    let mut words = line.splitn(4, ' ');
    let (name, version, of, licence) = (words.next()?, words.next()?, words.next()?, words.next()?);
    Some(Package {
        name: name.to_owned(),
        version: version.to_owned(),
        licence: licence.to_owned(),
        of: match of {
            "both" => "both",
            "rt-core" => "rt-core",
            _ => "host-ui",
        },
        known_anomalies: provenance::known_anomalies(name),
    })
}

//! Allowed dependencies between the workspace's crates, and banned external ones.

use std::collections::{BTreeMap, BTreeSet};

use toml::Table;

use super::layers::{LAYERS, OUTSIDE};

/// Manifest of each member by its folder.
pub type Manifests = BTreeMap<String, Table>;

/// Returns one line for each dependency that the table does not allow.
pub fn forbidden(workspace: &Table, members: &Manifests) -> Vec<String> {
    let mut found = Vec::new();
    let edges: BTreeMap<&String, Dependencies> = members
        .iter()
        .map(|(folder, manifest)| (folder, dependencies(folder, workspace, manifest)))
        .collect();
    for (folder, uses) in &edges {
        if is_outside(folder) {
            continue;
        }
        let Some(layer) = LAYERS.iter().find(|layer| layer.folder == folder.as_str()) else {
            found.push(format!("{folder}: has no row in the table of layers"));
            continue;
        };
        let too_high = uses.ours.iter().filter(|used| !layer.may_use.contains(&used.as_str()));
        found.extend(too_high.map(|used| format!("{folder} -> {used}: not among what it may use")));
        let named = layer
            .not_itself
            .iter()
            .flat_map(|list| list.iter())
            .filter(|name| uses.others.contains(**name));
        found.extend(named.map(|name| format!("{folder} -> {name}: not in this crate itself")));
        for below in reached(folder, &edges) {
            let others = edges.get(&below).map(|uses| &uses.others);
            let named = layer
                .never
                .iter()
                .flat_map(|list| list.iter())
                .filter(|name| others.is_some_and(|all| all.contains(**name)));
            found.extend(named.map(|name| format!("{folder} -> {name} (in {below}): not in this crate or below it")));
        }
    }
    found
}

fn is_outside(folder: &str) -> bool {
    OUTSIDE.contains(&folder) || folder.starts_with("tests/") || folder.starts_with("benches/")
}

struct Dependencies {
    ours: BTreeSet<String>,
    others: BTreeSet<String>,
}

/// Returns dependencies of every kind and target in a manifest.
fn dependencies(folder: &str, workspace: &Table, manifest: &Table) -> Dependencies {
    let mut found = Dependencies {
        ours: BTreeSet::new(),
        others: BTreeSet::new(),
    };
    let shared = workspace.get("workspace").and_then(|w| w.get("dependencies"));
    let targets = manifest
        .get("target")
        .and_then(|targets| targets.as_table())
        .into_iter()
        .flatten();
    let tables = targets.filter_map(|(_, target)| target.as_table()).chain([manifest]);
    for table in tables {
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for (name, value) in table.get(kind).and_then(|kind| kind.as_table()).into_iter().flatten() {
                let inherited = value.get("workspace").is_some();
                let entry = if inherited {
                    shared.and_then(|shared| shared.get(name)).unwrap_or(value)
                } else {
                    value
                };
                let package = entry
                    .get("package")
                    .and_then(|package| package.as_str())
                    .unwrap_or(name);
                match entry.get("path").and_then(|path| path.as_str()) {
                    Some(path) if inherited => found.ours.insert(path.to_string()),
                    Some(path) => found.ours.insert(joined(folder, path)),
                    None => found.others.insert(package.to_string()),
                };
            }
        }
    }
    found
}

/// Joins a path to a folder, relative to the root: `host-ui/dose` and `../files` give `host-ui/files`.
fn joined(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').collect();
    for part in path.split('/') {
        match part {
            "." | "" => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn reached(folder: &str, edges: &BTreeMap<&String, Dependencies>) -> BTreeSet<String> {
    let mut seen = BTreeSet::from([folder.to_string()]);
    let mut open = vec![folder.to_string()];
    while let Some(next) = open.pop() {
        let below = edges.get(&next).map(|uses| &uses.ours).into_iter().flatten();
        open.extend(below.filter(|used| seen.insert((*used).clone())).cloned());
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::{LAYERS, Manifests, forbidden};

    const WORKSPACE: &str = r#"
        [workspace.dependencies]
        core = { package = "rt-core", path = "rt-core" }
        host = { path = "host-ui/host" }
        egui = "1"
    "#;

    fn of(members: &[(&str, &str)]) -> Vec<String> {
        let members: Manifests = members
            .iter()
            .map(|(folder, text)| (folder.to_string(), text.parse().unwrap()))
            .collect();
        forbidden(&WORKSPACE.parse().unwrap(), &members)
    }

    #[test]
    fn what_goes_up_or_across_is_found() {
        let found = of(&[
            ("host-ui", "[dependencies]\ncore.workspace = true"),
            ("host-ui/host", "[dependencies]\nfiles = { path = '../files' }"),
            (
                "host-ui/files",
                "[dependencies]\nwin = { package = 'wgpu', version = '1' }\niceoryx2 = '0.10'",
            ),
            (
                "hw",
                "[target.'cfg(unix)'.dev-dependencies]\nkit = { path = '../tests' }",
            ),
            ("sounds", ""),
        ]);
        assert_eq!(
            found,
            [
                "host-ui -> rt-core: not among what it may use",
                "host-ui/files -> iceoryx2: not in this crate itself",
                "host-ui/files -> wgpu (in host-ui/files): not in this crate or below it",
                "host-ui/host -> wgpu (in host-ui/files): not in this crate or below it",
                "hw -> tests: not among what it may use",
                "sounds: has no row in the table of layers",
            ]
        );
    }

    #[test]
    fn what_the_table_allows_is_not() {
        let found = of(&[
            (
                "host-ui",
                "[dependencies]\negui.workspace = true\nhost.workspace = true",
            ),
            ("host-ui/host", "[dependencies]\nfiles = { path = '../files' }"),
            ("host-ui/files", "[dependencies]\nnifti = '0.18'"),
            ("tests", "[dependencies]\ncore.workspace = true\nhost.workspace = true"),
        ]);
        assert_eq!(found, Vec::<String>::new());
    }

    #[test]
    fn the_table_itself_goes_from_the_bottom_up_and_the_sides_do_not_meet() {
        for (row, layer) in LAYERS.iter().enumerate() {
            let above = |used: &&&str| !LAYERS[..row].iter().any(|lower| lower.folder == **used);
            assert_eq!(
                layer.may_use.iter().filter(above).count(),
                0,
                "{} uses what stands below it here",
                layer.folder
            );
            let host = layer.folder.starts_with("host-ui");
            let meets = |used: &&str| host && (used.starts_with("rt-core") || used.starts_with("hw"));
            assert!(
                !layer.may_use.iter().any(meets),
                "{} meets the real-time side",
                layer.folder
            );
        }
    }
}

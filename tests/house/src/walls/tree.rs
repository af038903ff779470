//! Files and packages of the workspace.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders with build or run output.
const MADE: [&str; 4] = ["target", "out", "__pycache__", "node_modules"];

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// Returns all files with one of the extensions, as sorted paths from the root.
pub fn files(endings: &[&str]) -> Vec<String> {
    let (root, mut found) = (root(), Vec::new());
    collect(&root, &root, endings, &mut found);
    found.sort();
    found
}

fn collect(root: &Path, folder: &Path, endings: &[&str], found: &mut Vec<String>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, name) = (entry.path(), entry.file_name().into_string().unwrap_or_default());
        let kind = entry.file_type().unwrap();
        if kind.is_dir() && !MADE.contains(&name.as_str()) && (!name.starts_with('.') || name == ".ci") {
            collect(root, &path, endings, found);
        } else if kind.is_file() && endings.iter().any(|ending| name.ends_with(ending)) {
            found.push(path.strip_prefix(root).unwrap().to_str().unwrap().to_string());
        }
    }
}

pub fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

pub fn manifest(path: &str) -> toml::Table {
    read(path).parse().unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Returns the folders of the workspace's members.
pub fn members() -> Vec<String> {
    let manifest = manifest("Cargo.toml");
    let members = manifest["workspace"]["members"].as_array().unwrap();
    members
        .iter()
        .map(|member| member.as_str().unwrap().to_string())
        .collect()
}

/// Packages outside the workspace that depend on its crates, with their own lock file.
const ALONE: [&str; 2] = ["host-ui/relay", "rt-core/python"];

/// Returns the folders of the workspace's members and of the packages outside it.
pub fn packages() -> Vec<String> {
    let alone = ALONE.into_iter().map(str::to_string);
    members().into_iter().chain(alone).collect()
}

/// Returns the root files of a member's library and programs.
pub fn crate_roots(member: &str) -> Vec<String> {
    let manifest = manifest(&format!("{member}/Cargo.toml"));
    let library = manifest.get("lib").and_then(|lib| lib.get("path"));
    let programs = manifest
        .get("bin")
        .and_then(|bins| bins.as_array())
        .into_iter()
        .flatten();
    let named = programs
        .filter_map(|program| program.get("path"))
        .chain(library)
        .filter_map(|path| path.as_str());
    let usual = ["src/lib.rs", "src/main.rs"].into_iter();
    let mut roots: Vec<_> = named.chain(usual).map(|path| format!("{member}/{path}")).collect();
    roots.retain(|path| root().join(path).is_file());
    roots.sort();
    roots.dedup();
    roots
}

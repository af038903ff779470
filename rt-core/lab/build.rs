//! Puts into the program what a filed report must name: commit, and every dependency with its version.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-env-changed=STYLET_COMMIT");
    println!("cargo:rustc-env=STYLET_COMMIT={}", commit());
    println!("cargo:rustc-env=STYLET_TOOLCHAIN={}", toolchain());
    let out = std::env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let list = dependencies(Path::new("../../Cargo.lock")).unwrap_or_default();
    std::fs::write(Path::new(&out).join("dependencies.txt"), list).expect("OUT_DIR can be written");
}

/// From the environment, else from git, else `unknown`: a source archive has neither.
fn commit() -> String {
    if let Ok(named) = std::env::var("STYLET_COMMIT") {
        return named;
    }
    // The log grows with each commit, whichever branch is checked out.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|p| Path::new(p).exists()) {
        println!("cargo:rerun-if-changed={log}");
    }
    println!("cargo:rerun-if-changed=src");
    let Some(commit) = git(&["rev-parse", "HEAD"]) else {
        return "unknown".to_owned();
    };
    let clean = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| s.is_empty());
    if clean {
        commit
    } else {
        format!("{commit} with changes")
    }
}

/// Version of the compiler, and the platform that it builds for.
fn toolchain() -> String {
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let output = Command::new(compiler).arg("--version").output().ok();
    let version = output.and_then(|o| String::from_utf8(o.stdout).ok());
    let version = version.map_or("unknown".to_owned(), |v| v.trim().to_owned());
    format!("{version}, {}", std::env::var("TARGET").unwrap_or_default())
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// `name version` of each package that `rt-core` needs, one a line, as locked.
fn dependencies(lock: &Path) -> Option<String> {
    println!("cargo:rerun-if-changed={}", lock.display());
    let lock: toml::Table = std::fs::read_to_string(lock).ok()?.parse().ok()?;
    let mut needs: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for package in lock.get("package")?.as_array()? {
        let text = |key: &str| package.get(key).and_then(|v| v.as_str()).map(str::to_owned);
        let listed = package.get("dependencies").and_then(|d| d.as_array());
        let listed = listed
            .into_iter()
            .flatten()
            .filter_map(|d| d.as_str().map(str::to_owned));
        needs.insert((text("name")?, text("version")?), listed.collect());
    }
    let mut found = BTreeSet::new();
    let mut open = vec!["rt-core".to_owned()];
    while let Some(wanted) = open.pop() {
        // "name", or "name version" where several are locked.
        let mut words = wanted.split(' ');
        let (name, version) = (words.next(), words.next());
        for (package, more) in &needs {
            let same = Some(package.0.as_str()) == name && version.is_none_or(|v| v == package.1);
            if same && found.insert(package.clone()) {
                open.extend(more.iter().cloned());
            }
        }
    }
    found.retain(|(name, _)| name != "rt-core");
    Some(
        found
            .iter()
            .map(|(name, version)| format!("{name} {version}\n"))
            .collect(),
    )
}

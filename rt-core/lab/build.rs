//! Embeds the facts that a filed report must name: commit, and every dependency with its version and licence.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-env-changed=STYLET_COMMIT");
    println!("cargo:rustc-env=STYLET_COMMIT={}", commit());
    println!("cargo:rustc-env=STYLET_TOOLCHAIN={}", toolchain());
    let out = std::env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let needs = locked(Path::new("../../Cargo.lock")).unwrap_or_default();
    std::fs::write(Path::new(&out).join("packages.txt"), packages(&needs)).expect("OUT_DIR can be written");
}

/// Returns the commit from the environment, else from git, else `unknown`: a source archive has neither.
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

/// Returns the version of the compiler, and the platform that it builds for.
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

/// Name and version of a package.
type Package = (String, String);
/// The packages that each one names, as `name` or `name version`.
type Needs = BTreeMap<Package, Vec<String>>;

/// Returns all locked packages. A parser for all of TOML would change features of packages that the simulator is built
/// from, so that building a product builds them twice; cargo writes one key, or one element of a list, a line.
fn locked(lock: &Path) -> Option<Needs> {
    println!("cargo:rerun-if-changed={}", lock.display());
    let lock = std::fs::read_to_string(lock).ok()?;
    let mut needs = Needs::new();
    for package in lock.split("[[package]]").skip(1) {
        let text = |key: &str| {
            package
                .lines()
                .find_map(|line| line.strip_prefix(key)?.strip_suffix('"'))
        };
        let listed = package
            .lines()
            .filter_map(|line| line.strip_prefix(" \"")?.strip_suffix("\","));
        let own = (text("name = \"")?.to_owned(), text("version = \"")?.to_owned());
        needs.insert(own, listed.map(str::to_owned).collect());
    }
    Some(needs)
}

/// Returns the packages that `program` depends on, without itself.
fn needed(needs: &Needs, program: &str) -> BTreeSet<Package> {
    let mut found = BTreeSet::new();
    let mut open = vec![program.to_owned()];
    while let Some(wanted) = open.pop() {
        // "name", or "name version" where several are locked.
        let mut words = wanted.split(' ');
        let (name, version) = (words.next(), words.next());
        for (package, more) in needs {
            let same = Some(package.0.as_str()) == name && version.is_none_or(|v| v == package.1);
            if same && found.insert(package.clone()) {
                open.extend(more.iter().cloned());
            }
        }
    }
    found.retain(|(name, _)| name != program);
    found
}

/// Returns the packages of some programs.
fn of_programs(needs: &Needs, programs: &[&str]) -> BTreeSet<Package> {
    programs.iter().flat_map(|program| needed(needs, program)).collect()
}

/// Lists `name version programs licence` of each foreign package in the programs of either side, one a line.
fn packages(needs: &Needs) -> String {
    let core = of_programs(needs, &["rt-core", "stylet-bridge", "stylet-lab", "stylet-study"]);
    let host = of_programs(needs, &["host-ui", "stylet-clinic", "stylet-igtl", "stylet-demo"]);
    let ours = |name: &str| name.starts_with("stylet-") || name == "rt-core" || name == "host-ui";
    let sources = sources();
    let line = |package: &Package| {
        let of = match (core.contains(package), host.contains(package)) {
            (true, true) => "both",
            (true, false) => "rt-core",
            _ => "host-ui",
        };
        let licence = licence(&sources, package).unwrap_or_else(|| "not known".to_owned());
        format!("{} {} {of} {licence}\n", package.0, package.1)
    };
    core.union(&host).filter(|(name, _)| !ours(name)).map(line).collect()
}

/// Folders in which cargo keeps the sources of registries.
fn sources() -> Vec<PathBuf> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cargo")));
    let registries = home.and_then(|h| std::fs::read_dir(h.join("registry/src")).ok());
    registries.into_iter().flatten().flatten().map(|e| e.path()).collect()
}

/// Reads `package.license` of the manifest in the sources.
fn licence(sources: &[PathBuf], (name, version): &Package) -> Option<String> {
    let manifest = |source: &PathBuf| std::fs::read_to_string(source.join(format!("{name}-{version}/Cargo.toml"))).ok();
    let text = sources.iter().find_map(manifest)?;
    // One line of it: parsing hundreds of manifests in full would slow the build too much.
    let line = text
        .lines()
        .find_map(|l| l.strip_prefix("license = \"")?.strip_suffix('"'));
    line.map(|l| l.replace(" / ", "/").replace('/', " OR "))
}

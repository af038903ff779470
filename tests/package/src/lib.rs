//! Installed files: man pages and completions of the programs, and the contents of the Debian packages.

#[cfg(test)]
mod commands;
#[cfg(test)]
mod contents;
#[cfg(test)]
mod help;
#[cfg(test)]
mod pages;

#[cfg(test)]
const PROGRAMS: [&str; 7] = [
    "rt-core",
    "stylet-lab",
    "stylet-study",
    "host-ui",
    "stylet-clinic",
    "stylet-igtl",
    "stylet-demo",
];
/// Packages, by the folder of their manifest.
#[cfg(test)]
const PACKAGES: [&str; 2] = ["rt-core", "host-ui"];

/// Returns the folder with pages and completions, as written by the programs.
#[cfg(test)]
fn manual(name: &str) -> std::path::PathBuf {
    let folder = stylet_test_kit::scratch(name);
    for program in PROGRAMS {
        let written = std::process::Command::new(stylet_test_kit::program(program))
            .args(["manual", "--out"])
            .arg(&folder)
            .output()
            .expect("it starts");
        assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    }
    folder
}

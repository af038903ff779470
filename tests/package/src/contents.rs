//! Contents of each Debian package: every file exists, names only installed files, and is in one package.

use crate::{PACKAGES, manual};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_test_kit::repository;

/// Returns the installed files: absolute path and source. Writes the pages to `pages` first.
fn installed(pages: &Path) -> BTreeMap<String, PathBuf> {
    let mut all = BTreeMap::new();
    for program in PACKAGES {
        for asset in assets(program) {
            for source in sources(program, &asset[0], pages) {
                let name = source.file_name().expect("a file").to_string_lossy().into_owned();
                let path = format!("/{}{name}", asset[1]);
                assert!(asset[1].ends_with('/'), "{path}: a folder is named");
                let executable = path.starts_with("/usr/bin/") || path.starts_with("/usr/libexec/");
                assert_eq!(asset[2], if executable { "755" } else { "644" }, "{path}");
                let twice = all.insert(path.clone(), source);
                // Licences lie in a folder of each package.
                assert!(twice.is_none(), "{path} is in the packages twice");
            }
        }
    }
    all
}

fn metadata(program: &str) -> toml::Table {
    let text = text(&repository(&format!("{program}/Cargo.toml")));
    let manifest: toml::Table = text.parse().expect("a manifest");
    manifest["package"]["metadata"]["deb"]
        .as_table()
        .expect("a table")
        .clone()
}

fn assets(program: &str) -> Vec<Vec<String>> {
    metadata(program)["assets"]
        .clone()
        .try_into()
        .expect("lists of source, folder, mode")
}

/// Returns the files behind one entry; every one must exist.
fn sources(program: &str, source: &str, pages: &Path) -> Vec<PathBuf> {
    let path = match source.strip_prefix("target/release/") {
        None => repository(&format!("{program}/{source}")),
        Some(built) => match built.strip_prefix("manual/") {
            None => stylet_test_kit::program(built),
            // Compressed by the packaging.
            Some(page) => pages.join(page.trim_end_matches(".gz")),
        },
    };
    let name = path.file_name().expect("a file").to_string_lossy().into_owned();
    let Some((head, tail)) = name.split_once('*') else {
        assert!(path.is_file(), "{program}: {source} is missing");
        return vec![path];
    };
    let files = std::fs::read_dir(path.parent().expect("a folder")).expect("a folder");
    let files = files.map(|file| file.expect("a file").path());
    let fits = |name: &str| name.starts_with(head) && name.ends_with(tail);
    let found: Vec<_> = files
        .filter(|file| file.file_name().is_some_and(|name| fits(&name.to_string_lossy())))
        .collect();
    assert!(!found.is_empty(), "{program}: {source} fits no file");
    found
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

/// Parses `key=value` lines; the last one of each key counts.
fn keys(text: &str) -> BTreeMap<&str, &str> {
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.filter_map(|line| line.split_once('=')).collect()
}

#[test]
fn every_file_of_the_packages_is_there_once_and_every_page_is_in_one() {
    let pages = manual("package-files");
    let files = installed(&pages);
    let packed = files.values().filter(|file| file.starts_with(&pages)).count();
    let written = [
        "man/man1",
        "bash-completion/completions",
        "zsh/vendor-completions",
        "fish/vendor_completions.d",
    ]
    .map(|folder| std::fs::read_dir(pages.join(folder)).expect("a folder").count());
    assert_eq!(packed, written.iter().sum::<usize>(), "pages that no package holds");
}

#[test]
fn the_desktop_starts_what_is_installed_and_finds_its_icon() {
    let files = installed(&manual("package-desktop"));
    let entry = text(&files["/usr/share/applications/stylet.desktop"]);
    assert!(entry.starts_with("[Desktop Entry]\n"), "{entry}");
    let keys = keys(&entry);
    assert_eq!(
        (keys["Type"], keys["Name"], keys["Terminal"]),
        ("Application", "Stylet", "false")
    );
    assert!(
        keys["Categories"].ends_with(';') && keys["Keywords"].ends_with(';'),
        "{entry}"
    );
    let program = keys["Exec"].split(' ').next().expect("a program");
    assert!(files.contains_key(program), "{program} is not installed");
    assert!(files.contains_key(&format!("/usr/bin/{}", keys["TryExec"])));
    let icon = format!("/usr/share/icons/hicolor/scalable/apps/{}.svg", keys["Icon"]);
    assert!(text(&files[&icon]).contains("<svg "), "{icon}");
    // The desktop identifies the program's window by this name.
    let window = text(&repository("host-ui/src/app/open.rs"));
    assert!(window.contains(&format!("with_app_id(\"{}\")", keys["StartupWMClass"])));
}

#[test]
fn the_lab_unit_starts_the_installed_program_with_the_loops_limits() {
    let files = installed(&manual("package-unit"));
    let unit = text(&files["/usr/lib/systemd/system/stylet-rt-core@.service"]);
    let keys = keys(&unit);
    let settings = text(&files[keys["EnvironmentFile"].trim_start_matches('-')]);
    let (program, option) = keys["ExecStart"].split_once(" $").expect("a program and its options");
    assert!(files.contains_key(program), "{program} is not installed");
    assert!(
        settings.contains(&format!("\n{option}=")),
        "{option} is not in {settings}"
    );
    assert_eq!((keys["LimitRTPRIO"], keys["LimitMEMLOCK"]), ("90", "infinity"));
    // With any of these in force, loops have no priority, or hosts do not find the core.
    for lost in [
        "PrivateTmp=",
        "RestrictRealtime=",
        "RemoveIPC=",
        "PrivateDevices=",
        "PrivateNetwork=",
        "PrivateUsers=",
    ] {
        assert!(!unit.contains(&format!("\n{lost}")), "{lost}");
    }
}

/// The unit had no sandbox: `systemd-analyze` gave it an exposure of 9.0.
#[test]
fn the_unit_is_exposed_to_no_more_than_a_real_time_process_must_be() {
    // Ten times the exposure.
    let judged = Command::new("systemd-analyze")
        .args(["security", "--offline=yes", "--no-pager", "--threshold=25"])
        .arg(repository("rt-core/package/stylet-rt-core@.service"))
        .output();
    match judged {
        Ok(judged) => assert!(judged.status.success(), "{}", String::from_utf8_lossy(&judged.stdout)),
        Err(why) => println!("skipped: systemd-analyze: {why}"),
    }
}

#[test]
fn rules_for_devices_name_the_vendors_that_the_programs_look_for() {
    let files = installed(&manual("package-rules"));
    for (rules, source, vendors) in [
        ("70-stylet-haptic.rules", "hw/src/libhd/diagnose/port.rs", &["2988"][..]),
        ("70-stylet-haptic.rules", "hw/src/drd/diagnose.rs", &["1451"]),
        (
            "70-stylet.rules",
            "host-ui/controllers/src/system/found.rs",
            &["256f", "046d"],
        ),
    ] {
        let rules = text(&files[&format!("/usr/lib/udev/rules.d/{rules}")]);
        let source = text(&repository(source));
        for vendor in vendors {
            let named = format!("\"{vendor}\"");
            assert!(source.contains(&named), "{vendor} in the program");
            assert!(rules.contains(&named), "{vendor} in {rules}");
        }
    }
    let page = text(&repository("docs/controllers.md"));
    let rules = text(&files["/usr/lib/udev/rules.d/70-stylet.rules"]);
    for rule in rules.lines().filter(|line| !line.starts_with('#')) {
        assert!(page.contains(rule), "docs/controllers.md has another rule than {rule}");
    }
}

/// Rights are granted only after a question was answered.
#[test]
fn scripts_are_valid_and_the_question_about_rights_begins_with_none() {
    for program in PACKAGES {
        let folder = metadata(program)["maintainer-scripts"]
            .as_str()
            .expect("a folder")
            .to_owned();
        let folder = repository(&format!("{program}/{folder}"));
        for file in std::fs::read_dir(folder).expect("scripts") {
            let path = file.expect("a script").path();
            if path.file_name().is_some_and(|name| name != "templates") {
                let checked = Command::new("sh").arg("-n").arg(&path).status().expect("sh");
                assert!(
                    checked.success() && text(&path).contains("\nset -e\n"),
                    "{}",
                    path.display()
                );
            }
        }
    }
    let question = text(&repository("rt-core/package/scripts/templates"));
    assert!(question.contains("\nDefault: none\n") && question.contains("\nChoices: none, group, program\n"));
    let script = text(&repository("rt-core/package/scripts/postinst"));
    assert!(script.contains("RET=none") && script.contains("group) grant_group") && script.contains("= program ]"));
    let limits = text(&repository("rt-core/runtime/src/rt/arm.rs"));
    for line in ["rtprio 90", "nice -11", "memlock unlimited"] {
        assert!(
            script.contains(&format!("@stylet - {line}")) && limits.contains(line),
            "{line}"
        );
    }
}

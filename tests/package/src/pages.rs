//! Every subcommand and option in a program's help has its entry on a page and in the completions.

use crate::help::helps;
use crate::{PROGRAMS, manual};
use std::path::Path;
use std::process::Command;

/// Long options with a separate entry.
fn options(help: &str) -> Vec<String> {
    let lines = help.lines().map(str::trim_start);
    let entries = lines.filter_map(|line| {
        let line = line
            .strip_prefix("-")
            .filter(|rest| rest.get(1..3) == Some(", "))
            .map_or(line, |rest| &rest[3..]);
        line.starts_with("--").then(|| line.split([' ', '=']).next())?
    });
    entries.map(str::to_owned).collect()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

#[test]
fn every_subcommand_and_option_is_on_its_page_and_completed() {
    let folder = manual("pages-complete");
    let (mut pages, mut checked) = (0, 0);
    for name in PROGRAMS {
        let scripts = [
            format!("bash-completion/completions/{name}"),
            format!("zsh/vendor-completions/_{name}"),
        ]
        .map(|script| read(&folder.join(script)));
        let fish = read(&folder.join(format!("fish/vendor_completions.d/{name}.fish")));
        for help in helps(vec![name.to_owned()]) {
            pages += 1;
            let words = &help.words;
            let page = read(&folder.join(format!("man/man1/{}.1", words.join("-"))));
            for option in options(&help.text) {
                checked += 1;
                let on_page = option.replace('-', "\\-");
                assert!(page.contains(&on_page), "{words:?}: {option} is not on its page");
                assert!(
                    scripts.iter().all(|script| script.contains(&option)),
                    "{words:?} {option}"
                );
                assert!(fish.contains(&format!("-l {}", &option[2..])), "{words:?} {option}");
            }
            for (below, _) in help.subcommands() {
                assert!(page.contains(&below.replace('-', "\\-")), "{words:?}: {below}");
            }
        }
    }
    let written = std::fs::read_dir(folder.join("man/man1")).expect("pages").count();
    assert_eq!(written, pages, "pages of what the help does not list");
    assert!(
        pages > 15 && checked > 60,
        "only {pages} pages and {checked} options found"
    );
}

#[test]
fn the_formatter_accepts_every_page_and_bash_its_completions() {
    let folder = manual("pages-valid");
    let pages: Vec<_> = std::fs::read_dir(folder.join("man/man1"))
        .expect("pages")
        .map(|page| page.expect("a page").path())
        .collect();
    let lint = Command::new("mandoc")
        .args(["-T", "lint", "-W", "error"])
        .args(&pages)
        .output()
        .expect("mandoc starts: `make test` installs it");
    let found = String::from_utf8_lossy(&lint.stdout);
    assert!(lint.status.success() && found.is_empty(), "{found}");
    for name in PROGRAMS {
        let script = folder.join("bash-completion/completions").join(name);
        let checked = Command::new("bash").arg("-n").arg(&script).status().expect("bash");
        assert!(checked.success(), "{}", script.display());
    }
}

#[test]
fn a_shell_completes_subcommands_options_and_values() {
    let folder = manual("pages-completed");
    let completed = |name: &str, words: &[&str]| {
        let script = folder.join("bash-completion/completions").join(name);
        let ask = "source \"$0\"; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); before=${COMP_WORDS[COMP_CWORD-1]}; \
                   \"_${1/-/__}\" \"$1\" \"${COMP_WORDS[COMP_CWORD]}\" \"$before\"; echo \"${COMPREPLY[@]}\"";
        let out = Command::new("bash")
            .args(["-c", ask])
            .arg(&script)
            .arg(name)
            .args(words)
            .output();
        String::from_utf8(out.expect("bash").stdout)
            .expect("UTF-8")
            .trim()
            .to_owned()
    };
    assert_eq!(completed("stylet-lab", &["do"]), "doctor");
    assert_eq!(completed("rt-core", &["--scene", "pel"]), "pelvis");
    assert_eq!(completed("stylet-lab", &["doctor", "--j"]), "--json");
    assert_eq!(completed("stylet-clinic", &["scene", "ch"]), "check");
    assert!(
        !completed("stylet-lab", &["l"]).contains("load"),
        "a hidden subcommand is offered"
    );
}

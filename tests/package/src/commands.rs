//! `docs/commands.md`: the commands and options of the programs, from their help.

use crate::help::{Help, helps};
use crate::{PACKAGES, PROGRAMS};
use std::fmt::Write as _;
use stylet_test_kit::repository;

const HEAD: &str = "\
# Commands

The test that checks this page also writes it, from the help of the programs:
`UPDATE_DOCS=1 cargo test --profile quick -p stylet-tests-package commands`. `COMMAND --help` explains each option.
The packages install man pages and completions for bash, zsh and fish; the command `manual` of each program writes them.
`rt-core` and `host-ui` start the programs of the laboratory, of studies, of files and of OpenIGTLink by themselves:
`rt-core latency` and `stylet-lab latency` are the same command.
[A class over the network](network.md) lists the commands of `relay`.
";

/// Returns the page: for each program a table of its commands, and the options of a run.
fn page() -> String {
    let mut page = HEAD.to_owned();
    for name in PROGRAMS {
        let helps = helps(vec![name.to_owned()]);
        let program = &helps[0];
        let about = program.text.lines().next().unwrap_or_default();
        let _ = write!(
            page,
            "\n## {name}\n\n{about}\n\n| command | what it does |\n|---|---|\n"
        );
        for (words, does) in helps.iter().flat_map(commands) {
            let _ = writeln!(page, "| `{words}` | {} |", cell(&does));
        }
        if PACKAGES.contains(&name) {
            let _ = write!(
                page,
                "\nOptions of a run, `{name} -h`:\n\n```\n{}\n```\n",
                options(name)
            );
        }
    }
    page
}

/// Returns each command in a help, as typed, with its line.
fn commands(help: &Help) -> Vec<(String, String)> {
    let listed = help.subcommands().into_iter();
    listed
        .map(|(name, does)| (format!("{} {name}", help.words.join(" ")), does))
        .collect()
}

/// Returns the options of the short help.
fn options(program: &str) -> String {
    let help = Help::short(program);
    let lines = help.text.lines().skip_while(|line| *line != "Options:").skip(1);
    lines
        .map(str::trim_end)
        .collect::<Vec<_>>()
        .join("\n")
        .trim_end()
        .to_owned()
}

/// Escapes text for a table cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

#[test]
fn the_page_of_commands_says_what_the_programs_say() {
    let (path, now) = (repository("docs/commands.md"), page());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &now).expect("the page can be written");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = kept.lines().zip(now.lines()).find(|(kept, now)| kept != now);
    assert!(
        kept == now,
        "docs/commands.md is not what the programs say: run the command at its head; {differs:?}"
    );
}

/// A command that a product gained or renamed would be unknown to the program that users type.
#[test]
fn every_command_of_a_product_is_typed_with_the_simulators_program() {
    let started = [
        ("rt-core", &["stylet-lab", "stylet-study"][..]),
        ("host-ui", &["stylet-clinic", "stylet-igtl", "stylet-demo"]),
    ];
    let mut checked = 0;
    for (simulator, products) in started {
        for product in products {
            for (command, _) in Help::short(product).subcommands() {
                if command == "manual" {
                    continue;
                }
                checked += 1;
                let help = |program: &str| Help::of(vec![program.to_owned(), command.clone()], "-h").text;
                assert_eq!(help(simulator), help(product), "{simulator} {command}");
            }
        }
    }
    assert!(checked > 15, "only {checked} commands found");
}

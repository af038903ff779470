//! Shell completions.

use clap::Command;
use clap_complete::{Shell, generate};
use std::path::PathBuf;

/// Returns path and text of the script for each shell.
pub fn scripts(program: Command) -> Vec<(PathBuf, Vec<u8>)> {
    let name = program.get_name().to_owned();
    let program = without_hidden(&program);
    let paths = [
        (Shell::Bash, format!("bash-completion/completions/{name}")),
        (Shell::Zsh, format!("zsh/vendor-completions/_{name}")),
        (Shell::Fish, format!("fish/vendor_completions.d/{name}.fish")),
    ];
    let script = |shell| {
        let mut text = Vec::new();
        generate(shell, &mut program.clone(), &name, &mut text);
        match shell {
            Shell::Bash => with_one_name_for_each_state(&name, text),
            _ => text,
        }
    };
    paths.map(|(shell, path)| (path.into(), script(shell))).into()
}

/// Renames mismatched states: the generator (4.6.11) enters subcommands as `rt__core__subcmd__doctor` and handles them
/// as `rt__subcmd__core__subcmd__doctor` if the program's name has a hyphen, so nothing would be completed there.
fn with_one_name_for_each_state(name: &str, script: Vec<u8>) -> Vec<u8> {
    let (entered, handled) = (name.replace('-', "__"), name.replace('-', "__subcmd__"));
    match String::from_utf8(script) {
        Ok(text) => text.replace(&handled, &entered).into_bytes(),
        Err(other) => other.into_bytes(),
    }
}

/// Returns the command without its hidden subcommands, which the scripts would offer.
fn without_hidden(command: &Command) -> Command {
    let shown = command.get_subcommands().filter(|below| !below.is_hide_set());
    let mut copy = Command::new(command.get_name().to_owned())
        .args(command.get_arguments())
        .groups(command.get_groups())
        .subcommands(shown.map(without_hidden));
    if let Some(about) = command.get_about() {
        copy = copy.about(about.clone());
    }
    if let Some(version) = command.get_version() {
        copy = copy.version(version.to_owned());
    }
    copy
}

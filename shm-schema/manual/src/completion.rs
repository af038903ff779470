//! Shell completions.

use clap::Command;
use clap_complete::{Shell, generate};
use std::path::PathBuf;

/// Path and text of the script for each shell.
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
        text
    };
    paths.map(|(shell, path)| (path.into(), script(shell))).into()
}

/// A command without its hidden subcommands, which the scripts would offer.
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

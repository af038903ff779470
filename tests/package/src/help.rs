//! Help texts of the built programs.

use std::process::Command;
use stylet_test_kit::program;

/// Help of one command.
pub struct Help {
    /// The command as typed.
    pub words: Vec<String>,
    /// Output of its help.
    pub text: String,
}

impl Help {
    /// Runs the command with `-h` or `--help`.
    pub fn of(words: Vec<String>, option: &str) -> Self {
        let shown = Command::new(program(&words[0])).args(&words[1..]).arg(option).output();
        let text = String::from_utf8(shown.expect("it starts").stdout).expect("UTF-8");
        Self { words, text }
    }

    /// Returns the short help of a program.
    pub fn short(program: &str) -> Self {
        Self::of(vec![program.to_owned()], "-h")
    }

    /// Returns names and lines of the list of commands, without `help`.
    pub fn subcommands(&self) -> Vec<(String, String)> {
        let list = self.text.lines().skip_while(|line| *line != "Commands:").skip(1);
        let list = list.take_while(|line| !line.is_empty());
        let entries = list.filter_map(|line| line.strip_prefix("  ")?.split_once(' '));
        entries
            .filter(|(name, _)| !name.is_empty() && *name != "help")
            .map(|(name, does)| (name.to_owned(), does.trim().to_owned()))
            .collect()
    }
}

/// Returns the help of a command and of all below it.
pub fn helps(words: Vec<String>) -> Vec<Help> {
    let help = Help::of(words, "--help");
    let below: Vec<Vec<String>> = help
        .subcommands()
        .into_iter()
        .map(|(name, _)| [help.words.clone(), vec![name]].concat())
        .collect();
    let mut all = vec![help];
    all.extend(below.into_iter().flat_map(helps));
    all
}

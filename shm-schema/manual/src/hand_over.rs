//! Commands that another program carries out.

use std::ffi::OsStr;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

/// A program in the same folder, and the commands that it carries out.
#[derive(Clone, Copy, Debug)]
pub struct Product {
    /// File name of the program.
    pub program: &'static str,
    /// First words of its commands.
    pub commands: &'static [&'static str],
}

/// The program of a command could not be started.
#[derive(Debug, thiserror::Error)]
#[error("'{command}' is a command of {}, which cannot be started ({source}): build it with 'make products', or install the packages", .program.display())]
pub struct HandOverError {
    command: String,
    program: PathBuf,
    source: std::io::Error,
}

/// Replaces this process by the program of another product if the first argument is one of its commands.
///
/// Call it first in `main`. It returns if the command is one of this program.
///
/// # Errors
/// If that program is missing or cannot be started.
pub fn hand_over(products: &[Product]) -> Result<(), HandOverError> {
    let mut words = std::env::args_os().skip(1);
    let Some(command) = words.next() else { return Ok(()) };
    let Some(product) = owner(products, &command) else {
        return Ok(());
    };
    let program = std::env::current_exe()
        .unwrap_or_default()
        .with_file_name(product.program);
    let source = Command::new(&program).arg(&command).args(words).exec();
    Err(HandOverError {
        command: command.to_string_lossy().into_owned(),
        program,
        source,
    })
}

/// Lists the products' commands, for the help of program `own`.
pub fn list(own: &str, products: &[Product]) -> String {
    let line = |product: &Product| format!("\n  {:<14} {}", product.program, product.commands.join(", "));
    let lines: String = products.iter().map(line).collect();
    format!("Commands of other programs, which `{own} COMMAND` starts:{lines}")
}

fn owner(products: &[Product], word: &OsStr) -> Option<Product> {
    let has = |product: &&Product| product.commands.iter().any(|command| word == *command);
    products.iter().find(has).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_belongs_to_the_product_that_lists_it() {
        let products = [Product {
            program: "stylet-lab",
            commands: &["latency", "cost"],
        }];
        let found = |word: &str| owner(&products, OsStr::new(word)).map(|p| p.program);
        assert_eq!(found("cost"), Some("stylet-lab"));
        assert_eq!([found("costs"), found("")], [None; 2]);
    }
}

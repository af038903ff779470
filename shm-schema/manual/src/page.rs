//! Man pages: one for the program and one for each of its subcommands.

use clap::{Arg, Command};
use clap_mangen::Man;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Returns path and text of each page.
pub fn pages(program: Command) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    // The pages themselves contain what `help` prints.
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let version = format!("Stylet {}", program.get_version().unwrap_or_default());
    let mut pages = Vec::new();
    add(&program, &version, None, &mut pages)?;
    Ok(pages)
}

/// Adds the page of a command, then those of its subcommands.
fn add(command: &Command, version: &str, above: Option<&str>, pages: &mut Vec<(PathBuf, Vec<u8>)>) -> io::Result<()> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let path = Path::new("man/man1").join(format!("{name}.1"));
    pages.push((path, page(name, command, version, above)?));
    for below in shown_subcommands(command) {
        add(below, version, Some(name), pages)?;
    }
    Ok(())
}

fn shown_subcommands(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|below| !below.is_hide_set())
}

fn page(name: &str, command: &Command, version: &str, above: Option<&str>) -> io::Result<Vec<u8>> {
    let man = Man::new(command.clone().mut_args(with_lines_apart));
    let mut text = Vec::new();
    // Without a date: the same sources give the same bytes.
    writeln!(text, ".TH \"{}\" \"1\" \"\" \"{version}\" \"Stylet\"", literal(name))?;
    man.render_name_section(&mut text)?;
    man.render_synopsis_section(&mut text)?;
    man.render_description_section(&mut text)?;
    man.render_options_section(&mut text)?;
    if shown_subcommands(command).next().is_some() {
        man.render_subcommands_section(&mut text)?;
    }
    if let Some(notes) = command.get_after_long_help() {
        write!(text, ".SH NOTES\n.nf\n")?;
        for line in notes.to_string().lines() {
            writeln!(text, "{}", literal(line))?;
        }
        writeln!(text, ".fi")?;
    }
    if let Some(above) = above {
        writeln!(text, ".SH \"SEE ALSO\"\n\\fB{}\\fR(1)", literal(above))?;
    }
    Ok(text)
}

/// Keeps the lines of a help text apart: the formatter would fill them into one paragraph.
fn with_lines_apart(arg: Arg) -> Arg {
    match arg.get_help().map(ToString::to_string) {
        Some(help) if help.contains('\n') && arg.get_long_help().is_none() => arg.help(help.replace('\n', "\n\n")),
        _ => arg,
    }
}

/// Escapes a line for roff: no requests, and hyphens that can be copied.
fn literal(line: &str) -> String {
    let line = line.replace('\\', "\\e").replace('-', "\\-");
    match line.chars().next() {
        // The formatter discourages empty lines.
        None => ".sp".to_owned(),
        // It would be parsed as a request.
        Some('.' | '\'') => format!("\\&{line}"),
        Some(_) => line,
    }
}

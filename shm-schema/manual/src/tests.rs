use super::*;
use clap::Arg;

fn program() -> Command {
    let check = Command::new("check")
        .about("Checks a file")
        .after_long_help("An example:\n\n[volume]\n.hidden = 'a\\b'\n'quoted'");
    Command::new("needle")
        .version("1.2")
        .about("Drives a needle")
        .arg(
            Arg::new("device")
                .long("device")
                .help("one: the first\ntwo: the second"),
        )
        .arg(Arg::new("speed").long("speed").help("Speed in mm/s"))
        .subcommand(Command::new("scene").about("Scenes").subcommand(check))
        .subcommand(Command::new("inner").hide(true))
}

fn text(path: &str) -> Option<String> {
    let files = files(program()).expect("in memory");
    let found = files.into_iter().find(|(p, _)| p == Path::new(path));
    found.map(|(_, text)| String::from_utf8(text).expect("UTF-8"))
}

#[test]
fn every_shown_command_has_a_page_that_leads_to_the_ones_around_it() {
    let top = text("man/man1/needle.1").expect("a page of the program");
    assert!(
        top.contains("needle\\-scene(1)") && top.contains("Speed in mm/s"),
        "{top}"
    );
    assert!(top.contains("Stylet 1.2"), "{top}");
    assert!(
        top.contains("one: the first\n\ntwo: the second"),
        "lines of a help text run together: {top}"
    );
    let below = text("man/man1/needle-scene-check.1").expect("a page of the subcommand of a subcommand");
    assert!(below.contains("\\fBneedle\\-scene\\fR(1)"), "{below}");
    assert_eq!(text("man/man1/needle-inner.1"), None, "hidden");
    assert_eq!(text("man/man1/needle-help.1"), None, "the pages are the help");
}

#[test]
fn an_example_keeps_its_lines_and_is_no_request_to_the_formatter() {
    let page = text("man/man1/needle-scene-check.1").expect("a page");
    let example = "An example:\n.sp\n[volume]\n\\&.hidden = 'a\\eb'\n\\&'quoted'\n.fi\n";
    assert!(page.contains(example), "{page}");
}

#[test]
fn each_shell_has_a_script_where_it_looks_for_one() {
    for path in [
        "bash-completion/completions/needle",
        "zsh/vendor-completions/_needle",
        "fish/vendor_completions.d/needle.fish",
    ] {
        let script = text(path).unwrap_or_else(|| panic!("{path}"));
        assert!(script.contains("speed") && script.contains("check"), "{path}: {script}");
        assert!(!script.contains("inner"), "{path} offers a hidden subcommand: {script}");
    }
}

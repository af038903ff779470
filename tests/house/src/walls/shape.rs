//! Layout of tests, size of files, errors as prose, paths of a developer's machine.

use super::lexer::{Token, closing, product_tokens, tokens};

/// Lines that a source file may have.
pub const LINES: usize = 400;

/// Ends of the paths of files that may be longer, and why.
pub const LONGER: &[(&str, &str)] = &[
    (
        "fake-libhd/src/abi.rs",
        "the driver's C interface, whole and in the order of its header",
    ),
    (
        "tests/system/device_libhd.rs",
        "one fault of a driver after another over one fixture",
    ),
    ("stability/cases.rs", "one row for each hard case"),
    (
        "tests/window/src/plan.rs",
        "one walk through the plan in the window, step after step",
    ),
    ("src/doctor/tests.rs", "one machine after another over one fixture"),
    (
        "chainmail/avx2.rs",
        "vector kernels that share their lanes and constants",
    ),
];

/// Tests stand at the end of `name.rs`, in `name/tests.rs`, or below `name/tests/`.
pub fn test_layout(path: &str, source: &str) -> Vec<String> {
    let stem = path.rsplit('/').next().unwrap_or(path).trim_end_matches(".rs");
    let mut found = Vec::new();
    if stem.ends_with("_tests") || stem.starts_with("tests_") {
        found.push(format!(
            "{path}: tests of `name.rs` stand in `name/tests.rs` or below `name/tests/`"
        ));
    }
    let tokens = tokens(source);
    let paths = tokens
        .windows(3)
        .filter(|w| w[0].is("#") && w[1].is("[") && w[2].is("path"));
    found.extend(paths.map(|w| {
        format!(
            "{path}:{}: a module stands where its name says, without #[path]",
            w[0].line
        )
    }));
    found
}

pub fn too_long(path: &str, lines: usize, longer: &[(&str, &str)]) -> Option<String> {
    let named = longer.iter().any(|(end, _)| path.ends_with(end));
    match (lines > LINES, named) {
        (true, false) => Some(format!("{path}: {lines} lines, more than {LINES}")),
        (false, true) => Some(format!("{path}: {lines} lines, no longer needs its exception")),
        _ => None,
    }
}

/// Public functions whose error is a `String` or several: `file:line name`.
pub fn prose_errors(path: &str, source: &str) -> Vec<String> {
    let tokens = product_tokens(source);
    let mut found = Vec::new();
    for at in (0..tokens.len()).filter(|&at| tokens[at].is("pub")) {
        let mut name = at + 1;
        if tokens.get(name).is_some_and(|token| token.is("(")) {
            name = closing(&tokens, name) + 1;
        }
        while tokens
            .get(name)
            .is_some_and(|token| matches!(token.text.as_str(), "const" | "async" | "unsafe" | "extern" | "\""))
        {
            name += 1;
        }
        if tokens.get(name).is_some_and(|token| token.is("fn")) && returns_prose(&tokens[name..]) {
            found.push(format!("{path}:{} {}", tokens[name].line, tokens[name + 1].text));
        }
    }
    found
}

/// Whether the signature that begins here returns `Result<_, String>` or `Result<_, Vec<String>>`.
fn returns_prose(signature: &[Token]) -> bool {
    let mut at = 0;
    while at < signature.len() && !signature[at].is("->") {
        match signature[at].text.as_str() {
            "(" | "[" => at = closing(signature, at) + 1,
            "{" | ";" => return false,
            _ => at += 1,
        }
    }
    let returned = signature[at..]
        .iter()
        .take_while(|token| !matches!(token.text.as_str(), "{" | ";" | "where"));
    let text: Vec<&str> = returned.map(|token| token.text.as_str()).collect();
    let ends = text.ends_with(&[",", "String", ">"]) || text.ends_with(&[",", "Vec", "<", "String", ">", ">"]);
    ends && text.get(1) == Some(&"Result")
}

/// Lines that name a folder of somebody's machine.
pub fn machine_paths(path: &str, source: &str) -> Vec<String> {
    const FOLDERS: [&str; 4] = ["/home/", "/Users/", "/root/", "/work/"];
    /// Names that stand for any user.
    const ANYBODY: [&str; 2] = ["/home/someone", "/home/user"];
    let named = |line: &str| {
        let line = ANYBODY
            .iter()
            .fold(line.to_string(), |line, name| line.replace(name, ""));
        FOLDERS.iter().any(|folder| begins_path(&line, folder))
    };
    let lines = source.lines().enumerate().filter(|(_, line)| named(line));
    lines
        .map(|(row, line)| format!("{path}:{}: {}", row + 1, line.trim()))
        .collect()
}

/// Whether an absolute path in the line starts with the folder.
fn begins_path(line: &str, folder: &str) -> bool {
    let starts = line.match_indices(folder).map(|(at, _)| line[..at].chars().next_back());
    let mut before = starts
        .map(|before| before.is_none_or(|c| !c.is_alphanumeric() && !matches!(c, '.' | '_' | '-' | '~' | '}' | ')')));
    before.any(|begins| begins)
}

#[cfg(test)]
mod tests {
    use super::{machine_paths, prose_errors, test_layout, too_long};

    #[test]
    fn tests_in_a_wrong_place_are_found() {
        assert_eq!(test_layout("src/a_tests.rs", "").len(), 1);
        assert_eq!(test_layout("src/tests_b.rs", "").len(), 1);
        assert_eq!(test_layout("src/a.rs", "\n#[path = \"x.rs\"]\nmod x;").len(), 1);
        assert_eq!(
            test_layout("src/a/tests.rs", "// #[path]\nconst A: &str = \"#[path]\";"),
            Vec::<String>::new()
        );
    }

    #[test]
    fn a_long_file_needs_an_exception_and_an_exception_a_long_file() {
        let longer = [("a/long.rs", "reason")];
        assert!(too_long("src/b.rs", 401, &longer).is_some());
        assert!(too_long("src/a/long.rs", 400, &longer).is_some());
        assert!(too_long("src/a/long.rs", 401, &longer).is_none());
        assert!(too_long("src/b.rs", 400, &longer).is_none());
    }

    #[test]
    fn errors_as_prose_are_found_where_they_leave_a_module() {
        let source = "
            pub fn a(f: impl Fn() -> u8) -> Result<Vec<u8>, String> { x }
            pub(crate) const fn b() -> Result<(), Vec<String>> where X: Y { x }
            fn private() -> Result<(), String> { x }
            pub fn good(f: Result<(), String>) -> Result<String, Error> { x }
            pub fn text() -> String { x }
            #[cfg(test)] pub fn test_only() -> Result<(), String> { x }";
        assert_eq!(prose_errors("a.rs", source), ["a.rs:2 a", "a.rs:3 b"]);
    }

    #[test]
    fn a_path_of_one_machine_is_found() {
        let own = ["see ", "/home", "/karin/x"].concat();
        assert_eq!(machine_paths("a.md", &own).len(), 1);
        assert_eq!(
            machine_paths("a.md", "$HOME/work/x, /home/someone/x, ~/work/y"),
            Vec::<String>::new()
        );
    }
}

//! Layout of tests, size of files, errors as prose, paths of a developer's machine.

use super::syntax::{self, is_test};
use syn::visit::{self, Visit};

/// Most lines of a source file.
pub const LINES: usize = 400;

/// Path suffixes of files that may be longer, and why.
pub const LONGER: &[(&str, &str)] = &[
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
];

/// Checks that tests stand at the end of `name.rs`, in `name/tests.rs`, or below `name/tests/`.
pub fn test_layout(path: &str, source: &str) -> Vec<String> {
    let stem = path.rsplit('/').next().unwrap_or(path).trim_end_matches(".rs");
    let mut found = Vec::new();
    if stem.ends_with("_tests") || stem.starts_with("tests_") {
        found.push(format!(
            "{path}: tests of `name.rs` stand in `name/tests.rs` or below `name/tests/`"
        ));
    }
    let lines = source.lines().enumerate();
    let paths = lines.filter(|(_, line)| line.trim_start().starts_with("#[path"));
    found.extend(paths.map(|(row, _)| {
        format!(
            "{path}:{}: a module stands where its name says, without #[path]",
            row + 1
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

/// Returns public functions whose error is one or several `String`s: `file:line name`.
pub fn prose_errors(path: &str, source: &str) -> Vec<String> {
    let mut found = ProseErrors(Vec::new());
    found.visit_file(&syntax::parse(path, source));
    found.0.iter().map(|error| format!("{path}:{error}")).collect()
}

struct ProseErrors(Vec<String>);

impl ProseErrors {
    fn look_at(&mut self, visibility: &syn::Visibility, signature: &syn::Signature) {
        let is_public = !matches!(visibility, syn::Visibility::Inherited);
        if is_public && returns_prose(&signature.output) {
            let name = &signature.ident;
            self.0.push(format!("{} {name}", name.span().start().line));
        }
    }
}

impl<'ast> Visit<'ast> for ProseErrors {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if !is_test(&item.attrs) {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_test(&item.attrs) {
            self.look_at(&item.vis, &item.sig);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            self.look_at(&item.vis, &item.sig);
        }
    }
}

/// Whether a function returns `Result<_, String>` or `Result<_, Vec<String>>`.
fn returns_prose(output: &syn::ReturnType) -> bool {
    let prose: [syn::ReturnType; 2] = [
        syn::parse_quote!(-> Result<_, String>),
        syn::parse_quote!(-> Result<_, Vec<String>>),
    ];
    let mut output = output.clone();
    if let syn::ReturnType::Type(_, returned) = &mut output
        && let syn::Type::Path(result) = &mut **returned
        && let Some(last) = result.path.segments.last_mut()
        && let syn::PathArguments::AngleBracketed(arguments) = &mut last.arguments
        && let Some(value) = arguments.args.first_mut()
    {
        *value = syn::parse_quote!(_);
    }
    prose.contains(&output)
}

/// Returns lines that name a folder of a developer's machine.
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

/// True if an absolute path in the line starts with the folder.
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

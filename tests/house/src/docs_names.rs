//! The pages name only what exists: identifiers occur in the sources, links and paths lead somewhere.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Pages outside `docs` whose names and links are checked too.
const ROOT_PAGES: [&str; 5] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "scenes/README.md",
];

/// Every file below the root of the workspace, as a path relative to it with `/` between the parts.
struct Tree {
    root: PathBuf,
    files: Vec<String>,
}

impl Tree {
    fn of_workspace() -> Self {
        let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut files = Vec::new();
        collect(&root, "", &mut files);
        files.sort();
        Self { root, files }
    }

    fn text(&self, file: &str) -> String {
        std::fs::read_to_string(self.root.join(file)).unwrap_or_else(|why| panic!("{file} cannot be read: {why}"))
    }

    /// Returns files whose path is `tail`, or ends in it after a `/`; crates may move without a change to the pages.
    fn ending_in<'a>(&'a self, tail: &'a str) -> impl Iterator<Item = &'a str> {
        let files = self.files.iter().map(String::as_str);
        files.filter(move |file| {
            file.strip_suffix(tail)
                .is_some_and(|head| head.is_empty() || head.ends_with('/'))
        })
    }

    /// True if `path` is the end of the path of a file, of a module (without `.rs`), or of a folder.
    fn has(&self, path: &str) -> bool {
        let path = path.trim_end_matches('/');
        let folder = format!("/{path}/");
        self.ending_in(path).next().is_some()
            || self.ending_in(&format!("{path}.rs")).next().is_some()
            || self.files.iter().any(|file| format!("/{file}").contains(&folder))
    }

    fn has_folder(&self, name: &str) -> bool {
        self.files
            .iter()
            .any(|file| file.rsplit('/').skip(1).any(|part| part == name))
    }

    /// Returns the pages that the tests in this file check.
    fn pages(&self) -> impl Iterator<Item = &str> {
        let checked = |file: &&str| file.ends_with(".md") && (file.starts_with("docs/") || ROOT_PAGES.contains(file));
        self.files.iter().map(String::as_str).filter(checked)
    }

    /// Returns the names of all test functions.
    fn tests(&self) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        for file in self.files.iter().filter(|file| file.ends_with(".rs")) {
            let source = without_comments(&self.text(file));
            let after = source.split("#[test]").skip(1);
            let names = after.filter_map(|rest| words(rest.split_once("fn ")?.1).next());
            found.extend(names.map(str::to_owned));
        }
        found
    }

    /// Returns the words of all source files but this one, without comments: a name in a comment alone does not exist.
    fn words_of_sources(&self) -> BTreeSet<String> {
        let is_source = |file: &&String| file.ends_with(".rs") && !file.ends_with("docs_names.rs");
        let mut known = BTreeSet::new();
        for file in self.files.iter().filter(is_source) {
            known.extend(words(&without_comments(&self.text(file))).map(str::to_owned));
        }
        known
    }
}

fn collect(root: &Path, below: &str, files: &mut Vec<String>) {
    let folder = root.join(below);
    for entry in std::fs::read_dir(&folder).unwrap_or_else(|why| panic!("{}: {why}", folder.display())) {
        let entry = entry.expect("the folder can be listed");
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = if below.is_empty() {
            name.clone()
        } else {
            format!("{below}/{name}")
        };
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => {
                if !["target", "out", ".git"].contains(&name.as_str()) {
                    collect(root, &path, files);
                }
            }
            _ => files.push(path),
        }
    }
}

fn without_comments(source: &str) -> String {
    let code = |line: &str| line.split("//").next().unwrap_or_default().to_owned();
    source.lines().map(code).collect::<Vec<_>>().join("\n")
}

/// Splits into runs of letters, digits and `_`.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .filter(|word| !word.is_empty())
}

fn is_identifier(word: &str) -> bool {
    word.len() > 1 && word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
}

/// Returns the text between single backticks, outside fenced blocks.
fn code_spans(page: &str) -> Vec<&str> {
    let mut spans = Vec::new();
    for (number, part) in page.split("```").enumerate() {
        if number % 2 == 0 {
            spans.extend(part.split('`').skip(1).step_by(2));
        }
    }
    spans
}

/// True if a span is one name of the code: `snake_case`, `SCREAMING_CASE`, `CamelCase`, `Type::item`. Three letters
/// such as `e_b` are mathematics.
fn is_code_name(span: &str) -> bool {
    let whole = words(span).all(is_identifier) && span.chars().all(|c| c.is_ascii_alphanumeric() || "_:".contains(c));
    let capitals = span.chars().filter(char::is_ascii_uppercase).count();
    let camel = span.starts_with(|c: char| c.is_ascii_uppercase())
        && capitals > 1
        && span.contains(|c: char| c.is_ascii_lowercase());
    whole && span.len() > 3 && (span.contains('_') || span.contains("::") || camel)
}

/// Expands `a/{b,c}/d` to `a/b/d` and `a/c/d`.
fn without_braces(path: &str) -> Vec<String> {
    match path
        .split_once('{')
        .and_then(|(head, rest)| Some((head, rest.split_once('}')?)))
    {
        Some((head, (middle, tail))) => middle
            .split(',')
            .flat_map(|part| without_braces(&format!("{head}{part}{tail}")))
            .collect(),
        None => vec![path.to_owned()],
    }
}

/// Returns the cells of the rows of every table on a page.
fn rows(page: &str) -> impl Iterator<Item = Vec<&str>> {
    let lines = page
        .lines()
        .filter(|line| line.starts_with('|') && !line.starts_with("|---"));
    lines.map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
}

#[test]
fn notation_leads_to_names_that_the_named_files_hold() {
    let tree = Tree::of_workspace();
    let keys = tree
        .ending_in("settings/src/table.rs")
        .map(|file| tree.text(file))
        .collect::<String>();
    let page = tree.text("docs/notation.md");
    let mut wrong = Vec::new();
    let mut checked = 0;
    for row in rows(&page).filter(|row| row.len() == 4 && row[1] != "name in code") {
        let files: Vec<&str> = code_spans(row[3])
            .into_iter()
            .flat_map(|path| tree.ending_in(path))
            .collect();
        let held: String = files.iter().map(|file| without_comments(&tree.text(file))).collect();
        let held: BTreeSet<&str> = words(&held).collect();
        for span in code_spans(row[1]) {
            checked += 1;
            let is_key = !span.starts_with('.') && span.split('.').count() == 2 && !span.contains(' ');
            let found = if is_key {
                keys.contains(&format!("\"{span}\""))
            } else {
                words(span)
                    .filter(|word| is_identifier(word))
                    .all(|word| held.contains(word))
            };
            if !found {
                wrong.push(format!("`{span}` of the row {} is not in {}", row[0], row[3]));
            }
        }
    }
    assert!(checked > 30, "the table of docs/notation.md was not found");
    assert!(wrong.is_empty(), "docs/notation.md:\n{}", wrong.join("\n"));
}

#[test]
fn every_code_name_on_a_page_occurs_in_the_sources() {
    let tree = Tree::of_workspace();
    let known = tree.words_of_sources();
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for page in tree.pages() {
        let text = tree.text(page);
        for span in code_spans(&text).into_iter().filter(|span| is_code_name(span)) {
            checked += 1;
            if words(span).any(|word| !known.contains(word)) {
                wrong.push(format!("{page}: `{span}`"));
            }
        }
    }
    assert!(checked > 50, "only {checked} names found");
    assert!(wrong.is_empty(), "no source has:\n{}", wrong.join("\n"));
}

#[test]
fn every_invariant_names_a_test_that_exists() {
    let tree = Tree::of_workspace();
    let tests = tree.tests();
    let page = tree.text("docs/invariants.md");
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for row in rows(&page).filter(|row| row.last() != Some(&"test")) {
        checked += 1;
        let spans = code_spans(row.last().copied().unwrap_or_default());
        let named: Vec<&&str> = spans.iter().filter(|span| is_code_name(span)).collect();
        if named.is_empty() || named.iter().any(|name| !tests.contains(**name)) {
            wrong.push(row.join(" | "));
        }
    }
    assert!(checked > 50, "the tables of docs/invariants.md were not found");
    assert!(wrong.is_empty(), "without an existing test:\n{}", wrong.join("\n"));
}

#[test]
fn every_link_and_path_on_a_page_leads_to_a_file() {
    let tree = Tree::of_workspace();
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for page in tree.pages() {
        let text = tree.text(page);
        let folder = page.rsplit_once('/').map_or("", |(folder, _)| folder);
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let target = link.split('#').next().unwrap_or_default();
            if !target.is_empty() && !target.contains("://") && !tree.root.join(folder).join(target).exists() {
                wrong.push(format!("{page}: ({link})"));
            }
        }
        for path in code_spans(&text).into_iter().flat_map(without_braces) {
            let plain =
                path.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c)) && !path.starts_with(['/', '.']);
            let first_is_ours = path.split_once('/').is_some_and(|(first, _)| tree.has_folder(first));
            let own_kind = path.ends_with(".rs") || path.ends_with(".md");
            if plain && (first_is_ours || own_kind) {
                checked += 1;
                if !tree.has(&path) {
                    wrong.push(format!("{page}: `{path}`"));
                }
            }
        }
    }
    assert!(checked > 50, "only {checked} paths found");
    assert!(wrong.is_empty(), "these lead nowhere:\n{}", wrong.join("\n"));
}

/// Returns formulas between `\\(` and `\\)` or `\\[` and `\\]`, the delimiters of mdBook's MathJax.
fn formulas(page: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for (opening, closing) in [(r"\\(", r"\\)"), (r"\\[", r"\\]")] {
        let after = page.split(opening).skip(1);
        found.extend(after.map(|rest| rest.split(closing).next().unwrap_or_default()));
    }
    found
}

/// True if Markdown would interpret part of a formula: an escape such as `\\,` or emphasis.
fn loses_by_markdown(formula: &str) -> bool {
    let plain = formula.replace(r"\\", "");
    let pairs = || plain.chars().zip(plain.chars().skip(1));
    plain.contains('*')
        || pairs().any(|(first, second)| first == '\\' && second.is_ascii_punctuation())
        || pairs().any(|(first, second)| second == '_' && !first.is_alphanumeric())
}

#[test]
fn formulas_survive_markdown() {
    let tree = Tree::of_workspace();
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for page in tree.pages() {
        let text = tree.text(page);
        checked += formulas(&text).len();
        let lost = formulas(&text).into_iter().filter(|formula| loses_by_markdown(formula));
        wrong.extend(lost.map(|formula| format!("{page}: {formula}")));
    }
    assert!(checked > 100, "only {checked} formulas found");
    assert!(wrong.is_empty(), "Markdown changes:\n{}", wrong.join("\n"));
}

/// A page that `docs/SUMMARY.md` does not list is not in the book of `make book`.
#[test]
fn every_page_of_docs_is_in_the_book() {
    let tree = Tree::of_workspace();
    let summary = tree.text("docs/SUMMARY.md");
    let is_listed = |page: &&str| {
        let own = page.strip_prefix("docs/").unwrap_or(page);
        summary.contains(&format!("]({own})"))
    };
    let pages: Vec<&str> = tree.pages().filter(|page| page.starts_with("docs/")).collect();
    let missing: Vec<&&str> = pages
        .iter()
        .filter(|page| **page != "docs/SUMMARY.md" && !is_listed(page))
        .collect();
    assert!(pages.len() > 20 && missing.is_empty(), "not in the book: {missing:?}");
}

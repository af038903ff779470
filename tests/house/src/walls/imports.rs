//! Modules of a crate, and the paths by which each names another.

use std::collections::BTreeMap;

use super::lexer::{Token, closing, product_tokens};

/// Modules from the root of the crate: `["rt", "haptic"]`.
pub type ModulePath = Vec<String>;

#[derive(Debug)]
pub struct Reference {
    pub from: ModulePath,
    /// Path from the root of the crate; modules first, then items.
    pub to: ModulePath,
    pub file: String,
    pub line: usize,
    /// Name that an import binds in `from`; none for a path within an expression.
    pub binds: Option<String>,
}

#[derive(Debug, Default)]
pub struct Crate {
    /// Names of the modules within each module.
    pub children: BTreeMap<ModulePath, Vec<String>>,
    pub references: Vec<Reference>,
}

/// Reads a crate from its root file on, along its `mod` items.
pub fn read_crate(root: &str, read: &dyn Fn(&str) -> Option<String>) -> Crate {
    let mut found = Crate::default();
    let folder = root.rsplit_once('/').map_or("", |(folder, _)| folder);
    read_file(root, folder, Vec::new(), read, &mut found);
    found
}

fn read_file(file: &str, folder: &str, module: ModulePath, read: &dyn Fn(&str) -> Option<String>, found: &mut Crate) {
    let Some(source) = read(file) else { return };
    let tokens = product_tokens(&source);
    read_module(&tokens, file, folder, module, read, found);
}

fn read_module(
    tokens: &[Token],
    file: &str,
    folder: &str,
    module: ModulePath,
    read: &dyn Fn(&str) -> Option<String>,
    found: &mut Crate,
) {
    found.children.entry(module.clone()).or_default();
    let mut at = 0;
    while at < tokens.len() {
        if tokens[at].is("mod") && tokens.get(at + 1).is_some_and(Token::is_name) {
            let name = tokens[at + 1].text.clone();
            let inner: ModulePath = module.iter().chain([&name]).cloned().collect();
            let inner_folder = format!("{folder}/{name}");
            let end = match tokens.get(at + 2).map(|token| token.text.as_str()) {
                Some("{") => {
                    let end = closing(tokens, at + 2);
                    read_module(&tokens[at + 3..end], file, &inner_folder, inner, read, found);
                    Some(end)
                }
                Some(";") => {
                    let files = [format!("{folder}/{name}.rs"), format!("{inner_folder}/mod.rs")];
                    let file = files.iter().find(|file| read(file).is_some());
                    if let Some(file) = file {
                        read_file(file, &inner_folder, inner, read, found);
                    }
                    Some(at + 2)
                }
                _ => None,
            };
            if let Some(end) = end {
                found.children.get_mut(&module).unwrap().push(name);
                at = end + 1;
                continue;
            }
        }
        if tokens[at].is("use") {
            let end = tokens[at..]
                .iter()
                .position(|token| token.is(";"))
                .map_or(tokens.len(), |length| at + length);
            read_use(&tokens[at + 1..end], &[], &mut |path, line, binds| {
                push(found, &module, path, file, line, Some(binds));
            });
            at = end + 1;
        } else if matches!(tokens[at].text.as_str(), "crate" | "super" | "self") && starts_path(tokens, at) {
            let line = tokens[at].line;
            let mut path = vec![tokens[at].text.clone()];
            while tokens.get(at + 1).is_some_and(|token| token.is("::"))
                && tokens.get(at + 2).is_some_and(Token::is_name)
            {
                path.push(tokens[at + 2].text.clone());
                at += 2;
            }
            push(found, &module, &path, file, line, None);
            at += 1;
        } else {
            at += 1;
        }
    }
}

fn starts_path(tokens: &[Token], at: usize) -> bool {
    let before = at.checked_sub(1).map_or("", |before| tokens[before].text.as_str());
    before != "::" && before != "in" && tokens.get(at + 1).is_some_and(|token| token.is("::"))
}

/// Calls `each` with the path, the line and the bound name of every leaf of a use tree.
fn read_use(tokens: &[Token], before: &[String], each: &mut dyn FnMut(&[String], usize, String)) {
    let mut path = before.to_vec();
    for (at, token) in tokens.iter().enumerate() {
        match token.text.as_str() {
            "{" => {
                let end = closing(tokens, at);
                for part in split(&tokens[at + 1..end]) {
                    read_use(part, &path, each);
                }
                return;
            }
            "*" => return each(&path, token.line, "*".to_string()),
            "as" => return each(&path, token.line, tokens[at + 1].text.clone()),
            "::" => {}
            "self" if !path.is_empty() => {}
            _ => path.push(token.text.clone()),
        }
    }
    if let (Some(last), Some(token)) = (path.last(), tokens.last()) {
        each(&path, token.line, last.clone());
    }
}

fn split(tokens: &[Token]) -> Vec<&[Token]> {
    let mut depth = 0;
    let parts = tokens.split(|token| {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        depth == 0 && token.is(",")
    });
    parts.filter(|part| !part.is_empty()).collect()
}

fn push(found: &mut Crate, module: &[String], path: &[String], file: &str, line: usize, binds: Option<String>) {
    let mut to = match path[0].as_str() {
        "crate" => Vec::new(),
        // A bare name may be a child or another crate: the graph drops what is no module.
        _ => module.to_vec(),
    };
    for part in path {
        match part.as_str() {
            "crate" | "self" => {}
            "super" => {
                to.pop();
            }
            _ => to.push(part.clone()),
        }
    }
    found.references.push(Reference {
        from: module.to_vec(),
        to,
        file: file.to_string(),
        line,
        binds,
    });
}

//! Words that went out of the tree, and where they still stand.

use std::collections::BTreeMap;

use toml::Table;

use super::lexer;

pub struct Word {
    /// The word, or words in sequence, in lower case.
    parts: Vec<String>,
    pub text: String,
    pub instead: String,
    /// Only as the name of a type or module.
    names: bool,
    /// Words in sequence around it that make it good English or the field's word.
    allowed: Vec<Vec<String>>,
    files: Vec<String>,
}

impl Word {
    fn is_allowed(&self, text: &Text, parts: &[Part], at: usize) -> bool {
        self.files.contains(&text.path) || self.allowed.iter().any(|phrase| covers(phrase, &self.parts, parts, at))
    }
}

/// One word of a text, with the line on which it stands.
type Part = (String, usize);

/// The words of one list of `words.toml`.
pub fn list(table: &Table, list: &str) -> Vec<Word> {
    let words = table[list].as_table().unwrap().iter();
    words
        .map(|(text, about)| read(text, about.as_table().unwrap()))
        .collect()
}

fn read(text: &str, about: &Table) -> Word {
    let reasons = about
        .get("allowed")
        .and_then(|allowed| allowed.as_table())
        .cloned()
        .unwrap_or_default();
    let (files, phrases): (Vec<String>, Vec<String>) =
        reasons.keys().cloned().partition(|key| key.contains(['/', '.']));
    Word {
        parts: split(text),
        text: text.to_string(),
        instead: about["instead"].as_str().unwrap().to_string(),
        names: about.get("names").is_some_and(|names| names.as_bool() == Some(true)),
        allowed: phrases.iter().map(|phrase| split(phrase)).collect(),
        files,
    }
}

/// A file as words, and as the names of its types and modules.
pub struct Text {
    pub path: String,
    all: Vec<Part>,
    names: Vec<Part>,
}

impl Text {
    pub fn of(path: &str, source: &str) -> Self {
        Self {
            path: path.to_string(),
            all: text_parts(path, source),
            names: type_names(path, source),
        }
    }
}

/// Places of each word of a list in a file: which word, and the line; line 0 is the name of the file.
pub fn places<'a>(words: &'a [Word], text: &Text) -> Vec<(&'a Word, usize)> {
    let mut found = Vec::new();
    for (parts, names) in [(&text.all, false), (&text.names, true)] {
        for (at, (part, line)) in parts.iter().enumerate() {
            let may_be = words
                .iter()
                .filter(|word| word.names == names && word.parts[0] == *part);
            let stands = may_be.filter(|word| stands(&word.parts, parts, at) && !word.is_allowed(text, parts, at));
            found.extend(stands.map(|word| (word, *line)));
        }
    }
    found
}

/// How often each word stands in each file.
pub fn counts(words: &[Word], files: &[Text]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut found: BTreeMap<String, BTreeMap<String, usize>> =
        words.iter().map(|word| (word.text.clone(), BTreeMap::new())).collect();
    for file in files {
        for (word, _) in places(words, file) {
            *found.get_mut(&word.text).unwrap().entry(file.path.clone()).or_default() += 1;
        }
    }
    found
}

fn stands(phrase: &[String], text: &[Part], at: usize) -> bool {
    text.len() >= at + phrase.len() && phrase.iter().zip(&text[at..]).all(|(a, (b, _))| a == b)
}

/// Whether `phrase` stands around the word at `at`.
fn covers(phrase: &[String], word: &[String], text: &[Part], at: usize) -> bool {
    let offsets = (0..phrase.len()).filter(|&offset| phrase[offset..].starts_with(word));
    offsets
        .filter_map(|offset| at.checked_sub(offset))
        .any(|start| stands(phrase, text, start))
}

fn text_parts(path: &str, source: &str) -> Vec<Part> {
    let name = split(path).into_iter().map(|part| (part, 0));
    let lines = source.lines().enumerate();
    name.chain(lines.flat_map(|(row, line)| split(line).into_iter().map(move |part| (part, row + 1))))
        .collect()
}

fn type_names(path: &str, source: &str) -> Vec<Part> {
    if !path.ends_with(".rs") {
        return Vec::new();
    }
    let tokens = lexer::tokens(source);
    let declared = tokens.windows(2).filter(|pair| {
        matches!(
            pair[0].text.as_str(),
            "struct" | "enum" | "trait" | "type" | "union" | "mod"
        ) && pair[1].is_name()
    });
    declared
        .flat_map(|pair| split(&pair[1].text).into_iter().map(|part| (part, pair[1].line)))
        .collect()
}

/// Words in lower case: `DoseDesk`, `dose_desk` and `dose desk` give the same.
fn split(text: &str) -> Vec<String> {
    let (mut parts, mut part, mut lower) = (Vec::new(), String::new(), false);
    for c in text.chars().chain([' ']) {
        let begins = !c.is_alphabetic() || (c.is_uppercase() && lower);
        if begins && !part.is_empty() {
            parts.push(std::mem::take(&mut part));
        }
        lower = c.is_lowercase();
        if c.is_alphabetic() {
            part.extend(c.to_lowercase());
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::{Text, Word, list, places};

    fn words() -> Vec<Word> {
        let text = r#"
            [gone]
            desk = { instead = "worker" }
            "put away" = { instead = "dismiss" }
            ground = { instead = "background", allowed = { "ground truth" = "field", "docs/a.md" = "quotes it" } }
            work = { instead = "task", names = true }
        "#;
        list(&text.parse().unwrap(), "gone")
    }

    fn found(path: &str, source: &str) -> Vec<(String, usize)> {
        let words = words();
        let mut found: Vec<_> = places(&words, &Text::of(path, source))
            .iter()
            .map(|(word, line)| (word.text.clone(), *line))
            .collect();
        found.sort();
        found
    }

    #[test]
    fn a_word_is_found_in_prose_in_names_across_lines_and_in_the_name_of_a_file() {
        let source = "/// It is put\n/// away.\nstruct DoseDesk;\nfn no_ground() {}\nmod work;";
        let expected = [("desk", 0), ("desk", 3), ("ground", 4), ("put away", 1), ("work", 5)];
        let expected = expected.map(|(word, line)| (word.to_string(), line));
        assert_eq!(found("src/dose_desk.rs", source), expected);
    }

    #[test]
    fn what_is_allowed_or_only_looks_alike_is_not() {
        let source = "The ground truth on a desktop background does not work; fn work() {}";
        assert_eq!(found("src/a.rs", source), []);
        assert_eq!(found("docs/a.md", "ground"), []);
    }
}

//! Meanings of terms of physics and of the clinic, shown on hover: the tables of `docs/words.md`,
//! compiled into the program.

use std::collections::BTreeMap;
use std::sync::LazyLock;

const PAGE: &str = include_str!("../../docs/words.md");

/// Meanings by term. Terms that share a row are separated by commas. Case matters: D is a dose, d a
/// distance.
static MEANINGS: LazyLock<BTreeMap<&str, &str>> = LazyLock::new(|| {
    let rows = PAGE.lines().filter_map(|line| {
        let (words, meaning) = line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | ")?;
        let is_head = words == "word";
        (!is_head).then_some((words, meaning))
    });
    rows.flat_map(|(words, meaning)| words.split(", ").map(move |word| (word, meaning)))
        .collect()
});

/// Returns the meaning of a term; `None` if the page has no row for it.
pub fn meaning(word: &str) -> Option<&'static str> {
    MEANINGS.get(word).copied()
}

/// Widget that names a term of the page.
pub trait Explained {
    /// Shows the meaning of the term on hover.
    fn explained(self, word: &str) -> Self;
}

impl Explained for egui::Response {
    fn explained(self, word: &str) -> Self {
        match meaning(word) {
            Some(meaning) => self.on_hover_text(format!("{word}: {meaning}")),
            None => self,
        }
    }
}

/// Returns a number of things, such as "1 seed" or "2 seeds".
pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Returns the text as a sentence.
pub fn sentence(text: &str) -> String {
    match text {
        "" => String::new(),
        text => format!("{}.", capital(text)),
    }
}

/// Returns the text with a capital at its start, unless a program's name stands there.
pub fn capital(text: &str) -> String {
    if text.starts_with("rt-core") {
        return text.to_owned();
    }
    let mut chars = text.chars();
    let first = chars.next().map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + chars.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};
    use stylet_dose::Dvh;
    use stylet_dose::criteria::DoseStructure;

    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a folder of sources").flatten() {
            let path = entry.path();
            if path.is_dir() {
                sources(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }

    /// Guards against a term that the page lacks, which would show nothing.
    #[test]
    fn every_explained_term_has_a_row_on_the_page() {
        let mut files = Vec::new();
        sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/panel"), &mut files);
        let mut asked = Vec::new();
        for file in files {
            let text = std::fs::read_to_string(&file).expect("a source");
            for call in text.split(".explained(\"").skip(1) {
                asked.push(call.split('"').next().unwrap_or_default().to_owned());
            }
        }
        asked.extend(["phase", "depth", "speed", "target", "spared", "fixed", "hole", "strand"].map(str::to_owned));
        let missing: Vec<&String> = asked.iter().filter(|word| meaning(word).is_none()).collect();
        println!("{} words are asked for, the page has {}", asked.len(), MEANINGS.len());
        assert!(asked.len() > 20 && missing.is_empty(), "without a row: {missing:?}");
    }

    #[test]
    fn the_page_explains_every_dose_measure() {
        let dvh = Dvh::new(&[145.0; 10], &[1e-6; 10]).expect("a histogram");
        for structure in [DoseStructure::Target, DoseStructure::Urethra, DoseStructure::Rectum] {
            let figures = structure.figures(&dvh, 145.0);
            assert!(!figures.is_empty());
            for name in figures.iter().map(|figure| figure.metric.to_string()) {
                assert!(meaning(&name).is_some(), "{name}");
            }
        }
        assert_eq!(meaning("no such word"), None);
        assert!(meaning("ChainMail").is_some_and(|m| m.contains("soft tissue")));
    }
}

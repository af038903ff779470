//! Sanitises foreign text (of files, peers, services, members of a class) for a terminal and a spreadsheet.

#![warn(missing_docs)]

use std::borrow::Cow;

/// A file controls what a message quotes of it, and how much.
const MOST_CHARS: usize = 4000;
/// A peer controls what a log line quotes of it, and how often.
const MOST_CHARS_OF_LINE: usize = 400;

/// Sanitises foreign text for a terminal: no control characters but line feeds, no bidirectional marks, and bounded
/// length.
///
/// ```
/// assert_eq!(stylet_text::printable("a\u{1b}[2Jb\nc\u{202e}d"), "a[2Jb\ncd");
/// ```
pub fn printable(text: &str) -> String {
    let mut kept: String = text.chars().filter(|c| is_shown(*c)).take(MOST_CHARS).collect();
    if text.chars().nth(MOST_CHARS).is_some() {
        kept.push_str("...");
    }
    kept
}

/// As [`printable`], in one line: a peer cannot forge a line of a log by sending a line feed.
pub fn printable_line(text: &str) -> String {
    let mut line: String = printable(text).replace('\n', " ");
    if let Some((end, _)) = line.char_indices().nth(MOST_CHARS_OF_LINE) {
        line.truncate(end);
        line.push_str("...");
    }
    line
}

/// As [`printable`], of any length: for a table with foreign names.
pub fn printable_table(text: &str) -> String {
    text.chars().filter(|c| is_shown(*c)).collect()
}

/// Escapes a cell of a table. A spreadsheet evaluates text that begins like a formula; a leading apostrophe prevents
/// that. Numbers are unchanged.
///
/// ```
/// use stylet_text::cell;
/// assert_eq!(cell("=HYPERLINK(\"http://x\")"), "'=HYPERLINK(\"http://x\")");
/// assert_eq!((cell("-1.5").as_ref(), cell("Smith").as_ref()), ("-1.5", "Smith"));
/// ```
pub fn cell(text: &str) -> Cow<'_, str> {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n']) && text.parse::<f64>().is_err() {
        return Cow::Owned(format!("'{text}"));
    }
    Cow::Borrowed(text)
}

fn is_shown(c: char) -> bool {
    let turns_or_hides = matches!(
        c,
        '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
    );
    c == '\n' || !c.is_control() && !turns_or_hides
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_character_that_commands_a_terminal_is_kept() {
        let all: String = (0..=0x10_ffff).filter_map(char::from_u32).collect();
        let kept = printable_table(&all);
        assert!(!kept.contains([
            '\u{1b}', '\u{9b}', '\u{7f}', '\r', '\u{8}', '\0', '\u{202e}', '\u{2066}'
        ]));
        assert!(kept.contains('\n') && kept.contains('ü') && kept.contains('µ'));
    }

    #[test]
    fn foreign_text_is_not_endless_and_a_line_is_one() {
        assert_eq!(printable(&"x".repeat(5000)).len(), MOST_CHARS + 3);
        assert_eq!(printable_line("a\r\nrefused: b\u{1b}[1A"), "a refused: b[1A");
        assert_eq!(
            printable_line(&"ü".repeat(5000)).chars().count(),
            MOST_CHARS_OF_LINE + 3
        );
    }

    #[test]
    fn a_formula_is_text_and_a_number_a_number() {
        for formula in [
            "=1+1",
            "+A1",
            "-A1",
            "@SUM(A1)",
            "\t=1",
            "\r=1",
            "-2+3+cmd|' /C calc'!A0",
            "--1",
        ] {
            assert_eq!(cell(formula), format!("'{formula}"));
        }
        for plain in ["", "-1", "+0.5", "-1e-3", "Smith", "12", "a=b"] {
            assert_eq!(cell(plain), plain);
        }
    }
}

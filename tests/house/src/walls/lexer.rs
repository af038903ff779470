//! Tokenises Rust source into identifiers and punctuation, each with its line, without comments, strings and test code.

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    pub text: String,
    pub line: usize,
}

impl Token {
    pub fn is(&self, text: &str) -> bool {
        self.text == text
    }

    pub fn is_name(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// Returns the tokens of a source file without code compiled only for tests.
pub fn product_tokens(source: &str) -> Vec<Token> {
    without_tests(&tokens(source))
}

/// Returns identifiers, numbers, `::`, `->` and single characters. A string literal becomes one `"`.
pub fn tokens(source: &str) -> Vec<Token> {
    let chars: Vec<char> = source.chars().collect();
    let mut found = Vec::new();
    let (mut at, mut line) = (0, 1);
    while at < chars.len() {
        let start = at;
        let rest = &chars[at..];
        let text = match rest[0] {
            '/' if rest.get(1) == Some(&'/') => {
                at += rest.iter().position(|&c| c == '\n').unwrap_or(rest.len());
                None
            }
            '/' if rest.get(1) == Some(&'*') => {
                at += block_comment(rest);
                None
            }
            '"' => {
                at += quoted(rest, '"');
                Some("\"".to_string())
            }
            '\'' => {
                at += char_or_lifetime(rest);
                None
            }
            c if c.is_alphanumeric() || c == '_' => {
                let length = rest.iter().take_while(|c| c.is_alphanumeric() || **c == '_').count();
                let word: String = rest[..length].iter().collect();
                let text_prefix = matches!(word.as_str(), "r" | "b" | "br" | "c" | "cr");
                match rest.get(length) {
                    Some('#')
                        if word == "r" && rest.get(length + 1).is_some_and(|c| c.is_alphabetic() || *c == '_') =>
                    {
                        at += 2;
                        None
                    }
                    Some('"' | '#') if text_prefix && word.contains('r') => {
                        at += length + raw(&rest[length..]);
                        Some("\"".to_string())
                    }
                    Some('"') if text_prefix => {
                        at += length + quoted(&rest[length..], '"');
                        Some("\"".to_string())
                    }
                    Some('\'') if word == "b" => {
                        at += length + quoted(&rest[length..], '\'');
                        None
                    }
                    _ => {
                        at += length;
                        Some(word)
                    }
                }
            }
            ':' if rest.get(1) == Some(&':') => {
                at += 2;
                Some("::".to_string())
            }
            '-' if rest.get(1) == Some(&'>') => {
                at += 2;
                Some("->".to_string())
            }
            c => {
                at += 1;
                (!c.is_whitespace()).then(|| c.to_string())
            }
        };
        if let Some(text) = text {
            found.push(Token { text, line });
        }
        line += chars[start..at].iter().filter(|&&c| c == '\n').count();
    }
    found
}

fn block_comment(chars: &[char]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < chars.len() {
        match (chars[at], chars.get(at + 1)) {
            ('/', Some('*')) => {
                depth += 1;
                at += 2;
            }
            ('*', Some('/')) => {
                depth -= 1;
                at += 2;
                if depth == 0 {
                    break;
                }
            }
            _ => at += 1,
        }
    }
    at
}

fn quoted(chars: &[char], end: char) -> usize {
    let mut at = 1;
    while at < chars.len() && chars[at] != end {
        at += if chars[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(chars.len())
}

fn raw(chars: &[char]) -> usize {
    let hashes = chars.iter().take_while(|c| **c == '#').count();
    if chars.get(hashes) != Some(&'"') {
        return hashes;
    }
    let mut at = hashes + 1;
    while at < chars.len() {
        if chars[at] == '"' && chars[at + 1..].iter().take(hashes).filter(|c| **c == '#').count() == hashes {
            return at + 1 + hashes;
        }
        at += 1;
    }
    chars.len()
}

fn char_or_lifetime(chars: &[char]) -> usize {
    match (chars.get(1), chars.get(2)) {
        (Some('\\'), _) | (Some(_), Some('\'')) => quoted(chars, '\''),
        _ => {
            1 + chars[1..]
                .iter()
                .take_while(|c| c.is_alphanumeric() || **c == '_')
                .count()
        }
    }
}

/// Removes the items under `#[cfg(test)]` or `#[test]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if !tokens[at].is("#") {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let of_the_file = tokens.get(at + 1).is_some_and(|token| token.is("!"));
        let open = at + 1 + usize::from(of_the_file);
        if !tokens.get(open).is_some_and(|token| token.is("[")) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let end = closing(tokens, open) + 1;
        let test = is_test(&tokens[open + 1..end - 1]);
        match (test, of_the_file) {
            (true, true) => return Vec::new(),
            (true, false) => at = item_end(tokens, end),
            (false, _) => {
                kept.extend_from_slice(&tokens[at..end]);
                at = end;
            }
        }
    }
    kept
}

fn is_test(attribute: &[Token]) -> bool {
    let texts: Vec<&str> = attribute.iter().map(|token| token.text.as_str()).collect();
    match texts.as_slice() {
        ["test"] | ["cfg", "(", "test", ")"] => true,
        ["cfg", "(", "all", rest @ ..] => rest.contains(&"test") && !rest.contains(&"not"),
        _ => false,
    }
}

/// Returns the index of the bracket that closes the one at `open`.
pub fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (index, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return index;
        }
    }
    tokens.len() - 1
}

/// Returns the first index after the item that starts at `start`: after its `;`, its body, or, for a field or an arm,
/// its `,`.
fn item_end(tokens: &[Token], start: usize) -> usize {
    const ITEMS: [&str; 15] = [
        "fn",
        "mod",
        "use",
        "struct",
        "enum",
        "impl",
        "const",
        "static",
        "type",
        "trait",
        "unsafe",
        "async",
        "extern",
        "let",
        "macro_rules",
    ];
    let mut at = start;
    while tokens.get(at).is_some_and(|token| token.is("#")) {
        at = closing(tokens, at + 1) + 1;
    }
    if tokens.get(at).is_some_and(|token| token.is("pub")) {
        at += 1;
        if tokens.get(at).is_some_and(|token| token.is("(")) {
            at = closing(tokens, at) + 1;
        }
    }
    let first = tokens.get(at).map_or("", |token| token.text.as_str());
    let item = ITEMS.contains(&first);
    let ends_at_body = item && !matches!(first, "use" | "let" | "type" | "static");
    while at < tokens.len() {
        match tokens[at].text.as_str() {
            ";" => return at + 1,
            "," if !item => return at + 1,
            "{" if ends_at_body || first == "{" => return closing(tokens, at) + 1,
            "(" | "[" | "{" => at = closing(tokens, at) + 1,
            ")" | "]" | "}" => return at,
            _ => at += 1,
        }
    }
    at
}

#[test]
fn comments_text_and_tests_are_no_code() {
    let source = r##"
        // use crate::a;
        /* /* use crate::b; */ */
        const A: &str = "use crate::c;"; const B: &str = r#"use "crate::d;"#; const C: char = '"';
        fn life<'a>(x: &'a str) -> &'a str { x }
        #[cfg(test)] use crate::e;
        #[cfg(test)] #[allow(dead_code)] pub(crate) fn test_only<T, U>() -> [u8; 3] { crate::f::g() }
        #[cfg(all(test, unix))] mod tests { use crate::h; }
        #[cfg(not(test))] use crate::kept;
    "##;
    let found = product_tokens(source);
    let after_crate: Vec<_> = found
        .windows(3)
        .filter(|w| w[0].is("crate"))
        .map(|w| w[2].text.clone())
        .collect();
    assert_eq!(after_crate, ["kept"]);
    assert_eq!(found.last().map(|token| token.line), Some(9));
}

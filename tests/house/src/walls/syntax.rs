//! Rust source as `syn` parses it, without what only tests compile.

use syn::{Attribute, Meta};

pub fn parse(path: &str, source: &str) -> syn::File {
    let mut file = syn::parse_file(source).unwrap_or_else(|why| panic!("{path}:{}: {why}", why.span().start().line));
    if is_test(&file.attrs) {
        file.items.clear();
    }
    file
}

/// Whether an item stands under `#[test]`, `#[cfg(test)]` or `#[cfg(all(test, ...))]`.
pub fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::Path(path) => path.is_ident("test"),
        Meta::List(list) if list.path.is_ident("cfg") => {
            let condition = list.tokens.to_string();
            condition == "test"
                || condition.starts_with("all") && condition.contains("test") && !condition.contains("not")
        }
        _ => false,
    })
}

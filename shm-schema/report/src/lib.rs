//! Self-contained report pages and their pictures: light, with system fonts.

#![warn(missing_docs)]

pub mod parts;
pub mod picture;

use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("report.css");

/// Returns a self-contained page; `style` follows the style sheet of all pages.
///
/// ```
/// use maud::html;
/// let page = stylet_report::page("Doses", "", &html! { h1 { "Doses" } });
/// assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<main><h1>Doses</h1></main>"));
/// ```
pub fn page(title: &str, style: &str, main: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { main { (main) } }
        }
    };
    page.into_string() + "\n"
}

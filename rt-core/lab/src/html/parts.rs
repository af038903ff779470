//! Numbers, cells and tables, as every section of the page writes them.

use crate::verdict::Outcome;
use maud::{Markup, Render, html};

/// Alignment of a column of a [`table`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    Text,
    /// To the right, on one line.
    Number,
    /// Text that may break anywhere.
    Wide,
}

impl Column {
    fn class(self) -> Option<&'static str> {
        match self {
            Self::Text => None,
            Self::Number => Some("n"),
            Self::Wide => Some("wide"),
        }
    }
}

/// Three significant digits or whole numbers; a thin space between thousands.
pub fn num(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.abs() < 100.0 {
        let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 3) as usize;
        let text = format!("{value:.digits$}");
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    let whole = format!("{value:.0}");
    let mut grouped = String::new();
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) && digit != '-' {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// Seconds or minutes, rounded up.
pub fn duration(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{} s", num(seconds.ceil()))
    } else {
        format!("{} min", num((seconds / 60.0).ceil()))
    }
}

/// The same sentence with the micro sign.
pub fn micro(text: &str) -> String {
    text.replace(" us", " \u{b5}s")
}

/// Text, or what shows itself, as a cell.
pub fn cell(content: impl Render) -> Markup {
    html! { (content) }
}

/// A number as a cell.
pub fn count(value: f64) -> Markup {
    cell(num(value))
}

pub fn or_na(value: Option<f64>) -> Markup {
    html! {
        @match value {
            Some(value) => (num(value)),
            None => span class="na" { "n/a" },
        }
    }
}

pub fn badge(outcome: Outcome) -> Markup {
    let class = match outcome {
        Outcome::Pass => "pass",
        Outcome::Fail => "fail",
        Outcome::NotMeasurable => "open",
    };
    html! { span class={ "badge " (class) } { (outcome.words()) } }
}

/// A table; a column past the end of `columns` is text.
pub fn table(head: &[impl Render], rows: &[Vec<Markup>], columns: &[Column]) -> Markup {
    let class = |i: usize| columns.get(i).and_then(|column| column.class());
    html! {
        table {
            thead { tr { @for (i, name) in head.iter().enumerate() { th class=[class(i)] { (name) } } } }
            tbody {
                @for row in rows {
                    tr { @for (i, content) in row.iter().enumerate() { td class=[class(i)] { (content) } } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_groups() {
        assert_eq!(
            [0.0, 0.0734, 1.5, 14.26, 812.4].map(num),
            ["0", "0.073", "1.5", "14.3", "812"]
        );
        assert_eq!(num(4_862_000.0), "4\u{202f}862\u{202f}000");
        assert_eq!([100.0, 20.0].map(num), ["100", "20"]);
    }

    #[test]
    fn text_cannot_break_out_of_a_table() {
        let page = table(&["<b>"], &[vec![cell("&\"")], vec![or_na(None)]], &[Column::Number]);
        assert_eq!(
            page.into_string(),
            "<table><thead><tr><th class=\"n\">&lt;b&gt;</th></tr></thead><tbody>\
             <tr><td class=\"n\">&amp;&quot;</td></tr><tr><td class=\"n\"><span class=\"na\">n/a</span></td></tr></tbody></table>"
        );
    }
}

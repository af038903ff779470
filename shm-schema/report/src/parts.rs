//! Numbers, cells, tables and cards shared by all sections of a page.

use maud::{Markup, Render, html};

/// Alignment of a column of a [`table`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// To the left.
    Text,
    /// Number, to the right on one line.
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

/// Formats three significant digits or whole numbers, with a thin space between thousands.
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
        if i > usize::from(value < 0.0) && (whole.len() - i).is_multiple_of(3) {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// Formats seconds or minutes, rounded up.
pub fn duration(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{} s", num(seconds.ceil()))
    } else {
        format!("{} min", num((seconds / 60.0).ceil()))
    }
}

/// Returns the sentence with the micro sign.
pub fn micro(text: &str) -> String {
    text.replace(" us", " \u{b5}s")
}

/// Renders text, or anything that renders itself, as a cell.
pub fn cell(content: impl Render) -> Markup {
    html! { (content) }
}

/// Renders a number as a cell.
pub fn count(value: f64) -> Markup {
    cell(num(value))
}

/// Renders a number as a cell, or a mark that there is none.
pub fn or_na(value: Option<f64>) -> Markup {
    html! {
        @match value {
            Some(value) => (num(value)),
            None => span class="na" { "n/a" },
        }
    }
}

/// Renders a row of cards, each with a value and the name of the value.
pub fn cards(all: impl IntoIterator<Item = (Markup, Markup)>) -> Markup {
    html! {
        section class="cards" { @for (value, what) in all { div { (value) br; span { (what) } } } }
    }
}

/// Renders a table; a column past the end of `columns` is text.
pub fn table(head: &[impl Render], rows: &[Vec<Markup>], columns: &[Column]) -> Markup {
    let class = |i: usize| columns.get(i).and_then(|column| column.class());
    html! {
        div class="scroll" {
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
}

/// Renders a table in which all columns but the first are numbers.
pub fn numbers(head: &[impl Render], rows: &[Vec<Markup>]) -> Markup {
    let mut columns = vec![Column::Number; head.len()];
    columns[0] = Column::Text;
    table(head, rows, &columns)
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
        assert_eq!([100.0, 20.0, -250.0].map(num), ["100", "20", "-250"]);
    }

    #[test]
    fn text_cannot_break_out_of_a_table() {
        let page = table(&["<b>"], &[vec![cell("&\"")], vec![or_na(None)]], &[Column::Number]);
        assert_eq!(
            page.into_string(),
            "<div class=\"scroll\"><table><thead><tr><th class=\"n\">&lt;b&gt;</th></tr></thead><tbody>\
             <tr><td class=\"n\">&amp;&quot;</td></tr><tr><td class=\"n\"><span class=\"na\">n/a</span></td></tr></tbody></table></div>"
        );
    }
}

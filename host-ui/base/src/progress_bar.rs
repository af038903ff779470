//! How far long work is, in a terminal; nothing where the output is a file.

use indicatif::{ProgressBar, ProgressStyle};

/// `of` of what `what` names, in the plural.
pub fn progress_bar(of: u64, what: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {what}, {{eta}} left");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(of).with_style(style)
}

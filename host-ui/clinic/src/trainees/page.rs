//! The page of a class, self-contained.

use super::figures::mean;
use super::{Attempt, Class, FIGURES, Figure, picture};
use maud::{Markup, html};
use stylet_base::format;
use stylet_report::parts::{cell, numbers};

/// Figures with a curve for each trainee: mean seed error, D90, time.
const CURVES: [usize; 3] = [0, 2, 4];

const OWN: &str = "\
.curves{display:grid;grid-template-columns:repeat(3,minmax(0,1fr));gap:14px}
.curves p{font-size:13px}
th{white-space:normal}
th,td{padding:5px 6px}
td.n,th.n{white-space:normal}
@media(max-width:720px){.curves{grid-template-columns:1fr}}
";

/// Returns the page as HTML.
pub fn page(class: &Class) -> String {
    let trainees = class.trainees();
    let main = html! {
        h1 { "Class" }
        p { (counted(trainees.len(), "trainee")) ", " (counted(class.attempts.len(), "procedure")) }
        h2 { "Comparison of trainees" }
        p {
            "Mean of all procedures of each trainee. Below it where the mean of many more would be with a probability of "
            "95 % (Student's t), from three procedures on; fewer have no interval, and neither do counts of rare events. Scenes, plans and exercises may differ "
            "between procedures: compare trainees who had the same."
        }
        (compared(&trainees))
        h2 { "Learning" }
        p {
            "Session by session. Few sessions say little, and sessions of one trainee are not independent."
        }
        @for (name, own) in &trainees {
            (learning(class, name, own))
        }
        h2 { "All procedures" }
        (every(&class.attempts))
        @if !class.left_out.is_empty() {
            h2 { "Left out" }
            @for why in &class.left_out { p class="bad" { (why) } }
        }
        footer {
            p {
                "Made by a simulator for research and training. Not a medical device, and no examination: how a "
                "trainee does here does not predict performance with patients."
            }
        }
    };
    stylet_report::page("Class", OWN, &main)
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn of_all(figure: &Figure, attempts: &[Attempt]) -> Vec<f64> {
    attempts.iter().filter_map(figure.of).collect()
}

fn compared(trainees: &[(&str, &[Attempt])]) -> Markup {
    let row = |(name, own): &(&str, &[Attempt])| {
        let figures = FIGURES.iter().map(|figure| summary(figure, own));
        [cell(name), cell(own.len())].into_iter().chain(figures).collect()
    };
    let head = ["Trainee", "procedures"]
        .into_iter()
        .chain(FIGURES.iter().map(|f| f.name));
    numbers(&head.collect::<Vec<_>>(), &trainees.iter().map(row).collect::<Vec<_>>())
}

fn summary(figure: &Figure, own: &[Attempt]) -> Markup {
    let is_count = figure.decimals == 0;
    // The mean of counts is rarely an integer.
    let decimals = |v: f64| {
        if is_count && v.fract() != 0.0 {
            1
        } else {
            figure.decimals
        }
    };
    let number = |v: f64| format::decimal(v, decimals(v));
    html! {
        @match mean(&of_all(figure, own)) {
            None => { "n/a" }
            Some((mean, interval)) => {
                (number(mean))
                @if let Some([low, high]) = interval.filter(|_| !is_count) { small { (number(low)) " to " (number(high)) } }
            }
        }
    }
}

fn learning(class: &Class, name: &str, own: &[Attempt]) -> Markup {
    let sessions = class.trainees().iter().map(|(_, own)| own.len()).max().unwrap_or(1);
    html! {
        h3 { (name) }
        div class="curves" {
            @for figure in CURVES.map(|n| &FIGURES[n]) {
                @let values: Vec<Option<f64>> = own.iter().map(figure.of).collect();
                @let most = of_all(figure, &class.attempts).into_iter().fold(0.0, f64::max);
                div {
                    p { (figure.name) }
                    (picture::curve(&values, upwards(most), sessions, figure.decimals))
                }
            }
        }
    }
}

/// Returns the next round number, for the scale.
fn upwards(most: f64) -> f64 {
    let step = 10_f64.powf(most.max(1e-3).log10().floor()) / 2.0;
    ((most / step).ceil() * step).max(step)
}

/// Formats the session: its local time, or the folder's name if that is not a time.
fn when(attempt: &Attempt) -> String {
    format::local_time(&attempt.session).unwrap_or_else(|| attempt.session.clone())
}

fn every(attempts: &[Attempt]) -> Markup {
    let shown = |figure: &Figure, a: &Attempt| {
        (figure.of)(a).map_or_else(|| "n/a".to_owned(), |v| format::decimal(v, figure.decimals))
    };
    let row = |a: &Attempt| {
        let session = html! { (when(a)) @if !a.title.is_empty() { small { (a.title) } } };
        let figures = FIGURES.iter().map(|figure| cell(shown(figure, a)));
        let before = [cell(&a.trainee), session].into_iter();
        before.chain(figures).chain([cell(a.exercises)]).collect()
    };
    let figures = FIGURES.iter().map(|f| f.name);
    let head = ["Trainee", "session"].into_iter().chain(figures).chain(["exercises"]);
    numbers(&head.collect::<Vec<_>>(), &attempts.iter().map(row).collect::<Vec<_>>())
}

//! Changes from one report of a PC to the next.

use super::Pc;
use super::entry::{Entry, Percentile};

/// A tail has grown if it is longer by more than this factor, and the intervals, if any, do not overlap.
const GROWN: f64 = 1.25;

/// A tail that grew between two reports of one PC and one protocol.
pub struct Growth<'a> {
    pub before: &'a Entry,
    pub after: &'a Entry,
    /// Percentile that grew.
    pub percentile: &'static str,
    pub from_us: f64,
    pub to_us: f64,
    pub changes: Vec<Change>,
}

/// One value of the machine section that differs; a value that one report lacks is `None`.
#[derive(Debug, PartialEq, Eq)]
pub struct Change {
    pub what: String,
    pub before: Option<String>,
    pub after: Option<String>,
}

/// Returns every growth between consecutive reports of the same protocol.
pub fn growths(pc: &Pc) -> Vec<Growth<'_>> {
    let mut found = Vec::new();
    for (i, after) in pc.entries.iter().enumerate() {
        let before = pc.entries[..i].iter().rev().find(|e| e.protocol == after.protocol);
        found.extend(before.and_then(|before| growth(before, after)));
    }
    found
}

/// Compares the highest percentile that both reports have.
fn growth<'a>(before: &'a Entry, after: &'a Entry) -> Option<Growth<'a>> {
    let both = |name| Some((name, before.percentile(name)?, after.percentile(name)?));
    let (percentile, from, to) = ["p99.9", "p99"].into_iter().find_map(both)?;
    has_grown(from, to).then(|| Growth {
        before,
        after,
        percentile,
        from_us: from.us,
        to_us: to.us,
        changes: changes(before, after),
    })
}

fn has_grown(from: Percentile, to: Percentile) -> bool {
    let apart = from
        .interval_us
        .zip(to.interval_us)
        .is_none_or(|(from, to)| to[0] > from[1]);
    to.us > GROWN * from.us && apart
}

/// Returns the differences between the machine sections. A fact missing from an older version is no change.
fn changes(before: &Entry, after: &Entry) -> Vec<Change> {
    let mut names: Vec<&String> = before.machine.keys().chain(after.machine.keys()).collect();
    names.sort();
    names.dedup();
    let of_group = |entry: &Entry, name: &str| {
        let group = name.split(": ").next().unwrap_or_default();
        entry.machine.keys().any(|k| k.split(": ").next() == Some(group))
    };
    let differs = |name: &&String| {
        let same = before.machine.get(*name) == after.machine.get(*name);
        !same && of_group(before, name) && of_group(after, name)
    };
    let change = |name: &String| Change {
        what: name.clone(),
        before: before.machine.get(name).cloned(),
        after: after.machine.get(name).cloned(),
    };
    names.into_iter().filter(differs).map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tail_grows_only_beyond_its_uncertainty() {
        let p = |us, interval_us| Percentile { us, interval_us };
        assert!(has_grown(p(20.0, Some([18.0, 22.0])), p(30.0, Some([27.0, 34.0]))));
        assert!(
            !has_grown(p(20.0, Some([18.0, 28.0])), p(30.0, Some([27.0, 34.0]))),
            "the intervals overlap"
        );
        assert!(
            !has_grown(p(20.0, Some([19.9, 20.1])), p(22.0, Some([21.9, 22.1]))),
            "a tenth is not much"
        );
        // Reports of older versions have no intervals.
        assert!(has_grown(p(20.0, None), p(30.0, Some([27.0, 34.0]))));
        assert!(!has_grown(p(30.0, None), p(20.0, None)));
    }
}

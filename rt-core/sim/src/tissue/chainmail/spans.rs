//! Links grouped into spans: stretches of consecutive elements linked to consecutive elements, all of one class.

use super::kernels::Pin;
use crate::scene::{Lattice, Run};

/// Element `lo + n` is linked to element `hi + n` for `n < len`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub lo: u32,
    pub hi: u32,
    pub len: u32,
    /// Runs of the two ends; the same for links along x.
    pub lo_run: u32,
    pub hi_run: u32,
    /// Row in the table of limits.
    pub class: u16,
    pub pin: Pin,
}

/// Spans along one axis in groups, one for each row `j + dims[1] * k`: the links whose upper end is in it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    spans: Vec<Span>,
    /// First span of each group, with one more entry at the end.
    groups: Vec<u32>,
}

impl Links {
    /// Returns the links whose upper end is in row `row`.
    #[inline(always)]
    pub fn below(&self, row: usize) -> &[Span] {
        match (self.groups.get(row), self.groups.get(row + 1)) {
            (Some(&start), Some(&end)) => &self.spans[start as usize..end as usize],
            _ => &[],
        }
    }

    pub fn all(&self) -> &[Span] {
        &self.spans
    }
}

/// The runs of every row, numbered through.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub runs: Vec<Run>,
    /// First run of each row, with one more entry at the end.
    first: Vec<u32>,
}

impl Rows {
    pub fn of(lattice: &Lattice) -> Rows {
        let mut rows = Rows::default();
        for k in 0..lattice.dims[2] {
            for j in 0..lattice.dims[1] {
                rows.first.push(rows.runs.len() as u32);
                rows.runs.extend_from_slice(lattice.row(j, k));
            }
        }
        rows.first.push(rows.runs.len() as u32);
        rows
    }

    /// Returns the numbers of the runs of a row.
    #[inline(always)]
    pub fn numbers(&self, row: usize) -> std::ops::Range<usize> {
        self.first[row] as usize..self.first[row + 1] as usize
    }

    /// Returns the numbers of the runs of rows `first..end`.
    #[inline(always)]
    pub fn numbers_of_rows(&self, first: usize, end: usize) -> std::ops::Range<usize> {
        self.first[first] as usize..self.first[end] as usize
    }

    pub fn count(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// Returns the run that an element is in.
    pub fn run_of(&self, element: u32) -> usize {
        self.runs.partition_point(|run| run.first <= element).saturating_sub(1)
    }
}

/// Says what class a link is of and which end is fixed, or `None` if nothing can move it.
pub(crate) type ClassOf<'a> = &'a dyn Fn(usize, u32, u32) -> Option<(u16, Pin)>;

/// Finds all links along `axis`.
pub(crate) fn links_along(axis: usize, lattice: &Lattice, rows: &Rows, class_of: ClassOf) -> Links {
    let ny = lattice.dims[1];
    let mut links = Links::default();
    for row in 0..rows.count() {
        links.groups.push(links.spans.len() as u32);
        let lower = match axis {
            0 => Some(row),
            1 if !row.is_multiple_of(ny) => Some(row - 1),
            2 => row.checked_sub(ny),
            _ => None,
        };
        if let Some(lower) = lower {
            push_row(axis, rows, [lower, row], class_of, &mut links.spans);
        }
    }
    links.groups.push(links.spans.len() as u32);
    links.spans.shrink_to_fit();
    links
}

/// Adds the links between two rows of cells, or between neighbours in one row.
fn push_row(axis: usize, rows: &Rows, [lower, upper]: [usize; 2], class_of: ClassOf, spans: &mut Vec<Span>) {
    if axis == 0 {
        for number in rows.numbers(upper) {
            let run = rows.runs[number];
            let ends = [number as u32; 2];
            push_classes(axis, [run.first, run.first + 1], run.len - 1, ends, class_of, spans);
        }
        return;
    }
    let (mut a, mut b) = (rows.numbers(lower), rows.numbers(upper));
    while let (Some(low), Some(high)) = (a.clone().next(), b.clone().next()) {
        let (l, h) = (rows.runs[low], rows.runs[high]);
        let (l_end, h_end) = (l.start_i + l.len, h.start_i + h.len);
        let (start, end) = (l.start_i.max(h.start_i), l_end.min(h_end));
        if start < end {
            let first = [l.first + start - l.start_i, h.first + start - h.start_i];
            push_classes(axis, first, end - start, [low as u32, high as u32], class_of, spans);
        }
        if l_end < h_end {
            a.next();
        } else {
            b.next();
        }
    }
}

/// Cuts a stretch of links where their class changes.
fn push_classes(
    axis: usize,
    [lo, hi]: [u32; 2],
    len: u32,
    [lo_run, hi_run]: [u32; 2],
    class_of: ClassOf,
    spans: &mut Vec<Span>,
) {
    let mut open: Option<Span> = None;
    for n in 0..len {
        let here = class_of(axis, lo + n, hi + n);
        match (&mut open, here) {
            (Some(span), Some((class, pin))) if (span.class, span.pin) == (class, pin) => span.len += 1,
            _ => {
                spans.extend(open.take());
                open = here.map(|(class, pin)| Span {
                    lo: lo + n,
                    hi: hi + n,
                    len: 1,
                    lo_run,
                    hi_run,
                    class,
                    pin,
                });
            }
        }
    }
    spans.extend(open);
}

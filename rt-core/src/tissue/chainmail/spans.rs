//! Links grouped into spans: stretches of consecutive elements linked to consecutive elements.

use crate::scene::Lattice;

/// Element `lo + n` is linked to element `hi + n` for `n < len`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub lo: u32,
    pub hi: u32,
    pub len: u32,
}

/// Spans along y or z in groups, each group the links between a row and the next (y) or between a plane
/// and the next (z).
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    spans: Vec<Span>,
    /// First span of each group, with one more entry at the end.
    groups: Vec<u32>,
}

impl Links {
    /// Links whose upper end is in row or plane `index`.
    pub fn below(&self, index: usize) -> &[Span] {
        match (self.groups.get(index), self.groups.get(index + 1)) {
            (Some(&start), Some(&end)) => &self.spans[start as usize..end as usize],
            _ => &[],
        }
    }

    pub fn all(&self) -> &[Span] {
        &self.spans
    }

    fn end_group(&mut self) {
        self.groups.push(self.spans.len() as u32);
    }

    /// Adds the links between two rows of cells.
    fn push_rows(&mut self, lattice: &Lattice, lo: [usize; 2], hi: [usize; 2]) {
        let (lo_row, hi_row) = (lattice.row(lo[0], lo[1]), lattice.row(hi[0], hi[1]));
        let (mut a, mut b) = (0, 0);
        while let (Some(l), Some(h)) = (lo_row.get(a), hi_row.get(b)) {
            let (l_end, h_end) = (l.start_i + l.len, h.start_i + h.len);
            let (start, end) = (l.start_i.max(h.start_i), l_end.min(h_end));
            if start < end {
                self.spans.push(Span {
                    lo: l.first + start - l.start_i,
                    hi: h.first + start - h.start_i,
                    len: end - start,
                });
            }
            if l_end < h_end {
                a += 1;
            } else {
                b += 1;
            }
        }
    }
}

/// All links along y (`axis` 1, groups by row `j + dims[1] * k`) or z (`axis` 2, groups by plane `k`).
pub(crate) fn links_along(axis: usize, lattice: &Lattice) -> Links {
    let mut links = Links::default();
    links.end_group();
    for k in 0..lattice.dims[2] {
        for j in 0..lattice.dims[1] {
            if axis == 1 {
                if j > 0 {
                    links.push_rows(lattice, [j - 1, k], [j, k]);
                }
                links.end_group();
            } else if k > 0 {
                links.push_rows(lattice, [j, k - 1], [j, k]);
            }
        }
        if axis == 2 {
            links.end_group();
        }
    }
    links
}

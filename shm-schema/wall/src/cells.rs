//! The protocol of a board: one writer fills cells in turn; readers take the newest one that stayed unchanged during
//! their copy.
//!
//! A cell has a number: even when it is complete, odd while it is written. Readers never write, so the writer never
//! waits.

#[cfg(loom)]
use loom::sync::atomic::{AtomicU64, Ordering, fence};
#[cfg(not(loom))]
use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Cells of a board. A reader has the time of three writes to copy one.
pub const CELLS: usize = 4;

/// Returns the cell of the write with that number; numbers begin with 1.
pub fn cell_of(number: u64) -> usize {
    (number % CELLS as u64) as usize
}

/// Fills the cell of write `number`, one more than the last. `newest` and `cell(n)` are the numbers that readers see.
pub fn write<'a>(newest: &AtomicU64, cell: impl Fn(usize) -> &'a AtomicU64, number: u64, fill: impl FnOnce(usize)) {
    let at = cell_of(number);
    cell(at).store(2 * number + 1, Ordering::Relaxed);
    // SYNC: pairs with the acquire fence in `read`: a reader that copied any byte of this write sees the odd number.
    fence(Ordering::Release);
    fill(at);
    // SYNC: pairs with the acquire loads in `read`: whoever sees these numbers sees the bytes.
    cell(at).store(2 * number, Ordering::Release);
    newest.store(number, Ordering::Release);
}

/// Copies the newest cell that is newer than `seen`; returns its number, or `None` if there is none or the writer has
/// overtaken the copy.
pub fn read<'a>(
    newest: &AtomicU64,
    cell: impl Fn(usize) -> &'a AtomicU64,
    seen: u64,
    copy: impl FnOnce(usize),
) -> Option<u64> {
    // SYNC: pairs with the release stores in `write`.
    let number = newest.load(Ordering::Acquire);
    let at = cell_of(number);
    if number == seen || cell(at).load(Ordering::Acquire) != 2 * number {
        return None;
    }
    copy(at);
    // SYNC: pairs with the release fence in `write`.
    fence(Ordering::Acquire);
    (cell(at).load(Ordering::Relaxed) == 2 * number).then_some(number)
}

#[cfg(all(test, loom))]
mod tests {
    use super::*;
    use loom::sync::Arc;

    struct Board {
        newest: AtomicU64,
        numbers: [AtomicU64; CELLS],
        values: [[AtomicU64; 2]; CELLS],
    }

    /// Every interleaving of a writer and a reader: a taken cell is consistent.
    #[test]
    fn a_cell_that_is_taken_is_whole() {
        let writes = CELLS as u64 + 1;
        let mut bounded = loom::model::Builder::new();
        bounded.preemption_bound = Some(3);
        bounded.check(move || {
            let zero = || AtomicU64::new(0);
            let board = Arc::new(Board {
                newest: zero(),
                numbers: std::array::from_fn(|_| zero()),
                values: std::array::from_fn(|_| [zero(), zero()]),
            });
            let writer = Arc::clone(&board);
            let writer = loom::thread::spawn(move || {
                for number in 1..=writes {
                    write(
                        &writer.newest,
                        |n| &writer.numbers[n],
                        number,
                        |at| {
                            writer.values[at]
                                .iter()
                                .for_each(|v| v.store(number, Ordering::Relaxed));
                        },
                    );
                }
            });
            let mut taken = [0; 2];
            let number = read(
                &board.newest,
                |n| &board.numbers[n],
                0,
                |at| {
                    taken = [0, 1].map(|n| board.values[at][n].load(Ordering::Relaxed));
                },
            );
            if let Some(number) = number {
                assert_eq!(taken, [number; 2]);
            }
            writer.join().unwrap();
        });
    }
}

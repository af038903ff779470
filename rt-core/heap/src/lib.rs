//! Counts each thread's heap calls, so that a loop can prove that it makes none; maps large blocks by themselves.
//!
//! A heap serves a large block from a hole between small ones, whatever threshold for mappings it was given: the
//! threshold only says how the heap grows. The small blocks that come after it keep the hole from closing, and under
//! `mlockall` no page of a hole is given back. Where scenes come and go, large blocks therefore never lie in the heap.

#![warn(missing_docs)]

mod mapped;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator below a size and mappings from there on, with a counter per thread.
pub struct CountingAllocator;

fn count() {
    // A thread that is ending has no counter left, and no tick.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

// SAFETY: the layout alone says who has a block, so each goes back to whom it came from.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        if mapped::takes(layout) {
            return mapped::alloc(layout.size());
        }
        // SAFETY: as our caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        if mapped::takes(layout) {
            return mapped::alloc(layout.size());
        }
        // SAFETY: as our caller promised.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        if mapped::takes(layout) {
            // SAFETY: a layout like this one was mapped.
            return unsafe { mapped::dealloc(pointer, layout.size()) };
        }
        // SAFETY: as our caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: our caller promised that the size suits the alignment.
        let wanted = unsafe { Layout::from_size_align_unchecked(size, layout.align()) };
        match (mapped::takes(layout), mapped::takes(wanted)) {
            // SAFETY: as our caller promised.
            (false, false) => unsafe { System.realloc(pointer, layout, size) },
            // SAFETY: a layout like this one was mapped.
            (true, true) => unsafe { mapped::resize(pointer, layout.size(), size) },
            // SAFETY: as our caller promised.
            _ => unsafe { self.change_place(pointer, layout, wanted) },
        }
    }
}

impl CountingAllocator {
    /// From the heap to a mapping or back.
    ///
    /// # Safety
    /// As for `realloc`.
    unsafe fn change_place(&self, pointer: *mut u8, layout: Layout, wanted: Layout) -> *mut u8 {
        // SAFETY: both blocks hold what is copied, and the old one is given back once.
        unsafe {
            let to = self.alloc(wanted);
            if !to.is_null() {
                std::ptr::copy_nonoverlapping(pointer, to, layout.size().min(wanted.size()));
                self.dealloc(pointer, layout);
            }
            to
        }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Allocations, frees and reallocations that this thread has made.
pub fn calls_of_this_thread() -> u64 {
    CALLS.with(Cell::get)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_box_is_two_calls() {
        let before = calls_of_this_thread();
        drop(std::hint::black_box(Box::new(7_u64)));
        assert_eq!(calls_of_this_thread() - before, 2);
    }

    fn begins_a_page<T>(block: &[T]) -> bool {
        block.as_ptr().addr().is_multiple_of(4096)
    }

    /// Scenes whose arrays lay in holes of the heap made the core grow over hundreds of changes of the scene.
    #[test]
    fn a_large_block_never_lies_in_a_hole_of_the_heap() {
        let small = || vec![1_u8; 16 << 10];
        let mut holes: Vec<_> = (0..256).map(|_| small()).collect();
        let mut number = 0;
        // Two of three go: what is left keeps the holes apart, each large enough for the block.
        holes.retain(|_| {
            number += 1;
            number % 3 == 0
        });
        for elements in 0..16 {
            let large = std::hint::black_box(vec![2_u8; (32 << 10) - 2048 + 2048 * (elements % 2 + 1)]);
            assert_eq!(begins_a_page(&large), large.len() >= 32 << 10, "{} bytes", large.len());
        }
    }

    #[test]
    fn a_block_keeps_its_values_as_it_grows_and_shrinks() {
        let mut values: Vec<u32> = Vec::with_capacity(4);
        for n in 0..1_000_000 {
            values.push(n);
        }
        assert!(begins_a_page(&values));
        for left in [300_000, 10_000, 8_191, 8_192, 100] {
            values.truncate(left);
            values.shrink_to_fit();
            assert!(values.iter().copied().eq(0..values.len() as u32), "{left} left");
        }
        assert!(vec![0_u8; 1 << 20].iter().all(|&byte| byte == 0));
    }
}

//! Blocks that are mapped by themselves and go back to the kernel whole.

use std::alloc::Layout;

/// From this size on a block is mapped.
const LARGE_BYTES: usize = 32 << 10;
/// The smallest page of any machine, and so what every mapping is aligned to.
const ALIGNED_BYTES: usize = 4 << 10;

/// True if a block of this layout is mapped: the same answer on allocation and on release.
pub fn takes(layout: Layout) -> bool {
    layout.size() >= LARGE_BYTES && layout.align() <= ALIGNED_BYTES
}

/// Zeros; null where there is no memory. The kernel rounds sizes up to whole pages.
pub fn alloc(bytes: usize) -> *mut u8 {
    let access = libc::PROT_READ | libc::PROT_WRITE;
    let kind = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
    // SAFETY: a new mapping at a place of the kernel's choice touches nothing that is in use.
    let block = unsafe { libc::mmap(std::ptr::null_mut(), bytes, access, kind, -1, 0) };
    or_null(block)
}

/// # Safety
/// `block` was given by [`alloc`] or [`resize`] with this size, and is in use no longer.
pub unsafe fn dealloc(block: *mut u8, bytes: usize) {
    // SAFETY: the range is one whole mapping of ours.
    unsafe { libc::munmap(block.cast(), bytes) };
}

/// Moved where it does not fit; null, and as it was, where there is no memory.
///
/// # Safety
/// As for [`dealloc`].
pub unsafe fn resize(block: *mut u8, bytes: usize, wanted: usize) -> *mut u8 {
    // SAFETY: the range is one whole mapping of ours, and our caller uses what this returns instead.
    or_null(unsafe { libc::mremap(block.cast(), bytes, wanted, libc::MREMAP_MAYMOVE) })
}

fn or_null(block: *mut libc::c_void) -> *mut u8 {
    if block == libc::MAP_FAILED {
        std::ptr::null_mut()
    } else {
        block.cast()
    }
}

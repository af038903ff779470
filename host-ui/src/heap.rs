//! Options of the C library's heap, which returns freed memory to the system; the driver's threads
//! allocate there too.

/// Most heaps; each thread's heap keeps freed blocks below a threshold, which glibc raises over
/// time.
const HEAPS_AT_MOST: libc::c_int = 2;
/// Smallest block with a separate mapping: a picture, a mesh or a volume returns to the system
/// when it is dropped.
const OWN_MAPPING_BYTES: libc::c_int = 1 << 20;

/// Limits the memory that the heap keeps. Must be called before other threads start. Does nothing
/// unless the C library is glibc.
pub fn keep_little() {
    #[cfg(target_env = "gnu")]
    // SAFETY: it only sets options of the allocator, which accepts any value.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, HEAPS_AT_MOST);
        libc::mallopt(libc::M_MMAP_THRESHOLD, OWN_MAPPING_BYTES);
    }
}

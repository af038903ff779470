//! What the C library keeps of memory that was given back; the driver's threads allocate there too.

/// Each thread's own heap keeps what it freed, and so does a block under the threshold, which glibc raises as it goes.
const HEAPS_AT_MOST: libc::c_int = 2;
/// A picture, a mesh or a volume goes back to the system when it is dropped.
const OWN_MAPPING_BYTES: libc::c_int = 1 << 20;

/// Call before other threads start. Nothing where the C library is not glibc.
pub fn keep_little() {
    #[cfg(target_env = "gnu")]
    // SAFETY: it only sets options of the allocator, which takes any value.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, HEAPS_AT_MOST);
        libc::mallopt(libc::M_MMAP_THRESHOLD, OWN_MAPPING_BYTES);
    }
}

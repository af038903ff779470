//! A block of atomics between a test and a fake driver: commands one way, reports the other. It is in memory, or in a
//! file mapped by two processes.
//!
//! A block of zeros is a healthy device.

#![warn(missing_docs)]

use libloading::os::unix::Library;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// A block used by both sides.
///
/// # Safety
///
/// The type is `repr(C)` and consists of atomics of 4 and 8 bytes, and of arrays of them.
// SYNC: every value of a block is independent, so each access is relaxed; its partner is the other side's access of the
// same field.
pub unsafe trait Block: Sized + Sync + 'static {
    /// Name of the function that returns the library's block: different for each fake, so that one test may use
    /// several.
    const EXPORT: &str;

    /// Returns a block of zeros that lives until the process ends.
    fn in_memory() -> &'static Self {
        let memory = memmap2::MmapMut::map_anon(size_of::<Self>()).expect("memory for the block");
        at(memory)
    }

    /// Returns the block in `file`, which is created if missing.
    fn in_file(file: &Path) -> &'static Self {
        let mut options = std::fs::OpenOptions::new();
        let opened = options.read(true).write(true).create(true).truncate(false).open(file);
        let opened = opened.expect("the control file can be opened");
        opened
            .set_len(size_of::<Self>() as u64)
            .expect("the control file can grow");
        // SAFETY: both sides use the file through atomics alone.
        at(unsafe { memmap2::MmapMut::map_mut(&opened) }.expect("the control file can be mapped"))
    }

    /// Returns the block in the file named by the environment, or one in memory.
    fn of_environment(variable: &str) -> &'static Self {
        match std::env::var_os(variable) {
            Some(file) => Self::in_file(file.as_ref()),
            None => Self::in_memory(),
        }
    }

    /// Sets the block to zero: a healthy device, and no calls.
    fn reset(&self) {
        let start = core::ptr::from_ref(self).cast::<AtomicU32>();
        for word in 0..size_of::<Self>() / size_of::<AtomicU32>() {
            // SAFETY: the block is made of atomics, and this stays inside it.
            // SYNC: relaxed; see the trait.
            unsafe { &*start.add(word) }.store(0, Ordering::Relaxed);
        }
    }
}

fn at<T: Block>(memory: memmap2::MmapMut) -> &'static T {
    let start = Box::leak(Box::new(memory)).as_ptr();
    // SAFETY: the map is never dropped, has this size, begins on a page, and every bit pattern is valid.
    unsafe { &*start.cast::<T>() }
}

/// Path of the built library `name` of a fake. Cargo puts it next to the tests, or one folder up if it was built
/// separately; the newer one counts.
///
/// # Panics
///
/// If it is in neither.
pub fn library(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own file");
    let deps = test.parent().expect("tests live in <target>/<profile>/deps");
    let folders = [Some(deps), deps.parent()];
    let found = folders.into_iter().flatten().map(|folder| folder.join(name));
    let age = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).ok();
    let newest = found.filter(|path| path.exists()).max_by_key(age);
    newest.unwrap_or_else(|| panic!("{name} is missing: run `cargo build --profile quick --workspace` first"))
}

/// Returns the block of the fake at `path`, which stays loaded.
///
/// # Panics
///
/// If it cannot be loaded, or is not a fake.
pub fn block_of<T: Block>(path: &Path) -> &'static T {
    // SAFETY: our own library; it has no constructors.
    let library = unsafe { Library::new(path) }.expect("the fake can be loaded");
    // SAFETY: the function has this type, and its block is never freed.
    let block = unsafe {
        let get = library
            .get::<extern "C" fn() -> *const T>(T::EXPORT.as_bytes())
            .expect("exported");
        &*get()
    };
    std::mem::forget(library);
    block
}

/// Stores a number in a cell of a block.
pub fn put(cell: &AtomicU64, value: f64) {
    // SYNC: relaxed; see `Block`.
    cell.store(value.to_bits(), Ordering::Relaxed);
}

/// Reads a number from a cell of a block.
pub fn get(cell: &AtomicU64) -> f64 {
    // SYNC: relaxed; see `Block`.
    f64::from_bits(cell.load(Ordering::Relaxed))
}

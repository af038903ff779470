//! Memory that one process writes and all others may only read.

use crate::cells::{self, CELLS};
use bytemuck::Pod;
use rustix::fs::{MemfdFlags, SealFlags};
use rustix::mm::{MapFlags, ProtFlags};
use std::io;
use std::marker::PhantomData;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::AtomicU64;

/// Each part begins on a cache line.
const LINE: usize = 64;

/// Offsets of a board's parts: the number of the newest cell, then the cells, each with its number, a header and
/// values.
#[derive(Clone, Copy)]
struct Layout {
    header: usize,
    values: usize,
    cell: usize,
    total: usize,
}

impl Layout {
    fn of<H: Pod, T: Pod>(values: usize) -> Option<Self> {
        let lines = |bytes: usize| bytes.checked_next_multiple_of(LINE);
        let header = LINE;
        let first = header.checked_add(lines(size_of::<H>())?)?;
        let cell = first.checked_add(lines(values.checked_mul(size_of::<T>())?)?)?;
        let total = CELLS.checked_mul(cell)?.checked_add(LINE)?;
        Some(Self {
            header,
            values: first,
            cell,
            total,
        })
    }
}

/// A mapping of a board.
struct Mapped {
    at: NonNull<u8>,
    layout: Layout,
}

// SAFETY: the mapping belongs to this value alone and is not tied to a thread.
unsafe impl Send for Mapped {}

impl Mapped {
    fn new(memory: BorrowedFd, layout: Layout, rights: ProtFlags) -> io::Result<Self> {
        // SAFETY: a new mapping at an address that the kernel chooses; the size of the memory is sealed, so that it
        // stays behind it.
        let at = unsafe { rustix::mm::mmap(std::ptr::null_mut(), layout.total, rights, MapFlags::SHARED, memory, 0)? };
        let at = NonNull::new(at.cast()).ok_or(io::ErrorKind::OutOfMemory)?;
        Ok(Self { at, layout })
    }

    fn place(&self, offset: usize) -> NonNull<u8> {
        debug_assert!(offset < self.layout.total);
        // SAFETY: the layout puts every offset inside of the mapping.
        unsafe { self.at.add(offset) }
    }

    fn newest(&self) -> &AtomicU64 {
        // SAFETY: the first eight bytes of a mapping are aligned, live as long as `self` and are used as an atomic
        // alone.
        unsafe { self.at.cast().as_ref() }
    }

    fn number(&self, cell: usize) -> &AtomicU64 {
        // SAFETY: likewise the first eight bytes of a cell, which begins on a line.
        unsafe { self.place(LINE + cell * self.layout.cell).cast().as_ref() }
    }

    fn header<H>(&self, cell: usize) -> NonNull<H> {
        self.place(LINE + cell * self.layout.cell + self.layout.header).cast()
    }

    fn values<T>(&self, cell: usize) -> NonNull<T> {
        match self.layout.values < self.layout.cell {
            true => self.place(LINE + cell * self.layout.cell + self.layout.values).cast(),
            false => NonNull::dangling(),
        }
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        // SAFETY: nothing borrows from the mapping any more.
        let _ = unsafe { rustix::mm::munmap(self.at.as_ptr().cast(), self.layout.total) };
    }
}

/// The writing side: headers with `values` values each.
pub struct Writer<H, T = ()> {
    mapped: Mapped,
    values: usize,
    /// Number of the last write.
    number: u64,
    holds: PhantomData<fn(H, T)>,
}

/// The reading side, in another process.
pub struct Reader<H, T = ()> {
    mapped: Mapped,
    seen: u64,
    holds: PhantomData<fn() -> (H, T)>,
}

impl<H: Pod, T: Pod> Writer<H, T> {
    /// Returns a zeroed board and its descriptor for readers, through which it cannot be mapped writable or written.
    pub fn new(name: &str, values: usize) -> io::Result<(Self, OwnedFd)> {
        let layout = Layout::of::<H, T>(values).ok_or(io::ErrorKind::OutOfMemory)?;
        let memory = rustix::fs::memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        rustix::fs::ftruncate(&memory, layout.total as u64)?;
        let mapped = Mapped::new(memory.as_fd(), layout, ProtFlags::READ | ProtFlags::WRITE)?;
        let seals = SealFlags::SHRINK | SealFlags::GROW | SealFlags::FUTURE_WRITE | SealFlags::SEAL;
        rustix::fs::fcntl_add_seals(&memory, seals)?;
        let writer = Self {
            mapped,
            values,
            number: 0,
            holds: PhantomData,
        };
        Ok((writer, memory))
    }

    /// Number of values in each cell.
    pub fn len(&self) -> usize {
        self.values
    }

    /// True if a cell has only a header.
    pub fn is_empty(&self) -> bool {
        self.values == 0
    }

    /// Publishes what `fill` writes to a cell, which holds an earlier write before. Neither waits nor allocates.
    pub fn write(&mut self, fill: impl FnOnce(&mut H, &mut [T])) {
        self.number += 1;
        let mapped = &self.mapped;
        cells::write(
            mapped.newest(),
            |cell| mapped.number(cell),
            self.number,
            |cell| {
                // SAFETY: header and values of the cell lie apart inside the mapping, aligned, valid for every bit
                // pattern; this process has no other reference to them, and no other process can write them.
                let (header, values) = unsafe {
                    let values = std::slice::from_raw_parts_mut(mapped.values(cell).as_ptr(), self.values);
                    (mapped.header(cell).as_mut(), values)
                };
                fill(header, values);
            },
        );
    }
}

impl<H: Pod, T: Pod> Reader<H, T> {
    /// Maps the board behind `memory`, with `values` values in each cell.
    pub fn new(memory: BorrowedFd, values: usize) -> io::Result<Self> {
        let layout = Layout::of::<H, T>(values).ok_or(io::ErrorKind::InvalidData)?;
        let size = rustix::fs::fstat(memory)?.st_size;
        let is_fixed = rustix::fs::fcntl_get_seals(memory)?.contains(SealFlags::SHRINK);
        if size != layout.total as i64 || !is_fixed {
            return Err(io::ErrorKind::InvalidData.into());
        }
        Ok(Self {
            mapped: Mapped::new(memory, layout, ProtFlags::READ)?,
            seen: 0,
            holds: PhantomData,
        })
    }

    /// True if there is a write that was not taken yet.
    pub fn has_news(&self) -> bool {
        // SYNC: a hint; `take` looks again.
        self.mapped.newest().load(std::sync::atomic::Ordering::Relaxed) != self.seen
    }

    /// Copies the newest write not taken yet to `header` and `values`, which must have room for a cell. Returns false
    /// if there is none, or if the writer overtook the copy: their contents are then undefined.
    ///
    /// # Safety
    /// Both must be valid for writes, of a header and of as many values as the board was opened with.
    pub unsafe fn take_to(&mut self, header: *mut H, values: *mut T, count: usize) -> bool {
        let mapped = &self.mapped;
        let taken = cells::read(
            mapped.newest(),
            |cell| mapped.number(cell),
            self.seen,
            |cell| {
                // SAFETY: the source lies inside the mapping, the caller answers for the target. Another process may
                // write meanwhile: the copy is of plain bytes, which are used only when the number of the cell stayed
                // the same.
                unsafe {
                    std::ptr::copy_nonoverlapping(mapped.header::<H>(cell).as_ptr(), header, 1);
                    std::ptr::copy_nonoverlapping(mapped.values::<T>(cell).as_ptr(), values, count);
                }
            },
        );
        self.seen = taken.unwrap_or(self.seen);
        taken.is_some()
    }
}

impl<H: Pod> Reader<H> {
    /// Returns the newest header not taken yet.
    pub fn take(&mut self) -> Option<H> {
        let mut header = H::zeroed();
        // SAFETY: there is room for a header, and there are no values.
        unsafe { self.take_to(&mut header, NonNull::dangling().as_ptr(), 0) }.then_some(header)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_takes_each_newest_write_once() {
        let (mut writer, memory) = Writer::<[u64; 3], u16>::new("test", 5).expect("room");
        let mut reader = Reader::<[u64; 3], u16>::new(memory.as_fd(), 5).expect("a board");
        let mut take = || {
            let (mut header, mut values) = ([0; 3], [0; 5]);
            // SAFETY: room for a header and five values.
            unsafe { reader.take_to(&mut header, values.as_mut_ptr(), 5) }.then_some((header, values))
        };
        assert_eq!(take(), None);
        for n in 1..20_u64 {
            writer.write(|header, values| {
                *header = [n; 3];
                values.fill(n as u16);
            });
            if n % 3 == 0 {
                assert_eq!(take(), Some(([n; 3], [n as u16; 5])));
                assert_eq!(take(), None);
            }
        }
    }

    #[test]
    fn nobody_else_can_write_or_resize_a_board() {
        let (_writer, memory) = Writer::<u64>::new("test", 0).expect("room");
        let layout = Layout::of::<u64, ()>(0).expect("small");
        assert!(Mapped::new(memory.as_fd(), layout, ProtFlags::READ).is_ok());
        assert!(Mapped::new(memory.as_fd(), layout, ProtFlags::READ | ProtFlags::WRITE).is_err());
        assert!(rustix::io::write(&memory, &[1]).is_err());
        assert!(rustix::fs::ftruncate(&memory, 0).is_err());
        assert!(rustix::fs::fcntl_add_seals(&memory, SealFlags::WRITE).is_err());
    }

    #[test]
    fn memory_that_is_no_such_board_is_refused() {
        let (_writer, memory) = Writer::<u64>::new("test", 0).expect("room");
        assert!(Reader::<u64, u8>::new(memory.as_fd(), 1).is_err());
        assert!(Reader::<u64, u8>::new(memory.as_fd(), usize::MAX).is_err());
        let loose = rustix::fs::memfd_create("test", MemfdFlags::ALLOW_SEALING).expect("room");
        assert!(Reader::<u64>::new(loose.as_fd(), 0).is_err());
    }

    /// Data taken while the writer continues is consistent, whoever is faster.
    #[test]
    fn a_fast_writer_tears_nothing() {
        let (mut writer, memory) = Writer::<u64, u64>::new("test", 2000).expect("room");
        let mut reader = Reader::<u64, u64>::new(memory.as_fd(), 2000).expect("a board");
        let writes = if cfg!(miri) { 50 } else { 20_000 };
        std::thread::scope(|scope| {
            let writing = scope.spawn(move || {
                for n in 1..=writes {
                    writer.write(|header, values| {
                        *header = n;
                        values.fill(n);
                    });
                }
            });
            let (mut header, mut values, mut taken) = (0, vec![0; 2000], 0);
            while !writing.is_finished() || taken == 0 {
                // SAFETY: room for a header and 2000 values.
                if unsafe { reader.take_to(&mut header, values.as_mut_ptr(), 2000) } {
                    taken += 1;
                    assert!(values.iter().all(|&v| v == header), "{header}");
                }
            }
        });
    }
}

//! Functions that `run.mjs` calls: bytes go in, text comes out, and the caller has the clock.

use crate::{Bench, repeat};
use std::cell::RefCell;
use stylet_sim::scene::TissueKind;

#[derive(Default)]
struct Shared {
    input: Vec<u8>,
    text: String,
    bench: Option<Bench>,
}

thread_local! {
    static SHARED: RefCell<Shared> = RefCell::default();
}

fn with<T>(work: impl FnOnce(&mut Shared) -> T) -> T {
    SHARED.with_borrow_mut(work)
}

/// Returns the place for an input of `len` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn room(len: usize) -> *mut u8 {
    std::panic::set_hook(Box::new(|panicked| {
        // The text may be borrowed where the panic happened; it is then lost.
        let _ = SHARED.with(|shared| {
            shared
                .try_borrow_mut()
                .map(|mut shared| shared.text = panicked.to_string())
        });
    }));
    with(|shared| {
        shared.input = vec![0; len];
        shared.input.as_mut_ptr()
    })
}

/// Returns the place of the text.
#[unsafe(no_mangle)]
pub extern "C" fn text() -> *const u8 {
    with(|shared| shared.text.as_ptr())
}

/// Returns the length of the text.
#[unsafe(no_mangle)]
pub extern "C" fn text_len() -> usize {
    with(|shared| shared.text.len())
}

/// Repeats the recording in the input; true if every bit is the same. The text says what differs.
#[unsafe(no_mangle)]
pub extern "C" fn repeat_input() -> bool {
    let input = with(|shared| std::mem::take(&mut shared.input));
    let (text, is_same) = match repeat(&input, || {}) {
        Ok(found) => (found.to_string(), found.is_same()),
        Err(why) => (format!("{why}\n"), false),
    };
    with(|shared| shared.text = text);
    is_same
}

/// Prepares a needle in tissue of that number among [`TissueKind::ALL`]; false if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn prepare(tissue: usize) -> bool {
    let Some(tissue) = TissueKind::ALL.get(tissue) else {
        return false;
    };
    let bench = Bench::new(*tissue);
    with(|shared| (shared.text, shared.bench) = (tissue.name().to_owned(), Some(bench)));
    true
}

/// Rehearses it; returns the number of force ticks.
#[unsafe(no_mangle)]
pub extern "C" fn rehearse() -> f64 {
    let bench = with(|shared| shared.bench.take());
    bench.map_or(0.0, |mut bench| {
        let ticks = bench.rehearse();
        with(|shared| shared.bench = Some(bench));
        ticks
    })
}

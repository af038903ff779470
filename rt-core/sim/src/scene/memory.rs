//! Check that a scene fits into available memory.

use super::problem::SceneProblem;

/// Memory that `rt-core` takes for each element of a large scene: lattice, tissue, surface and the slices of shared
/// memory. Measured as resident memory of `rt-core --scene full` above that of `--scene paper`, rounded up.
const BYTES_PER_ELEMENT: u64 = 120;

/// Returns a problem when a scene of so many elements, cut from so many labels, needs more memory than is available.
pub(super) fn problem(elements: usize, cells: usize, available_bytes: u64) -> Option<SceneProblem> {
    let needed_bytes = elements as u64 * BYTES_PER_ELEMENT + cells as u64;
    (needed_bytes > available_bytes).then_some(SceneProblem::Memory {
        elements,
        needed_bytes,
        available_bytes,
    })
}

/// Returns the memory that the kernel reports as available without swapping; no limit where it reports none.
pub(super) fn available_bytes() -> u64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    available_in(&text).unwrap_or(u64::MAX)
}

fn available_in(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_larger_than_the_memory_is_refused_with_both_figures() {
        let million = 1_000_000;
        assert_eq!(problem(million, million, 121 * million as u64), None);
        let said = problem(million, million, 100 << 20).expect("too large").to_string();
        assert!(
            said.contains("1000000 elements") && said.contains("116 MiB") && said.contains("100 MiB"),
            "{said}"
        );
    }

    #[test]
    fn the_kernel_s_figure_is_read() {
        let text = "MemTotal: 8 kB\nMemAvailable:   16252928 kB\nBuffers: 1 kB\n";
        assert_eq!(available_in(text), Some(16_252_928 * 1024));
        assert_eq!(available_in("MemTotal: 8 kB"), None);
    }
}

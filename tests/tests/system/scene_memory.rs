//! Memory of the core over changes of the scene.

use std::time::Duration;
use stylet_tests::{Core, load_builtin, until};

/// Resident memory of a process, MB.
fn resident_mb(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("it runs");
    let line = status.lines().find(|l| l.starts_with("VmRSS:")).expect("a size");
    let kb: f64 = line.split_whitespace().nth(1).and_then(|n| n.parse().ok()).expect("kB");
    kb * 1e-3
}

/// Memory after each of `swaps` changes between `paper` and `pelvis`.
fn over_swaps(swaps: usize) -> Vec<f64> {
    let mut core = Core::start();
    let mut link = core.host();
    let mut memory_mb = Vec::new();
    for swap in 0..swaps {
        let generation = link.scene().map_or(0, |scene| scene.header.generation);
        load_builtin(&mut link, (swap + 1) as u32 % 2).expect("built in");
        let runs = until(Duration::from_secs(20), || {
            link.poll();
            let scene = link.scene().map_or(0, |scene| scene.header.generation);
            scene > generation && link.snapshot().is_some_and(|s| s.header.scene_generation == scene)
        });
        assert!(runs, "scene {swap} does not run");
        memory_mb.push(resident_mb(core.id()));
    }
    drop(link);
    println!("force loop {}", core.finish()["haptic"]);
    memory_mb
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

/// A leaked scene would add several MB per change. The growth of the heap over hundreds of changes is measured below.
#[test]
fn memory_stays_over_changes_of_the_scene() {
    let memory_mb = over_swaps(48);
    let (early, late) = (mean(&memory_mb[12..24]), mean(&memory_mb[36..]));
    println!("{early:.1} MB after 12 changes, {late:.1} MB after 36");
    assert!(late < early * 1.15, "{memory_mb:.1?}");
}

/// `cargo test --profile quick -p stylet-tests --test system four_hundred -- --ignored --nocapture`
#[test]
#[ignore = "a measurement of some minutes"]
fn memory_over_four_hundred_changes() {
    let memory_mb = over_swaps(400);
    println!("{:.1?}", memory_mb.chunks(20).map(mean).collect::<Vec<_>>());
    let hundreds: Vec<f64> = memory_mb.chunks(100).map(mean).collect();
    println!(
        "MB by hundreds {hundreds:.2?}, last of the second {:.4}",
        hundreds[3] / hundreds[1]
    );
    // A line being solved takes 20 MB and more, at random: the minimum is without one.
    let least: Vec<f64> = memory_mb
        .chunks(100)
        .map(|hundred| hundred.iter().copied().fold(f64::MAX, f64::min))
        .collect();
    println!("least of each hundred {least:.2?}");
}

//! The latency laboratory as a user runs it: causes that are injected into a measurement, campaigns that are killed,
//! and files for other programs.

#[cfg(test)]
mod campaign;
#[cfg(test)]
mod causes;
#[cfg(test)]
mod inject;
#[cfg(test)]
mod interchange;

/// Removes the files of a killed process from shared memory.
#[cfg(test)]
fn sweep(process: u32) {
    let left = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    for file in left.filter(|f| f.file_name().to_string_lossy().contains(&format!("_lab-{process}"))) {
        let path = file.path();
        let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
    }
}

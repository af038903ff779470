//! Reads and writes large files in pieces, to spare a force loop.
//!
//! A non-preemptible kernel keeps the processor for a whole copy: 20 MB in one call take 5 ms.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

/// Bytes in one call: some 20 µs.
const PIECE: usize = 1 << 16;

/// Reads a whole file.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(bytes),
            Ok(n) => bytes.extend_from_slice(&piece[..n]),
            Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
            Err(why) => return Err(why),
        }
    }
}

/// Writes a file of these parts, which is on the disk before it gets its name.
pub fn write(path: &Path, parts: &[&[u8]]) -> io::Result<()> {
    let unfinished = path.with_extension(format!("{}.part", std::process::id()));
    let written = File::create(&unfinished).and_then(|mut file| {
        let mut pieces = parts.iter().flat_map(|part| part.chunks(PIECE));
        pieces.try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
        fs::rename(&unfinished, path)
    });
    if written.is_err() {
        // An incomplete file is of no use.
        let _ = fs::remove_file(&unfinished);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_many_pieces_comes_back_whole() {
        let path = std::env::temp_dir().join(format!("stylet-pieces-{}", std::process::id()));
        let bytes: Vec<u8> = (0..3 * PIECE + 7).map(|n| (n % 251) as u8).collect();
        for part in [&bytes[..], &bytes[..PIECE], &[]] {
            write(&path, &[part]).unwrap();
            assert_eq!(read(&path).unwrap(), part);
        }
        std::fs::remove_file(&path).unwrap();
        assert!(read(&path).is_err());
    }
}

//! Provenance of a result: each input with its SHA-256, the program with its version, and the time.

use crate::readers::file_of_program;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::io::{Error, Read};
use std::path::{Path, PathBuf};
use stylet_base::format::utc_now;
use stylet_base::input;
use stylet_files::dicom::Identity;

/// Number of bytes read at a time.
const PART_BYTES: usize = 1 << 16;

/// Error of an input that could not be read again for its digest.
#[derive(Debug, thiserror::Error)]
#[error("{}: its digest cannot be computed ({why}); was it moved?", .path.display())]
pub struct DigestError {
    /// The file.
    pub path: PathBuf,
    /// What the system reported.
    pub why: Error,
}

/// Like [`made`], for inputs that are not files: each by its name, with size and SHA-256 of its
/// content.
pub fn made_of(inputs: &[(&str, &[u8])]) -> Value {
    let input = |(name, content): &(&str, &[u8])| json!({ "input": name, "bytes": content.len(), "sha256": hexadecimal(&Sha256::digest(content)) });
    of_inputs(inputs.iter().map(input).collect())
}

fn of_inputs(inputs: Vec<Value>) -> Value {
    json!({
        "program": "host-ui",
        "version": env!("CARGO_PKG_VERSION"),
        "made_at": utc_now(),
        "inputs": inputs,
    })
}

fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns program, version, time, and each of the `inputs` by the option that named it, with size
/// and SHA-256, and with the patient and the frame of reference of a clinical file.
pub fn made(inputs: &[(&str, &Path)]) -> Result<Value, DigestError> {
    let input = |(option, path): &(&str, &Path)| {
        let (sha256, bytes) = match file_of_program(path) {
            Some(text) => (hexadecimal(&Sha256::digest(text)), text.len() as u64),
            None => sha256(path)?,
        };
        let mut input =
            json!({ "option": option, "file": path.display().to_string(), "bytes": bytes, "sha256": sha256 });
        if let Ok(Some(identity)) = Identity::of_path(path) {
            input["patient_id"] = json!(identity.patient_id);
            input["study_uid"] = json!(identity.study);
            input["frame_of_reference_uid"] = json!(identity.frame_of_reference);
        }
        Ok(input)
    };
    Ok(of_inputs(inputs.iter().map(input).collect::<Result<_, DigestError>>()?))
}

/// Returns the digest in hexadecimal digits, and the size in bytes. For a folder it is that of the
/// list of its files as `sha256sum` prints it, sorted by name.
fn sha256(path: &Path) -> Result<(String, u64), DigestError> {
    let failed = |why| DigestError {
        path: path.to_owned(),
        why,
    };
    if path.is_dir() {
        let entries = std::fs::read_dir(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let mut files: Vec<PathBuf> = entries.map_err(failed)?.into_iter().map(|entry| entry.path()).collect();
        files.retain(|file| file.is_file());
        files.sort();
        let (mut list, mut bytes) = (String::new(), 0);
        for file in &files {
            let (digest, size) = sha256(file)?;
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            list += &format!("{digest}  {name}\n");
            bytes += size;
        }
        return Ok((hexadecimal(&Sha256::digest(list.as_bytes())), bytes));
    }
    let (mut file, _) = input::open(path).map_err(|why| failed(Error::other(why.to_string())))?;
    let (mut digest, mut bytes) = (Sha256::new(), 0);
    let mut part = vec![0; PART_BYTES];
    loop {
        let count = file.read(&mut part).map_err(failed)?;
        if count == 0 {
            break;
        }
        digest.update(&part[..count]);
        bytes += count as u64;
    }
    Ok((hexadecimal(&digest.finalize()), bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against a result without its input files.
    #[test]
    fn an_input_is_named_with_its_digest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let made = made(&[("--seeds", &path)]).unwrap();
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            made["inputs"][0]["sha256"],
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!(made["inputs"][0]["bytes"], 3);
        assert_eq!(
            made_of(&[("plan", b"abc")])["inputs"][0]["sha256"],
            made["inputs"][0]["sha256"]
        );
        assert!(made["version"].is_string() && made["made_at"].is_string());
        assert!(super::made(&[("--seeds", &folder.path().join("none"))]).is_err());
        let of_program = super::made(&[("--source", Path::new("6711"))]).unwrap();
        let text = file_of_program(Path::new("6711")).unwrap();
        assert_eq!(of_program["inputs"][0]["bytes"], text.len());
        // A folder by its list, as sha256sum prints it.
        std::fs::write(folder.path().join("empty"), "").unwrap();
        let made = super::made(&[("--images", folder.path())]).unwrap();
        let list = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  abc\n\
                    e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  empty\n";
        assert_eq!(
            made["inputs"][0]["sha256"],
            made_of(&[("", list.as_bytes())])["inputs"][0]["sha256"]
        );
    }
}

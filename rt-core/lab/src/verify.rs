//! Verifies that a saved report is unaltered. It finds damage and careless edits; it is not a signature.

use crate::files::sha256;
use crate::report::{JSON, NO_DIGEST};
use std::path::{Path, PathBuf};

/// The report cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {}: {source}", .path.display())]
pub struct ReadError {
    /// `report.json` of the report.
    pub path: PathBuf,
    /// What the system reports.
    pub source: std::io::Error,
}

/// Checks the report at `place`, its folder or its `report.json`, and prints every problem.
///
/// Returns 0 when the report is unaltered, else 1.
///
/// # Errors
/// `report.json` cannot be read.
pub fn run(place: &Path) -> Result<u8, ReadError> {
    let file = if place.is_dir() {
        place.join(JSON)
    } else {
        place.to_owned()
    };
    let text = std::fs::read_to_string(&file).map_err(|source| ReadError {
        path: file.clone(),
        source,
    })?;
    let folder = file.parent().unwrap_or(Path::new("."));
    let problems = problems(&text, |name| std::fs::read(folder.join(name)).ok());
    for problem in &problems {
        println!("{problem}");
    }
    if problems.is_empty() {
        println!("{}: unaltered", file.display());
    }
    Ok(u8::from(!problems.is_empty()))
}

/// Everything that was altered; `read` returns the content of a file beside the report.
fn problems(text: &str, read: impl Fn(&str) -> Option<Vec<u8>>) -> Vec<String> {
    let Ok(report) = serde_json::from_str::<serde_json::Value>(text) else {
        return vec![format!("{JSON}: tampered with or damaged, it is not JSON")];
    };
    let digest = report["sha256"].as_str().unwrap_or_default();
    if digest.len() != NO_DIGEST.len() || digest == NO_DIGEST {
        return vec![format!("{JSON}: it carries no SHA-256")];
    }
    let mut problems = Vec::new();
    let found = sha256(text.replacen(digest, NO_DIGEST, 1).as_bytes());
    if found != digest {
        problems.push(format!(
            "{JSON}: tampered with: its SHA-256 is {found}, it says {digest}"
        ));
    }
    for file in report["files"].as_array().into_iter().flatten() {
        let (name, said) = (
            file["name"].as_str().unwrap_or_default(),
            file["sha256"].as_str().unwrap_or_default(),
        );
        let Some(bytes) = read(name) else {
            problems.push(format!("{name}: missing"));
            continue;
        };
        // The page shows the report's digest, which did not exist yet when the page's was taken.
        let bare = match std::str::from_utf8(&bytes) {
            Ok(page) => page.replacen(digest, NO_DIGEST, 1).into_bytes(),
            Err(_) => bytes,
        };
        if sha256(&bare) != said {
            problems.push(format!(
                "{name}: tampered with: its SHA-256 is not the one that the report names"
            ));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAW: &[u8] = b"raw data";

    /// A report with one page, digests and all.
    fn written() -> (String, Vec<u8>) {
        let page = format!("<p>{NO_DIGEST}</p>");
        let text = format!(
            "{{\"sha256\": \"{NO_DIGEST}\", \"max_us\": 48.5, \"files\": [{{\"name\": \"raw\", \"sha256\": \"{}\"}}, \
             {{\"name\": \"page\", \"sha256\": \"{}\"}}]}}",
            sha256(RAW),
            sha256(page.as_bytes())
        );
        let digest = sha256(text.as_bytes());
        let fill = |s: &str| s.replacen(NO_DIGEST, &digest, 1);
        (fill(&text), fill(&page).into_bytes())
    }

    fn check(text: &str, raw: Option<&[u8]>, page: &[u8]) -> Vec<String> {
        problems(text, |name| {
            if name == "raw" {
                raw.map(<[u8]>::to_vec)
            } else {
                Some(page.to_vec())
            }
        })
    }

    #[test]
    fn unaltered_report_passes_and_every_change_is_found() {
        let (text, page) = written();
        assert_eq!(check(&text, Some(RAW), &page), Vec::<String>::new());
        let better = text.replace("48.5", "18.5");
        assert!(check(&better, Some(RAW), &page)[0].contains("report.json: tampered"));
        assert_eq!(check(&text, Some(b"raw dat4"), &page).len(), 1);
        assert_eq!(check(&text, None, &page), ["raw: missing"]);
        assert!(check(&text, Some(RAW), b"<p>other</p>")[0].contains("page: tampered"));
        assert!(check("{}", None, b"")[0].contains("no SHA-256"));
        assert!(check("{", None, b"")[0].contains("not JSON"));
    }
}

//! Every change is detected and named: a byte, a key, a program.

use super::*;
use crate::sealed::NO_DIGEST;

const RAW: &[u8] = b"raw data";

/// Returns a report with one page, digests and all.
fn written() -> (String, Vec<u8>) {
    let page = "<p>page</p>";
    let text = format!(
        "{{\"schema\": \"{OLD_SCHEMA}\", \"sha256\": \"{NO_DIGEST}\", \"max_us\": 48.5, \"files\": [{{\"name\": \"raw\", \"sha256\": \"{}\"}}, \
         {{\"name\": \"page\", \"sha256\": \"{}\"}}]}}",
        sha256(RAW),
        sha256(page.as_bytes())
    );
    let digest = sha256(text.as_bytes());
    (text.replacen(NO_DIGEST, &digest, 1), page.as_bytes().to_vec())
}

fn check(text: &str, raw: Option<&[u8]>, page: &[u8]) -> Vec<String> {
    sealed::problems(JSON, text, |name| {
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

/// Makes a key; `None` if ssh-keygen is not installed.
pub fn key(folder: &Path, name: &str) -> Option<PathBuf> {
    let made = std::process::Command::new("ssh-keygen")
        .args(["-q", "-t", "ed25519", "-N", "", "-C", name, "-f"])
        .arg(folder.join(name))
        .status();
    if made.is_err() {
        println!("skipped: ssh-keygen is not installed");
    }
    made.ok().map(|_| folder.join(name))
}

/// A report in its own folder, with two keys: that of A. Meyer, a permitted signer, and another.
struct Signed {
    folder: PathBuf,
}

impl Signed {
    /// Makes a folder; `None` if ssh-keygen is not installed.
    fn new(name: &str) -> Option<Self> {
        let folder = std::env::temp_dir().join(format!("stylet-signed-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
        let signed = Self { folder };
        for name in ["meyer", "other"] {
            key(&signed.folder, name)?;
        }
        let public = std::fs::read_to_string(signed.path("meyer.pub")).expect("a public key");
        std::fs::write(signed.path("allowed"), format!("a.meyer@site {public}")).expect("written");
        let (text, page) = written();
        let text = text.replacen(
            '{',
            "{\"programs\": [{\"name\": \"rt-core\", \"sha256\": \"0123\"}], ",
            1,
        );
        let digest = sha256(text.replacen(&text_digest(&text), NO_DIGEST, 1).as_bytes());
        let old = text_digest(&text);
        signed.put(JSON, text.replacen(&old, &digest, 1).as_bytes());
        signed.put("raw", RAW);
        signed.put("page", &page);
        sign::sign(&signed.path(JSON), &signed.path("meyer")).expect("the key signs");
        Some(signed)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("the folder can be written");
    }

    /// Flips the byte in the middle of a file during `then`.
    fn flipped(&self, name: &str, then: impl FnOnce()) {
        let whole = std::fs::read(self.path(name)).expect("a file");
        let mut flipped = whole.clone();
        flipped[whole.len() / 2] ^= 1;
        self.put(name, &flipped);
        then();
        self.put(name, &whole);
    }

    fn args(&self) -> VerifyArgs {
        VerifyArgs {
            report: self.folder.clone(),
            allowed_signers: Some(self.path("allowed")),
            binary: Vec::new(),
            nonce: None,
            timestamp_ca: None,
        }
    }

    fn signature(&self) -> Result<String, String> {
        sign::signer(&self.path(JSON), Some(&self.path("allowed"))).map_err(|e| e.to_string())
    }
}

impl Drop for Signed {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

pub fn text_digest(text: &str) -> String {
    let report: Value = serde_json::from_str(text).expect("JSON");
    report["sha256"].as_str().expect("a digest").to_owned()
}

#[test]
fn signature_names_person_and_key() {
    let Some(signed) = Signed::new("good") else { return };
    let said = signed.signature().expect("a good signature");
    assert!(
        said.starts_with("signed by a.meyer@site with ED25519 key SHA256:"),
        "{said}"
    );
    // Oracle: the fingerprint as ssh-keygen -l prints it.
    let listed = std::process::Command::new("ssh-keygen")
        .arg("-lf")
        .arg(signed.path("meyer.pub"))
        .output()
        .expect("runs");
    let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(
        said.ends_with(listed.split(' ').nth(1).expect("a fingerprint")),
        "{said} {listed}"
    );
    assert_eq!(run(&signed.args()).expect("readable"), 0);
    let unnamed = sign::signer(&signed.path(JSON), None).expect("a good signature");
    assert!(unnamed.starts_with("signed with ED25519 key SHA256:") && unnamed.contains("--allowed-signers"));
}

#[test]
fn one_flipped_byte_is_found_in_each_file_and_named() {
    let Some(signed) = Signed::new("flipped") else { return };
    let found = || {
        let bytes = std::fs::read(signed.path(JSON)).expect("a report");
        sealed::problems(JSON, &String::from_utf8_lossy(&bytes), |name| {
            std::fs::read(signed.path(name)).ok()
        })
    };
    for name in ["raw", "page", JSON] {
        signed.flipped(name, || {
            assert_eq!(run(&signed.args()).expect("readable"), 1, "{name}");
            assert!(
                found().iter().any(|problem| problem.starts_with(name)),
                "{name}: {:?}",
                found()
            );
        });
    }
    signed.flipped(JSON, || {
        let why = signed.signature().expect_err("another report");
        assert!(
            why.starts_with("report.json.sig: the signature is not one of this report.json"),
            "{why}"
        );
    });
    signed.flipped("report.json.sig", || {
        let why = signed.signature().expect_err("no signature");
        assert!(why.starts_with("report.json.sig: "), "{why}");
    });
    assert_eq!((found(), run(&signed.args()).expect("readable")), (Vec::new(), 0));
}

#[test]
fn wrong_key_and_missing_signature_are_named() {
    let Some(signed) = Signed::new("key") else { return };
    sign::sign(&signed.path(JSON), &signed.path("other")).expect("the key signs");
    let why = signed.signature().expect_err("not allowed");
    assert!(
        why.contains("wrong key: signed with ED25519 key SHA256:") && why.contains("allowed does not list"),
        "{why}"
    );
    assert_eq!(run(&signed.args()).expect("readable"), 1);
    std::fs::remove_file(signed.path("report.json.sig")).expect("removed");
    assert!(signed.signature().expect_err("none").contains("not signed"));
    assert_eq!(
        sign::signer(&signed.path(JSON), None).ok().as_deref(),
        Some("not signed")
    );
    // An invalid key.
    signed.put("meyer", b"no key");
    let why = sign::sign(&signed.path(JSON), &signed.path("meyer"))
        .expect_err("no key")
        .to_string();
    assert!(why.contains("cannot sign the report"), "{why}");
}

#[test]
fn report_of_another_program_is_named() {
    let report = serde_json::json!({"programs": [{"name": "rt-core", "sha256": "0123"}]});
    assert_eq!(other_program(&report, Path::new("bin/rt-core"), "0123"), None);
    let why = other_program(&report, Path::new("bin/rt-core"), "4567").expect("another one");
    assert!(
        why.contains("rt-core has the SHA-256 4567, the report names rt-core 0123"),
        "{why}"
    );
    // Reports of older versions name none.
    assert!(
        other_program(&Value::Null, Path::new("rt-core"), "4567").is_some_and(|why| why.contains("names no program"))
    );
}

#[test]
fn another_challenge_is_refused() {
    let Some(signed) = Signed::new("nonce") else { return };
    let asked = |nonce: &str| VerifyArgs {
        nonce: Some(nonce.to_owned()),
        ..signed.args()
    };
    assert_eq!(run(&asked("7")).expect("readable"), 1, "the report answers none");
    let text = std::fs::read_to_string(signed.path(JSON)).expect("a report");
    let bare = text
        .replacen('{', "{\"nonce\": \"7\", ", 1)
        .replacen(&text_digest(&text), NO_DIGEST, 1);
    signed.put(JSON, sealed::seal(&bare).as_bytes());
    sign::sign(&signed.path(JSON), &signed.path("meyer")).expect("the key signs");
    assert_eq!(run(&asked("7")).expect("readable"), 0);
    assert_eq!(run(&asked("8")).expect("readable"), 1);
}

/// Oracle: openssl itself is the authority.
#[test]
fn a_time_stamp_is_checked_and_one_of_another_report_is_refused() {
    let Some(signed) = Signed::new("stamp") else { return };
    let openssl = |words: &str| {
        let run = std::process::Command::new("openssl")
            .args(words.split(' '))
            .current_dir(&signed.folder)
            .output();
        run.map(|o| assert!(o.status.success(), "{words}: {}", String::from_utf8_lossy(&o.stderr)))
    };
    signed.put(
        "tsa.cnf",
        b"[req]\ndistinguished_name=dn\n[dn]\n[tsa]\nextendedKeyUsage=critical,timeStamping\n[ts]\ndefault_tsa=t\n[t]\nserial=serial\n\
          crypto_device=builtin\nsigner_cert=tsa.pem\nsigner_key=tsa.key\nsigner_digest=sha256\ndefault_policy=1.2.3\ndigests=sha256\n",
    );
    signed.put("serial", b"01");
    let made = openssl(
        "req -x509 -newkey rsa:2048 -nodes -keyout tsa.key -out tsa.pem -subj /CN=Clock -config tsa.cnf -extensions tsa",
    );
    if made.is_err() {
        println!("skipped: openssl is not installed");
        return;
    }
    openssl("ts -query -data report.json -sha256 -cert -out report.json.tsq").expect("runs");
    openssl("ts -reply -config tsa.cnf -section t -queryfile report.json.tsq -out report.json.tsr").expect("runs");
    let said = stamp::check(&signed.path(JSON), &signed.path("tsa.pem")).expect("a good stamp");
    assert!(
        said.starts_with("stamped by the authority at ") && said.ends_with("GMT"),
        "{said}"
    );
    signed.put(JSON, b"{}");
    let why = stamp::check(&signed.path(JSON), &signed.path("tsa.pem")).expect_err("another report");
    assert!(why.to_string().contains("not a time stamp of this report"), "{why}");
}

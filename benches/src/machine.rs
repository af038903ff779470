//! Machine of a measurement, and the folder where its results are kept.

use std::path::PathBuf;
use std::process::Command;

/// Returns the name and value of what has a say in a time; what cannot be read says so.
pub fn describe() -> Vec<(String, String)> {
    let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let output = |program: &str, arguments: &[&str]| {
        let run = Command::new(program).args(arguments).output();
        let text = run.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned());
        text.ok()
            .filter(|t| !t.is_empty())
            .unwrap_or_else(|| "not known".to_owned())
    };
    let cpu = file("/proc/cpuinfo");
    let model = cpu
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let pairs = [
        ("date", output("date", &["-u", "+%Y-%m-%d"])),
        ("host", output("uname", &["-n"])),
        ("kernel", output("uname", &["-sr"])),
        ("processor", model.map_or("not known", |(_, name)| name).to_owned()),
        ("cores", cores.to_string()),
        ("commit", output("git", &["rev-parse", "--short=12", "HEAD"])),
        ("command", std::env::args().collect::<Vec<_>>().join(" ")),
    ];
    pairs.map(|(name, value)| (name.to_owned(), value)).into()
}

/// Returns `benches/runs/<date>-<host>`.
pub fn run_folder(machine: &[(String, String)]) -> PathBuf {
    let of = |name: &str| machine.iter().find(|(n, _)| n == name).map_or("", |(_, value)| value);
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("runs")
        .join(format!("{}-{}", of("date"), of("host")))
}

//! A page of the repository, and a folder in which its commands are typed.

use crate::Ended;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use stylet_test_kit::{program, repository, scratch, until};

const PROGRAMS: [&str; 6] = ["make", "sudo", "cargo", "rt-core", "host-ui", "sigrok-cli"];
const OPENS_WITHIN: Duration = Duration::from_secs(30);
const STAYS_FOR: Duration = Duration::from_secs(3);

/// How a command of a page is tried.
#[derive(Clone, Copy)]
pub enum Try {
    /// It ends with success.
    Succeeds,
    /// It ends with a verdict on the machine: good, bad, or that it cannot be measured.
    Judged,
    /// A window shows frames until it is closed.
    Window,
    /// It runs until it is ended.
    Stays,
    /// It builds or runs more than a test may: its target or its package exists.
    Known,
    /// It is not tried here, for this reason.
    Elsewhere(&'static str),
}

/// A command as the page has it, replacements in it, and how it is tried.
type Row<'a> = (&'a str, &'a [(&'a str, &'a str)], Try);

pub struct Page {
    name: &'static str,
    folder: PathBuf,
    instance: String,
    blocks: Vec<String>,
    left: Vec<String>,
    core: Option<Ended>,
}

impl Page {
    /// Reads a page, and makes a folder that looks like a clone with its programs built.
    pub fn open(name: &'static str) -> Self {
        let text = std::fs::read_to_string(repository(name)).expect("a page");
        let blocks: Vec<String> = text.split("```\n").skip(1).step_by(2).map(str::to_owned).collect();
        let commands = blocks.iter().flat_map(|block| block.lines()).map(command_of);
        let is_typed = |line: &&str| PROGRAMS.contains(&line.split(' ').next().unwrap_or_default());
        let stem = Path::new(name)
            .file_stem()
            .and_then(|stem| stem.to_str())
            .expect("a name");
        let folder = scratch(&format!("journey-{stem}"));
        std::fs::create_dir(folder.join("target")).expect("a folder");
        let programs = program("rt-core").parent().expect("a folder").to_owned();
        let linked = [(programs, "target/quick"), (repository("sources"), "sources")];
        for (from, to) in linked {
            std::os::unix::fs::symlink(from.canonicalize().expect("there"), folder.join(to)).expect("a link");
        }
        Self {
            name,
            folder,
            instance: format!("j{}-{}", std::process::id(), &stem[..stem.len().min(12)]),
            left: commands.filter(is_typed).map(str::to_owned).collect(),
            blocks,
            core: None,
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub fn has(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|why| panic!("{name}: {why}"))
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("written");
    }

    /// Returns the listing of the page that begins with this line.
    pub fn listing(&self, first: &str) -> String {
        let found = self.blocks.iter().find(|block| block.starts_with(first));
        found
            .unwrap_or_else(|| panic!("{}: no listing begins with {first}", self.name))
            .clone()
    }

    /// Starts the core that the page says to have running.
    pub fn start_core(&mut self) {
        let core = self.shell("exec rt-core --rt-if-allowed").stderr(Stdio::null()).spawn();
        self.core = Some(Ended(core.expect("bash")));
    }

    pub fn end_core(&mut self) {
        self.core = None;
    }

    /// Types these commands, each of which must be on the page.
    pub fn types(&mut self, rows: &[Row<'_>]) {
        for &(command, replaced, tried) in rows {
            let at = self.left.iter().position(|left| left == command);
            let at = at.unwrap_or_else(|| panic!("{} has no {command:?}, but {:?}", self.name, self.left));
            self.left.remove(at);
            let typed = replaced.iter().fold(command.to_owned(), |typed, (from, to)| {
                assert!(typed.contains(from), "{typed:?} has no {from:?}");
                typed.replace(from, to)
            });
            match tried {
                Try::Succeeds => drop(self.run(&typed, &[0])),
                Try::Judged => drop(self.run(&typed, &[0, 1, 2])),
                Try::Window => self.opens(&typed),
                Try::Stays => self.stays(&typed),
                Try::Known => assert_known(&typed),
                Try::Elsewhere(why) => assert!(!why.is_empty()),
            }
        }
    }

    /// Asserts that no command of the page was left out.
    pub fn ends(self) {
        assert_eq!(self.left, Vec::<String>::new(), "{}", self.name);
    }

    /// Returns a shell for a command, which gets the instance of this page.
    fn shell(&self, typed: &str) -> Command {
        let takes_one = [
            "host-ui procedure",
            "host-ui plan",
            "host-ui record",
            "host-ui --",
            "rt-core --",
        ];
        let begin = typed.strip_prefix("exec ").unwrap_or(typed);
        let of_own = match takes_one.iter().any(|takes| begin.starts_with(takes)) {
            true => format!("{typed} --instance {}", self.instance),
            false => typed.to_owned(),
        };
        let mut shell = Command::new("bash");
        let programs = self.folder.join("target/quick");
        let path = std::env::var("PATH").unwrap_or_default();
        shell
            .args(["-c", &of_own])
            .current_dir(&self.folder)
            .env("PATH", format!("{}:{path}", programs.display()))
            .env("XDG_STATE_HOME", &self.folder)
            .stdin(Stdio::null());
        shell
    }

    fn run(&self, typed: &str, codes: &[i32]) -> String {
        let done = self.shell(typed).output().expect("bash");
        let said = String::from_utf8_lossy(&done.stdout).into_owned();
        let why = String::from_utf8_lossy(&done.stderr);
        let is_expected = done.status.code().is_some_and(|code| codes.contains(&code));
        assert!(is_expected, "{}: {typed}\n{said}{why}", self.name);
        assert!(!said.is_empty() || !why.is_empty(), "{typed} says nothing");
        said
    }

    fn stays(&self, typed: &str) {
        let mut running = Ended(self.shell(&format!("exec {typed}")).spawn().expect("bash"));
        let ended = until(STAYS_FOR, || !matches!(running.0.try_wait(), Ok(None)));
        assert!(!ended, "{}: {typed} ended", self.name);
    }

    fn opens(&self, typed: &str) {
        let screen = Screen::open();
        let said = self.path("window.txt");
        let log = File::create(&said).expect("a file");
        let mut window = self.shell(&format!("exec {typed} --count-frames"));
        window
            .env("DISPLAY", &screen.name)
            .env_remove("WAYLAND_DISPLAY")
            .stderr(log);
        let mut window = Ended(window.spawn().expect("bash"));
        let drawn = || {
            std::fs::read_to_string(&said)
                .unwrap_or_default()
                .matches("frames/s")
                .count()
                > 1
        };
        let opened = until(OPENS_WITHIN, || drawn() || !matches!(window.0.try_wait(), Ok(None)));
        assert!(opened && drawn(), "{}: {typed}\n{}", self.name, self.read("window.txt"));
    }
}

/// Returns a line of a block without its remark.
fn command_of(line: &str) -> &str {
    line.split(" # ").next().unwrap_or_default().trim_end()
}

/// Asserts that a target of make exists, or the package of a test.
fn assert_known(typed: &str) {
    let words: Vec<&str> = typed.split(' ').collect();
    if let ["make", target] = words[..] {
        let makefile = std::fs::read_to_string(repository("Makefile")).expect("a file");
        assert!(makefile.contains(&format!("\n{target}:")), "{typed}");
        return;
    }
    let at = words.iter().position(|word| *word == "-p").expect("a package");
    let known = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()))
        .args(["pkgid", "--offline", words[at + 1]])
        .current_dir(repository("."))
        .output();
    assert!(known.expect("cargo").status.success(), "{typed}");
}

/// A virtual screen.
struct Screen {
    name: String,
    _server: Ended,
}

impl Screen {
    fn open() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1366x768x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts: `make test` installs it");
        let (mut number, output) = (String::new(), server.stdout.take().expect("piped"));
        BufReader::new(output)
            .read_line(&mut number)
            .expect("Xvfb names its display");
        Self {
            name: format!(":{}", number.trim()),
            _server: Ended(server),
        }
    }
}

//! A remote operator whose program, relay, line or terminal ends during a motion: the hand is at rest within 0.4 s and
//! 5 mm.
//!
//! `tests/tests/system/motion_sender.rs` measures the same without a relay.

use crate::fixture::{Keys, Named, Running, code, core, joining, program, scratch, until};
use crate::host::Host;
use crate::proxy::Proxy;
use std::fs::File;
use std::io::{PipeReader, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_relay::keys::{Role, Validity, write_invitation};
use stylet_relay::now_ns;
use stylet_shm_schema::{TickRecord, flags};

/// Trials of each kind; `STYLET_TRIALS` sets more.
const TRIALS: usize = 2;
/// Speed of the insertion: the fastest published, mm/s.
const MM_PER_S: &str = "123";
/// Rest means slower than 3 mm/s: less than this over that many ticks, m.
const REST_TICKS: usize = 50;
const AT_REST_M: f64 = 1.5e-4;
const MOST_MM: f64 = 5.0;
const MOST_TICKS: usize = 400;

/// Component that ends, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    ProgramKilled,
    ProgramStopped,
    RelayKilled,
    RelayStopped,
    LineCut,
    TerminalClosed,
    /// The relay's output was full, and its line is cut: it has a message to print.
    OutputFull,
    OutputClosed,
    /// As above for the server's output, and the operator's relay is killed.
    ServersOutputFull,
    ServersOutputClosed,
    ServersTerminalClosed,
    ServerKilledWithItsKeeper,
}

const ALL: [End; 12] = [
    End::ProgramKilled,
    End::ProgramStopped,
    End::RelayKilled,
    End::RelayStopped,
    End::LineCut,
    End::TerminalClosed,
    End::OutputFull,
    End::OutputClosed,
    End::ServersOutputFull,
    End::ServersOutputClosed,
    End::ServersTerminalClosed,
    End::ServerKilledWithItsKeeper,
];

/// A full pipe, and its other end.
pub fn full() -> (PipeReader, Stdio) {
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    let set = |flags: libc::c_int| {
        // SAFETY: an open file of ours.
        unsafe { libc::fcntl(writer.as_raw_fd(), libc::F_SETFL, flags) }
    };
    set(libc::O_NONBLOCK);
    while (&writer).write(&[b'.'; 4096]).is_ok() {}
    while (&writer).write(b".").is_ok() {}
    set(0);
    writer.flush().expect("nothing waits here");
    (reader, writer.into())
}

/// A pipe whose other end is closed.
fn closed() -> Stdio {
    std::io::pipe().expect("a pipe").1.into()
}

/// A terminal: the user's end, and a program's.
fn terminal() -> (File, File) {
    let (mut person, mut program) = (0, 0);
    let nothing = std::ptr::null_mut();
    // SAFETY: writes two numbers, and takes nothing else.
    let opened = unsafe {
        libc::openpty(
            &raw mut person,
            &raw mut program,
            nothing,
            nothing.cast(),
            nothing.cast(),
        )
    };
    assert_eq!(opened, 0, "no terminal");
    // No program keeps the user's end open.
    for end in [person, program] {
        // SAFETY: an open file of ours.
        unsafe { libc::fcntl(end, libc::F_SETFD, libc::FD_CLOEXEC) };
    }
    // SAFETY: open files owned by no other value.
    unsafe { (File::from_raw_fd(person), File::from_raw_fd(program)) }
}

/// Makes the program a session leader whose terminal is its standard input.
fn take_terminal() -> std::io::Result<()> {
    // SAFETY: system calls with plain arguments.
    let taken = unsafe { libc::setsid() != -1 && libc::ioctl(libc::STDIN_FILENO, libc::TIOCSCTTY, 0) == 0 };
    taken.then_some(()).ok_or_else(std::io::Error::last_os_error)
}

/// A program of the test, ended with it.
struct Program(Child);

impl Program {
    fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("the program starts"))
    }

    /// Starts the program on a terminal; closing the user's end closes it.
    fn on_terminal(command: &mut Command) -> (Self, File) {
        let (person, program) = terminal();
        let end = || Stdio::from(OwnedFd::from(program.try_clone().expect("a second handle")));
        command.stdin(end()).stdout(end()).stderr(end());
        // SAFETY: between fork and exec it only makes system calls.
        unsafe { command.pre_exec(take_terminal) };
        (Self::start(command), person)
    }

    fn procedure(named: &Named, log: &Path) -> Self {
        let mut command = Command::new(program("host-ui"));
        command
            .args([
                "procedure",
                "--instance",
                named.0.name(),
                "--insert-speed",
                MM_PER_S,
                "--out",
            ])
            .arg(scratch("motion").join("out"))
            .stdout(Stdio::null())
            .stderr(File::create(log).expect("written"));
        Self::start(&mut command)
    }

    fn send(&self, signal: libc::c_int) {
        // SAFETY: a child of ours that has not been waited for.
        assert_eq!(unsafe { libc::kill(self.0.id() as libc::pid_t, signal) }, 0);
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.send(libc::SIGCONT);
        self.send(libc::SIGTERM);
        if !until(Duration::from_secs(5), || matches!(self.0.try_wait(), Ok(Some(_)))) {
            let _ = self.0.kill();
        }
        let _ = self.0.wait();
    }
}

/// The server, the operator's relay and its program, with what is needed to end them.
struct Way {
    program: Program,
    relay: Program,
    server: Program,
    /// What the program says of a failure.
    log: PathBuf,
    cable: Proxy,
    /// Terminals and pipes of the relay and the server.
    persons: [Option<File>; 2],
    _readers: [Option<PipeReader>; 2],
}

/// Sets the destination of its output.
fn output(command: &mut Command, is_full: bool, is_closed: bool, log: &Path) -> Option<PipeReader> {
    let words = || Stdio::from(File::create(log).expect("written"));
    command.stderr(words());
    let (reader, out) = match (is_full, is_closed) {
        (true, _) => {
            let (reader, out) = full();
            (Some(reader), out)
        }
        (_, true) => (None, closed()),
        _ => (None, words()),
    };
    command.stdout(out);
    reader
}

impl Way {
    fn begin(end: End, keys: &Keys, invitation: &Path, near: &Named, far: &Named) -> Self {
        let log = scratch("way").join("log");
        let mut command = keys.serving(near, "127.0.0.1");
        let (server, reader, person) = match end {
            End::ServersTerminalClosed => {
                let (server, person) = Program::on_terminal(&mut command);
                (server, None, Some(person))
            }
            _ => {
                let [is_full, is_closed] = [End::ServersOutputFull, End::ServersOutputClosed].map(|its| end == its);
                let reader = output(command.stdin(Stdio::null()), is_full, is_closed, &log);
                (Program::start(&mut command), reader, None)
            }
        };
        let cable = Proxy::to(keys.port);
        let path = through(invitation, &cable);
        let mut command = joining(&path, far);
        let (relay, its_reader, its_person) = match end {
            End::TerminalClosed => {
                let (relay, mut person) = Program::on_terminal(&mut command);
                let code = std::fs::read_to_string(path.with_extension("code")).expect("kept");
                writeln!(person, "{code}").expect("typed");
                (relay, None, Some(person))
            }
            _ => {
                let [is_full, is_closed] = [End::OutputFull, End::OutputClosed].map(|its| end == its);
                let reader = output(command.stdin(code(&path)), is_full, is_closed, &log);
                (Program::start(&mut command), reader, None)
            }
        };
        // A busy PC joins for longer than a procedure looks for a core.
        assert!(
            Host::new(far).sees_the_core(Duration::from_secs(40)),
            "{end:?}: not joined"
        );
        let log = log.with_file_name("procedure");
        Self {
            program: Program::procedure(far, &log),
            relay,
            server,
            log,
            cable,
            persons: [its_person, person],
            _readers: [its_reader, reader],
        }
    }

    fn strike(&mut self, end: End) {
        match end {
            End::ProgramKilled => self.program.send(libc::SIGKILL),
            End::ProgramStopped => self.program.send(libc::SIGSTOP),
            End::RelayKilled | End::ServersOutputFull | End::ServersOutputClosed => self.relay.send(libc::SIGKILL),
            End::RelayStopped => self.relay.send(libc::SIGSTOP),
            End::LineCut | End::OutputFull | End::OutputClosed => self.cable.cut(true),
            End::TerminalClosed => self.persons[0] = None,
            End::ServersTerminalClosed => self.persons[1] = None,
            End::ServerKilledWithItsKeeper => {
                let keeper = self.server.0.id();
                let children = std::fs::read_to_string(format!("/proc/{keeper}/task/{keeper}/children"));
                let server: i32 = children.expect("a keeper").trim().parse().expect("one server");
                // SAFETY: a signal to a child of our child, which cannot have been waited for while it runs.
                unsafe { libc::kill(server, libc::SIGKILL) };
                self.server.send(libc::SIGKILL);
            }
        }
    }
}

fn through(invitation: &Path, cable: &Proxy) -> PathBuf {
    let mut changed = crate::fixture::invitation(invitation);
    changed.server = format!("127.0.0.1:{}", cable.port);
    let path = invitation.with_extension(format!("through-{}", cable.port));
    write_invitation(&path, &changed).expect("written");
    path
}

/// Motion of the hand as seen by another host.
#[derive(Debug)]
struct Trial {
    mm_per_s: f64,
    farthest_mm: f64,
    /// Ticks until it was at rest.
    ticks: usize,
}

fn apart_m(a: &TickRecord, b: &TickRecord) -> f64 {
    let [a, b] = [a, b].map(|record| record.tip_in_scene_m);
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn watch(beside: &mut Host, limit: Duration, ready: impl Fn(&[TickRecord]) -> bool) -> bool {
    until(limit, || {
        beside.poll();
        ready(&beside.taken)
    })
}

/// True if a host sees it move faster than 30 mm/s.
fn moves(records: &[TickRecord]) -> bool {
    let [.., before, _, _, _, _, _, _, _, _, last] = records else {
        return false;
    };
    apart_m(last, before) > 3e-4 && last.flags & flags::IN_MOTION != 0
}

/// Ends the component at that time after the needle is seen to move.
fn trial(way: &mut Way, end: End, beside: &mut Host, after: Duration) -> Trial {
    beside.poll();
    beside.taken.clear();
    if !watch(beside, Duration::from_secs(40), moves) {
        let words = std::fs::read_to_string(&way.log);
        panic!("{end:?}: the needle does not move; its procedure said: {words:?}");
    }
    watch(beside, after, |_| false);
    // Between two strokes of the needle nothing would be seen.
    watch(beside, Duration::from_secs(5), moves);
    let ended_ns = now_ns();
    way.strike(end);
    watch(beside, Duration::from_millis(900), |_| false);
    let records = &beside.taken;
    let last = records
        .iter()
        .rposition(|record| record.due_ns <= ended_ns)
        .expect("records");
    let (before, silent) = (&records[last.saturating_sub(10)], &records[last..]);
    let at = &silent[0];
    Trial {
        mm_per_s: apart_m(at, before) * 1e5,
        farthest_mm: silent.iter().map(|record| apart_m(record, at)).fold(0.0, f64::max) * 1e3,
        ticks: silent
            .windows(REST_TICKS)
            .rposition(|w| apart_m(&w[REST_TICKS - 1], &w[0]) > AT_REST_M)
            .map_or(0, |begin| begin + 1),
    }
}

fn trials() -> usize {
    let asked = std::env::var("STYLET_TRIALS").ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(TRIALS)
}

/// Kinds named by `STYLET_TRIALS_OF`, or all.
fn kinds() -> impl Iterator<Item = End> {
    let asked = std::env::var("STYLET_TRIALS_OF").unwrap_or_default();
    ALL.into_iter().filter(move |end| format!("{end:?}").contains(&asked))
}

#[test]
fn a_hand_whose_far_operator_ends_is_at_rest_within_5_mm_and_400_ticks() {
    let (near, far) = (Named::new(), Named::new());
    let _core: Running = core(&near, &[]);
    let keys = Keys::new();
    let invitation = keys.invite("otto", Role::Operator, Validity::days(1));
    let mut beside = Host::new(&near);
    assert!(beside.sees_the_core(Duration::from_secs(20)));
    let mut random = stylet_random::Random(now_ns());
    let mut all = Vec::new();
    println!("| what ends | trials | mm: least, middle, most | ticks: middle, most | from up to mm/s |");
    for end in kinds() {
        let mut seen = Vec::new();
        for _ in 0..trials() {
            let mut way = Way::begin(end, &keys, &invitation, &near, &far);
            seen.push(trial(
                &mut way,
                end,
                &mut beside,
                Duration::from_millis(random.below(700) as u64),
            ));
        }
        seen.sort_by(|a, b| a.farthest_mm.total_cmp(&b.farthest_mm));
        let mut ticks: Vec<usize> = seen.iter().map(|trial| trial.ticks).collect();
        ticks.sort_unstable();
        let fastest = seen.iter().map(|trial| trial.mm_per_s).fold(0.0, f64::max);
        let [least, middle, most] = [0, seen.len() / 2, seen.len() - 1].map(|n| seen[n].farthest_mm);
        println!(
            "| {end:?} | {} | {least:.2}, {middle:.2}, {most:.2} | {}, {} | {fastest:.0} |",
            seen.len(),
            ticks[ticks.len() / 2],
            ticks[ticks.len() - 1]
        );
        all.extend(seen.into_iter().map(|trial| (end, trial)));
    }
    let beyond: Vec<_> = all
        .iter()
        .filter(|(_, trial)| trial.ticks > MOST_TICKS || trial.farthest_mm > MOST_MM)
        .collect();
    assert!(beyond.is_empty(), "{beyond:?}");
}

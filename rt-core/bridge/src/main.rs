//! `stylet-bridge`: serves hosts over iceoryx2, and relays data between them and the force process.
//!
//! `rt-core` starts it with one end of a socket as its standard input, and restarts it if it ends or hangs. It holds no
//! lasting state: the force process sends everything again to a new one.

mod host;
mod load;
mod ports;

use ports::Ports;
use std::ffi::OsString;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use stylet_ports::ServiceError;
use stylet_shm_schema::{Epoch, HapticState, Instance, InstanceError, SecondState};
use stylet_wall::board::Reader;
use stylet_wall::packet::{ALIVE_EVERY, Alive, BoardSize, Closed, Kind, LOOK_EVERY, Packet, Socket, Start};

const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// Packets of the force process relayed before hosts have their turn.
const PACKETS_AT_ONCE: u32 = 64;

/// Reason why this process ends.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error("start rt-core: it starts this program by itself")]
    Arguments,
    #[error("the force process has ended")]
    ForceProcess,
    #[error("the socket to the force process: {0}")]
    Socket(std::io::Error),
    #[error(transparent)]
    Service(#[from] ServiceError),
    #[error(transparent)]
    Instance(#[from] InstanceError),
}

impl From<Closed> for Ended {
    fn from(why: Closed) -> Self {
        match why {
            Closed::Ended => Self::ForceProcess,
            Closed::Io(why) => Self::Socket(why),
        }
    }
}

fn main() -> ExitCode {
    follow_force_process();
    let mut socket = match std::io::stdin().as_fd().try_clone_to_owned() {
        Ok(end) => Socket::of(end),
        Err(_) => return ExitCode::FAILURE,
    };
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    match carry_out(&arguments, &mut socket).unwrap_or_else(|why| why) {
        Ended::ForceProcess => ExitCode::SUCCESS,
        why => {
            let words = why.to_string();
            if socket.send(Kind::Failed, words.as_bytes(), None).is_err() {
                eprintln!("stylet-bridge: {words}");
            }
            ExitCode::FAILURE
        }
    }
}

/// Ends with the force process, and never before it: a key in the terminal is for `rt-core` alone.
fn follow_force_process() {
    // SAFETY: each call takes a signal number and has no other preconditions.
    unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
        for signal in [libc::SIGINT, libc::SIGHUP, libc::SIGTERM, libc::SIGPIPE] {
            libc::signal(signal, libc::SIG_IGN);
        }
    }
}

/// Runs the bridge of `INSTANCE FOLDER TOKEN`; for a measurement `host INSTANCE` or `load INSTANCE`.
fn carry_out(arguments: &[OsString], socket: &mut Socket) -> Result<Ended, Ended> {
    let instance = |name: &OsString| Instance::new(&name.to_string_lossy());
    match arguments {
        [task, name] if task == "host" => host::watch(&instance(name)?, socket),
        [task, name] if task == "load" => load::copy_all(&instance(name)?, socket),
        [name, folder, token] => {
            let token = token.to_string_lossy().into_owned();
            serve(&Epoch::of(instance(name)?, PathBuf::from(folder), token), socket)
        }
        _ => Err(Ended::Arguments),
    }
}

fn serve(epoch: &Epoch, socket: &mut Socket) -> Result<Ended, Ended> {
    let start = loop {
        socket.wait(Duration::from_secs(1));
        match socket.receive()? {
            Some(packet) if packet.kind == Kind::Start => break packet.value::<Start>().ok_or(Ended::Arguments)?,
            _ => {}
        }
    };
    let mut bridge = Bridge::new(epoch, &start)?;
    socket.send(Kind::Ready, &[], None)?;
    loop {
        bridge.pass(socket)?;
        socket.wait(LOOK_EVERY);
    }
}

/// State of this process.
struct Bridge {
    ports: Ports,
    state: Option<Reader<HapticState>>,
    second_state: Option<Reader<SecondState>>,
    alive: Option<Instant>,
    cleaned: Instant,
}

impl Bridge {
    fn new(epoch: &Epoch, start: &Start) -> Result<Self, Ended> {
        let ports = Ports::new(epoch, start)?;
        epoch.secure()?;
        Ok(Self {
            ports,
            state: None,
            second_state: None,
            alive: None,
            cleaned: Instant::now(),
        })
    }

    fn pass(&mut self, socket: &mut Socket) -> Result<(), Ended> {
        self.ports.connect();
        for _ in 0..PACKETS_AT_ONCE {
            match socket.receive()? {
                Some(packet) => self.take(packet),
                None => break,
            }
        }
        if let Some(state) = self.state.as_mut().and_then(Reader::take) {
            self.ports.state.write(&state);
        }
        if let (Some(board), Some(state)) = (&self.ports.second, self.second_state.as_mut().and_then(Reader::take)) {
            board.write(&state);
        }
        self.ports.send_snapshot();
        self.ports.forward(socket)?;
        if self.alive.is_none_or(|then| then.elapsed() >= ALIVE_EVERY) {
            self.alive = Some(Instant::now());
            let alive = Alive {
                has_viewers: self.ports.has_viewers().into(),
                refused: self.ports.refused,
            };
            // A heartbeat without room may be dropped: the next comes soon.
            socket.send(Kind::Alive, bytemuck::bytes_of(&alive), None)?;
        }
        if self.cleaned.elapsed() >= CLEAN_EVERY {
            self.cleaned = Instant::now();
            self.ports.node.clean_up();
        }
        Ok(())
    }

    fn take(&mut self, packet: Packet) {
        match (packet.kind, &packet.memory) {
            (Kind::State, Some(memory)) => self.state = Reader::new(memory.as_fd(), 0).ok(),
            (Kind::SecondState, Some(memory)) => self.second_state = Reader::new(memory.as_fd(), 0).ok(),
            (Kind::Snapshots, Some(memory)) => {
                if let Some(BoardSize { len }) = packet.value() {
                    self.ports.show_snapshots(memory.as_fd(), len as usize);
                }
            }
            _ => self.ports.publish(packet),
        }
    }
}

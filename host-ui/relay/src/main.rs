//! The command line of `relay`.

use clap::{CommandFactory, Parser, Subcommand};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_manual::ManualArgs;
use stylet_relay::control::{self, Order};
use stylet_relay::keys::{Invitation, Lab, Role, Validity, write_invitation};
use stylet_relay::net::PORT;
use stylet_relay::serve::{self, keeper};
use stylet_relay::{RelayError, join, say};
use stylet_shm_schema::Instance;

/// Carries a running Stylet to other machines: a class that watches, an instructor elsewhere, an operator at another
/// screen.
///
/// On the machine with rt-core: `relay keys new --host ADDRESS` once, `relay keys invite NAME --role observer` for each
/// person, then `relay serve`. On another machine: `relay join --invitation FILE`, and host-ui, record and everything
/// else run there as they do beside the core.
#[derive(Parser)]
#[command(name = "relay", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Serve the core of this machine to the lab's members
    Serve {
        /// The core's instance, as in `rt-core --instance`
        #[arg(long, default_value = "main")]
        instance: String,
        /// Address and port to listen on; may be given several times
        #[arg(long, value_name = "ADDRESS:PORT", required = true)]
        listen: Vec<String>,
        /// Folder of the lab's keys
        #[arg(long, value_name = "DIR", default_value = "lab-keys")]
        keys: PathBuf,
        /// Set by the process that watches over the server
        #[arg(long, hide = true)]
        kept: bool,
    },
    /// Show the core of another machine here, as if it ran here; asks for the code of the invitation, or takes it from
    /// the standard input
    Join {
        /// Address of the machine that serves, with or without a port [default: that of the invitation]
        host: Option<String>,
        /// The file that `relay keys invite` wrote
        #[arg(long, value_name = "FILE")]
        invitation: PathBuf,
        /// The instance that hosts here use; no core may run under it
        #[arg(long, default_value = "main")]
        instance: String,
    },
    /// Make a lab's keys, invite people, revoke them
    Keys {
        #[command(subcommand)]
        task: KeysTask,
        /// Folder of the lab's keys
        #[arg(long, value_name = "DIR", default_value = "lab-keys", global = true)]
        keys: PathBuf,
    },
    /// Ask for the needle, hand it over, or see who is there
    Lease {
        #[command(subcommand)]
        task: LeaseTask,
        /// The instance of the relay on this machine
        #[arg(long, default_value = "main", global = true)]
        instance: String,
    },
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

#[derive(Subcommand)]
enum KeysTask {
    /// Make the lab's authority and the certificate of this machine
    New {
        /// A name or an address under which members reach this machine; may be given several times
        #[arg(long, value_name = "ADDRESS", required = true)]
        host: Vec<String>,
    },
    /// Make a member's key, write it as an invitation and print the code that opens it: whoever has both is the member
    Invite {
        /// Name of the person
        name: String,
        /// What the person may do: an operator moves the needle, an instructor stops the hand and changes parameters
        /// and scene, an observer watches
        #[arg(long)]
        role: Role,
        /// Address of this machine, with or without a port, as the member reaches it
        #[arg(long, value_name = "ADDRESS")]
        server: String,
        /// Days until the certificate expires
        #[arg(long, default_value_t = 180)]
        days: u32,
        /// The file [default: NAME.invitation]
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Accept nothing from a person any more, and send nothing, within a second
    Revoke {
        /// Name of the person
        name: String,
    },
    /// List everybody with a certificate
    List,
}

#[derive(Subcommand)]
enum LeaseTask {
    /// Operate from this machine
    Take,
    /// Operate no longer
    Release,
    /// Hand the needle to somebody who is connected
    Give {
        /// Name of the person
        name: String,
    },
    /// Show who is connected, who operates, round trips and losses
    Status,
}

fn main() -> ExitCode {
    let code = match run(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            say::complain(format!("relay: {why}"));
            ExitCode::from(keeper::CANNOT)
        }
    };
    say::flush();
    code
}

/// Returns a flag set by termination signals: from a user, another program, or a closed terminal.
fn on_signals() -> Result<Arc<AtomicBool>, RelayError> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    say::end_on_panic();
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if signal == SIGHUP && is_ignored(signal) {
            continue;
        }
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(RelayError::Signals)?;
    }
    Ok(stop)
}

/// True if the signal is ignored, as under `nohup`: the program survives its terminal.
fn is_ignored(signal: libc::c_int) -> bool {
    // SAFETY: numbers alone.
    let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
    // SAFETY: only reads how the signal is handled, into `action`, which is valid for writes.
    unsafe { libc::sigaction(signal, std::ptr::null(), &raw mut action) };
    action.sa_sigaction == libc::SIG_IGN
}

/// Reads the code of an invitation: a line of the standard input, typed without echo.
fn code() -> Result<String, RelayError> {
    let is_typed = std::io::stdin().is_terminal();
    let shown = is_typed.then(hide_typing).flatten();
    if is_typed {
        let _ = write!(std::io::stderr(), "code of the invitation: ");
    }
    let mut line = String::new();
    let read = std::io::stdin().read_line(&mut line);
    if let Some(shown) = shown {
        // SAFETY: settings that were read from this terminal.
        unsafe { libc::tcsetattr(libc::STDIN_FILENO, libc::TCSANOW, &raw const shown) };
        let _ = writeln!(std::io::stderr());
    }
    read.map_err(RelayError::Code)?;
    Ok(line)
}

/// Turns echo off and returns the former settings of the terminal.
fn hide_typing() -> Option<libc::termios> {
    // SAFETY: numbers alone.
    let mut settings: libc::termios = unsafe { std::mem::zeroed() };
    // SAFETY: `settings` is valid for writes.
    if unsafe { libc::tcgetattr(libc::STDIN_FILENO, &raw mut settings) } != 0 {
        return None;
    }
    let shown = settings;
    settings.c_lflag &= !libc::ECHO;
    // SAFETY: settings of this terminal, changed in one flag.
    unsafe { libc::tcsetattr(libc::STDIN_FILENO, libc::TCSANOW, &raw const settings) };
    Some(shown)
}

/// Appends the default port to an address without one.
fn with_port(host: &str) -> String {
    let has_port = host
        .rsplit_once(':')
        .is_some_and(|(name, port)| port.parse::<u16>().is_ok() && (!name.contains(':') || name.ends_with(']')));
    match has_port {
        true => host.to_owned(),
        false => format!("{host}:{PORT}"),
    }
}

fn run(task: Task) -> Result<(), RelayError> {
    match task {
        Task::Serve {
            instance,
            listen,
            keys,
            kept,
        } => {
            let instance = Instance::new(&instance)?;
            let stop = on_signals()?;
            if !kept {
                let arguments: Vec<_> = std::env::args_os().skip(1).collect();
                return keeper::keep(&instance, &arguments, &stop);
            }
            let options = serve::Options {
                instance,
                listen,
                lab: Lab::new(&keys),
            };
            serve::run(&options, &stop, &mut keeper::Beat::of_stdin())
        }
        Task::Join {
            host,
            invitation,
            instance,
        } => {
            let invitation = Invitation::read(&invitation)?;
            let server = with_port(host.as_deref().unwrap_or(&invitation.server));
            let instance = Instance::new(&instance)?;
            let identity = invitation.identity(&code()?)?;
            let options = join::Options {
                instance,
                server,
                invitation,
                identity,
            };
            let stop = on_signals()?;
            join::run(&options, &stop)
        }
        Task::Manual(args) => Ok(args.run(Cli::command())?),
        Task::Keys { task, keys } => keys_task(task, &Lab::new(&keys)),
        Task::Lease { task, instance } => {
            let order = match task {
                LeaseTask::Take => Order::Take,
                LeaseTask::Release => Order::Release,
                LeaseTask::Give { name } => Order::Give(name),
                LeaseTask::Status => Order::Status,
            };
            println!("{}", control::ask(&Instance::new(&instance)?, &order)?);
            Ok(())
        }
    }
}

fn keys_task(task: KeysTask, lab: &Lab) -> Result<(), RelayError> {
    match task {
        KeysTask::New { host } => {
            lab.make(&host)?;
            println!("made the lab's authority and the certificate of {}", host.join(", "));
        }
        KeysTask::Invite {
            name,
            role,
            server,
            days,
            out,
        } => {
            let (invitation, code) = lab.invite(&name, role, &server, Validity::days(days))?;
            let out = out.unwrap_or_else(|| PathBuf::from(format!("{}.invitation", name.replace(['/', ' '], "-"))));
            write_invitation(&out, &invitation)?;
            println!(
                "{}: {name} may join as {role}. Tell {name} the code by another way than the file goes:\n{code}",
                out.display()
            );
        }
        KeysTask::Revoke { name } => {
            lab.revoke(&name)?;
            println!("nothing is accepted from {name} any more");
        }
        KeysTask::List => {
            for member in lab.members()?.members {
                let state = if member.revoked { "revoked" } else { "valid" };
                let until = time::OffsetDateTime::from_unix_timestamp(member.until_s)
                    .map_or("?".to_owned(), |until| until.date().to_string());
                println!(
                    "{:3}  {:<11} {state:<8} until {until}  {}",
                    member.seat,
                    member.role.to_string(),
                    member.name
                );
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pages and completions come from the definition of the command line; `tests/package` checks their contents.
    #[test]
    fn every_command_has_its_page_and_every_option_its_place_in_it() {
        let files = stylet_manual::files(Cli::command()).expect("in memory");
        let text = |path: String| {
            let page = files.iter().find(|(its, _)| its.to_str() == Some(&path));
            let page = page.unwrap_or_else(|| panic!("{path} is missing"));
            String::from_utf8_lossy(&page.1).replace('\\', "")
        };
        let bash = text("bash-completion/completions/relay".to_owned());
        let mut waiting = vec![("relay".to_owned(), Cli::command())];
        let mut options = 0;
        while let Some((name, command)) = waiting.pop() {
            let page = text(format!("man/man1/{name}.1"));
            for option in command
                .get_arguments()
                .filter(|a| !a.is_hide_set())
                .filter_map(|a| a.get_long())
            {
                assert!(page.contains(&format!("--{option}")), "{name}: --{option}");
                assert!(bash.contains(&format!("--{option}")), "--{option}");
                options += 1;
            }
            let below = command.get_subcommands().filter(|below| !below.is_hide_set());
            waiting.extend(below.map(|below| (format!("{name}-{}", below.get_name()), below.clone())));
        }
        assert!(options > 10, "{options} options");
    }
}

//! `stylet-igtl`: serves a core to 3D Slicer over OpenIGTLink.

use clap::{CommandFactory, Parser, Subcommand};
use std::error::Error;
use std::net::SocketAddr;
use std::process::ExitCode;
use stylet_igtl::hand::HandOptions;
use stylet_igtl::serve;
use stylet_manual::ManualArgs;
use stylet_shm_schema::Instance;

/// OpenIGTLink server of Stylet.
///
/// `host-ui igtl` and `stylet-igtl igtl` are the same command.
#[derive(Parser, Debug)]
#[command(name = "stylet-igtl", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Serve needle, seeds, gland and state to 3D Slicer over OpenIGTLink, until interrupted;
    /// anyone who reaches the address can watch, because the protocol has no passwords
    Igtl {
        /// Name under which rt-core was started
        #[arg(long, default_value = "main", value_parser = Instance::new)]
        instance: Instance,
        /// Address and port to listen on
        #[arg(long, default_value = "127.0.0.1:18944", value_name = "ADDRESS")]
        listen: SocketAddr,
        /// Transforms of the needle per second, 1 to 200
        #[arg(long, default_value_t = 60.0, value_name = "HZ")]
        hz: f64,
        /// Let transforms of this name move the simulated hand: a tracker or a stepper behind PLUS. Anyone who reaches
        /// the address can send them
        #[arg(long, value_name = "NAME")]
        hand: Option<String>,
        /// Let transforms of this name, such as ProbeToScene, move the simulated hand with the ultrasound probe
        /// (rt-core --device-2)
        #[arg(long, value_name = "NAME")]
        probe: Option<String>,
        /// Maximum speed of both hands, 0.1 to 1000 mm/s
        #[arg(long, default_value_t = 100.0, value_name = "MM/S")]
        hand_speed: f64,
    },
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

fn main() -> ExitCode {
    match carry_out(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("stylet-igtl: {}", stylet_base::format::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}

fn carry_out(task: Task) -> Result<(), Box<dyn Error>> {
    stylet_manual::end_with_reader();
    match task {
        Task::Igtl {
            instance,
            listen,
            hz,
            hand,
            probe,
            hand_speed,
        } => {
            if !(1.0..=200.0).contains(&hz) {
                return Err(format!("--hz {hz}: 1 to 200 Hz are possible").into());
            }
            if !(0.1..=1000.0).contains(&hand_speed) {
                return Err(format!("--hand-speed {hand_speed}: 0.1 to 1000 mm/s are possible").into());
            }
            let moved_by = |device: Option<String>| {
                device.map(|device| HandOptions {
                    device,
                    speed_m_per_s: hand_speed * 1e-3,
                })
            };
            let ended = serve::run(&serve::Options {
                instance: instance.clone(),
                listen,
                rate_hz: hz,
                hand: moved_by(hand),
                probe: moved_by(probe),
            });
            instance.sweep();
            Ok(ended?)
        }
        Task::Manual(args) => Ok(args.run(Cli::command())?),
    }
}

//! The command `record`: a session to a file, or to viewers while it runs.

use super::CommandError;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;
use stylet_host::record::{self, To};
use stylet_shm_schema::Instance;

#[derive(Args, Debug)]
pub struct RecordArgs {
    /// Name under which rt-core was started
    #[arg(long, default_value = "main", value_parser = Instance::new)]
    instance: Instance,
    /// File to write
    #[arg(long, value_name = "FILE.mcap", required_unless_present = "live")]
    out: Option<PathBuf>,
    /// Serve the messages of a recording to Foxglove's app instead, on this address and port
    /// [default: 127.0.0.1:8765]; needs 'make live'
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", conflicts_with = "out")]
    live: Option<String>,
    /// Seconds to record [default: until interrupted or until rt-core ends]
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Snapshots of the gland per second, 0 to 60; the core sends 67 while the needle moves, 33
    /// while it rests, and 17 while the gland is undisturbed
    #[arg(long, default_value_t = 20.0, value_name = "HZ")]
    snapshot_rate: f64,
}

impl RecordArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let fits = self.duration.is_none_or(|s| s > 0.0 && s < 1e6) && (0.0..=60.0).contains(&self.snapshot_rate);
        if !fits {
            return Err("--duration needs seconds above 0, --snapshot-rate 0 to 60 Hz".into());
        }
        let to = match (self.out, self.live) {
            (Some(file), _) => To::File(file),
            (None, Some(address)) => To::Viewers(address),
            (None, None) => return Err("give --out or --live for the session".into()),
        };
        let ended = record::run(&record::Options {
            instance: self.instance.clone(),
            to,
            duration: self.duration.map(Duration::from_secs_f64),
            snapshots_hz: self.snapshot_rate,
        });
        self.instance.sweep();
        Ok(ended?)
    }
}

//! Orders from this machine to its relay: one line each, over a socket that only its user can open.

use crate::RelayError;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::time::Duration;
use stylet_shm_schema::Instance;

/// Longest line of an order, bytes.
const LINE: usize = 200;
const PATIENCE: Duration = Duration::from_secs(2);

fn path(instance: &Instance) -> PathBuf {
    instance.folder().join("relay.socket")
}

/// An order for the lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// To operate from here.
    Take,
    /// To stop operating from here.
    Release,
    /// To let another member operate.
    Give(String),
    /// To list the members.
    Status,
}

impl Order {
    /// Encodes the order as a line.
    pub fn line(&self) -> String {
        match self {
            Self::Take => "take".to_owned(),
            Self::Release => "release".to_owned(),
            Self::Give(name) => format!("give {name}"),
            Self::Status => "status".to_owned(),
        }
    }

    /// Parses the order of a line.
    pub fn of_line(line: &str) -> Option<Self> {
        match line.trim() {
            "take" => Some(Self::Take),
            "release" => Some(Self::Release),
            "status" => Some(Self::Status),
            line => line
                .strip_prefix("give ")
                .map(|name| Self::Give(name.trim().to_owned())),
        }
    }
}

/// The relay's end.
pub struct Orders {
    listener: UnixListener,
    path: PathBuf,
}

impl Orders {
    /// Opens the socket, replacing that of a killed relay.
    pub fn listen(instance: &Instance) -> Result<Self, RelayError> {
        instance.make_folder()?;
        let path = path(instance);
        let failed = |why| RelayError::File {
            path: path.clone(),
            why,
        };
        let _ = std::fs::remove_file(&path);
        let listener = UnixListener::bind(&path).map_err(failed)?;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(Self { listener, path })
    }

    /// Answers an order, if there is one.
    pub fn pass(&self, answer: impl FnOnce(Order) -> String) {
        let Ok((stream, _)) = self.listener.accept() else {
            return;
        };
        // A program that can open the socket could end the relay anyway; the wait for its line is short.
        let _ = stream.set_nonblocking(false);
        let _ = stream.set_read_timeout(Some(Duration::from_millis(50)));
        let mut line = String::new();
        let mut input = BufReader::new(std::io::Read::take(&stream, LINE as u64));
        if input.read_line(&mut line).is_err() {
            return;
        }
        let words = match Order::of_line(&line) {
            Some(order) => answer(order),
            None => "the relay knows take, release, give NAME and status".to_owned(),
        };
        let _ = (&stream).write_all(words.as_bytes());
    }
}

impl Drop for Orders {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Sends an order to the relay of `instance` and returns its answer.
pub fn ask(instance: &Instance, order: &Order) -> Result<String, RelayError> {
    let failed = |why| RelayError::NoRelay {
        instance: instance.name().to_owned(),
        why,
    };
    let mut stream = UnixStream::connect(path(instance)).map_err(failed)?;
    stream.set_read_timeout(Some(PATIENCE)).map_err(failed)?;
    stream
        .write_all(format!("{}\n", order.line()).as_bytes())
        .map_err(failed)?;
    let mut answer = String::new();
    std::io::Read::read_to_string(&mut stream, &mut answer).map_err(failed)?;
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_survive_their_line() {
        for order in [
            Order::Take,
            Order::Release,
            Order::Status,
            Order::Give("Dr. B".to_owned()),
        ] {
            assert_eq!(Order::of_line(&order.line()), Some(order));
        }
        assert_eq!(Order::of_line("stop"), None);
    }
}

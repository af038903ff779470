//! The keeper of an Inverse3: connects it, starts its servo thread, watches it, and connects it again after a loss.

use core::time::Duration;
use std::sync::Arc;
use std::thread::JoinHandle;

use crate::driver_thread::keeper::{self, Connect};
use crate::driver_thread::serving;
use crate::driver_thread::shared::Shared;
use crate::haply::servo::{Servo, loss};
use crate::haply::session::{self, ConnectionError, Description, Wanted};
use crate::haply::socket::{NoSocket, Service, Socket};
use crate::haply::wire::Wire;

/// Owner of the connection; see the module.
pub struct Connector {
    service: Service,
    wanted: Wanted,
    shared: Arc<Shared>,
    /// Servo state; `None` while the servo thread owns it.
    servo: Option<Servo>,
    /// Device of the first connection, whose limits the force loop uses.
    known: Option<Description>,
}

/// Connection, before and while a thread serves it.
pub enum Connection {
    Open(Box<Socket>, Option<String>),
    Served(JoinHandle<Servo>),
    Given,
}

type Keeper = keeper::Keeper<Connector>;

impl Connect for Connector {
    type Session = Connection;
    type Description = Description;
    type Error = ConnectionError;

    fn open(&mut self) -> Result<Connection, ConnectionError> {
        let socket = self.service.connect().map_err(|why| match why {
            NoSocket::NotTrusted(why) => ConnectionError::NotTrusted(why.to_string()),
            why => ConnectionError::NoService {
                address: self.service.to_string(),
                why: why.to_string(),
            },
        })?;
        // The version is queried only once the owner of the service is known.
        Ok(Connection::Open(Box::new(socket), self.service.version()))
    }

    fn prepare(&mut self, keeper: &mut Keeper, connection: &mut Connection) -> Result<bool, ConnectionError> {
        let Connection::Open(mut socket, version) = core::mem::replace(connection, Connection::Given) else {
            return Err(ConnectionError::NoServo);
        };
        let opened = session::open(&mut *socket, &self.wanted, self.known.as_ref(), version);
        let description = match opened {
            Ok(description) => description,
            Err(error) => {
                socket.close();
                return Err(error);
            }
        };
        let mut servo = self.servo.take().ok_or(ConnectionError::NoServo)?;
        servo.begin(socket, &description);
        let started = serving::start("haply-servo", servo, &self.shared).ok_or(ConnectionError::NoServo)?;
        *connection = Connection::Served(started.thread);
        let granted = started.granted.ok_or(ConnectionError::NoServo)?;
        let granted = granted.map_err(ConnectionError::NotArmed)?;
        keeper.report(&format!("{description}; servo thread: {granted}"));
        self.known.get_or_insert_with(|| description.clone());
        keeper.opened(description);
        Ok(true)
    }

    fn watch(&mut self, keeper: &mut Keeper, connection: &Connection) -> Option<String> {
        let runs = || matches!(connection, Connection::Served(servo) if !servo.is_finished());
        let loss = |code| loss::text(code).to_owned();
        let silence = ConnectionError::NoServo.to_string();
        // None of its calls blocks.
        keeper::watch(keeper, &self.shared, Duration::MAX, runs, loss, &silence)
    }

    /// Ends the servo thread, which leaves zero force, and closes the connection. None of its calls
    /// blocks.
    fn release(&mut self, _keeper: &mut Keeper, connection: Connection) {
        self.shared.request_release();
        match connection {
            Connection::Open(mut socket, _) => socket.close(),
            Connection::Served(thread) => {
                self.servo = thread.join().ok();
                // A thread that could not be armed has not closed the connection.
                if let Some(servo) = &mut self.servo {
                    servo.end_connection();
                }
            }
            Connection::Given => {}
        }
        self.shared.released();
    }

    fn not_connected(&self) {
        self.shared.not_connected();
    }
}

impl Connector {
    pub fn new(service: Service, wanted: Wanted, shared: Arc<Shared>, servo: Servo) -> Self {
        Self {
            service,
            wanted,
            shared,
            servo: Some(servo),
            known: None,
        }
    }
}

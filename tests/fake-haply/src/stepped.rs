//! The service without a socket and without a clock: its messages arrive at its own simulated time.

use std::collections::VecDeque;
use std::time::Instant;

use stylet_hw::haply::{Wire, WireError};

use crate::service::{Sent, Service, Wrong};

/// One connection; see the module.
pub struct Stepped {
    service: Service,
    unread: VecDeque<String>,
    under_way: VecDeque<(u64, Sent)>,
    closed: bool,
}

impl Stepped {
    /// Opens a connection, unless the service accepts none.
    pub fn open(service: &Service) -> Option<Self> {
        let mut state = service.state();
        if state.wrong == Wrong::Closes {
            return None;
        }
        let mut under_way = VecDeque::new();
        if state.wrong != Wrong::Hangs {
            under_way.push_back((0, Sent::Text(state.open())));
        }
        drop(state);
        Some(Self {
            service: service.clone(),
            unread: VecDeque::new(),
            under_way,
            closed: false,
        })
    }

    /// Lets the service read all arrived messages, unless it hangs.
    fn advance(&mut self) -> Result<(), WireError> {
        let mut state = self.service.state();
        if self.closed || state.wrong == Wrong::Closes {
            if !self.closed {
                state.closed();
            }
            self.closed = true;
            return Err(WireError::Closed);
        }
        if state.wrong == Wrong::Hangs {
            return Ok(());
        }
        while let Some(text) = self.unread.pop_front() {
            let late_ms = if let Wrong::Late(ms) = state.wrong { ms } else { 0 };
            let due = state.now_ms() + late_ms;
            let answers = state.answer(&text);
            self.under_way.extend(answers.into_iter().map(|sent| (due, sent)));
        }
        Ok(())
    }
}

impl Wire for Stepped {
    fn send(&mut self, text: &str) -> Result<(), WireError> {
        self.unread.push_back(text.to_owned());
        self.advance()
    }

    fn receive(&mut self, _until: Instant, text: &mut String) -> Result<bool, WireError> {
        self.advance()?;
        let mut state = self.service.state();
        match self.under_way.front() {
            Some((due, _)) if *due <= state.now_ms() => {}
            _ => return Ok(false),
        }
        state.answered();
        match self.under_way.pop_front() {
            Some((_, Sent::Text(arrived))) if arrived.len() > 256 * 1024 => Err(WireError::Closed),
            Some((_, Sent::Text(arrived))) => {
                *text = arrived;
                Ok(true)
            }
            _ => Err(WireError::NoText),
        }
    }

    fn close(&mut self) {
        if !self.closed {
            self.service.state().closed();
        }
        self.closed = true;
    }
}

//! Whole processes: a core, its relay, and relays that join under other instances of this machine, as other machines
//! would.

mod carries;
mod faults;
mod fixture;
mod floods;
mod hand_over;
mod host;
mod lease;
mod line;
mod motion;
mod outlines;
mod panics;
mod proxy;
mod rights;
mod seats;
mod space;
mod watch;

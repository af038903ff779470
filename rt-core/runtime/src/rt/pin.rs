//! A pin that the force loop toggles for an external instrument: a register of a serial or parallel port.
//!
//! One instruction writes it, without a system call, so the contract of the loops holds. The right to the register is
//! acquired before the threads start, and they inherit it.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use stylet_random::Random;

/// A register with its two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    port: u16,
    values: [u8; 2],
}

/// Offset of the modem control register of a serial port (16550).
const MODEM_CONTROL: u16 = 4;
const DTR: u8 = 1;
const RTS: u8 = 2;
/// Enables the interrupt of a serial port; its driver has set it.
const OUT2: u8 = 8;
/// Shortest time between two edges in ticks; up to 63 more are added.
const FEWEST_TICKS: u32 = 20;

/// Reason why a pin cannot be toggled.
#[derive(Debug, thiserror::Error)]
pub enum PinError {
    /// A text that names no pin.
    #[error("{0:?}: expected serial:0x3F8:rts, serial:0x3F8:dtr, /dev/ttyS0:rts or parallel:0x378")]
    NoPin(String),
    /// A serial device without a register.
    #[error(
        "{}: no serial port of this PC. Adapters on USB and terminals have no register that the force loop could write by one \
         instruction, and it makes no system call for a pin",
        .0.display()
    )]
    NoRegister(PathBuf),
    /// A port that the kernel does not allow to write.
    #[error("the port {port:#x} may not be written ({why}): run as root")]
    Refused {
        /// The port.
        port: u16,
        /// Error of the kernel.
        why: std::io::Error,
    },
    /// A processor without ports.
    #[error("this processor has no ports that a program can write")]
    NoPorts,
}

impl FromStr for Pin {
    type Err = PinError;

    /// Parses `serial:0x3F8:rts`, `serial:0x3F8:dtr`, `/dev/ttyS0:rts`, which names the same port, or `parallel:0x378`,
    /// which toggles pin 2.
    fn from_str(text: &str) -> Result<Self, PinError> {
        let expected = || PinError::NoPin(text.to_owned());
        let address = |word: &str| {
            let digits = word
                .strip_prefix("0x")
                .or(word.strip_prefix("0X"))
                .ok_or_else(expected)?;
            let port = u16::from_str_radix(digits, 16).map_err(|_| expected())?;
            // Below are the board's controllers: no serial or parallel port is there.
            (0x100..0xfff0).contains(&port).then_some(port).ok_or_else(expected)
        };
        let words: Vec<&str> = text.split(':').collect();
        match words[..] {
            ["serial", port, line @ ("rts" | "dtr")] => Ok(Self::serial(address(port)?, line)),
            [device, line @ ("rts" | "dtr")] if device.starts_with("/dev/") => {
                Ok(Self::serial(address(&register_of(Path::new(device))?)?, line))
            }
            ["parallel", port] => Ok(Self {
                port: address(port)?,
                values: [0, 1],
            }),
            _ => Err(expected()),
        }
    }
}

/// Returns the port of a serial device, as its driver reports it. Read with the command line, before any loop.
// Read with the command line, before any loop.
#[allow(clippy::disallowed_methods)]
fn register_of(device: &Path) -> Result<String, PinError> {
    let name = device.file_name().unwrap_or_default();
    let port = std::fs::read_to_string(Path::new("/sys/class/tty").join(name).join("port")).unwrap_or_default();
    match port.trim() {
        "" | "0x0" => Err(PinError::NoRegister(device.to_owned())),
        port => Ok(port.to_owned()),
    }
}

impl Pin {
    fn serial(port: u16, line: &str) -> Self {
        let bit = if line == "rts" { RTS } else { DTR };
        Self {
            port: port + MODEM_CONTROL,
            values: [OUT2, OUT2 | bit],
        }
    }

    /// Acquires the right to the register for this thread and those that it starts; needs root.
    ///
    /// # Errors
    /// The kernel refuses, or the processor has no such registers.
    #[cfg(target_arch = "x86_64")]
    pub fn acquire(self) -> Result<Toggle, PinError> {
        // SAFETY: numbers only.
        if unsafe { libc::ioperm(libc::c_ulong::from(self.port), 1, 1) } != 0 {
            let why = std::io::Error::last_os_error();
            let port = self.port;
            return Err(PinError::Refused { port, why });
        }
        Ok(Toggle {
            pin: self,
            level: 0,
            left: FEWEST_TICKS,
            random: Random(1),
        })
    }

    /// Acquires the right to the register for this thread and those that it starts; needs root.
    ///
    /// # Errors
    /// The processor has no such registers.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn acquire(self) -> Result<Toggle, PinError> {
        Err(PinError::NoPorts)
    }
}

/// A writable pin, and the time of its next edge.
#[derive(Clone, Debug)]
pub struct Toggle {
    #[cfg_attr(
        not(target_arch = "x86_64"),
        expect(dead_code, reason = "there are no ports to write")
    )]
    pin: Pin,
    level: usize,
    left: u32,
    random: Random,
}

impl Toggle {
    /// Counts a tick; true if the pin was toggled in it. The times between edges form a pattern that repeats only after
    /// hours, so a capture can be aligned with the record.
    pub fn tick(&mut self) -> bool {
        self.left -= 1;
        if self.left > 0 {
            return false;
        }
        self.level ^= 1;
        self.write();
        self.left = FEWEST_TICKS + self.random.below(64) as u32;
        true
    }

    #[cfg(target_arch = "x86_64")]
    fn write(&self) {
        let value = self.pin.values[self.level];
        // SAFETY: `acquire` has the right to this port for this thread; the instruction touches no memory.
        unsafe {
            std::arch::asm!("out dx, al", in("dx") self.pin.port, in("al") value, options(nomem, nostack, preserves_flags))
        };
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn write(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_read_and_what_is_none_is_refused() {
        let pin = |text: &str| text.parse::<Pin>();
        assert_eq!(
            pin("serial:0x3F8:rts").ok().map(|p| (p.port, p.values)),
            Some((0x3fc, [8, 10]))
        );
        assert_eq!(
            pin("serial:0x2f8:dtr").ok().map(|p| (p.port, p.values)),
            Some((0x2fc, [8, 9]))
        );
        assert_eq!(
            pin("parallel:0x378").ok().map(|p| (p.port, p.values)),
            Some((0x378, [0, 1]))
        );
        for none in [
            "",
            "serial:0x3F8",
            "serial:0x3F8:cts",
            "parallel:378",
            "parallel:0x20",
            "parallel:0xffff",
        ] {
            assert!(pin(none).is_err(), "{none}");
        }
    }

    /// A pseudo-terminal has neither modem lines nor a register.
    #[test]
    fn a_serial_port_is_found_by_name_and_a_terminal_is_refused() {
        // SAFETY: no preconditions; the ends close with the test.
        let master = unsafe { libc::posix_openpt(libc::O_RDWR | libc::O_NOCTTY) };
        let mut name = [0_u8; 64];
        // SAFETY: `name` is valid for writes of its length.
        let named = unsafe { libc::ptsname_r(master, name.as_mut_ptr().cast(), name.len()) };
        assert_eq!((master >= 0, named), (true, 0), "{}", std::io::Error::last_os_error());
        let name = std::ffi::CStr::from_bytes_until_nul(&name)
            .expect("ends")
            .to_str()
            .expect("ASCII");
        let why = format!("{name}:rts")
            .parse::<Pin>()
            .expect_err("no modem lines")
            .to_string();
        assert!(why.contains(name) && why.contains("no register"), "{why}");
        // SAFETY: opened above.
        unsafe { libc::close(master) };
        if std::fs::read_to_string("/sys/class/tty/ttyS0/port").is_ok_and(|p| p.trim() == "0x3F8") {
            assert_eq!("/dev/ttyS0:dtr".parse::<Pin>().ok(), "serial:0x3F8:dtr".parse().ok());
        }
    }

    /// Runs on the emulated serial port of a virtual machine, if writable: the written value is read back. On another
    /// machine something may be connected.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn a_serial_port_takes_both_levels_in_a_pattern_without_equal_neighbours() {
        let ports = std::fs::read_to_string("/proc/ioports").unwrap_or_default();
        let emulated = std::fs::read_to_string("/proc/cpuinfo").is_ok_and(|c| c.contains(" hypervisor"));
        let toggle = (emulated && ports.contains("03f8-03ff : serial"))
            .then(|| "serial:0x3F8:rts".parse::<Pin>().expect("valid").acquire());
        let Some(Ok(mut toggle)) = toggle else {
            eprintln!("skipped: no serial port that may be written");
            return;
        };
        let control = || {
            let value: u8;
            // SAFETY: `acquire` has the right to this port for this thread; reading it changes nothing.
            unsafe {
                std::arch::asm!("in al, dx", in("dx") 0x3fc_u16, out("al") value, options(nomem, nostack, preserves_flags))
            };
            value
        };
        let before = control();
        let (mut edges, mut last) = (Vec::new(), 0);
        for tick in 1..=10_000 {
            if toggle.tick() {
                let expected = toggle.pin.values[toggle.level];
                assert_eq!(control() & 0x0f, expected);
                edges.push(tick - last);
                last = tick;
            }
        }
        // SAFETY: as in `write`; the driver's own value comes back.
        unsafe {
            std::arch::asm!("out dx, al", in("dx") 0x3fc_u16, in("al") before, options(nomem, nostack, preserves_flags))
        };
        assert!(
            edges.len() > 150 && edges[1..].iter().all(|n| (20..84).contains(n)),
            "{edges:?}"
        );
        let runs = |length: usize| {
            edges
                .windows(length)
                .map(<[i32]>::to_vec)
                .collect::<std::collections::BTreeSet<_>>()
        };
        // Each sequence of three gaps occurs once.
        assert_eq!(runs(3).len(), edges.len() - 2);
    }
}

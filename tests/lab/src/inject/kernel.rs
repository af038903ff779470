//! Injections through the kernel: network, control group, disk.

use super::{Target, ended, on_core};
use std::fs::{self, File};
use std::io::Write;
use std::net::UdpSocket;
use std::os::fd::FromRawFd;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Sends datagrams to the broadcast address of the loopback: each goes to every socket of its port, within one softirq.
pub fn softirqs(target: Target, end: Instant) -> Result<(), String> {
    const SOCKETS: usize = 3_000;
    const PORT: u16 = 47_613;
    raise_file_limit();
    ended(on_core("inj-softirq", target.core, 0, move || {
        let sockets: Vec<UdpSocket> = (0..SOCKETS).map_while(|_| shared_socket(PORT)).collect();
        let from = UdpSocket::bind("127.0.0.1:0").map_err(|e| e.to_string())?;
        from.set_broadcast(true).map_err(|e| e.to_string())?;
        if sockets.len() < 300 {
            return Err(format!("only {} sockets", sockets.len()));
        }
        while Instant::now() < end {
            from.send_to(&[0; 16], ("127.255.255.255", PORT))
                .map_err(|e| e.to_string())?;
            std::thread::sleep(Duration::from_millis(3));
        }
        Ok(())
    }))?
}

fn raise_file_limit() {
    let mut limit = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: `limit` is valid for writes and then for reads.
    unsafe {
        libc::getrlimit(libc::RLIMIT_NOFILE, &mut limit);
        limit.rlim_cur = limit.rlim_max;
        libc::setrlimit(libc::RLIMIT_NOFILE, &limit);
    }
}

/// Returns a socket that shares its port with the others.
fn shared_socket(port: u16) -> Option<UdpSocket> {
    let one: libc::c_int = 1;
    let address = libc::sockaddr_in {
        sin_family: libc::AF_INET as libc::sa_family_t,
        sin_port: port.to_be(),
        sin_addr: libc::in_addr { s_addr: 0 },
        sin_zero: [0; 8],
    };
    // SAFETY: numbers only; the descriptor is owned by the socket made of it.
    let socket = unsafe {
        let fd = libc::socket(libc::AF_INET, libc::SOCK_DGRAM | libc::SOCK_CLOEXEC, 0);
        if fd < 0 {
            return None;
        }
        UdpSocket::from_raw_fd(fd)
    };
    let fd = std::os::fd::AsRawFd::as_raw_fd(&socket);
    // SAFETY: option and address are valid for reads and as long as is said.
    let bound = unsafe {
        libc::setsockopt(fd, libc::SOL_SOCKET, libc::SO_REUSEADDR, (&raw const one).cast(), 4);
        libc::bind(fd, (&raw const address).cast(), size_of::<libc::sockaddr_in>() as u32)
    };
    (bound == 0).then_some(socket)
}

/// A group that is removed, with the thread back in the root group, when dropped.
struct Group {
    folder: PathBuf,
    root: PathBuf,
    thread: i32,
}

impl Drop for Group {
    fn drop(&mut self) {
        let _ = fs::write(self.root.join("tasks"), self.thread.to_string());
        let _ = fs::remove_dir(&self.folder);
    }
}

/// Returns the force loop in a group that may use real time for 0.1 ms of each 30 ms.
pub fn throttled(target: Target, end: Instant) -> Result<(), String> {
    let root = PathBuf::from("/sys/fs/cgroup/cpu");
    if !root.join("cpu.rt_runtime_us").exists() {
        return Err(
            "no control group of this kernel has a share of real-time work (CONFIG_RT_GROUP_SCHED, cgroup v1)"
                .to_owned(),
        );
    }
    let folder = root.join(format!("stylet-test-{}", std::process::id()));
    let put = |file: PathBuf, text: &str| fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()));
    fs::create_dir(&folder).map_err(|e| e.to_string())?;
    let group = Group {
        folder,
        root,
        thread: target.thread,
    };
    put(group.folder.join("cpu.rt_period_us"), "30000")?;
    put(group.folder.join("cpu.rt_runtime_us"), "100")?;
    put(group.folder.join("tasks"), &target.thread.to_string())?;
    std::thread::sleep(end.saturating_duration_since(Instant::now()));
    Ok(())
}

fn scratch_file() -> PathBuf {
    stylet_test_kit::scratch("lab-inject").join("file")
}

/// Writes and syncs 96 MiB at a time, next to the loop on its core.
pub fn large_fsync(target: Target, end: Instant) -> Result<(), String> {
    let path = scratch_file();
    ended(on_core("inj-fsync", target.core, 0, move || {
        let bytes = vec![7_u8; 32 << 20];
        while Instant::now() < end {
            let mut file = File::create(&path).map_err(|e| e.to_string())?;
            for _ in 0..3 {
                file.write_all(&bytes).map_err(|e| e.to_string())?;
            }
            file.sync_all().map_err(|e| e.to_string())?;
        }
        let _ = fs::remove_file(&path);
        Ok(())
    }))?
}

/// Restores the interrupt's core when dropped.
struct Moved {
    file: PathBuf,
    before: String,
}

impl Drop for Moved {
    fn drop(&mut self) {
        let _ = fs::write(&self.file, self.before.trim());
    }
}

/// Reads past the page cache in many threads, with the disk's interrupts on the core of the loop.
pub fn disk_interrupt(target: Target, end: Instant) -> Result<(), String> {
    let numbers = disk_interrupts();
    if numbers.is_empty() {
        return Err("no interrupt of a disk in /proc/interrupts".to_owned());
    }
    let mut moved = Vec::new();
    for number in numbers {
        let file = PathBuf::from(format!("/proc/irq/{number}/smp_affinity_list"));
        let before = fs::read_to_string(&file).unwrap_or_default();
        if fs::write(&file, target.core.to_string()).is_ok() {
            moved.push(Moved { file, before });
        }
    }
    let path = scratch_file();
    fs::write(&path, vec![1_u8; 64 << 20]).map_err(|e| e.to_string())?;
    File::open(&path)
        .and_then(|f| f.sync_all())
        .map_err(|e| e.to_string())?;
    let core = usize::from(target.core == 0);
    let readers: Vec<_> = (0..48)
        .map(|i| {
            let path = path.clone();
            on_core("inj-reader", core, 0, move || read_directly(&path, i, end))
        })
        .collect();
    for reader in readers {
        ended(reader)??;
    }
    let _ = fs::remove_file(&path);
    Ok(())
}

fn disk_interrupts() -> Vec<u32> {
    let table = fs::read_to_string("/proc/interrupts").unwrap_or_default();
    let is_disk = |line: &&str| ["nvme", "ahci", "-req."].iter().any(|name| line.contains(name));
    let lines = table.lines().filter(is_disk);
    lines.filter_map(|l| l.split_once(':')?.0.trim().parse().ok()).collect()
}

fn read_directly(path: &PathBuf, seed: u64, end: Instant) -> Result<(), String> {
    let file = File::options()
        .read(true)
        .custom_flags(libc::O_DIRECT)
        .open(path)
        .map_err(|e| e.to_string())?;
    // O_DIRECT needs an address that is a multiple of a block.
    let mut room = vec![0_u8; 8_192];
    let offset = room.as_ptr().align_offset(4_096);
    let mut random = stylet_random::Random(seed);
    while Instant::now() < end {
        let at = random.draw() % (64 << 8) * 4_096;
        file.read_at(&mut room[offset..offset + 4_096], at)
            .map_err(|e| e.to_string())?;
    }
    Ok(())
}

//! Stops one thread of another process while the others run.

/// Stopped by ptrace until dropped. The process must be a child of this one, or this one root.
pub struct StoppedThread(libc::pid_t);

/// Returns the thread of `process` with this name.
pub fn thread_id(process: u32, name: &str) -> libc::pid_t {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).expect("a process that runs");
    let ids = tasks
        .flatten()
        .filter_map(|t| t.file_name().to_string_lossy().parse().ok());
    ids.into_iter()
        .find(|id: &libc::pid_t| {
            let comm = std::fs::read_to_string(format!("/proc/{process}/task/{id}/comm"));
            comm.is_ok_and(|c| c.trim() == name)
        })
        .unwrap_or_else(|| panic!("no thread {name} in {process}"))
}

impl StoppedThread {
    pub fn stop(process: u32, name: &str) -> Self {
        let id = thread_id(process, name);
        let nothing = std::ptr::null_mut::<libc::c_void>();
        // SAFETY: PTRACE_SEIZE takes no address and options as a number; the thread is one of a child of ours.
        let seized = unsafe { libc::ptrace(libc::PTRACE_SEIZE, id, nothing, nothing) };
        assert_eq!(seized, 0, "ptrace: {}", std::io::Error::last_os_error());
        // SAFETY: as above; it takes neither address nor data.
        unsafe { libc::ptrace(libc::PTRACE_INTERRUPT, id, nothing, nothing) };
        // SAFETY: a thread that is seized; the status is not wanted.
        let waited = unsafe { libc::waitpid(id, std::ptr::null_mut(), libc::__WALL) };
        assert_eq!(waited, id, "the thread {name} did not stop");
        Self(id)
    }
}

/// True once all threads of the process have ended except traced ones, or it no longer exists.
pub fn is_dead(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat"));
    stat.map_or(true, |s| s.contains(") Z "))
}

impl Drop for StoppedThread {
    fn drop(&mut self) {
        let nothing = std::ptr::null_mut::<libc::c_void>();
        // SAFETY: a thread that we have seized; the status is not wanted. One that ended meanwhile is waited for, or
        // its process could not be.
        unsafe {
            if libc::ptrace(libc::PTRACE_DETACH, self.0, nothing, nothing) != 0 {
                libc::waitpid(self.0, std::ptr::null_mut(), libc::__WALL);
            }
        }
    }
}

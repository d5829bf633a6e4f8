//! A running QEMU, and the connections that it opens.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Child;
use std::thread;
use std::time::{Duration, Instant};

use crate::{ANSWER_LIMIT, Result};

/// How often a connection is looked for.
const LOOK: Duration = Duration::from_millis(5);

/// A running QEMU. It is killed when this is dropped.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
}

impl Process {
    pub(crate) fn new(name: String, child: Child) -> Self {
        Self { name, child }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A free port of this machine that QEMU connects to.
#[derive(Debug)]
pub struct Listener {
    listener: TcpListener,
    address: SocketAddr,
}

impl Listener {
    /// Takes the port.
    ///
    /// # Errors
    /// When there is none.
    pub fn new() -> Result<Self> {
        let open = || {
            let listener = TcpListener::bind("127.0.0.1:0")?;
            // The wait for QEMU has a limit.
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok(Self { listener, address })
        };
        open().map_err(|error: std::io::Error| format!("a port of this machine for the emulator: {error}"))
    }

    /// Where QEMU connects to.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// QEMU's connection, on which a read waits for [`ANSWER_LIMIT`] at most.
    ///
    /// # Errors
    /// When QEMU ends before it connects, or does not within [`ANSWER_LIMIT`].
    pub fn accept(&self, qemu: &mut Process) -> Result<TcpStream> {
        let start = Instant::now();
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => {
                    let options = stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true));
                    let options = options.and_then(|()| stream.set_read_timeout(Some(ANSWER_LIMIT)));
                    return options.map(|()| stream).map_err(|error| format!("{}'s connection: {error}", qemu.name));
                }
                Err(error) if error.kind() != ErrorKind::WouldBlock => {
                    return Err(format!("{}'s connection to {}: {error}", qemu.name, self.address));
                }
                Err(_) => {}
            }
            if let Some(status) = qemu.child.try_wait().map_err(|error| format!("{}: {error}", qemu.name))? {
                return Err(format!("{} ended with {status} before it connected; it says why above", qemu.name));
            }
            if start.elapsed() > ANSWER_LIMIT {
                let limit_s = ANSWER_LIMIT.as_secs();
                return Err(format!("{} did not connect to {} within {limit_s} s", qemu.name, self.address));
            }
            thread::sleep(LOOK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    #[test]
    fn a_program_that_ends_before_it_connects_is_reported() {
        let listener = Listener::new().unwrap();
        let child = Command::new(std::env::current_exe().unwrap()).arg("--list").stdout(Stdio::null()).spawn();
        let mut process = Process::new("some-qemu".to_owned(), child.unwrap());
        let error = listener.accept(&mut process).unwrap_err();
        assert!(error.starts_with("some-qemu ended with exit status: 0 before it connected"), "{error}");
    }
}

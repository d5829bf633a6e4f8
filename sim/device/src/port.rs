//! The line: a serial port, or TCP for the emulator.

use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::Duration;

use super::DeviceError;

/// Baud rate of the controller's UART.
pub const DEFAULT_BAUD: u32 = 1_000_000;

/// A read returns after this long without a byte, so that time limits are looked at.
pub(super) const READ_LIMIT: Duration = Duration::from_millis(10);
/// A write that takes longer has failed: the other end does not take its bytes.
const WRITE_LIMIT: Duration = Duration::from_secs(2);

/// A line with a short time limit on reads.
pub trait Port: Read + Write + Send {}

impl<T: Read + Write + Send + ?Sized> Port for T {}

/// Opens `tcp:HOST:PORT`, or else the serial port of that name at `baud`.
///
/// # Errors
/// [`DeviceError::Open`].
pub fn open(address: &str, baud: u32) -> Result<Box<dyn Port>, DeviceError> {
    let failed = |reason: String| DeviceError::Open { address: address.to_owned(), reason };
    match address.strip_prefix("tcp:") {
        Some(host) => tcp(host).map(|stream| Box::new(stream) as Box<dyn Port>).map_err(|e| failed(e.to_string())),
        None => serialport::new(address, baud)
            .timeout(READ_LIMIT)
            .open()
            .map(|port| Box::new(port) as Box<dyn Port>)
            .map_err(|error| failed(error.to_string())),
    }
}

fn tcp(host: &str) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::other("the name has no address");
    for address in host.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, WRITE_LIMIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(READ_LIMIT))?;
                stream.set_write_timeout(Some(WRITE_LIMIT))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

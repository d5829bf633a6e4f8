//! The line between host and controller.

use std::io::{Read, Write};
use std::time::Duration;

/// Baud rate of the controller's UART.
pub const DEFAULT_BAUD: u32 = 1_000_000;

/// A read returns after this long without a byte, so that time limits are looked at.
pub const READ_LIMIT: Duration = Duration::from_millis(10);
/// A write that takes longer has failed: the other end does not take its bytes.
pub const WRITE_LIMIT: Duration = Duration::from_secs(2);

/// A line with a short time limit on reads.
pub trait Port: Read + Write + Send {}

impl<T: Read + Write + Send + ?Sized> Port for T {}

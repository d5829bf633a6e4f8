//! The checksum of stored settings and of the link's frames.

use crc::{CRC_32_ISCSI, Crc};

/// CRC-32/ISCSI. It detects any 5 wrong bits up to 655 bytes (5243 bits), and any 3 up to 256 MiB (Koopman, "32-bit cyclic
/// redundancy codes for internet applications", 2002).
pub static CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

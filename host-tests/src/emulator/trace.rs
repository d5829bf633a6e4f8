//! Accesses to what QEMU does not model. It writes them down, so that a test sees what would have happened at the pins.

use std::path::PathBuf;

/// The file that QEMU writes.
pub struct Trace(PathBuf);

/// A register was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortWrite {
    /// Offset within the port or device.
    pub offset: u32,
    /// What was written.
    pub value: u32,
}

impl Trace {
    pub(super) fn new(path: PathBuf) -> Self {
        Self(path)
    }

    /// How much was written down so far.
    ///
    /// # Panics
    /// When there is no trace.
    #[must_use]
    pub fn mark(&self) -> usize {
        std::fs::metadata(&self.0).expect("a trace").len() as usize
    }

    /// What was written to port C, that of the outputs, since the mark.
    ///
    /// # Panics
    /// When there is no trace, or it does not look as expected.
    #[must_use]
    pub fn outputs_since(&self, mark: usize) -> Vec<PortWrite> {
        self.writes_since(mark, "GPIOC")
    }

    /// What was written to the flash's own registers since the mark.
    ///
    /// # Panics
    /// As [`Self::outputs_since`].
    #[must_use]
    pub fn flash_since(&self, mark: usize) -> Vec<PortWrite> {
        self.writes_since(mark, "Flash Int")
    }

    fn writes_since(&self, mark: usize, device: &str) -> Vec<PortWrite> {
        let text = std::fs::read_to_string(&self.0).expect("a trace");
        let start = format!("{device}: unimplemented device write (");
        let write = |line: &str| {
            let fields = line.strip_prefix(&start)?.trim_end_matches(')');
            let number = |name: &str| {
                let text = fields.split(", ").find_map(|field| field.strip_prefix(name))?;
                u32::from_str_radix(text.trim().trim_start_matches("0x"), 16).ok()
            };
            Some(PortWrite { offset: number("offset")?, value: number("value")? })
        };
        text[mark..].lines().filter_map(write).collect()
    }
}

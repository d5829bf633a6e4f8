//! The image that would be flashed, in QEMU: its link, the emulator's monitor, a debugger, and the accesses to pins that
//! QEMU does not model but writes down.

mod debugger;
mod link;
mod monitor;
mod trace;

use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use emulator::{ANSWER_LIMIT, Listener, Pace, Process, Qemu, STM32F405};
use ihex::Record;

pub use debugger::Debugger;
pub use link::Link;
pub use monitor::Monitor;
pub use trace::{PortWrite, Trace};

/// Longest wait for one answer.
pub const PATIENCE: Duration = ANSWER_LIMIT;

/// The image that `cargo xtask test` has built and named.
///
/// # Panics
/// When it has not.
#[must_use]
pub fn image() -> PathBuf {
    named("ROTORLEAD_STM32F405_IMAGE")
}

/// The same with a panic in its control task, which strikes when the first output goes above one half.
///
/// # Panics
/// When `cargo xtask test` has not named it.
#[must_use]
pub fn panicking_image() -> PathBuf {
    named("ROTORLEAD_PANICKING_STM32F405_IMAGE")
}

pub(crate) fn named(variable: &str) -> PathBuf {
    std::env::var_os(variable).unwrap_or_else(|| panic!("{variable} names no image; `cargo xtask test` does")).into()
}

/// How to start the emulator.
pub struct Start<'a> {
    /// The image.
    pub image: &'a Path,
    /// What the sectors of the settings hold.
    pub settings_flash: Option<&'a [u8]>,
    /// Whether accesses to what QEMU does not model are written down. Some 300 kB a second.
    pub trace: bool,
    /// Whether a debugger is attached.
    pub debugger: bool,
}

impl<'a> Start<'a> {
    /// This image and nothing else.
    #[must_use]
    pub fn new(image: &'a Path) -> Self {
        Self { image, settings_flash: None, trace: false, debugger: false }
    }
}

/// The controller gave a motor up since nothing came from the host for longer than it allows, as it must.
///
/// The emulated time runs some four times as fast as the real one and waits for nobody: a host that its own machine holds
/// up for 50 ms, or 250 ms while it injects, is late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostLate;

/// A host is late that often only if something else is wrong.
const MOST_ATTEMPTS: usize = 6;

/// Does what needs a host that is never late, again when it was.
///
/// # Panics
/// When it always was.
pub fn keeping_up<T>(mut attempt: impl FnMut() -> Result<T, HostLate>) -> T {
    for _ in 0..MOST_ATTEMPTS {
        match attempt() {
            Ok(done) => return done,
            Err(HostLate) => println!("the host was held up; once more"),
        }
    }
    panic!("the host was late {MOST_ATTEMPTS} times in a row")
}

/// A running emulator. Ends with its value.
pub struct Machine {
    /// The host's end of the controller's link.
    pub link: Link,
    /// The emulator's monitor.
    pub monitor: Monitor,
    /// The debugger, where one was asked for.
    pub debugger: Option<Debugger>,
    /// What was written down, where that was asked for.
    pub trace: Trace,
    _qemu: Process,
    _folder: tempfile::TempDir,
}

impl Machine {
    /// Starts the emulator and waits until the controller answers.
    ///
    /// # Panics
    /// When it does not.
    #[must_use]
    pub fn boot(start: &Start<'_>) -> Self {
        let mut machine = Self::begin(start).unwrap_or_else(|error| panic!("{error}"));
        machine.link.wait_for_start();
        machine
    }

    /// Starts the emulator, waits until the controller answers, and gives the address of its link for another program.
    ///
    /// QEMU takes a free port of its own and keeps it: one that was tried here before could be in somebody else's hands
    /// again, or in those of a process that was forked while it was tried.
    ///
    /// # Panics
    /// When QEMU is not there, or the controller does not answer.
    #[must_use]
    pub fn serve(image: &Path) -> (Process, String) {
        let serve = || {
            let monitor = Listener::new()?;
            let qemu = Qemu::new(&STM32F405, image, Pace::Fastest).serve_link(0);
            let mut qemu = qemu.connect_monitor(&monitor).start()?;
            let monitor = monitor.accept(&mut qemu)?;
            Ok::<_, String>((qemu, monitor))
        };
        let (qemu, monitor) = serve().unwrap_or_else(|error| panic!("{error}"));
        let address = Monitor::new(monitor).listening_address(&STM32F405.link_name());
        let stream = TcpStream::connect(&address).expect("QEMU listens");
        // When this connection ends, QEMU takes the next one.
        Link::new(stream).wait_for_start();
        (qemu, format!("tcp:{address}"))
    }

    fn begin(start: &Start<'_>) -> emulator::Result<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (link, monitor) = (Listener::new()?, Listener::new()?);
        let mut qemu = Qemu::new(&STM32F405, start.image, Pace::Fastest).connect_link(&link).connect_monitor(&monitor);
        let debugger = if start.debugger { Some(Listener::new()?) } else { None };
        if let Some(debugger) = &debugger {
            qemu = qemu.connect_debugger(debugger);
        }
        let log = folder.path().join("trace");
        if start.trace {
            qemu = qemu.trace(&log);
        }
        if let Some(bytes) = start.settings_flash {
            let file = folder.path().join("settings.hex");
            std::fs::write(&file, intel_hex(SETTINGS_ADDRESS, bytes)).expect("a temporary file");
            qemu = qemu.load(&file);
        }
        let mut qemu = qemu.start()?;
        Ok(Self {
            link: Link::new(link.accept(&mut qemu)?),
            monitor: Monitor::new(monitor.accept(&mut qemu)?),
            debugger: debugger.map(|debugger| debugger.accept(&mut qemu).map(Debugger::new)).transpose()?,
            trace: Trace::new(log),
            _qemu: qemu,
            _folder: folder,
        })
    }
}

/// Address of the settings' first sector: src/board/board.x.
const SETTINGS_ADDRESS: u32 = 0x080C_0000;

/// Bytes from an address on in Intel's format: QEMU takes raw ones only up to the size of a RAM that this board has not.
fn intel_hex(address: u32, bytes: &[u8]) -> String {
    let mut records = Vec::new();
    for (at, block) in (address..).step_by(32).zip(bytes.chunks(32)) {
        if at == address || at.is_multiple_of(1 << 16) {
            records.push(Record::ExtendedLinearAddress((at >> 16) as u16));
        }
        records.push(Record::Data { offset: at as u16, value: block.to_vec() });
    }
    records.push(Record::EndOfFile);
    ihex::create_object_file_representation(&records).expect("blocks of 32 bytes fit a record")
}

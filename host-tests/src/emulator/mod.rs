//! The image that would be flashed, in QEMU: its link, the emulator's monitor, a debugger, and the accesses to pins that
//! QEMU does not model but writes down.

mod debugger;
mod link;
mod monitor;
mod trace;

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

pub use debugger::Debugger;
pub use link::Link;
pub use monitor::Monitor;
pub use trace::{PortWrite, Trace};

/// Longest wait for one answer. The emulator shares its machine with other tests.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// The board. What it has of an STM32F405 and what not: QEMU's documentation, "STM32 boards".
const BOARD: &str = "olimex-stm32-h405";

/// The image that `cargo xtask test` has built and named.
///
/// # Panics
/// When it has not.
#[must_use]
pub fn image() -> PathBuf {
    named("ROTORLEAD_IMAGE")
}

/// The same with a panic in its control task, which strikes when the first output goes above one half.
///
/// # Panics
/// When `cargo xtask test` has not named it.
#[must_use]
pub fn panicking_image() -> PathBuf {
    named("ROTORLEAD_PANICKING_IMAGE")
}

fn named(variable: &str) -> PathBuf {
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
    qemu: Child,
    _folder: tempfile::TempDir,
}

impl Machine {
    /// Starts the emulator and waits until the controller answers.
    ///
    /// # Panics
    /// When it does not.
    #[must_use]
    pub fn boot(start: &Start<'_>) -> Self {
        let mut machine = Self::begin(start);
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
    pub fn serve(image: &Path) -> (Served, String) {
        let mut qemu = command(image);
        qemu.args(["-serial", "tcp:127.0.0.1:0,server=on,wait=off,nodelay=on"]);
        let monitor = Listener::new();
        qemu.args(["-qmp", &format!("tcp:{}", monitor.address)]);
        let served = Served(run(&mut qemu));
        let address = Monitor::new(monitor.accept()).listening_address(LINK_SERIAL);
        let stream = TcpStream::connect(&address).expect("QEMU listens");
        // When this connection ends, QEMU takes the next one.
        Link::new(stream).wait_for_start();
        (served, format!("tcp:{address}"))
    }

    fn begin(start: &Start<'_>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut qemu = command(start.image);
        // QEMU connects to the test, so that there is no port to guess.
        let link = Listener::new();
        qemu.args(["-serial", &format!("tcp:{},nodelay=on", link.address)]);
        let monitor = Listener::new();
        qemu.args(["-qmp", &format!("tcp:{}", monitor.address)]);
        let debugger = start.debugger.then(Listener::new);
        if let Some(debugger) = &debugger {
            let (host, port) = debugger.address.split_once(':').expect("an address with its port");
            qemu.args(["-chardev", &format!("socket,id=debugger,host={host},port={port}"), "-gdb", "chardev:debugger"]);
        }
        let log = folder.path().join("trace");
        if start.trace {
            qemu.args(["-d", "unimp", "-D"]).arg(&log);
        }
        if let Some(bytes) = start.settings_flash {
            let file = folder.path().join("settings.hex");
            std::fs::write(&file, intel_hex(SETTINGS_ADDRESS, bytes)).expect("a temporary file");
            qemu.arg("-device").arg(format!("loader,file={}", file.display()));
        }
        let qemu = run(&mut qemu);
        Self {
            link: Link::new(link.accept()),
            monitor: Monitor::new(monitor.accept()),
            debugger: debugger.map(|debugger| Debugger::new(debugger.accept())),
            trace: Trace::new(log),
            qemu,
            _folder: folder,
        }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        end(&mut self.qemu);
    }
}

/// An emulator that another program talks to. Ends with its value.
pub struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        end(&mut self.0);
    }
}

/// Address of the settings' first sector: memory.x.
const SETTINGS_ADDRESS: u32 = 0x080C_0000;

/// QEMU's name of the third serial line, the controller's link.
const LINK_SERIAL: &str = "serial2";

/// QEMU with everything but the lines to it.
///
/// An instruction takes 1 ns of emulated time: of the shifts that QEMU has, the one in which a control tick has most
/// instructions, nearly as many as on silicon. With `sleep=on` the thread that brings the bytes of the link was seen to
/// wait up to 300 ms for the one that executes.
fn command(image: &Path) -> Command {
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-M", BOARD, "-nographic", "-monitor", "none", "-icount", "shift=0,sleep=off"])
        .arg("-kernel")
        .arg(image);
    // The third serial line is USART3: `LINK_SERIAL`.
    qemu.args(["-serial", "null", "-serial", "null"]).stdin(Stdio::null()).stdout(Stdio::null());
    qemu
}

fn run(qemu: &mut Command) -> Child {
    qemu.spawn().expect("QEMU runs; `cargo xtask setup` installs it")
}

fn end(qemu: &mut Child) {
    // It may have ended by itself.
    let _ = qemu.kill();
    let _ = qemu.wait();
}

/// Bytes from an address on in Intel's format: QEMU takes raw ones only up to the size of a RAM that this board has not.
fn intel_hex(address: u32, bytes: &[u8]) -> String {
    let record = |address: u16, kind: u8, data: &[u8]| {
        let head = [data.len() as u8, (address >> 8) as u8, address as u8, kind];
        let fields = head.iter().chain(data);
        let sum = fields.clone().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        let digits: String = fields.chain([&sum.wrapping_neg()]).map(|byte| format!("{byte:02X}")).collect();
        format!(":{digits}\n")
    };
    let mut text = String::new();
    for (n, block) in (0..).zip(bytes.chunks(32)) {
        let at = address + 32 * n;
        if n == 0 || at.is_multiple_of(1 << 16) {
            text += &record(0, 4, &[(at >> 24) as u8, (at >> 16) as u8]);
        }
        text += &record(at as u16, 0, block);
    }
    text + &record(0, 1, &[])
}

struct Listener {
    listener: TcpListener,
    address: String,
}

impl Listener {
    fn new() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port of this machine");
        let address = listener.local_addr().expect("the port's address").to_string();
        Self { listener, address }
    }

    fn accept(&self) -> TcpStream {
        let (stream, _) = self.listener.accept().expect("QEMU connects");
        stream.set_nodelay(true).expect("an open connection");
        stream.set_read_timeout(Some(PATIENCE)).expect("an open connection");
        stream
    }
}

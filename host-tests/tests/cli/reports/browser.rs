//! Pages in headless Chromium: what is asked of it and what it answers.

use std::cell::RefCell;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::devtools::Pipe;

/// Names under which a browser may be installed.
const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"];
/// Longest that a page may take until its figures are drawn.
const DRAWN_WITHIN: Duration = Duration::from_secs(60);
/// Height of a window, pixels.
const HEIGHT: u32 = 900;
/// What of a sheet of A4 is printed on, pixels of 1/96 inch.
pub const SHEET: (u32, u32) = (717, 1046);
/// Its size and margins, inches.
const A4: (f64, f64) = (8.27, 11.69);
const MARGIN: f64 = 0.4;
/// Containers have no sandbox, and the pages are our own. The browser itself asks nothing of the
/// network either.
/// Pages that are not in front are drawn as fast as the one that is.
const FLAGS: [&str; 17] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-quic",
    "--disable-renderer-backgrounding",
    "--disable-sync",
    "--hide-scrollbars",
    "--mute-audio",
    "--no-first-run",
    "--no-startup-window",
];

/// A browser with a profile of its own, which goes with it.
pub struct Chromium {
    pipe: RefCell<Pipe>,
    _profile: tempfile::TempDir,
}

impl Chromium {
    /// Starts one. `None`, said on standard error, where none is installed.
    ///
    /// # Panics
    /// Where `CI` is set and there is none, or it does not start.
    pub fn start() -> Option<Self> {
        let Some(program) = PROGRAMS.into_iter().find(|program| is_installed(program)) else {
            let message = "there is no browser: `cargo xtask setup` installs Chromium";
            assert!(std::env::var_os("CI").is_none(), "{message}");
            eprintln!("skipped: {message}");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        let folder = format!("--user-data-dir={}", profile.path().display());
        let pipe = Pipe::start(program, FLAGS.into_iter().chain([folder.as_str()]));
        Some(Self { pipe: RefCell::new(pipe), _profile: profile })
    }

    /// Opens a file as a window of this width shows it, and waits until its figures are drawn.
    pub fn open(&self, file: &Path, width: u32, scheme: &str) -> OpenPage<'_> {
        let url = format!("file://{}", file.canonicalize().unwrap().display());
        let (target, session) = {
            let mut pipe = self.pipe.borrow_mut();
            let target = text(&pipe.call(None, "Target.createTarget", &json!({ "url": "about:blank" }))["targetId"]);
            let attach = json!({ "targetId": target, "flatten": true });
            let session = text(&pipe.call(None, "Target.attachToTarget", &attach)["sessionId"]);
            (target, session)
        };
        let page = OpenPage { browser: self, target, session, url };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            page.call(&format!("{domain}.enable"), &json!({}));
        }
        page.resize(width, HEIGHT);
        page.show("", scheme);
        page.call("Page.navigate", &json!({ "url": page.url }));
        let start = Instant::now();
        while !page.is_drawn() {
            assert!(start.elapsed() < DRAWN_WITHIN, "{} is not drawn: {:?}", page.url, page.complaints());
            std::thread::sleep(Duration::from_millis(20));
        }
        page
    }
}

/// Whether a program can be run.
fn is_installed(program: &str) -> bool {
    let version = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    version.is_ok_and(|status| status.success())
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_else(|| panic!("{value} is no text")).to_owned()
}

/// A console message, an exception, or a request, as a sentence.
fn complaint(event: &Value, own: &str) -> Option<String> {
    let parameters = &event["params"];
    match event["method"].as_str()? {
        "Runtime.consoleAPICalled" => Some(format!("console: {}", parameters["args"])),
        "Runtime.exceptionThrown" => Some(format!("exception: {}", parameters["exceptionDetails"])),
        "Log.entryAdded" => Some(format!("log: {}", parameters["entry"]["text"])),
        "Network.requestWillBeSent" => {
            let url = parameters["request"]["url"].as_str()?;
            let is_own = url == own || url.starts_with("data:") || url.starts_with("blob:");
            (!is_own).then(|| format!("request: {url}"))
        }
        _ => None,
    }
}

/// A page that is open.
pub struct OpenPage<'a> {
    browser: &'a Chromium,
    target: String,
    session: String,
    url: String,
}

/// What a page is on paper.
pub struct Printed {
    /// The file.
    pub bytes: Vec<u8>,
    /// How many sheets.
    pub sheets: usize,
}

impl OpenPage<'_> {
    /// Whether the page says that its figures are drawn. While it is loaded there is nothing to be asked yet.
    fn is_drawn(&self) -> bool {
        let drawn = json!({ "expression": "document.documentElement?.dataset.drawn", "returnByValue": true });
        let found = self.browser.pipe.borrow_mut().try_call(Some(&self.session), "Runtime.evaluate", &drawn);
        found.is_ok_and(|found| found["result"]["value"] == "true")
    }

    /// What an expression, or a promise of it, comes to.
    pub fn evaluate<T: DeserializeOwned>(&self, expression: &str) -> T {
        let script = format!("(async () => JSON.stringify(await ({expression})))()");
        let value = self.script(&script);
        serde_json::from_str(value.as_str().unwrap_or_else(|| panic!("{expression}: {value}"))).unwrap()
    }

    /// Runs a script once.
    pub fn run(&self, script: &str) {
        self.script(script);
    }

    fn script(&self, script: &str) -> Value {
        let parameters = json!({ "expression": script, "awaitPromise": true, "returnByValue": true });
        let mut found = self.call("Runtime.evaluate", &parameters);
        assert!(found["exceptionDetails"].is_null(), "{script}: {}", found["exceptionDetails"]);
        found["result"]["value"].take()
    }

    /// Moves the mouse, as a hand does: in two steps.
    pub fn point_at(&self, x: f64, y: f64) {
        for x in [x - 3.0, x] {
            self.call("Input.dispatchMouseEvent", &json!({ "type": "mouseMoved", "x": x, "y": y }));
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// What the console, the log and the network had to say.
    pub fn complaints(&self) -> Vec<String> {
        let pipe = self.browser.pipe.borrow();
        let own = pipe.events().iter().filter(|event| event["sessionId"] == self.session.as_str());
        own.filter_map(|event| complaint(event, &self.url)).collect()
    }

    /// The whole page as PNG.
    pub fn screenshot(&self, file: &Path) {
        let (width, height): (u32, u32) = self.evaluate("[innerWidth, document.documentElement.scrollHeight]");
        self.resize(width, height);
        std::thread::sleep(Duration::from_millis(300));
        let png = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        std::fs::write(file, bytes(&png)).unwrap();
        self.resize(width, HEIGHT);
    }

    /// The page as it is printed.
    pub fn print(&self) -> Printed {
        let options = json!({
            "paperWidth": A4.0, "paperHeight": A4.1,
            "marginTop": MARGIN, "marginBottom": MARGIN, "marginLeft": MARGIN, "marginRight": MARGIN,
        });
        let bytes = bytes(&self.call("Page.printToPDF", &options));
        assert!(bytes.starts_with(b"%PDF-"), "this is no PDF file");
        // Of its objects only streams are compressed.
        let is_sheet = |at: &usize| bytes[*at..].starts_with(b"/Type /Page") && bytes[*at + 11] != b's';
        let sheets = (0..bytes.len() - 12).filter(is_sheet).count();
        Printed { bytes, sheets }
    }

    /// Lays the page out as for a sheet of paper, until it is closed.
    pub fn as_printed(&self, scheme: &str) {
        self.resize(SHEET.0, SHEET.1);
        self.show("print", scheme);
        std::thread::sleep(Duration::from_millis(200));
    }

    /// Shows the page on this medium and by day or by night.
    pub fn show(&self, media: &str, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", &json!({ "media": media, "features": features }));
    }

    fn resize(&self, width: u32, height: u32) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", &metrics);
    }

    fn call(&self, method: &str, parameters: &Value) -> Value {
        self.browser.pipe.borrow_mut().call(Some(&self.session), method, parameters)
    }
}

/// The file in an answer.
fn bytes(answer: &Value) -> Vec<u8> {
    STANDARD.decode(text(&answer["data"])).unwrap()
}

impl Drop for OpenPage<'_> {
    fn drop(&mut self) {
        // While a panic unwinds the browser may be gone.
        if !std::thread::panicking() {
            self.browser.pipe.borrow_mut().call(None, "Target.closeTarget", &json!({ "targetId": self.target }));
        }
    }
}

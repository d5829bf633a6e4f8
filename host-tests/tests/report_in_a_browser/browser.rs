//! Headless Chromium, driven over its DevTools protocol.

use std::ffi::OsStr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use headless_chrome::browser::default_executable;
use headless_chrome::browser::tab::point::Point;
use headless_chrome::protocol::cdp::types::{Event, Method};
use headless_chrome::protocol::cdp::{Emulation, Network, Page};
use headless_chrome::types::PrintToPdfOptions;
use headless_chrome::{Browser, LaunchOptions, Tab};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// Longest that a page may take until its figures are drawn.
const DRAWN_WITHIN: Duration = Duration::from_secs(60);
/// Height of a window, pixels.
const HEIGHT: u32 = 900;
/// What of a sheet of A4 is printed on, pixels of 1/96 inch.
pub const SHEET: (u32, u32) = (717, 1046);
/// Its size and margins, inches.
const A4: (f64, f64) = (8.27, 11.69);
const MARGIN: f64 = 0.4;
/// Beside those that the library gives anyway.
const FLAGS: [&str; 4] = ["--disable-quic", "--disable-component-update", "--hide-scrollbars", "--mute-audio"];

/// A browser with a profile of its own, which goes with it.
pub struct Chromium {
    browser: Browser,
    _profile: tempfile::TempDir,
}

impl Chromium {
    /// Starts one. `None`, said on standard error, where none is installed.
    ///
    /// # Panics
    /// Where `CI` is set and there is none, or it does not start.
    pub fn start() -> Option<Self> {
        let path = match default_executable() {
            Ok(path) => path,
            Err(reason) => {
                let message = format!("{reason}: `cargo xtask setup` installs Chromium");
                assert!(std::env::var_os("CI").is_none(), "{message}");
                eprintln!("skipped: {message}");
                return None;
            }
        };
        let profile = tempfile::tempdir().unwrap();
        let options = LaunchOptions {
            path: Some(path),
            headless: true,
            // Containers have no sandbox, and the page is our own.
            sandbox: false,
            enable_gpu: false,
            user_data_dir: Some(profile.path().to_owned()),
            idle_browser_timeout: Duration::from_secs(300),
            args: FLAGS.iter().map(OsStr::new).collect(),
            ..LaunchOptions::default()
        };
        Some(Self { browser: Browser::new(options).unwrap(), _profile: profile })
    }

    /// Opens a file as a window of this width shows it, and waits until its figures are drawn.
    pub fn open(&self, file: &Path, width: u32, scheme: &str) -> OpenPage {
        let tab = self.browser.new_tab().unwrap();
        tab.set_default_timeout(DRAWN_WITHIN);
        let complaints = Arc::new(Mutex::new(Vec::new()));
        let url = format!("file://{}", file.canonicalize().unwrap().display());
        tab.enable_runtime().unwrap().enable_log().unwrap();
        call::<Network::Enable>(&tab, json!({}));
        let (heard, own) = (Arc::clone(&complaints), url.clone());
        tab.add_event_listener(Arc::new(move |event: &Event| {
            if let Some(complaint) = complaint(event, &own) {
                heard.lock().unwrap().push(complaint);
            }
        }))
        .unwrap();
        let page = OpenPage { tab: Arc::clone(&tab), complaints, scheme: scheme.to_owned() };
        page.resize(width, HEIGHT);
        page.emulate("", scheme);
        tab.navigate_to(&url).unwrap();
        let start = Instant::now();
        while page.evaluate::<Value>("document.documentElement?.dataset.drawn ?? null") != "true" {
            assert!(start.elapsed() < DRAWN_WITHIN, "{url} is not drawn: {:?}", page.complaints());
            std::thread::sleep(Duration::from_millis(50));
        }
        page
    }
}

/// A console message, an exception, or a request, as a sentence.
fn complaint(event: &Event, own: &str) -> Option<String> {
    match event {
        Event::RuntimeConsoleAPICalled(event) => Some(format!("console: {:?}", event.params.args)),
        Event::RuntimeExceptionThrown(event) => Some(format!("exception: {:?}", event.params.exception_details)),
        Event::LogEntryAdded(event) => Some(format!("log: {}", event.params.entry.text)),
        Event::NetworkRequestWillBeSent(event) => {
            let url = &event.params.request.url;
            let is_own = url == own || url.starts_with("data:") || url.starts_with("blob:");
            (!is_own).then(|| format!("request: {url}"))
        }
        _ => None,
    }
}

/// Calls a method whose parameters are given as JSON: most have many that are optional.
fn call<M: Method + serde::Serialize + DeserializeOwned + std::fmt::Debug>(tab: &Tab, parameters: Value) {
    tab.call_method(serde_json::from_value::<M>(parameters).unwrap()).unwrap();
}

/// A page that is open.
pub struct OpenPage {
    tab: Arc<Tab>,
    complaints: Arc<Mutex<Vec<String>>>,
    scheme: String,
}

/// What a page is on paper.
pub struct Printed {
    /// The file.
    pub bytes: Vec<u8>,
    /// How many sheets.
    pub sheets: usize,
}

impl OpenPage {
    /// What an expression, or a promise of it, comes to.
    pub fn evaluate<T: DeserializeOwned>(&self, expression: &str) -> T {
        let script = format!("(async () => JSON.stringify(await ({expression})))()");
        let found = self.tab.evaluate(&script, true).unwrap_or_else(|error| panic!("{expression}: {error}"));
        let text = found.value.and_then(|value| value.as_str().map(str::to_owned));
        let text = text.unwrap_or_else(|| panic!("{expression}: {:?}", found.description));
        serde_json::from_str(&text).unwrap()
    }

    /// Runs a script once.
    pub fn run(&self, script: &str) {
        self.tab.evaluate(script, false).unwrap();
    }

    /// Moves the mouse, as a hand does: in two steps.
    pub fn point_at(&self, x: f64, y: f64) {
        for x in [x - 3.0, x] {
            self.tab.move_mouse_to_point(Point { x, y }).unwrap();
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// What the console, the log and the network had to say.
    pub fn complaints(&self) -> Vec<String> {
        self.complaints.lock().unwrap().clone()
    }

    /// The whole page as PNG.
    pub fn screenshot(&self, file: &Path) {
        let (width, height): (u32, u32) = self.evaluate("[innerWidth, document.documentElement.scrollHeight]");
        self.resize(width, height);
        std::thread::sleep(Duration::from_millis(300));
        let png = self.tab.capture_screenshot(Page::CaptureScreenshotFormatOption::Png, None, None, true).unwrap();
        std::fs::write(file, png).unwrap();
        self.resize(width, HEIGHT);
    }

    /// The page as it is printed.
    pub fn print(&self) -> Printed {
        let options = PrintToPdfOptions {
            paper_width: Some(A4.0),
            paper_height: Some(A4.1),
            margin_top: Some(MARGIN),
            margin_bottom: Some(MARGIN),
            margin_left: Some(MARGIN),
            margin_right: Some(MARGIN),
            ..PrintToPdfOptions::default()
        };
        let bytes = self.tab.print_to_pdf(Some(options)).unwrap();
        assert!(bytes.starts_with(b"%PDF-"), "this is no PDF file");
        // Of its objects only streams are compressed.
        let is_sheet = |at: &usize| bytes[*at..].starts_with(b"/Type /Page") && bytes[*at + 11] != b's';
        let sheets = (0..bytes.len() - 12).filter(is_sheet).count();
        Printed { bytes, sheets }
    }

    /// Lays the page out as for a sheet of paper, until it is closed.
    pub fn as_printed(&self) {
        self.resize(SHEET.0, SHEET.1);
        self.emulate("print", &self.scheme);
        std::thread::sleep(Duration::from_millis(200));
    }

    fn emulate(&self, media: &str, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        call::<Emulation::SetEmulatedMedia>(&self.tab, json!({ "media": media, "features": features }));
    }

    fn resize(&self, width: u32, height: u32) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        call::<Emulation::SetDeviceMetricsOverride>(&self.tab, metrics);
    }
}

impl Drop for OpenPage {
    fn drop(&mut self) {
        let _ = self.tab.close(false);
    }
}

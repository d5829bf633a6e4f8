//! `rotorlead serve`

use std::borrow::Cow;
use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use clap::Args;
use flate2::read::GzDecoder;
use miette::miette;

use super::browser::open_page;
use super::outcome::print_bytes;

/// The page's files: name, and bytes as gzip has them. None where the program was built without the page.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/web_files.rs"));

/// Where the page is unless another port is asked for: a browser keeps what it may do, such as to talk to a controller, for one address.
/// Chosen: any that no service has by the list of IANA.
const PORT: u16 = 8687;

/// Longest that a browser may take for a request, or for reading its answer.
const PATIENCE: Duration = Duration::from_secs(30);
/// Bytes of the longest request, and headers in it. Chosen: servers commonly take 8 KB and 100.
const LONGEST_HEAD: usize = 16_384;
const MOST_HEADERS: usize = 100;

/// What every answer says: the page takes its own files alone, and no other page may hold it.
const HEADERS: [(&str, &str); 5] = [
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
         connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("Cache-Control", "no-cache"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
];

/// Opens a page in the browser that reads logs, shows what they say, and writes to the controller
///
/// The page is in this program, which gives it to this machine alone: it listens on 127.0.0.1 and nowhere else, until Ctrl-C. All is
/// computed in the browser, and nothing is sent anywhere. docs/web.md says what it does.
#[derive(Args, Debug)]
pub struct Serve {
    /// Port of 127.0.0.1; 0 takes any that is free
    #[arg(long, default_value_t = PORT)]
    port: u16,
    /// Print the address, and open no browser
    #[arg(long)]
    no_browser: bool,
}

impl Serve {
    /// Runs the command, until the program is ended.
    pub fn run(&self) -> miette::Result<()> {
        if FILES.is_empty() {
            let help = "a release's archive has a program with the page; from the sources, `cargo xtask build --web` builds both. Any web server serves the page's folder, too";
            return Err(miette!(help = help, "this program was built without the page"));
        }
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, self.port));
        let listener = TcpListener::bind(address).map_err(|error| {
            miette!(
                help = "is it open already? Else --port 0 takes a port that is free",
                "cannot listen on {address}: {error}"
            )
        })?;
        let port = listener.local_addr().map_or(self.port, |address| address.port());
        let page = format!("http://127.0.0.1:{port}/");
        print_bytes(format!("{page}\nCtrl-C ends it.\n").as_bytes())?;
        if !self.no_browser {
            open_page(&page);
        }
        for browser in listener.incoming().flatten() {
            // A browser that has gone, or for which there is no thread, needs no answer.
            let _ = thread::Builder::new().spawn(move || talk(browser, port));
        }
        Ok(())
    }
}

/// One request and its answer: a browser opens a connection for each.
fn talk(mut browser: TcpStream, port: u16) -> io::Result<()> {
    browser.set_read_timeout(Some(PATIENCE))?;
    browser.set_write_timeout(Some(PATIENCE))?;
    let mut head = Vec::new();
    loop {
        let mut part = [0; 2048];
        let length = browser.read(&mut part)?;
        head.extend_from_slice(&part[..length]);
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        let answer = match request.parse(&head) {
            Ok(httparse::Status::Complete(_)) => answer(&request, port),
            Ok(httparse::Status::Partial) if length > 0 && head.len() < LONGEST_HEAD => continue,
            _ => Answer::refused("400 Bad Request"),
        };
        browser.write_all(answer.head().as_bytes())?;
        if request.method != Some("HEAD") {
            browser.write_all(&answer.body)?;
        }
        return browser.shutdown(Shutdown::Write);
    }
}

/// What a request gets.
struct Answer {
    status: &'static str,
    headers: Vec<(&'static str, &'static str)>,
    body: Cow<'static, [u8]>,
}

impl Answer {
    fn refused(status: &'static str) -> Self {
        Self { status, headers: Vec::new(), body: Cow::Borrowed(status.as_bytes()) }
    }

    /// All before the body.
    fn head(&self) -> String {
        let own = self.headers.iter().chain(&HEADERS).map(|(name, value)| format!("{name}: {value}\r\n"));
        let (status, own, length) = (self.status, own.collect::<String>(), self.body.len());
        format!("HTTP/1.1 {status}\r\n{own}Content-Length: {length}\r\nConnection: close\r\n\r\n")
    }
}

fn answer(request: &httparse::Request, port: u16) -> Answer {
    let header = |name: &str| {
        let found = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
        found.map_or("", |header| str::from_utf8(header.value).unwrap_or_default())
    };
    let is_own = |name: &str| header("Host") == format!("{name}:{port}") || (port == 80 && header("Host") == name);
    // A name of another's that leads here would make this page one of theirs.
    if !["127.0.0.1", "localhost"].into_iter().any(is_own) {
        return Answer::refused("421 Misdirected Request");
    }
    if !matches!(request.method, Some("GET" | "HEAD")) {
        return Answer::refused("405 Method Not Allowed");
    }
    let path = request.path.unwrap_or_default().split(['?', '#']).next().unwrap_or_default();
    let name = if path == "/" { "index.html" } else { path.trim_start_matches('/') };
    let Some((_, packed)) = FILES.iter().find(|(file, _)| *file == name) else {
        return Answer::refused("404 Not Found");
    };
    let mut headers = vec![("Content-Type", content_type(name)), ("Vary", "Accept-Encoding")];
    let body = if header("Accept-Encoding").contains("gzip") {
        headers.push(("Content-Encoding", "gzip"));
        Cow::Borrowed(*packed)
    } else {
        let mut bytes = Vec::new();
        GzDecoder::new(*packed).read_to_end(&mut bytes).expect("it was packed when this was built");
        Cow::Owned(bytes)
    };
    Answer { status: "200 OK", headers, body }
}

/// By the end of a file's name.
fn content_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("wasm") => "application/wasm",
        _ => "text/plain; charset=utf-8",
    }
}

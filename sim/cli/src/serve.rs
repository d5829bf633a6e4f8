//! `rotorlead serve`

use std::net::{Ipv4Addr, SocketAddr};

use clap::Args;
use flate2::read::GzDecoder;
use miette::miette;
use tiny_http::{Header, Method, Request, Response, Server};

use super::outcome::print_bytes;

/// The page's files: name, and bytes as gzip has them. None where the program was built without the page.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/web_files.rs"));

/// Where the page is unless another port is asked for: a browser keeps what it may do, such as to talk to a controller, for one address.
/// Chosen: any that no service has by the list of IANA.
const PORT: u16 = 8687;

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
            let help = "`cargo xtask build --web` builds the page, and a program with it; any web server serves its folder, too";
            return Err(miette!(help = help, "this program was built without the page"));
        }
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, self.port));
        let server = Server::http(address).map_err(|error| {
            miette!(
                help = "is it open already? Else --port 0 takes a port that is free",
                "cannot listen on {address}: {error}"
            )
        })?;
        let port = server.server_addr().to_ip().map_or(self.port, |address| address.port());
        let page = format!("http://127.0.0.1:{port}/");
        print_bytes(format!("{page}\nCtrl-C ends it.\n").as_bytes())?;
        if !self.no_browser && open::that_detached(&page).is_err() {
            eprintln!("No browser was found: open the address by hand.");
        }
        for request in server.incoming_requests() {
            let response = answer(&request, port);
            // A browser that has gone needs no answer.
            let _ = request.respond(response);
        }
        Ok(())
    }
}

/// What a request gets.
fn answer(request: &Request, port: u16) -> Response<std::io::Cursor<Vec<u8>>> {
    let header =
        |name: &str| request.headers().iter().find(|header| header.field.as_str().as_str().eq_ignore_ascii_case(name));
    let is_own = |host: &str| ["127.0.0.1", "localhost"].iter().any(|name| host == format!("{name}:{port}"));
    let refuse = |status: u16, words: &str| with_headers(Response::from_string(words).with_status_code(status));
    // A name of another's that leads here would make this page one of theirs.
    if !header("Host").is_some_and(|host| is_own(host.value.as_str())) {
        return refuse(421, "This address is for 127.0.0.1 alone.\n");
    }
    if !matches!(request.method(), Method::Get | Method::Head) {
        return refuse(405, "There is nothing but files here.\n");
    }
    let path = request.url().split(['?', '#']).next().unwrap_or_default();
    let name = if path == "/" { "index.html" } else { path.trim_start_matches('/') };
    let Some((_, packed)) = FILES.iter().find(|(file, _)| *file == name) else {
        return refuse(404, "There is no such file.\n");
    };
    let takes_gzip = header("Accept-Encoding").is_some_and(|header| header.value.as_str().contains("gzip"));
    let mut response = if takes_gzip {
        Response::from_data(*packed).with_header(written("Content-Encoding", "gzip"))
    } else {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut GzDecoder::new(*packed), &mut bytes)
            .expect("it was packed when this was built");
        Response::from_data(bytes)
    };
    response.add_header(written("Content-Type", content_type(name)));
    response.add_header(written("Vary", "Accept-Encoding"));
    with_headers(response)
}

fn with_headers(mut response: Response<std::io::Cursor<Vec<u8>>>) -> Response<std::io::Cursor<Vec<u8>>> {
    HEADERS.iter().for_each(|(name, value)| response.add_header(written(name, value)));
    response
}

fn written(name: &str, value: &str) -> Header {
    Header::from_bytes(name, value).expect("names and values are plain text")
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

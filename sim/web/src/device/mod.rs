//! A controller at a serial port that the page has opened. The protocol is the library's own: it waits for its line as it does on a desktop,
//! while the worker that it runs in goes on.
#![expect(deprecated, reason = "wasm-bindgen marks all that waits for promises as one that may still change")]

mod memory;
mod port;
mod request;

use std::path::Path;
use std::time::Duration;

use rotorlead::settings::{MOTORS, PulseProtocol};
use rotorlead::throttle::Throttle;
use rotorlead_device::{
    Applied, DEFAULT_BAUD, Header, Keeper, Said, Session, apply, compensator_settings, entries, fault_lines,
    info_lines, save_chosen, stop_frame,
};
use rotorlead_plant::CompensatorDesign;
use rotorlead_records::files::TextFile;
use rotorlead_tune::{COMPENSATOR_FILE, Operator, Tuning, is_yes};
use serde_json::{Map, Value, json};
use wasm_bindgen::prelude::*;

use crate::fault::Fault;
use crate::said;
use memory::MotorInMemory;
use port::{SerialLine, say, typed_answer};
use request::Request;

/// A controller at the line of its worker.
#[wasm_bindgen]
pub struct Device(Session);

#[wasm_bindgen]
impl Device {
    /// A conversation with the controller at a port that messages call `name`; an answer is waited for as long as `limit_s`.
    #[wasm_bindgen(constructor)]
    #[must_use]
    pub fn new(name: &str, limit_s: f64) -> Self {
        Self(Session::new(Box::new(SerialLine), name, Duration::from_secs_f64(limit_s.clamp(0.1, 100.0))))
    }

    /// Answers a question; others wait until it is answered.
    #[wasm_bindgen(jspi)]
    pub fn ask(&mut self, request: &str) -> String {
        said(parse(request).and_then(|request| answer(&mut self.0, request)))
    }
}

/// What the page has to know before it speaks to a controller.
#[wasm_bindgen]
#[must_use]
pub fn facts() -> String {
    let protocols = PulseProtocol::ALL.map(PulseProtocol::name);
    json!({ "baud": DEFAULT_BAUD, "motors": MOTORS, "protocols": protocols, "stop": stop_frame() }).to_string()
}

fn parse(request: &str) -> Result<Request, Fault> {
    serde_json::from_str(request).map_err(|error| Fault::new(format!("no question: {error}"), "load the page again"))
}

fn answer(session: &mut Session, request: Request) -> Result<Value, Fault> {
    let answer = match request {
        Request::Info => info(session),
        Request::Faults => session.faults().map(|faults| json!({ "lines": fault_lines(&faults), "faults": faults })),
        Request::Get => session.settings().map(|settings| {
            let entries = entries(&settings).into_iter().map(|(name, value)| (name, Value::String(value)));
            json!({ "settings": entries.collect::<Map<_, _>>() })
        }),
        Request::Set { compensator, motor, pairs } => return set(session, compensator, motor, pairs),
        Request::Save => save_chosen(session).map(|()| json!({ "saved": true })),
        Request::Stop => session.stop_excitation().map(|()| json!({ "stopping": true })),
        Request::Tune(form) => {
            let Tuning { summary, warnings, json } = form.options()?.tune(session, &mut Page)?;
            return Ok(json!({ "summary": summary, "warnings": warnings, "tuned": json }));
        }
    };
    answer.map_err(|error| miette::Report::from(error).into())
}

fn info(session: &mut Session) -> Result<Value, rotorlead_device::DeviceError> {
    let info = session.info()?;
    let line = |said: Said| match said {
        Said::Fact(text) => json!({ "text": text, "is_warning": false }),
        Said::Warning(text) => json!({ "text": text, "is_warning": true }),
    };
    let level = |bits: i32| (bits >= 0).then(|| Throttle::from_bits(bits).to_f64());
    let motors: Vec<Value> = info
        .motors
        .iter()
        .zip(&info.paths)
        .map(|(state, path)| {
            json!({
                "state": format!("{state:?}"),
                "input": level(path.command),
                "input_hz": path.input_hz,
                "compensates": path.compensates,
                "output": level(path.output),
                "output_hz": path.output_hz,
            })
        })
        .collect();
    let lines: Vec<Value> = info_lines(&info).into_iter().map(line).collect();
    Ok(json!({ "lines": lines, "motors": motors, "info": info }))
}

/// As `rotorlead device set --compensator`.
fn set(
    session: &mut Session,
    compensator: Option<String>,
    motor: Option<u8>,
    pairs: Vec<(String, String)>,
) -> Result<Value, Fault> {
    let mut changes = match compensator {
        Some(text) => {
            let file = TextFile::from_bytes(Path::new(COMPENSATOR_FILE), text.into_bytes())?;
            let design = CompensatorDesign::parse(file)?;
            compensator_settings(&design, COMPENSATOR_FILE, motor).map_err(miette::Report::from)?
        }
        None => Vec::new(),
    };
    let typed: Vec<String> = pairs.iter().map(|(key, value)| format!("{key} {value}")).collect();
    changes.extend(pairs);
    let Applied { warnings, .. } = apply(session, &changes, &typed.join(" ")).map_err(miette::Report::from)?;
    let set: Map<String, Value> = changes.into_iter().map(|(key, value)| (key, Value::String(value))).collect();
    Ok(json!({ "set": set, "warnings": warnings }))
}

/// Whoever is at the page.
struct Page;

impl Operator for Page {
    fn announce(&mut self, what: &str) {
        say(&json!({ "announced": what }));
    }

    fn propose(&mut self, summary: &str) {
        say(&json!({ "proposed": summary }));
    }

    fn is_confirmed(&mut self, question: &str) -> bool {
        is_yes(&typed_answer(question))
    }

    fn prepare(&mut self) -> miette::Result<String> {
        Ok("files of this page".to_owned())
    }

    fn keeper(&mut self, motor: u8, header: Header) -> miette::Result<Box<dyn Keeper>> {
        say(&json!({ "turning": true }));
        Ok(Box::new(MotorInMemory::new(motor, header)))
    }

    fn playing(&self, motor: u8, nominal: f64, rows: usize, total: usize) {
        say(&json!({ "motor": motor, "nominal": nominal, "rows": rows, "total": total }));
    }

    fn at_rest(&mut self) {
        say(&json!({ "turning": false }));
    }
}

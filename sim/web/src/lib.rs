//! The host side in a browser: logs that a page was given, and what the command line says of them. Nothing here knows a disk, and
//! nothing leaves the page.
//!
//! A page makes a [`Motor`] of the logs of one motor and asks it. Questions and answers are JSON, as `request.rs` and
//! `motor.rs` have them; both go through [`rotorlead_results`], so that the numbers are those of the command line.

mod choices;
pub mod device;
mod fault;
mod fleet;
mod motor;
mod page;
mod request;

use std::panic;

use serde_json::Value;
use wasm_bindgen::prelude::*;

use fault::Fault;
use request::Request;

/// One motor: its logs, and what was made of them.
#[wasm_bindgen]
pub struct Motor(motor::Motor);

#[wasm_bindgen]
impl Motor {
    /// A motor without a log.
    #[wasm_bindgen(constructor)]
    #[must_use]
    #[allow(clippy::new_without_default)] // It is JavaScript's `new Motor()`.
    pub fn new() -> Self {
        Self(motor::Motor::default())
    }

    /// Gives it a log, or a file of an experiment's folder.
    pub fn add(&mut self, name: String, bytes: Vec<u8>) {
        self.0.add(name, bytes);
    }

    /// Answers a question. `watch` is called with what is done now, and with how many steps of it are done.
    pub fn ask(&mut self, request: &str, watch: &js_sys::Function) -> String {
        let watch = |stage: &str, steps: u32| {
            // A page that fails to show how far it is has its answer all the same.
            let _ = watch.call2(&JsValue::NULL, &stage.into(), &steps.into());
        };
        said(Request::parse(request).and_then(|request| self.0.ask(&request, &watch)))
    }
}

/// What the questions may be answered with: excitations, units, formats, programs to export for.
#[wasm_bindgen]
#[must_use]
pub fn choices() -> String {
    choices::choices().to_string()
}

/// Motors side by side: a list of `{"motor", "model"}`, each model the text of its file.
#[wasm_bindgen]
#[must_use]
pub fn fleet(motors: &str) -> String {
    said(fleet::compare(motors))
}

/// Has a panic's message in the browser's console, where a trap alone says nothing.
#[wasm_bindgen(start)]
pub fn start() {
    panic::set_hook(Box::new(|panic| error(&panic.to_string())));
}

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console)]
    fn error(message: &str);
}

fn said(answer: Result<Value, Fault>) -> String {
    answer.unwrap_or_else(|fault| fault.json()).to_string()
}

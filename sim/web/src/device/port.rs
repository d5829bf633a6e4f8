//! The line to the controller, and the page: what JavaScript has, called as if it were at hand. WebAssembly waits for the promises meanwhile.
#![expect(deprecated, reason = "wasm-bindgen marks all that waits for promises as one that may still change")]

use std::io::{Error, ErrorKind, Read, Result, Write};

use js_sys::Uint8Array;
use rotorlead_device::{READ_LIMIT, WRITE_LIMIT};
use wasm_bindgen::prelude::*;

#[wasm_bindgen(raw_module = "./device-host.js")]
extern "C" {
    /// Bytes that have come, `most` of them or fewer; none where none come within the limit. Throws where the line is cut or broken.
    #[wasm_bindgen(catch, suspending)]
    fn read(most: u32, limit_ms: u32) -> std::result::Result<Uint8Array, JsValue>;

    /// Sends bytes; throws where the other end does not take them within the limit, or the line is cut or broken.
    #[wasm_bindgen(catch, suspending)]
    fn write(bytes: Uint8Array, limit_ms: u32) -> std::result::Result<(), JsValue>;

    /// What somebody types in answer to a question; throws where nobody does.
    #[wasm_bindgen(catch, suspending)]
    fn ask(question: &str) -> std::result::Result<String, JsValue>;

    /// Says something to the page, as JSON.
    #[wasm_bindgen]
    fn tell(what: &str);
}

/// The serial port that the page has opened.
pub struct SerialLine;

impl Read for SerialLine {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let bytes = read(buffer.len() as u32, READ_LIMIT.as_millis() as u32).map_err(|error| broken(&error))?;
        let length = bytes.length() as usize;
        if length == 0 {
            return Err(ErrorKind::TimedOut.into());
        }
        bytes.copy_to(&mut buffer[..length]);
        Ok(length)
    }
}

impl Write for SerialLine {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        write(Uint8Array::from(bytes), WRITE_LIMIT.as_millis() as u32).map_err(|error| broken(&error))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

fn broken(error: &JsValue) -> Error {
    let message = error.dyn_ref::<js_sys::Error>().map(|error| String::from(error.message()));
    Error::other(message.unwrap_or_else(|| format!("{error:?}")))
}

/// Asks whoever is at the page, and gives what they typed; nothing where nobody did.
pub fn typed_answer(question: &str) -> String {
    ask(question).unwrap_or_default()
}

/// Says something to the page.
pub fn say(what: &serde_json::Value) {
    tell(&what.to_string());
}

//! QEMU's monitor (QMP).

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;

use serde_json::{Value, json};

/// The connection.
pub struct Monitor(BufReader<TcpStream>);

impl Monitor {
    pub(super) fn new(stream: TcpStream) -> Self {
        let mut monitor = Self(BufReader::new(stream));
        assert!(monitor.line().get("QMP").is_some(), "QEMU greets");
        monitor.execute("qmp_capabilities", Value::Null);
        monitor
    }

    /// The reset of the whole machine, as by its reset pin: RAM keeps what it holds.
    pub fn reset(&mut self) {
        self.execute("system_reset", Value::Null);
    }

    /// The emulated time stands still.
    pub fn stop(&mut self) {
        self.execute("stop", Value::Null);
    }

    /// The emulated time goes on.
    pub fn go_on(&mut self) {
        self.execute("cont", Value::Null);
    }

    /// A word of the controller's memory, or a register's.
    ///
    /// # Panics
    /// When there is none.
    pub fn word(&mut self, address: u32) -> u32 {
        let said = self.execute("human-monitor-command", json!({ "command-line": format!("xp /1wx {address:#x}") }));
        let word = said.as_str().and_then(|text| text.split_once("0x")).map(|(_, word)| word.trim());
        word.and_then(|word| u32::from_str_radix(word, 16).ok()).unwrap_or_else(|| panic!("{address:#x}: {said}"))
    }

    /// Host and port at which QEMU listens for a connection to a line.
    ///
    /// # Panics
    /// When it does not.
    pub fn listening_address(&mut self, line: &str) -> String {
        let lines = self.execute("query-chardev", Value::Null);
        let of_line = lines.as_array().and_then(|all| all.iter().find(|one| one["label"] == line));
        // As in `disconnected:tcp:127.0.0.1:45678,server=on`.
        let name = of_line.and_then(|one| one["filename"].as_str());
        let address = name.and_then(|name| name.split_once("tcp:")).and_then(|(_, rest)| rest.split_once(','));
        address.map(|(address, _)| address.to_owned()).unwrap_or_else(|| panic!("{line}: {lines}"))
    }

    fn execute(&mut self, command: &str, arguments: Value) -> Value {
        let mut request = json!({ "execute": command });
        if !arguments.is_null() {
            request["arguments"] = arguments;
        }
        writeln!(self.0.get_mut(), "{request}").expect("the emulator runs");
        loop {
            let mut line = self.line();
            if let Some(error) = line.get("error") {
                panic!("{command}: {error}");
            }
            // Events come between.
            if let Some(answer) = line.get_mut("return") {
                return answer.take();
            }
        }
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.0.read_line(&mut line).expect("QEMU answers");
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"))
    }
}

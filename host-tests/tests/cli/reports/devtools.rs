//! The Chrome DevTools Protocol over a pipe: JSON messages, each ended by a zero, on two descriptors of the browser's.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Longest wait for one answer, and for the end of the browser.
const PATIENCE: Duration = Duration::from_secs(60);
const END_WITHIN: Duration = Duration::from_secs(10);

/// A browser, and what it said. It ends with its value.
pub struct Pipe {
    process: Child,
    commands: ChildStdin,
    messages: Receiver<Value>,
    last: u64,
    events: Vec<Value>,
}

impl Pipe {
    /// Starts the program. It reads commands from descriptor 3 and answers on 4, which only a shell can hand over without unsafe
    /// code; the shell makes way for it.
    pub fn start<'a>(program: &str, arguments: impl Iterator<Item = &'a str>) -> Self {
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null", program, "--remote-debugging-pipe"])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let commands = process.stdin.take().unwrap();
        let answers = BufReader::new(process.stdout.take().unwrap());
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            for message in answers.split(0).map_while(Result::ok) {
                let message = serde_json::from_slice(&message).unwrap();
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        Self { process, commands, messages, last: 0, events: Vec::new() }
    }

    /// Calls a method, of one page's session or of the browser, and gives its result.
    ///
    /// # Panics
    /// Where the browser refuses it or does not answer.
    pub fn call(&mut self, session: Option<&str>, method: &str, parameters: &Value) -> Value {
        self.try_call(session, method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// As [`Self::call`], with the browser's refusal as an error.
    ///
    /// # Panics
    /// Where the browser does not answer.
    pub fn try_call(&mut self, session: Option<&str>, method: &str, parameters: &Value) -> Result<Value, Value> {
        self.last += 1;
        let mut command = json!({ "id": self.last, "method": method, "params": parameters });
        if let Some(session) = session {
            command["sessionId"] = session.into();
        }
        let sent = self.commands.write_all(format!("{command}\0").as_bytes());
        sent.unwrap_or_else(|error| panic!("{method}: the browser is gone: {error}"));
        let start = Instant::now();
        loop {
            let message = self.messages.recv_timeout(PATIENCE.saturating_sub(start.elapsed()));
            let mut message = message.unwrap_or_else(|error| panic!("{method}: the browser does not answer: {error}"));
            if message["id"] == self.last {
                let error = message["error"].take();
                return if error.is_null() { Ok(message["result"].take()) } else { Err(error) };
            }
            self.events.push(message);
        }
    }

    /// Every event up to the last answer.
    pub fn events(&self) -> &[Value] {
        &self.events
    }
}

impl Drop for Pipe {
    fn drop(&mut self) {
        // So that its helpers end too. What it answers is not awaited.
        let _ = write!(self.commands, "{}\0", json!({ "id": 0, "method": "Browser.close" }));
        let start = Instant::now();
        while matches!(self.process.try_wait(), Ok(None)) && start.elapsed() < END_WITHIN {
            std::thread::sleep(Duration::from_millis(20));
        }
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

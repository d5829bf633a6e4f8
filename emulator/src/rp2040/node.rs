//! rp2040js: a script that node executes, with runs on its input and their traces on its output.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde::{Deserialize, Serialize};

use super::{Drive, Error, Flash, Question, Run, Trace};

/// npm's package that has the emulator. Its inside is used, so the version is exact.
pub const NPM_PACKAGE: &str = "rp2040js";
/// The version of that package.
pub const VERSION: &str = "1.4.1";
/// Debian's package that has node.
pub const NODE_PACKAGE: &str = "nodejs";
/// First major version of node that the emulator runs in.
pub const OLDEST_NODE: u32 = 18;

const PROGRAM: &str = "node";
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/rp2040js/run.mjs");

/// Where `cargo xtask setup` installs the emulator: in cargo's target folder.
#[must_use]
pub fn package_folder() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate is a folder of the workspace");
    root.join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into())).join(NPM_PACKAGE)
}

/// Major version of the node that is installed; `None` where none runs.
#[must_use]
pub fn node_version() -> Option<u32> {
    let output = Command::new(PROGRAM).arg("--version").stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    String::from_utf8_lossy(&output.stdout).strip_prefix('v')?.split('.').next()?.parse().ok()
}

/// Whether a folder has the emulator in its version.
#[must_use]
pub fn is_installed(folder: &Path) -> bool {
    let description = std::fs::read(folder.join("node_modules").join(NPM_PACKAGE).join("package.json"));
    let description = description.ok().and_then(|text| serde_json::from_slice::<serde_json::Value>(&text).ok());
    description.is_some_and(|description| description["version"] == VERSION)
}

/// A run as the script takes it.
#[derive(Serialize)]
struct Request<'a> {
    flash: &'a [Flash],
    #[serde(flatten)]
    run: &'a Run,
}

/// What the script prints in a line.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Question(Question),
    Trace(Box<Trace>),
}

pub(super) fn run(run: &Run, flash: &[Flash]) -> Result<Trace, Error> {
    Node::installed()?.run(run, flash, |_| Vec::new())
}

/// A process of node with the script.
#[derive(Debug)]
pub(super) struct Node {
    child: Child,
    /// `None` once the script has been left alone.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Node {
    pub(super) fn installed() -> Result<Self, Error> {
        Self::start(PROGRAM, &package_folder())
    }

    fn start(program: &str, folder: &Path) -> Result<Self, Error> {
        if !is_installed(folder) {
            return Err(Error::NotInstalled(format!("{NPM_PACKAGE} {VERSION} is not in {}", folder.display())));
        }
        let mut command = Command::new(program);
        command.arg(SCRIPT).arg(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|error| match error.kind() {
            ErrorKind::NotFound => Error::NotInstalled(format!("there is no {program}")),
            _ => Error::Node(error.to_string()),
        })?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::Node(format!("{program} has no pipes")));
        };
        Ok(Self { child, input: Some(input), output: BufReader::new(output) })
    }

    /// A run behind those before; `answer` is asked what a responder without answers does.
    pub(super) fn run(
        &mut self,
        run: &Run,
        flash: &[Flash],
        mut answer: impl FnMut(&Question) -> Vec<Drive>,
    ) -> Result<Trace, Error> {
        self.send(&Request { flash, run })?;
        loop {
            match self.receive()? {
                Line::Trace(trace) => return Ok(*trace),
                Line::Question(question) => self.send(&answer(&question))?,
            }
        }
    }

    fn send(&mut self, value: &impl Serialize) -> Result<(), Error> {
        let mut line = serde_json::to_vec(value).map_err(|error| Error::Node(error.to_string()))?;
        line.push(b'\n');
        let written = self.input.as_mut().is_some_and(|input| input.write_all(&line).is_ok());
        if written { Ok(()) } else { Err(self.end()) }
    }

    fn receive(&mut self) -> Result<Line, Error> {
        let mut line = String::new();
        match self.output.read_line(&mut line) {
            Ok(length) if length > 0 => {
                serde_json::from_str(&line).map_err(|error| Error::Node(format!("its trace: {error}")))
            }
            _ => Err(self.end()),
        }
    }

    /// Why the script has ended early, which it says on its other output.
    fn end(&mut self) -> Error {
        self.input = None;
        let mut said = String::new();
        // What it does not say is not known.
        let _ = self.child.stderr.take().map(|mut output| output.read_to_string(&mut said));
        match self.child.wait() {
            Ok(status) => Error::Node(format!("it ended with {status}: {}", said.trim())),
            Err(error) => Error::Node(error.to_string()),
        }
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rp2040::{
        Analog, Bytes, Conflict, Drive, Edge, Fault, Handler, Plug, PlugEvent, PowerCut, Region, Release, Reset,
        Responder, Write,
    };

    #[test]
    fn a_missing_package_names_its_remedy() {
        let error = Node::start(PROGRAM, Path::new("nowhere")).unwrap_err();
        assert_eq!(error.to_string(), "rp2040js 1.4.1 is not in nowhere; `cargo xtask setup` installs it");
    }

    /// What `look` finds of a folder that seems to have the package in a version.
    fn with_package<T>(version: &str, look: impl FnOnce(&Path) -> T) -> T {
        let folder = std::env::temp_dir().join(format!("{NPM_PACKAGE}-{version}-{}", std::process::id()));
        let package = folder.join("node_modules").join(NPM_PACKAGE);
        std::fs::create_dir_all(&package).unwrap();
        std::fs::write(package.join("package.json"), format!("{{\"version\": \"{version}\"}}")).unwrap();
        let found = look(&folder);
        std::fs::remove_dir_all(&folder).unwrap();
        found
    }

    #[test]
    fn a_missing_node_names_its_remedy() {
        let error = with_package(VERSION, |folder| Node::start("no-such-node", folder).unwrap_err());
        assert_eq!(error.to_string(), "there is no no-such-node; `cargo xtask setup` installs it");
    }

    #[test]
    fn another_version_is_not_the_emulator() {
        assert!(!with_package("1.3.0", is_installed));
    }

    #[test]
    fn the_script_gets_flat_names() {
        let mut run = Run::new("image", 9);
        run.inputs = vec![Edge { cycle: 1, pin: 2, is_high: true }];
        run.analog = vec![Analog { cycle: 23, input: 24, count: 25 }];
        run.releases = vec![Release { cycle: 18, pin: 19 }];
        let answers = vec![vec![Drive { after: 20, level: None }]];
        run.responders = vec![
            Responder { pin: 21, falls: 22, answers: Some(answers) },
            Responder { pin: 29, falls: 30, answers: None },
        ];
        run.uart_in = vec![Bytes { cycle: 3, bytes: vec![4] }];
        run.usb_in = vec![Bytes { cycle: 26, bytes: vec![27] }];
        run.plug = vec![Plug { cycle: 28, what: PlugEvent::PluggedIntoNoisyHub }];
        run.writes = vec![Write { cycle: 5, address: 6, value: 7 }];
        run.watch = vec![8];
        run.handlers_from = 17;
        run.memory = vec![Region { address: 10, length: 11 }];
        run.is_debugged = true;
        run.power_cut = Some(PowerCut { operation: 12, bytes: 13 });
        let flash = [Flash { offset: 14, bytes: vec![15, 16] }];
        let expected = serde_json::json!({
            "flash": [{ "offset": 14, "bytes": [15, 16] }],
            "inputs": [{ "cycle": 1, "pin": 2, "is_high": true }],
            "analog": [{ "cycle": 23, "input": 24, "count": 25 }],
            "releases": [{ "cycle": 18, "pin": 19 }],
            "responders": [
                { "pin": 21, "falls": 22, "answers": [[{ "after": 20, "level": null }]] },
                { "pin": 29, "falls": 30, "answers": null },
            ],
            "uart_in": [{ "cycle": 3, "bytes": [4] }],
            "usb_in": [{ "cycle": 26, "bytes": [27] }],
            "plug": [{ "cycle": 28, "what": "plugged_into_noisy_hub" }],
            "writes": [{ "cycle": 5, "address": 6, "value": 7 }],
            "watch": [8],
            "handlers_from": 17,
            "memory": [{ "address": 10, "length": 11 }],
            "is_debugged": true,
            "power_cut": { "operation": 12, "bytes": 13 },
            "until_cycle": 9,
        });
        assert_eq!(serde_json::to_value(Request { flash: &flash, run: &run }).unwrap(), expected);
    }

    #[test]
    fn a_trace_is_read_from_what_the_script_prints() {
        let text = r#"{"trace": {"cycles": 100, "edges": [{"cycle": 1, "pin": 2, "is_high": true}],
            "conflicts": [{"cycle": 14, "pin": 15}], "uart": [3], "usb": [16], "usb_set_ups": [17], "boot_loader": null,
            "resets": [{"cycle": 4, "is_forced": false}], "faults": [{"cycle": 5, "pc": 6, "what": "BKPT"}],
            "handlers": [{"exception": 15, "first_cycle": 10, "calls": 11, "total_cycles": 12, "most_cycles": 13}],
            "memory": [[7, 8], []], "flash_operations": 2, "power_is_cut": false, "unmodelled": ["UART0"]}}"#;
        let expected = Trace {
            cycles: 100,
            edges: vec![Edge { cycle: 1, pin: 2, is_high: true }],
            conflicts: vec![Conflict { cycle: 14, pin: 15 }],
            uart: vec![3],
            usb: vec![16],
            usb_set_ups: vec![17],
            boot_loader: None,
            resets: vec![Reset { cycle: 4, is_forced: false }],
            faults: vec![Fault { cycle: 5, pc: 6, what: "BKPT".to_owned() }],
            handlers: vec![Handler { exception: 15, first_cycle: 10, calls: 11, total_cycles: 12, most_cycles: 13 }],
            memory: vec![vec![7, 8], vec![]],
            flash_operations: 2,
            power_is_cut: false,
            unmodelled: vec!["UART0".to_owned()],
        };
        assert_eq!(serde_json::from_str::<Line>(text).unwrap(), Line::Trace(Box::new(expected)));
    }

    #[test]
    fn a_question_is_read_from_what_the_script_prints() {
        let text = r#"{"question": [{"cycle": 1, "pin": 2, "is_high": false}]}"#;
        let edges = vec![Edge { cycle: 1, pin: 2, is_high: false }];
        assert_eq!(serde_json::from_str::<Line>(text).unwrap(), Line::Question(Question { edges }));
    }
}

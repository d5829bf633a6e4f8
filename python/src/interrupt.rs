//! Long computations, beside which Python goes on.

use std::panic::resume_unwind;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::{PyResult, Python};

use crate::error::raised;

/// How long Ctrl-C may have to wait for an answer.
const CHECK: Duration = Duration::from_millis(50);

/// Does `work` on a thread of its own, without the interpreter's lock. Ctrl-C raises `KeyboardInterrupt` at once; the work has
/// nothing that ends it early, and goes on unseen until it is done or Python ends.
pub fn run<T: Send + 'static>(py: Python, work: impl FnOnce() -> miette::Result<T> + Send + 'static) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let worker = thread::spawn(move || {
        // Nobody may wait for it any more.
        let _ = sender.send(work());
    });
    loop {
        let (received, waiting) = py.detach(move || (receiver.recv_timeout(CHECK), receiver));
        receiver = waiting;
        match received {
            Ok(result) => return result.map_err(|report| raised(&report)),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                let panic = worker.join().expect_err("it ended without a result");
                resume_unwind(panic);
            }
        }
    }
}

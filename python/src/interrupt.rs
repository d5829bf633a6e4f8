//! Long computations, beside which Python goes on.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use miette::IntoDiagnostic as _;
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::{PyErr, PyResult, Python};
use rayon::ThreadPoolBuilder;

use crate::error::raised;

/// How long Ctrl-C may have to wait for an answer.
const CHECK: Duration = Duration::from_millis(50);

/// Does `work` on a thread of its own, without the interpreter's lock. Ctrl-C raises `KeyboardInterrupt` at once; the work has
/// nothing that ends it early, and goes on unseen until it is done or Python ends.
pub fn run<T: Send + 'static>(py: Python, work: impl FnOnce() -> miette::Result<T> + Send + 'static) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let reported = move || {
        // Nobody may wait for it any more.
        let _ = sender.send(catch_unwind(AssertUnwindSafe(|| in_pool(work))));
    };
    thread::Builder::new()
        .spawn(reported)
        .map_err(|error| PyOSError::new_err(format!("no thread can be started for the computation: {error}")))?;
    loop {
        let (received, waiting) = py.detach(move || (receiver.recv_timeout(CHECK), receiver));
        receiver = waiting;
        match received {
            Ok(Ok(result)) => return result.map_err(|report| raised(&report)),
            Ok(Err(panic)) => return Err(broken(&*panic)),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => return Err(broken(&"it ended without a result")),
        }
    }
}

/// Does `work` with threads that end with it. Those of a pool for the whole process are not there in a child that `multiprocessing`
/// forks, which would wait for them for ever.
fn in_pool<T: Send>(work: impl FnOnce() -> miette::Result<T> + Send) -> miette::Result<T> {
    let alone = || ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    ThreadPoolBuilder::new().build().or_else(|_| alone()).into_diagnostic()?.install(work)
}

/// The exception of a panic. It is none of those that `except Exception` lets pass.
fn broken(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    PyRuntimeError::new_err(format!(
        "{}: this is an error of rotorlead, which should be reported with what was given",
        text.unwrap_or("a panic without a message")
    ))
}

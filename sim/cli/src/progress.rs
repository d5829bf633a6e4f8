//! A bar, or a spinner, on standard error for anything that may take more than a second. Nothing is drawn where that is
//! no terminal.

use std::fmt::Write;
use std::io::{IsTerminal as _, stderr};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use rotorlead_records::files::bytes_read;

/// How often what is drawn changes.
const TICK: Duration = Duration::from_millis(200);
/// How long work goes on before anything is drawn: what is done by then would only flash up.
const SHORT: Duration = Duration::from_millis(400);

/// Whether nothing is drawn on a terminal either.
static IS_HIDDEN: AtomicBool = AtomicBool::new(false);

/// Draws nothing from now on.
pub fn hide() {
    IS_HIDDEN.store(true, Ordering::Relaxed);
}

/// Whether there is anybody to draw for.
fn is_seen() -> bool {
    !IS_HIDDEN.load(Ordering::Relaxed) && stderr().is_terminal()
}

/// What is left to do, once something is done that tells how fast it goes.
fn left(state: &ProgressState, to: &mut dyn Write) {
    if state.pos() > 0 {
        let _ = write!(to, "about {:#} left", HumanDuration(state.eta()));
    }
}

/// A sign of life for work whose steps are not counted, that says `what` and for how long.
pub fn spinner(what: &'static str) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{spinner} {msg} {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    start(ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()).with_style(style), what)
}

/// A bar of `steps` steps, that says `what`.
pub fn bar(what: &'static str, steps: u64) -> ProgressBar {
    start(step_bar(steps, "{msg} {wide_bar} {pos}/{len} {left}"), what)
}

/// A bar for work whose number of steps depends on what comes out, with about so many. Each is reported by [`step`].
pub fn estimate(what: &'static str, steps: u64) -> ProgressBar {
    start(step_bar(steps, "{msg} {wide_bar} {left}"), what)
}

fn step_bar(steps: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let style = style.with_key("left", left);
    ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden()).with_style(style)
}

/// One more step of [`estimate`]. Where there are more than was thought, a quarter is left to do.
pub fn step(bar: &ProgressBar) {
    bar.inc(1);
    leave_a_quarter(bar);
}

fn leave_a_quarter(bar: &ProgressBar) {
    if 5 * bar.position() > 4 * bar.length().unwrap_or_default() {
        bar.set_length(bar.position() + bar.position().div_ceil(4));
    }
}

/// Does `work` that first reads the CSV files in `folders` and then computes from them, with a bar of bytes. What is read is known;
/// what follows is taken to go on at the pace of the reading, for at least a quarter as long.
pub fn over_files<T>(what: &'static str, folders: &[&Path], work: impl FnOnce() -> T) -> T {
    let bytes = folders.iter().map(|folder| csv_bytes(folder)).sum::<u64>().max(1);
    let bar = estimate(what, bytes + bytes / 4);
    if !is_seen() {
        return work();
    }
    let (start, before) = (Instant::now(), bytes_read());
    let is_done = AtomicBool::new(false);
    thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            let mut reading = None;
            while !is_done.load(Ordering::Relaxed) {
                let read = bytes_read() - before;
                if read >= bytes {
                    let pace = reading.get_or_insert_with(|| start.elapsed()).as_secs_f64();
                    bar.set_position((bytes as f64 * start.elapsed().as_secs_f64() / pace.max(1e-3)) as u64);
                } else {
                    bar.set_position(read);
                }
                leave_a_quarter(&bar);
                thread::park_timeout(TICK);
            }
        });
        // Also when the work panics: a scope waits for its threads.
        let end = Ended { is_done: &is_done, watcher: watcher.thread().clone() };
        let result = work();
        drop(end);
        bar.finish_and_clear();
        result
    })
}

/// Ends the thread that watches, when it is dropped.
struct Ended<'a> {
    is_done: &'a AtomicBool,
    watcher: thread::Thread,
}

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.is_done.store(true, Ordering::Relaxed);
        self.watcher.unpark();
    }
}

/// Bytes of the CSV files in a folder; zero where it cannot be read, of which the work itself complains.
fn csv_bytes(folder: &Path) -> u64 {
    let Ok(entries) = folder.read_dir() else { return 0 };
    let files = entries.flatten().filter(|entry| entry.path().extension().is_some_and(|end| end == "csv"));
    files.filter_map(|file| Some(file.metadata().ok()?.len())).sum()
}

fn start(bar: ProgressBar, what: &'static str) -> ProgressBar {
    bar.set_message(what);
    if is_seen() {
        let late = bar.downgrade();
        // Without this thread the work is done all the same, unseen.
        let _ = thread::Builder::new().spawn(move || {
            thread::sleep(SHORT);
            if let Some(bar) = late.upgrade().filter(|bar| !bar.is_finished()) {
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(TICK);
            }
        });
    }
    bar
}

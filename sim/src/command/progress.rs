//! A bar, or a spinner, on standard error for anything that may take more than a second. Nothing is drawn where that is
//! no terminal.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Whether nothing is drawn on a terminal either.
static IS_HIDDEN: AtomicBool = AtomicBool::new(false);

/// Draws nothing from now on.
pub fn hide() {
    IS_HIDDEN.store(true, Ordering::Relaxed);
}

fn target() -> ProgressDrawTarget {
    if IS_HIDDEN.load(Ordering::Relaxed) { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() }
}

/// A sign of life for work whose steps are not told, that says `what` and for how long.
pub fn spinner(what: &'static str) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{spinner} {msg} {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    start(ProgressBar::with_draw_target(None, target()).with_style(style), what)
}

/// A bar of `steps` steps, that says `what`.
pub fn bar(what: &'static str, steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    start(ProgressBar::with_draw_target(Some(steps), target()).with_style(style), what)
}

/// A bar for work whose number of steps depends on what comes out, with about so many. Each is told by [`step`].
pub fn estimate(what: &'static str, steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} about {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    start(ProgressBar::with_draw_target(Some(steps), target()).with_style(style), what)
}

/// One more step of [`estimate`]. Where there are more than was thought, a quarter is left to do.
pub fn step(bar: &ProgressBar) {
    bar.inc(1);
    if 5 * bar.position() > 4 * bar.length().unwrap_or_default() {
        bar.set_length(bar.position() + bar.position().div_ceil(4));
    }
}

fn start(bar: ProgressBar, what: &'static str) -> ProgressBar {
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

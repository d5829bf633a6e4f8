//! Every test there is.

use crate::run::{Result, cargo, run};
use crate::{bench, firmware, library, setup};

/// Formatting, lints, documentation, host tests, the library as another firmware takes it, and what the image for the
/// controller shows of itself.
pub fn all() -> Result {
    setup::components()?;
    setup::targets()?;
    if let Err(error) = setup::browser() {
        // The test that needs it says so too, and fails where nobody reads along.
        eprintln!("xtask: {error}\nxtask: without it reports are not opened in a browser");
    }
    run(&mut cargo(&["fmt", "--all", "--check"]))?;
    run(&mut cargo(&["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"]))?;
    run(&mut cargo(&["test", "--workspace", "--locked"]))?;
    run(cargo(&["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings"))?;
    library::check()?;
    firmware::test()?;
    bench::firmware(None)
}

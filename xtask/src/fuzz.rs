//! The fuzzers under libFuzzer, which works on folders: the stored inputs are unpacked for it.

use crate::run::{Result, command, output, root, run, target_folder};

/// Fuzzes one target: new inputs go to `fuzz/corpus/TARGET`, beside which the stored ones are read. The options are
/// libFuzzer's.
pub fn fuzz(target: &str, options: &[&str]) -> Result {
    let stored = corpus::read(target)?;
    let folder = target_folder().join("fuzz-inputs").join(target);
    corpus::unpack(&stored, &folder)?;
    let found = root().join("fuzz/corpus").join(target);
    std::fs::create_dir_all(&found).map_err(|error| format!("{}: {error}", found.display()))?;
    if output(&mut command("cargo", &["+nightly", "fuzz", "--version"])).is_none() {
        return Err(
            "the fuzzers take a nightly compiler and cargo-fuzz: `rustup toolchain install nightly` and `cargo \
                    install cargo-fuzz --locked` install them"
                .to_owned(),
        );
    }
    // Without the address sanitizer: the library forbids `unsafe`, and the fuzzers are twice as fast.
    let fuzzer = || command("cargo", &["+nightly", "fuzz", "run", "-s", "none", target]);
    let Some(options) = options.strip_prefix(&["--merge"]) else {
        return run(fuzzer().arg(found).arg(folder).arg("--").args(options));
    };
    // libFuzzer adds to the first folder what reaches new code.
    run(fuzzer().arg(&folder).arg(found).args(["--", "-merge=1"]).args(options))?;
    let merged = corpus::pack(&folder)?;
    corpus::write(target, &merged)?;
    println!("{}: {} inputs, {} of them new", target, merged.len(), merged.len() - stored.len());
    Ok(())
}

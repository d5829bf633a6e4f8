//! The blind cases: builds the tool and the judge, and lets the one judge the other.

use crate::run::{Result, cargo, release_folder, root, run};

/// Where the whole report set's page goes.
const PAGE: &str = "docs/confusion.md";

/// Runs the blind cases with these options of the judge's.
pub fn run_cases(options: &[&str]) -> Result {
    let judges = !options.contains(&"--only-ceilings");
    if judges {
        run(&mut cargo(&["build", "--release", "--package", "rotorlead-cli", "--bin", "rotorlead", "--locked"]))?;
    }
    let mut judge = cargo(&["run", "--release", "--package", "blind-cases", "--locked", "--"]);
    judge.args(options);
    if judges {
        let tool = release_folder().join(format!("rotorlead{}", std::env::consts::EXE_SUFFIX));
        judge.arg("--tool").arg(tool).arg("--page").arg(root().join(PAGE));
        if let Some(program) = described() {
            judge.args(["--program", &program]);
        }
    }
    run(&mut judge)
}

/// What git calls the tree; `None` where it is none of git's.
fn described() -> Option<String> {
    let output = std::process::Command::new("git")
        .args(["describe", "--always", "--dirty"])
        .current_dir(root())
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

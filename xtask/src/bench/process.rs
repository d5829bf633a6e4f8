//! What a run of another program costs: time by the clock, time of the processor, memory.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::run::Result;

/// How often the memory of a running program is looked at.
const LOOK: Duration = Duration::from_millis(1);
/// Ticks per second of the times in `/proc`, on every Linux of the last decades.
const TICKS_PER_S: f64 = 100.0;

/// What one run cost.
#[derive(Clone, Debug, Default)]
pub struct Cost {
    /// From its start to its end.
    pub wall_s: f64,
    /// Of all its threads, in steps of 10 ms; `None` where the system has no `/proc`.
    pub cpu_s: Option<f64>,
    /// The most memory that was resident, MiB; `None` likewise. What the last millisecond added is not seen.
    pub peak_mib: Option<f64>,
    /// What it printed.
    pub output: String,
}

/// Runs a program that prints little.
pub fn measure(command: &mut Command) -> Result<Cost> {
    let name = command.get_program().to_string_lossy().into_owned();
    let failed = |error: std::io::Error| format!("{name}: {error}");
    let cpu_before = cpu_of_children_s();
    let start = Instant::now();
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().map_err(failed)?;
    let mut peak_mib = None;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        // A program that has just ended has no memory left to show.
        peak_mib = peak_resident(child.id()).or(peak_mib);
        thread::sleep(LOOK);
    };
    let wall_s = start.elapsed().as_secs_f64();
    let cpu_s = cpu_of_children_s().zip(cpu_before).map(|(after, before)| after - before);
    let output = child.wait_with_output().map_err(failed)?.stdout;
    if !status.success() {
        return Err(format!("{name} ended with {status}"));
    }
    Ok(Cost { wall_s, cpu_s, peak_mib, output: String::from_utf8_lossy(&output).into_owned() })
}

/// `VmHWM` of a process: the most that was ever resident.
fn peak_resident(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

/// User and system time of all programs that this one has run to their ends.
fn cpu_of_children_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name before the last parenthesis may hold spaces; fields 16 and 17 of the whole are the 14th and 15th after it.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field)?.parse::<f64>().ok();
    Some((ticks(13)? + ticks(14)?) / TICKS_PER_S)
}

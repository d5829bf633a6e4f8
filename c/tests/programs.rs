//! What programs in C and C++ get is what the library gives, bit for bit, and every status can be provoked from C.
//!
//! `CC` and `CXX` in the environment name other compilers than `cc` and `c++`. One that is missing is a failure.

use std::collections::BTreeSet;
use std::ffi::CStr;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output};
use std::sync::LazyLock;

use rotorlead::compensator::{CommandRange, Compensator};
use rotorlead::design::{CurvePoint, DEFAULT_SLEW_PER_S, InverseDesign, LeadDesign, LeadParameters, ReferenceModel};
use rotorlead::throttle::Command;
use rotorlead_design::{DesignOptions, InverseOptions, design, design_inverse};
use rotorlead_export::c_header;
use rotorlead_plant::{CompensatorDesign, Lag, Model, Point};

/// Rates of the loops of flight controllers, hertz.
const LOOP_RATES_HZ: [u32; 4] = [1000, 2000, 4000, 8000];
/// That of a slow one, at which the example's lead is refused and its inverse is not.
const SLOW_RATE_HZ: u32 = 400;

/// The archive, built once, as a simulator links it: without checks for overflows, which memory that others have written to
/// may cause. In a folder of its own: cargo holds the other one's lock while it builds.
static ARCHIVE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("archive");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut build = Process::new(cargo);
    build.args(["build", "--release", "--package", "rotorlead-c", "--lib", "--locked", "--target-dir"]).arg(&folder);
    succeeds(&mut build, "cargo");
    folder.join("release/librotorlead_c.a")
});

fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// What it prints. It has to be there, and to succeed.
#[track_caller]
fn succeeds(process: &mut Process, needs: &str) -> String {
    let ended = process.output();
    let Output { status, stdout, stderr } = ended.unwrap_or_else(|error| {
        panic!("{}: {error}: this test needs {needs}; `cargo xtask setup` installs it", process.get_program().display())
    });
    assert!(status.success(), "{process:?}:\n{}", String::from_utf8_lossy(&stderr));
    String::from_utf8(stdout).unwrap()
}

/// A program in C or C++.
struct Program {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Program {
    #[track_caller]
    fn build(file: &str, standard: &str) -> Self {
        let is_c = file.ends_with(".c");
        let (variable, usual) = if is_c { ("CC", "cc") } else { ("CXX", "c++") };
        let compiler = std::env::var(variable).unwrap_or_else(|_| usual.to_owned());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("program");
        let mut build = Process::new(compiler);
        build.args(["-Wall", "-Wextra", "-Werror", "-pedantic", "-I"]).arg(source("include"));
        build.arg(format!("-std={standard}")).arg(source(file)).arg(&*ARCHIVE).args(["-lpthread", "-ldl", "-lm", "-o"]);
        succeeds(build.arg(&path), if is_c { "a C compiler" } else { "a C++ compiler" });
        Self { path, _folder: folder }
    }

    #[track_caller]
    fn run(&self, arguments: &[String]) -> String {
        succeeds(Process::new(&self.path).args(arguments), "the program")
    }
}

/// What the programs have in place of a random number.
fn scattered(number: u32) -> u32 {
    number.wrapping_mul(2_654_435_761)
}

/// `examples/lead.c` in Rust.
fn lead(loop_rate_hz: u32, slew_per_s: f64) -> Vec<u32> {
    let idle = 0.05_f32;
    let lead = LeadParameters::from_poles(&[6.2758, 9.2889, 14.1275], 628.32).unwrap();
    let design = LeadDesign::new(lead, f64::from(loop_rate_hz), None).unwrap().with_slew(slew_per_s).unwrap();
    let level = Command::saturating_from_f64(f64::from(idle));
    let mut motors = [Compensator::new(design.filter(), level, Command::ONE); 4];
    let mut outputs = Vec::new();
    for tick in 0..5000_u32 {
        for (number, motor) in motors.iter_mut().enumerate() {
            if tick < 50 || tick / 1000 == 3 {
                motor.reset(level);
                outputs.push(0.0);
                continue;
            }
            let random = scattered(tick / 100 * 4 + number as u32 + 1);
            let command = idle + (1.0 - idle) * (random >> 8) as f32 / 16_777_216.0;
            outputs.push(motor.update(Command::saturating_from_f64(f64::from(command))).to_f64() as f32);
        }
    }
    outputs.into_iter().map(f32::to_bits).collect()
}

/// `examples/inverse.cpp` in Rust.
fn inverse(loop_rate_hz: u32) -> Vec<i32> {
    let points = [(0.40, 0.1593), (0.45, 0.1360), (0.50, 0.1077), (0.55, 0.1009), (0.60, 0.0852), (0.65, 0.0708)];
    let points = points.map(|(command, tau_s)| CurvePoint { command, tau_s });
    let reference = ReferenceModel { omega_f_rad_s: 94.2, damping: 0.71 };
    let design = InverseDesign::new(reference, f64::from(loop_rate_hz), &points).unwrap();
    let range =
        CommandRange { lowest: Command::saturating_from_f64(0.35), highest: Command::saturating_from_f64(0.70) };
    let min = Command::saturating_from_f64(0.05);
    let mut motor = Compensator::new(design.filter(160.0, range).unwrap(), min, Command::ONE);
    let command =
        |tick: u32| Command::saturating_from_bits(((scattered(tick / 100 + 1) >> 4) + (1 << 27)).cast_signed());
    let tick = |tick| {
        if tick % 1500 == 0 {
            motor.set_enabled(tick / 1500 % 2 == 0);
        }
        if tick % 7000 == 6999 {
            motor.restart(command(tick));
        }
        motor.update(command(tick)).to_bits()
    };
    (0..20_000).map(tick).collect()
}

#[test]
fn a_lead_in_c_is_that_of_the_library_at_every_rate() {
    for standard in ["c99", "c11"] {
        let program = Program::build("examples/lead.c", standard);
        for rate in LOOP_RATES_HZ {
            for (given, slew_per_s) in [(None, DEFAULT_SLEW_PER_S), (Some("0"), 0.0), (Some("160"), 160.0)] {
                let arguments = [Some(rate.to_string()), given.map(str::to_owned)];
                let printed = program.run(&arguments.into_iter().flatten().collect::<Vec<_>>());
                let printed: Vec<u32> = printed.lines().map(|line| u32::from_str_radix(line, 16).unwrap()).collect();
                assert_eq!(printed, lead(rate, slew_per_s), "{standard}, {rate} Hz, {slew_per_s} per second");
            }
        }
    }
}

/// Its coefficient g0 would be more than 1/2.
#[test]
fn a_loop_that_is_too_slow_for_a_lead_is_refused_with_the_remedy() {
    let program = Program::build("examples/lead.c", "c99");
    let ended = Process::new(&program.path).arg(SLOW_RATE_HZ.to_string()).output().unwrap();
    assert!(!ended.status.success() && ended.stdout.is_empty());
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(said.starts_with("a coefficient does not fit its format") && said.contains("loop_rate_hz"), "{said}");
    let slower = LeadParameters::from_poles(&[6.2758, 9.2889, 14.1275], 470.0).unwrap();
    assert!(LeadDesign::new(slower, f64::from(SLOW_RATE_HZ), None).is_ok());
}

#[test]
fn an_inverse_in_cpp_is_that_of_the_library_at_every_rate() {
    for standard in ["c++11", "c++17"] {
        let program = Program::build("examples/inverse.cpp", standard);
        for rate in LOOP_RATES_HZ.into_iter().chain([SLOW_RATE_HZ]) {
            let printed = program.run(&[rate.to_string()]);
            let printed: Vec<i32> = printed.lines().map(|line| line.parse().unwrap()).collect();
            assert_eq!(printed, inverse(rate), "{standard}, {rate} Hz");
        }
    }
}

/// Designs what an exported header has, and prints what comes of commands in steps of 2^-29.
const EXPORTED: &str = r#"
#include <inttypes.h>
#include <stdio.h>
#include "compensator.h"
int main(void)
{
    rotorlead_compensator motor = { { 0 } };
    const rotorlead_command start = { INT32_C(1) << 28 };
    rotorlead_command output;
    if (motor_design(&motor, 0.0, 1.0) != ROTORLEAD_STATUS_OK || rotorlead_reset(&motor, start) != ROTORLEAD_STATUS_OK) {
        return 1;
    }
    for (uint32_t tick = 0; tick < 2000; tick++) {
        const rotorlead_command command = { (int32_t)(((tick / 100 + 1) * UINT32_C(2654435761) >> 4) + (UINT32_C(1) << 27)) };
        if (rotorlead_step(&motor, command, &output) != ROTORLEAD_STATUS_OK) {
            return 2;
        }
        printf("%" PRId32 "\n", output.q29);
    }
    return 0;
}
"#;

#[test]
fn an_exported_header_gives_the_compensator_that_it_was_exported_from() {
    let point = |nominal, time_constant_s| Point::new(nominal, Lag { gain: 10.0, time_constant_s, delay_s: 0.0 });
    let model = Model {
        format: 1,
        points: vec![point(0.4, 0.1593), point(0.5, 0.1077), point(0.65, 0.0708)],
        static_map: None,
        time_constant_curve: None,
        effects: Vec::new(),
        provenance: None,
    };
    let lead = design(&model, &DesignOptions { slew_per_s: Some(20.0), ..DesignOptions::default() }).unwrap();
    let inverse = design_inverse(&model, &InverseOptions::default()).unwrap().compensator;
    for compensator in [CompensatorDesign::from(lead), CompensatorDesign::from(inverse)] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("compensator.h"), c_header(&compensator)).unwrap();
        let program = folder.path().join("exported.c");
        std::fs::write(&program, EXPORTED).unwrap();
        let printed = Program::build(&program.to_string_lossy(), "c99").run(&[]);
        let mut running = compensator.running(Command::saturating_from_f64(0.5));
        let expected = (0..2000_u32).map(|tick| {
            let bits = (scattered(tick / 100 + 1) >> 4) + (1 << 27);
            let command = Command::saturating_from_f64(f64::from(bits) / f64::from(1 << 29));
            running.update(command).to_bits().to_string()
        });
        assert!(printed.lines().eq(expected), "{}", c_header(&compensator));
    }
}

#[test]
fn every_status_is_provoked_from_c() {
    let printed = Program::build("tests/errors.c", "c99").run(&[]);
    let numbers: BTreeSet<i32> = printed.lines().map(|line| line.split(' ').next().unwrap().parse().unwrap()).collect();
    // SAFETY: the function gives a constant that ends with 0.
    #[allow(unsafe_code)]
    let text = |number| unsafe { CStr::from_ptr(rotorlead_c::rotorlead_status_text(number)) }.to_str().unwrap();
    let all: BTreeSet<i32> = (0..).take_while(|number| text(*number) != "no such status").collect();
    assert_eq!(numbers, all);
    for number in [-1, i32::MIN, i32::MAX] {
        assert_eq!(text(number), "no such status");
    }
}

/// In each of the five states that the program goes through at least: the 32 bits of the seal, 6 of the filter's number, and 7 of
/// whether it is enabled. In all of them: 30 of the states' own numbers, and 7 of each of the three paths.
#[test]
fn whatever_its_memory_holds_a_step_does_no_harm() {
    let printed = Program::build("tests/broken_memory.c", "c99").run(&[]);
    assert_eq!(printed.lines().count(), 3, "{printed}");
    for line in printed.lines() {
        let refused: u32 = line.rsplit(' ').next().unwrap().parse().unwrap();
        assert!(refused >= 5 * (32 + 6 + 7) + 30 + 3 * 7, "{line}");
    }
}

#[test]
fn the_function_of_the_page_compiles() {
    let page = std::fs::read_to_string(source("../docs/c-interface.md")).unwrap();
    let blocks: Vec<&str> = page.split("```c\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert_eq!(blocks.len(), 1);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.c");
    std::fs::write(&file, format!("{}\nint main(void)\n{{\n    return 0;\n}}\n", blocks[0])).unwrap();
    Program::build(file.to_str().unwrap(), "c99");
}

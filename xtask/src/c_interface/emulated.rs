//! The archive in the emulator: its functions are called through the debugger, as C would call them.
//!
//! The emulated core is a Cortex-M4F. It executes the code for a Cortex-M7 too, which uses no FPU of double precision; where it
//! did, the core would stop.

use emulator::{Debugger, Registers};
use rotorlead::compensator::{CommandRange, Compensator};
use rotorlead::design::{
    CurvePoint, DEFAULT_DAMPING, DEFAULT_SLEW_PER_S, InverseDesign, LeadDesign, LeadParameters, ReferenceModel,
};
use rotorlead::throttle::Command;

use super::archive::{Core, functions};
use crate::bench::machine::Machine;
use crate::bench::trace::{AsEmulated, Cost, trace};
use crate::image::Image;
use crate::run::Result;

/// Rates that flight controllers have, hertz.
const LOOP_RATES_HZ: [f64; 4] = [1000.0, 2000.0, 4000.0, 8000.0];
/// Ticks that are compared at each of them.
const TICKS: u32 = 120;
/// Tick at which the filter is switched for the first time: what is usual comes before.
const SWITCHES_AT: usize = TICKS as usize / 8;
/// Ticks until the mixer's command changes.
const HOLD: u32 = 12;

const LEAD: LeadParameters =
    LeadParameters { omega_z_rad_s: 14.1275, omega_f_rad_s: 94.2156, damping: DEFAULT_DAMPING };
const REFERENCE: ReferenceModel = ReferenceModel { omega_f_rad_s: 94.2156, damping: DEFAULT_DAMPING };
const POINTS: [CurvePoint; 3] = [
    CurvePoint { command: 0.40, tau_s: 0.1593 },
    CurvePoint { command: 0.50, tau_s: 0.1077 },
    CurvePoint { command: 0.65, tau_s: 0.0708 },
];
const COMPENSATED: [f64; 2] = [0.35, 0.70];
const LIMITS: [f64; 2] = [0.05, 1.0];

/// RAM, by what lies there; the stack ends where the vector table says.
const COMPENSATOR: u32 = 0x2000_0000;
const PARAMETERS: u32 = 0x2000_0400;
const POINTS_AT: u32 = 0x2000_0600;
const OUTPUT: u32 = 0x2000_0800;
/// Where a call returns to: a branch to itself.
const BACK: u32 = 0x2000_0C00;
const STACK: u32 = 0x2001_0000;
const LINK_REGISTER: usize = 14;
const STACK_POINTER: usize = 13;
/// Switches the FPU on: the coprocessor access control register of ARMv7-M.
const CPACR: (u32, u32) = (0xE000_ED88, 0xF << 20);
/// TIM2 of the STM32F405, which counts the emulator's instructions: its clock, its switch, its count.
const TIMER_CLOCK: (u32, u32) = (0x4002_3840, 1);
const TIMER_ON: (u32, u32) = (0x4000_0000, 1);
const TIMER_COUNT: u32 = 0x4000_0024;

/// A kind of compensator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Lead,
    UnlimitedLead,
    Inverse,
}

impl Kind {
    const ALL: [Self; 3] = [Self::Lead, Self::UnlimitedLead, Self::Inverse];

    /// As the page has it.
    const fn name(self) -> &'static str {
        match self {
            Self::Lead => "lead",
            Self::UnlimitedLead => "lead without a slew limit",
            Self::Inverse => "inverse",
        }
    }

    const fn slew_per_s(self) -> f64 {
        match self {
            Self::Lead => DEFAULT_SLEW_PER_S,
            Self::UnlimitedLead => 0.0,
            Self::Inverse => 160.0,
        }
    }
}

/// Runs every kind at each rate, and gives the rows of the page's tables. An error where an output is not the library's.
pub fn measure(core: &Core) -> Result<Vec<String>> {
    let linked = core.link(&core.build(&[])?, &functions()?)?;
    let mut machine = Machine::start(&linked.path)?;
    let mut bench = Bench { debugger: &mut machine.debugger, image: &linked.image };
    bench.set_up()?;
    let mut rows = Vec::new();
    for kind in Kind::ALL {
        let mut designs = Vec::new();
        for rate_hz in LOOP_RATES_HZ {
            // In thousands, rounded up.
            designs.push(bench.design(kind, rate_hz)?.div_ceil(1000));
            for step in Step::ALL {
                bench.run(kind, step, rate_hz, &mut |bench| bench.returned().map(drop))?;
            }
        }
        rows.push(row(&format!("design of the {}", kind.name()), core, &designs));
        // The instructions of a tick do not depend on the rate, which is that of the last design.
        for step in Step::ALL {
            let mut costs: Vec<Cost> = Vec::new();
            bench.run(kind, step, LOOP_RATES_HZ[3], &mut |bench| {
                costs.push(trace(bench.debugger, bench.image, &[BACK], &mut AsEmulated)?);
                Ok(())
            })?;
            let most = costs.iter().copied().max_by_key(|cost| cost.instructions).ok_or("nothing was measured")?;
            let mut usual: Vec<u32> = costs.iter().take(SWITCHES_AT).map(|cost| cost.instructions).collect();
            usual.sort_unstable();
            let of_a_second_us = LOOP_RATES_HZ.map(|rate_hz| most.cycles * rate_hz as u32 / core.clock_mhz);
            let counts = [usual[usual.len() / 2], most.instructions, most.cycles];
            let what = format!("`{}`, {}", step.function(), kind.name());
            rows.push(row(&what, core, &[&counts[..], &of_a_second_us].concat()));
        }
    }
    let outputs = Kind::ALL.len() * Step::ALL.len() * (LOOP_RATES_HZ.len() + 1) * TICKS as usize;
    println!("{:<10} {outputs} outputs are the library's, bit for bit", core.name);
    Ok(rows)
}

fn row(what: &str, core: &Core, numbers: &[u32]) -> String {
    let numbers: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    format!("| {what} | {} | {} |", core.name, numbers.join(" | "))
}

/// The library's own.
fn reference(kind: Kind, rate_hz: f64) -> Result<Compensator> {
    let [min, max] = LIMITS.map(Command::saturating_from_f64);
    let [lowest, highest] = COMPENSATED.map(Command::saturating_from_f64);
    Ok(match kind {
        Kind::Lead | Kind::UnlimitedLead => {
            let design = LeadDesign::new(LEAD, rate_hz, None).and_then(|design| design.with_slew(kind.slew_per_s()));
            Compensator::new(design.map_err(|error| error.to_string())?.filter(), min, max)
        }
        Kind::Inverse => {
            let design = InverseDesign::new(REFERENCE, rate_hz, &POINTS).map_err(|error| error.to_string())?;
            let filter = design.filter(kind.slew_per_s(), CommandRange { lowest, highest });
            Compensator::new(filter.map_err(|error| error.to_string())?, min, max)
        }
    })
}

/// What is called in each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Float,
    Fixed,
}

impl Step {
    const ALL: [Self; 2] = [Self::Float, Self::Fixed];

    const fn function(self) -> &'static str {
        match self {
            Self::Float => "rotorlead_step_float",
            Self::Fixed => "rotorlead_step",
        }
    }
}

struct Bench<'a> {
    debugger: &'a mut Debugger,
    image: &'a Image,
}

fn words(numbers: impl IntoIterator<Item = f64>) -> Vec<u32> {
    numbers.into_iter().flat_map(|number| [number.to_bits() as u32, (number.to_bits() >> 32) as u32]).collect()
}

impl Bench<'_> {
    fn set_up(&mut self) -> Result {
        for (address, value) in [CPACR, TIMER_CLOCK, TIMER_ON] {
            self.debugger.store(address, value)?;
        }
        self.debugger.set_words(BACK, &[0xE7FE_E7FE])?;
        // For all calls: with each change of a breakpoint the emulator translates its code anew.
        self.debugger.add_breakpoint(BACK)
    }

    /// The core stands at a function's first instruction, and will return.
    fn enter(&mut self, function: &str, arguments: &[u32], numbers: &[[u32; 2]]) -> Result {
        let index = self.image.function_named(function).ok_or_else(|| format!("the archive has no {function}"))?;
        for (register, &value) in arguments.iter().enumerate() {
            self.debugger.set_register(register, value)?;
        }
        for (register, &value) in numbers.iter().enumerate() {
            self.debugger.set_float_register(register, value)?;
        }
        self.debugger.set_register(STACK_POINTER, STACK)?;
        self.debugger.set_register(LINK_REGISTER, BACK | 1)?;
        self.debugger.jump(self.image.functions[index].address)
    }

    /// Calls a function, which has to succeed.
    fn call(&mut self, function: &str, arguments: &[u32], numbers: &[[u32; 2]]) -> Result {
        self.enter(function, arguments, numbers)?;
        let status = self.returned()?.r[0];
        if status == 0 { Ok(()) } else { Err(format!("{function} gives the status {status}")) }
    }

    /// Runs to the function's end.
    fn returned(&mut self) -> Result<Registers> {
        let registers = self.debugger.run()?;
        if registers.pc() == BACK {
            Ok(registers)
        } else {
            Err(format!("the core stopped at {:#x}, not at {BACK:#x}", registers.pc()))
        }
    }

    /// Designs the compensator; gives the instructions that takes.
    fn design(&mut self, kind: Kind, rate_hz: f64) -> Result<u32> {
        let numbers = [rate_hz, LIMITS[0], LIMITS[1]].map(|number| {
            let [low, high] = [number.to_bits() as u32, (number.to_bits() >> 32) as u32];
            [low, high]
        });
        let parameters = match kind {
            Kind::Lead | Kind::UnlimitedLead => {
                words([LEAD.omega_z_rad_s, LEAD.omega_f_rad_s, LEAD.damping, kind.slew_per_s()])
            }
            Kind::Inverse => {
                let ReferenceModel { omega_f_rad_s, damping } = REFERENCE;
                words([omega_f_rad_s, damping, kind.slew_per_s(), COMPENSATED[0], COMPENSATED[1]])
            }
        };
        self.debugger.set_words(PARAMETERS, &parameters)?;
        let points = words(POINTS.iter().flat_map(|point| [point.command, point.tau_s]));
        self.debugger.set_words(POINTS_AT, &points)?;
        let start = self.debugger.read(TIMER_COUNT)?;
        match kind {
            Kind::Lead | Kind::UnlimitedLead => {
                self.call("rotorlead_design_lead", &[COMPENSATOR, PARAMETERS], &numbers)?
            }
            Kind::Inverse => {
                let arguments = [COMPENSATOR, PARAMETERS, POINTS_AT, POINTS.len() as u32];
                self.call("rotorlead_design_inverse", &arguments, &numbers)?;
            }
        }
        Ok(self.debugger.read(TIMER_COUNT)?.wrapping_sub(start))
    }

    /// Runs the compensator and the library's side by side, `tick` from a step's first instruction to its return. The filter is
    /// switched out and in again, and the commands leave what an inverse covers: so the ticks are of every kind.
    fn run(&mut self, kind: Kind, step: Step, rate_hz: f64, tick: &mut dyn FnMut(&mut Self) -> Result) -> Result {
        let mut reference = reference(kind, rate_hz)?;
        let level = Command::saturating_from_f64(0.5);
        self.call("rotorlead_set_enabled", &[COMPENSATOR, 1], &[])?;
        self.call("rotorlead_reset", &[COMPENSATOR, level.to_bits().cast_unsigned()], &[])?;
        reference.reset(level);
        for count in 0..TICKS {
            if count % (TICKS / 4) == SWITCHES_AT as u32 {
                let enabled = !reference.is_enabled();
                self.call("rotorlead_set_enabled", &[COMPENSATOR, u32::from(enabled)], &[])?;
                reference.set_enabled(enabled);
            }
            let random = (count / HOLD + 1).wrapping_mul(2_654_435_761) >> 8;
            let number = 0.3 + 0.45 * random as f32 / 16_777_216.0;
            let command = Command::saturating_from_f32(number);
            match step {
                Step::Float => self.enter(step.function(), &[COMPENSATOR, OUTPUT], &[[number.to_bits(), 0]])?,
                Step::Fixed => {
                    self.enter(step.function(), &[COMPENSATOR, command.to_bits().cast_unsigned(), OUTPUT], &[])?;
                }
            }
            tick(self)?;
            let output = self.debugger.read(OUTPUT)?;
            let expected = reference.update(command);
            let expected = match step {
                Step::Float => expected.to_f32().to_bits(),
                Step::Fixed => expected.to_bits().cast_unsigned(),
            };
            if output != expected {
                return Err(format!("{step:?}, {kind:?}, {rate_hz} Hz, tick {count}: {output:#x}, not {expected:#x}"));
            }
        }
        Ok(())
    }
}

//! Filters side by side: an image of their own, in which each has the same functions.

use std::path::Path;

use super::machine::Machine;
use super::trace::{AsEmulated, Cost, trace};
use crate::image::Image;
use crate::run::Result;

/// The module in the image, and what its name is in tables and in JSON.
const FILTERS: [(&str, &str, &str); 5] = [
    ("rotorlead_section", "rotorlead lead", "biquad"),
    (LIMITED, "rotorlead lead, slew", LIMITED_KEY),
    (INVERSE, "rotorlead inverse", INVERSE_KEY),
    ("idsp_dither", "idsp 0.23 Dither", "idsp_dither"),
    ("biquad_f32", "biquad 0.6 f32 DF1", "biquad_f32"),
];
/// Those with a tick of another length, in which their slew limits the output. That of the inverse has 16 bits.
const LIMITED: &str = "rotorlead_limited_section";
const INVERSE: &str = "rotorlead_inverse";
/// What they are in JSON.
pub const LIMITED_KEY: &str = "biquad_limited";
pub const INVERSE_KEY: &str = "inverse";
/// Samples of a block, and motors of a tick, as in the image.
const BLOCK: u32 = 32;
const MOTORS: u32 = 4;
/// The level at which the image lets filters settle, Q2.29, and the nearest output of the inverse, 2^-16.
const LEVEL: i32 = 314_159_265;
const LEVEL_OF_INVERSE: i32 = (LEVEL + (1 << 12)) & -(1 << 13);

/// One filter's figures.
#[derive(Clone, Debug)]
pub struct Filter {
    /// For people.
    pub name: &'static str,
    /// In JSON.
    pub key: &'static str,
    /// A sample by a call that is not inlined: all instructions of the function, its return included.
    pub call: Cost,
    /// Inlined: one sample of each of four motors, for all of them.
    pub motors: Cost,
    /// A block of 32 samples, for all of them.
    pub block: Cost,
    /// A call in which a limit changes the output, where that takes another path.
    pub limited: Option<Cost>,
    /// Bytes of the state, and of the coefficients.
    pub state_bytes: u32,
    pub coefficient_bytes: u32,
    /// What is left of a step after 20 s, in steps of 2^-29, from the nearest output that there is.
    pub steady_error: i32,
}

impl Filter {
    /// State and coefficients.
    pub const fn bytes(&self) -> u32 {
        self.state_bytes + self.coefficient_bytes
    }

    /// Instructions per sample of the four motors.
    pub fn per_motor(&self) -> f64 {
        f64::from(self.motors.instructions) / f64::from(MOTORS)
    }

    /// Instructions per sample of a block.
    pub fn per_sample(&self) -> f64 {
        f64::from(self.block.instructions) / f64::from(BLOCK)
    }

    /// Cycles per sample of a block, estimated.
    pub fn cycles_per_sample(&self) -> f64 {
        f64::from(self.block.cycles) / f64::from(BLOCK)
    }
}

/// Measures them.
pub fn measure(image_path: &Path, image: &Image) -> Result<Vec<Filter>> {
    let mut bench = Bench { machine: Machine::start(image_path)?, image };
    let filters = FILTERS.iter().map(|(module, name, key)| bench.filter(module, name, key)).collect::<Result<_>>()?;
    bench.cross_check()?;
    Ok(filters)
}

struct Bench<'a> {
    machine: Machine,
    image: &'a Image,
}

impl Bench<'_> {
    /// In the order in which the image calls them.
    fn filter(&mut self, module: &str, name: &'static str, key: &'static str) -> Result<Filter> {
        let of = |function: &str| format!("{module}::{function}");
        let call = self.cost(&of("call"))?;
        let motors = self.cost(&of("motors"))?;
        let block = self.cost(&of("block"))?;
        let [state_bytes, coefficient_bytes] = [self.result("size")?, self.result("size")?];
        let steady = self.result(&of("steady"))?.cast_signed();
        let limited = match module {
            LIMITED | INVERSE => Some(self.cost(&of("call"))?),
            _ => None,
        };
        let level = if module == INVERSE { LEVEL_OF_INVERSE } else { LEVEL };
        let steady_error = steady - level;
        Ok(Filter { name, key, call, motors, block, limited, state_bytes, coefficient_bytes, steady_error })
    }

    /// Two more blocks take as many nanoseconds more of the emulator's time as they have instructions when executed
    /// step by step.
    fn cross_check(&mut self) -> Result {
        let mut stepped_and_counted = || Ok::<_, String>((self.cost("counted")?.instructions, self.result("counted")?));
        let (one, three) = (stepped_and_counted()?, stepped_and_counted()?);
        let (stepped, counted) = (three.0 - one.0, three.1.wrapping_sub(one.1));
        if stepped == counted {
            Ok(())
        } else {
            Err(format!("{stepped} instructions take {counted} ns of the emulator's time"))
        }
    }

    fn enter(&mut self, function: &str) -> Result<u32> {
        let name = format!("firmware_bench::probes::{function}");
        let index = self.image.function_named(&name).ok_or_else(|| format!("the image has no function {name}"))?;
        let registers = self.machine.debugger.run_to(self.image.functions[index].address)?;
        Ok(registers.r[14] & !1)
    }

    fn cost(&mut self, function: &str) -> Result<Cost> {
        let back = self.enter(function)?;
        trace(&mut self.machine.debugger, self.image, &[back], &mut AsEmulated)
    }

    fn result(&mut self, function: &str) -> Result<u32> {
        let back = self.enter(function)?;
        Ok(self.machine.debugger.run_to(back)?.r[0])
    }
}

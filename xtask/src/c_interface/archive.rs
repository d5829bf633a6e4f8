//! The archive for a core, and what a linker takes of it.

use std::path::{Path, PathBuf};

use crate::board;
use crate::image::{Calls, Image};
use crate::run::{Result, beside, root, run, target_folder};
use crate::{firmware, setup};

/// A core that the archive is built for.
pub struct Core {
    /// As data sheets and the page have it.
    pub name: &'static str,
    /// As the compiler has it.
    cpu: &'static str,
    /// Features that it is not to use.
    without: &'static str,
    /// Clock of one that is common in flight controllers, megahertz.
    pub clock_mhz: u32,
}

/// Those of flight controllers. Not every Cortex-M7 has an FPU of double precision (the STM32F722 and F745 have not), and the
/// code for one stops on the others: both archives do without, as rustc's page on the target says how. The clocks are those of
/// an STM32F405 and of an STM32F745.
pub const CORES: [Core; 2] = [
    Core { name: "Cortex-M4F", cpu: "cortex-m4", without: "", clock_mhz: 168 },
    Core { name: "Cortex-M7", cpu: "cortex-m7", without: "-fp64", clock_mhz: 216 },
];

/// What a flight controller may call: what the page calls it, and the functions.
const USES: [(&str, &[&str]); 4] = [
    ("a step and a reset", &STEP),
    ("these and the design of a lead", &LEAD),
    ("these and the design of an inverse", &INVERSE),
    ("everything", &[]),
];
const STEP: [&str; 2] = ["rotorlead_step_float", "rotorlead_reset"];
const LEAD: [&str; 3] = [STEP[0], STEP[1], "rotorlead_design_lead"];
const INVERSE: [&str; 3] = [STEP[0], STEP[1], "rotorlead_design_inverse"];

/// A program of nothing but the archive's functions: a vector table, so that the emulator takes it, and no RAM that is
/// initialized.
const SCRIPT: &str = "
ENTRY(rotorlead_step_float)
SECTIONS {
    .vectors 0x08000000 : { LONG(0x20010000) LONG(rotorlead_step_float | 1) }
    .text : { *(.text .text.*) }
    .rodata : { *(.rodata .rodata.*) }
    .data 0x20000000 : { *(.data .data.*) }
    .bss : { *(.bss .bss.* COMMON) }
    /DISCARD/ : { *(.ARM.exidx*) *(.ARM.extab*) }
}
";

impl Core {
    /// Builds the archive.
    pub fn build(&self, features: &[&str]) -> Result<PathBuf> {
        let toolchain = setup::target()?;
        let mut build = toolchain.cargo(&["build", "--package", "rotorlead-c", "--lib", "--locked"]);
        build.args(["--profile", "firmware", "--features", &features.join(",")]);
        build.env("CARGO_TARGET_DIR", self.folder());
        let folder = if features.is_empty() { self.folder() } else { beside(&mut build, &self.folder()) };
        run(build.env("RUSTFLAGS", format!("-C target-cpu={} -C target-feature={}", self.cpu, self.without)))?;
        Ok(folder.join(&board::default()?.target).join("firmware/librotorlead_c.a"))
    }

    fn folder(&self) -> PathBuf {
        target_folder().join("c").join(self.cpu)
    }

    /// Links what a program takes that calls these functions, and nothing else.
    pub fn link(&self, archive: &Path, functions: &[impl AsRef<str>]) -> Result<Linked> {
        let [script, path] = ["program.x", "program.elf"].map(|name| self.folder().join(name));
        std::fs::write(&script, SCRIPT).map_err(|error| format!("{}: {error}", script.display()))?;
        let mut link = setup::target()?.linker()?;
        link.args(["--gc-sections", "--emit-relocs", "-T"]).arg(script);
        link.args(functions.iter().map(|function| format!("--undefined={}", function.as_ref())));
        run(link.arg(archive).arg("-o").arg(&path))?;
        let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Linked { image: Image::read(&bytes)?, path })
    }
}

/// A linked program.
pub struct Linked {
    pub image: Image,
    pub path: PathBuf,
}

/// Every function of the header.
pub fn functions() -> Result<Vec<String>> {
    let path = root().join("c/include/rotorlead.h");
    let header = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let code: String = header.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let names = code.split('(').filter_map(|before| before.rsplit([' ', '*']).next());
    let found: Vec<String> = names.filter(|name| name.starts_with("rotorlead_")).map(str::to_owned).collect();
    if found.len() < STEP.len() { Err("the header has no functions".to_owned()) } else { Ok(found) }
}

/// A row of a table of the page: what it is about, and bytes on each core.
pub struct Bytes {
    pub of: String,
    pub on_cores: Vec<u64>,
}

/// What is linked for each use, and the deepest stack of each function. An error where the archive holds state of its own, calls
/// through a pointer, or can panic.
pub fn measure() -> Result<[Vec<Bytes>; 2]> {
    let all = functions()?;
    let row = |of: &str| Bytes { of: of.to_owned(), on_cores: vec![] };
    let mut sizes: Vec<Bytes> = USES.iter().map(|(what, _)| row(what)).collect();
    let mut stacks: Vec<Bytes> = all.iter().map(|name| row(&format!("`{name}`"))).collect();
    for core in &CORES {
        let planted = core.link(&core.build(&[firmware::PLANTED])?, &all)?;
        match no_panic(&planted.image, &all) {
            Ok(()) => return Err("the check for panics does not see the one that was planted".to_owned()),
            Err(found) => eprintln!("xtask: as it should, the check finds the planted panic: {found}"),
        }
        let archive = core.build(&[])?;
        println!("{:<10} {}", core.name, archive.display());
        for (row, (_, functions)) in sizes.iter_mut().zip(USES) {
            let called = if functions.is_empty() { all.clone() } else { functions.iter().map(|&f| f.into()).collect() };
            row.on_cores.push(core.link(&archive, &called)?.image.flash_bytes);
        }
        let Linked { image, .. } = core.link(&archive, &all)?;
        no_panic(&image, &all)?;
        if image.ram_bytes != 0 {
            return Err(format!("the archive has {} bytes of state of its own", image.ram_bytes));
        }
        println!("{:<10} no panic can be reached, nothing is called through a pointer, nothing lies in RAM", core.name);
        let calls = Calls::from_image(&image);
        for (row, name) in stacks.iter_mut().zip(&all) {
            row.on_cores.push(calls.depth(find_root(&image, name)?, &|_| false)?.bytes.into());
        }
    }
    Ok([sizes, stacks])
}

fn find_root(image: &Image, name: &str) -> Result<usize> {
    image.function_named(name).ok_or_else(|| format!("the archive has no function {name}"))
}

fn no_panic(image: &Image, functions: &[String]) -> Result {
    let calls = Calls::from_image(image);
    functions.iter().try_for_each(|name| firmware::cannot_panic(&calls, find_root(image, name)?, name))
}

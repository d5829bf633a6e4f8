//! What the tasks know of the boards that the application runs on. `docs/boards.md` says how one is added.

use std::ops::Range;

/// One board, as the tasks see it.
#[derive(Debug)]
pub struct Board {
    /// Feature of the package `rotorlead` that brings the board's code, its HAL and its memory map.
    pub feature: &'static str,
    /// Binary of that package that runs on it.
    pub binary: &'static str,
    /// Rust's target of its core.
    pub target: &'static str,
    /// Addresses of the RAM that holds data: the region `RAM` of its memory map.
    pub ram: Range<u32>,
    /// Its interrupts.
    pub interrupts: Interrupts,
    /// The emulator's version of it.
    pub emulator: &'static emulator::Board,
    /// What probe-rs calls its chip.
    pub probe_chip: &'static str,
}

/// Interrupts of the application, by their names in the vector table.
#[derive(Debug)]
pub struct Interrupts {
    /// Edges of the inputs.
    pub capture: &'static str,
    /// The control task.
    pub tick: &'static str,
    /// Bytes of the link.
    pub link: &'static str,
    /// The supply's voltage.
    pub supply: &'static str,
    /// Exceptions above all of them, which add to the deepest stack.
    pub above: &'static [&'static str],
}

/// An STM32F405RG, as `src/board/` sets it up.
pub const STM32F405: Board = Board {
    feature: "stm32f405",
    binary: "rotorlead-firmware",
    // A Cortex-M4 with a single-precision FPU.
    target: "thumbv7em-none-eabihf",
    ram: 0x2000_0000..0x2002_0000,
    interrupts: Interrupts {
        capture: "TIM2",
        tick: "SysTick",
        link: "USART3",
        supply: "PVD",
        above: &["NonMaskableInt"],
    },
    emulator: &emulator::STM32F405,
    probe_chip: "STM32F405RGTx",
};

/// Every board.
pub const BOARDS: [&Board; 1] = [&STM32F405];

/// The board that the tasks build for.
pub const BOARD: &Board = &STM32F405;

#[cfg(test)]
mod tests {
    use super::{BOARD, STM32F405};
    use crate::image::flash_files::FLASH;

    #[test]
    fn the_regions_are_those_of_the_memory_map() {
        let script = include_str!("../../src/board/board.x");
        let region = |name: &str, range: &std::ops::Range<u32>| {
            format!("{name} : ORIGIN = {:#010x}, LENGTH = {}K", range.start, range.len() / 1024)
        };
        for expected in [region("FLASH", &FLASH), region("RAM", &STM32F405.ram)] {
            assert!(script.contains(&expected), "board.x has no `{expected}`");
        }
    }

    #[test]
    fn the_features_and_binaries_are_those_of_the_package() {
        let manifest = include_str!("../../Cargo.toml");
        for board in super::BOARDS {
            assert!(manifest.contains(&format!("\n{} = [", board.feature)), "no feature {}", board.feature);
            let binary = format!("name = \"{}\"", board.binary);
            let required = format!("required-features = [\"{}\"]", board.feature);
            let sections = manifest.split("\n[").filter(|section| section.starts_with("[bin]]"));
            let found = sections.filter(|section| section.contains(&binary) && section.contains(&required)).count();
            assert_eq!(found, 1, "{}: binaries that need {}", board.binary, board.feature);
        }
    }

    /// `docs/boards.md`.
    const PAGE: &str = include_str!("../../docs/boards.md");

    #[test]
    fn the_page_on_boards_names_every_method_that_a_board_must_give() {
        let traits = include_str!("../../src/controller/hardware.rs");
        let methods = traits.lines().filter_map(|line| line.strip_prefix("    fn ")?.split('(').next());
        let methods: Vec<&str> = methods.collect();
        assert!(methods.len() > 15, "only {} methods were found", methods.len());
        for method in methods {
            assert!(PAGE.contains(&format!("`{method}`")), "docs/boards.md does not say what `{method}` does");
        }
    }

    #[test]
    fn the_page_on_boards_names_every_file_of_the_board() {
        for entry in std::fs::read_dir(crate::run::root().join("src/board")).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            assert!(PAGE.contains(&name), "docs/boards.md does not name {name}");
        }
    }

    #[test]
    fn cargo_run_flashes_the_same_chip() {
        let config = include_str!("../../.cargo/config.toml");
        assert!(config.contains(&format!("[target.{}]", BOARD.target)));
        assert!(config.contains(&format!("--chip {} ", BOARD.probe_chip)));
    }
}

//! What the tasks know of the boards that the application runs on. `docs/boards.md` says how one is added.

use std::ops::Range;

use crate::image::flash_files::{FlashMap, Form};
use crate::image::uf2::Family;

/// One board, as the tasks see it.
#[derive(Debug)]
pub struct Board {
    /// What `--board` calls it.
    pub name: &'static str,
    /// Package that has the board's code, its HAL and its memory map.
    pub package: &'static str,
    /// Feature of that package that brings them, where it takes one.
    pub feature: Option<&'static str>,
    /// Binary of that package that runs on it.
    pub binary: &'static str,
    /// Rust's target of its core.
    pub target: &'static str,
    /// Addresses of the RAM that holds data: the region `RAM` of its memory map.
    pub ram: Range<u32>,
    /// Its flash.
    pub flash: FlashMap,
    /// Its interrupts.
    pub interrupts: Interrupts,
    /// Page that says what the image takes.
    pub sizes_page: &'static str,
}

/// Interrupts of the application, by their names in the vector table.
#[derive(Debug)]
pub struct Interrupts {
    /// Edges of the inputs, where they are not left to the control task.
    pub capture: Option<&'static str>,
    /// The control task.
    pub tick: &'static str,
    /// Bytes of the link.
    pub link: &'static str,
    /// The supply's voltage, where something watches it.
    pub supply: Option<&'static str>,
    /// Exceptions above all of them, which add to the deepest stack.
    pub above: &'static [&'static str],
    /// What the core stores at an interrupt, and a word to align it.
    pub frame_bytes: u32,
}

impl Interrupts {
    /// Those of the path from pulse to pulse, of the link's bytes and of the supply: those that must never panic. Each has a
    /// priority of its own.
    pub fn path(&self) -> impl Iterator<Item = &'static str> {
        [Some(self.tick), self.capture, Some(self.link), self.supply].into_iter().flatten()
    }
}

/// An STM32F405RG, as `src/board/` sets it up.
pub const STM32F405: Board = Board {
    name: "stm32f405",
    package: "rotorlead",
    feature: Some("stm32f405"),
    binary: "rotorlead-firmware",
    // A Cortex-M4 with a single-precision FPU.
    target: "thumbv7em-none-eabihf",
    ram: 0x2000_0000..0x2002_0000,
    // Sectors 0 to 9 for the image, and 10 and 11 for the settings.
    flash: FlashMap {
        image: 0x0800_0000..0x080C_0000,
        settings: 0x080C_0000..0x0810_0000,
        vectors: 0x0800_0000,
        form: Form::Hex,
    },
    interrupts: Interrupts {
        capture: Some("TIM2"),
        tick: "SysTick",
        link: "USART3",
        supply: Some("PVD"),
        above: &["NonMaskableInt"],
        // 26 words with the floating-point unit on.
        frame_bytes: 27 * 4,
    },
    sizes_page: "README.md",
};

/// What probe-rs calls the chip of the STM32F405, for `cargo xtask flash`.
pub const PROBE_CHIP: &str = "STM32F405RGTx";

/// A Raspberry Pi Pico, as `boards/rp2040/` sets it up.
pub const RP2040: Board = Board {
    name: "rp2040",
    package: "rotorlead-rp2040",
    feature: None,
    binary: "rotorlead-rp2040",
    // A Cortex-M0+.
    target: "thumbv6m-none-eabi",
    ram: 0x2000_E000..0x2004_2000,
    // The second stage of the boot, the image, and two sectors of 4 KiB for the settings.
    flash: FlashMap {
        image: 0x1000_0000..0x101F_E000,
        settings: 0x101F_E000..0x1020_0000,
        vectors: 0x1000_0100,
        form: Form::Uf2(Family::Rp2040),
    },
    interrupts: Interrupts {
        capture: None,
        tick: "SysTick",
        link: "UART0_IRQ",
        supply: None,
        above: &[],
        frame_bytes: 9 * 4,
    },
    sizes_page: "docs/board-rp2040.md",
};

/// Every board.
pub const BOARDS: [&Board; 2] = [&STM32F405, &RP2040];

/// The board that the tasks build for where none is named.
pub const BOARD: &Board = &STM32F405;

/// The emulator's version of [`BOARD`].
pub const EMULATED: &emulator::Board = &emulator::STM32F405;

#[cfg(test)]
mod tests {
    use super::{BOARD, PROBE_CHIP, RP2040, STM32F405};

    fn assert_regions(script: &str, regions: &[(&str, std::ops::Range<u32>)]) {
        for (name, range) in regions {
            let expected = format!("{name} : ORIGIN = {:#010X}, LENGTH = {}K", range.start, range.len() / 1024);
            let expected = expected.replace("0X", "0x");
            assert!(script.contains(&expected), "board.x has no `{expected}`");
        }
    }

    #[test]
    fn the_regions_are_those_of_the_memory_maps() {
        let (flash, ram) = (STM32F405.flash.image, STM32F405.ram);
        assert_regions(include_str!("../../src/board/board.x"), &[("FLASH", flash), ("RAM", ram)]);
        let script = include_str!("../../boards/rp2040/board.x");
        assert_regions(script, &[("RAM", RP2040.ram)]);
        let image = RP2040.flash.image;
        let expected = format!("LENGTH = {}K - 0x{:x}", image.len() / 1024, RP2040.flash.vectors - image.start);
        assert!(script.contains(&format!("FLASH : ORIGIN = {:#010x}, {expected}", RP2040.flash.vectors)), "{expected}");
    }

    #[test]
    fn the_settings_begin_behind_the_image() {
        for board in super::BOARDS {
            assert_eq!(board.flash.settings.start, board.flash.image.end, "{}", board.name);
        }
        let driver = include_str!("../../src/board/settings_flash.rs");
        assert!(driver.contains("const START: usize = 0x080C_0000;"));
        let driver = include_str!("../../boards/rp2040/src/settings_flash.rs");
        assert!(driver.contains("const START: u32 = 0x1F_E000;"));
    }

    #[test]
    fn the_features_and_binaries_are_those_of_the_packages() {
        let manifests = [include_str!("../../Cargo.toml"), include_str!("../../boards/rp2040/Cargo.toml")];
        for (board, manifest) in super::BOARDS.into_iter().zip(manifests) {
            assert!(manifest.contains(&format!("\nname = \"{}\"", board.package)), "{}", board.name);
            let binary = format!("name = \"{}\"", board.binary);
            let required = board.feature.map(|feature| format!("required-features = [\"{feature}\"]"));
            assert!(board.feature.is_none_or(|feature| manifest.contains(&format!("\n{feature} = ["))));
            let sections = manifest.split("\n[").filter(|section| section.starts_with("[bin]]"));
            let is_right = |section: &&str| {
                section.contains(&binary) && required.as_ref().is_none_or(|line| section.contains(line))
            };
            assert_eq!(sections.filter(is_right).count(), 1, "{}: its binary", board.name);
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
    fn the_page_on_boards_names_every_file_of_the_boards() {
        for folder in ["src/board", "boards/rp2040/src"] {
            for entry in std::fs::read_dir(crate::run::root().join(folder)).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                assert!(PAGE.contains(&name), "docs/boards.md does not name {folder}/{name}");
            }
        }
    }

    #[test]
    fn cargo_run_flashes_the_same_chip() {
        let config = include_str!("../../.cargo/config.toml");
        assert!(config.contains(&format!("[target.{}]", BOARD.target)));
        assert!(config.contains(&format!("--chip {} ", PROBE_CHIP)));
    }
}

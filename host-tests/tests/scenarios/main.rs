//! What must hold of every controller, written once: played by the library on a board in memory, by the STM32F405's image, and
//! by the RP2040's at its pins in two emulators. The table in `docs/firmware.md` says what was proven where.
//!
//! What needs the images needs the emulators, too: `cargo xtask test` gives both.

mod bench;
mod flight;
mod frames;
mod pulses;
mod safety;

use emulator::rp2040::Emulator;
use host_tests::scenario::{Miss, Mocks, Rp2040, Scenario, Spoiled, Stm32, Target, table};

/// Each scenario as a test of the images, and all in a list.
macro_rules! scenarios {
    ($($module:ident::$name:ident),* $(,)?) => {
        const ALL: &[Scenario] = &[$($module::$name),*];

        mod on_the_images {
            $(
                #[test]
                #[ignore = "needs the images and the emulators: cargo xtask test"]
                #[allow(non_snake_case, reason = "the test has the name of its scenario")]
                fn $name() {
                    super::on_the_images(&super::$module::$name);
                }
            )*
        }
    };
}

scenarios! {
    pulses::CONSTANT_PULSES,
    pulses::STEP,
    pulses::LATENCY,
    frames::FRAMES,
    frames::INSTRUCTIONS,
    frames::DAMAGED_FRAMES,
    frames::PULSES_TO_FRAMES,
    frames::FRAMES_TO_PULSES,
    frames::LOST_FRAMES,
    flight::BETAFLIGHT,
    flight::ARDUPILOT,
    flight::TURTLE,
    safety::SILENT_WITH_PULSES,
    safety::SILENT_WITH_FRAMES,
    safety::FULL_THROTTLE,
    safety::NO_SETTINGS,
    safety::NO_SETTINGS_ASKED,
    safety::WRONG_PROTOCOL,
    safety::LOST_PULSES,
    safety::LOST_TO_THE_TICK,
    safety::GLITCHES,
    safety::THRESHOLDS,
    bench::STORED_SETTINGS,
    bench::INJECTION,
    bench::EXCITATION,
    bench::TOO_SLOW,
    bench::RECORDER,
    bench::CONVERTER,
    bench::JUMPER,
}

fn on_the_images(scenario: &Scenario) {
    let targets: [&dyn Target; 3] = [&Stm32, &Rp2040(Emulator::Node), &Rp2040(Emulator::Native)];
    for target in targets {
        table::hold(scenario.name, target.column(), &(scenario.prove)(target));
    }
}

#[test]
fn the_library_on_a_board_in_memory_plays_every_scenario() {
    let proofs = ALL.iter().map(|scenario| (scenario.name, (scenario.prove)(&Mocks)));
    let (wrong, proofs): (Vec<_>, Vec<_>) = proofs.partition(|(_, proof)| matches!(proof, Err(Miss::Wrong(_))));
    assert!(wrong.is_empty(), "{wrong:#?}");
    proofs.iter().for_each(|(name, proof)| table::hold(name, Mocks.column(), proof));
}

/// Each control of a scenario must make it fail, and without one it must hold.
fn check_controls(scenario: &Scenario, target: &dyn Target) {
    assert!(!scenario.controls.is_empty(), "{}", scenario.name);
    let proof = (scenario.prove)(target);
    assert!(proof.is_ok(), "{}: {proof:?}", scenario.name);
    for (what, spoil) in scenario.controls {
        match (scenario.prove)(&Spoiled { target, spoil: *spoil }) {
            Err(Miss::Wrong(found)) => println!("{}, {what}: {found}", scenario.name),
            other => panic!("{}, {what}: {other:?}", scenario.name),
        }
    }
}

#[test]
fn whatever_spoils_a_scenario_makes_it_fail() {
    ALL.iter().for_each(|scenario| check_controls(scenario, &Mocks));
}

/// Of all, those that are exact to a tick, and those of the jumper.
#[test]
#[ignore = "needs the images and the emulators: cargo xtask test"]
fn what_spoils_a_scenario_makes_it_fail_at_the_pins_too() {
    for scenario in [safety::LOST_TO_THE_TICK, safety::THRESHOLDS, bench::JUMPER] {
        check_controls(&scenario, &Rp2040(Emulator::Node));
    }
}

#[test]
fn the_table_has_a_row_for_each_scenario_and_no_other() {
    let names: Vec<&str> = ALL.iter().map(|scenario| scenario.name).chain(table::OF_BOARDS).collect();
    assert_eq!(table::rows(), names);
}

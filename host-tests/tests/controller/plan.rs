//! What settings mean for the timers, at every protocol, frame rate and clock.

use host_tests::any_settings;
use host_tests::board::{CRYSTAL, INTERNAL, INTERNAL_PLL};
use host_tests::cases;
use proptest::prelude::*;
use rotorlead::capture::Signal;
use rotorlead::channel::Input;
use rotorlead::controller::{
    ClockReport, Plan, Supervisor, channel_settings, channels, check_crystal, check_timer, filters, longest_pulse_ticks,
};
use rotorlead::link::{Clock, CrystalCheck};
use rotorlead::settings::{
    FASTEST_RAW_DUTY_HZ, Pulse, PulseProtocol, SHORTEST_LEVEL_US, SLOWEST_TIMER_HZ, Settings, Validated,
};
use rotorlead::throttle::{Command, EscCommand};

const PROTOCOLS: [(PulseProtocol, u16); 3] = [
    (PulseProtocol::RawDuty, FASTEST_RAW_DUTY_HZ),
    (PulseProtocol::StandardPwm, 495),
    (PulseProtocol::OneShot125, 3703),
];

/// The clocks of the board, and what its timers may be measured to be: the slowest that is used, one of an emulator, odd ones.
fn timers_hz() -> Vec<u32> {
    let boards = [CRYSTAL, INTERNAL_PLL, INTERNAL].map(|clocks| clocks.timer_hz);
    [&boards[..], &[SLOWEST_TIMER_HZ, 999_983 + 77_777, 41_999_999, 1_000_000_000]].concat()
}

/// Valid settings with these pulses, and levels that a raw duty may have at any of its rates.
fn with(input: Pulse, output: Pulse) -> Validated {
    let bits = |value: f64| Command::saturating_from_f64(value).to_bits();
    let mut settings = Settings { input, output, ..Settings::default() };
    if output.protocol == PulseProtocol::RawDuty {
        let shortest = f64::from(SHORTEST_LEVEL_US) * 1e-6 * f64::from(output.frame_hz);
        settings.stop = bits(shortest);
        settings.motors.iter_mut().for_each(|motor| motor.max = bits(1.0 - shortest));
    }
    settings.validate().unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_protocol_at_every_frame_rate_suits_every_clock() {
    let mut count = 0;
    for timer_hz in timers_hz() {
        for (protocol, fastest) in PROTOCOLS {
            for frame_hz in 40..=fastest {
                let output = Pulse { protocol, frame_hz };
                // An input as fast, and one that the output need not follow.
                for input_hz in [frame_hz.min(495), 50] {
                    let input = Pulse { protocol: PulseProtocol::StandardPwm, frame_hz: input_hz };
                    let settings = with(input, output);
                    let at = format!("{output:?} after {input_hz} Hz at {timer_hz} Hz");
                    let plan = Plan::new(&settings, timer_hz, true).unwrap_or_else(|| panic!("{at}: refused"));
                    let (scale, frames) = plan.output.pulses().unwrap();
                    let us = |counts: u32| 1e6 * f64::from(counts) / f64::from(frames.counter_hz);
                    let count_us = us(1);
                    // The rate of the frames, to the nearest count; a protocol that follows is never faster.
                    let frame_us = 1e6 / f64::from(frame_hz);
                    assert!((us(frames.shortest) - frame_us).abs() <= count_us, "{at}: {frames:?}");
                    let is_raw = protocol == PulseProtocol::RawDuty;
                    assert!(is_raw || us(frames.shortest) >= frame_us * (1.0 - 1e-9), "{at}: too fast");
                    assert!(frames.longest <= 1 << 16 && frames.shortest <= frames.longest, "{at}: {frames:?}");
                    assert_eq!(frames.follow_input(), settings.output_follows_input(), "{at}");
                    // The longest pulse leaves its gap.
                    let gap_us = us(frames.shortest) - us(longest_pulse_ticks(&settings, scale));
                    assert!(gap_us >= f64::from(SHORTEST_LEVEL_US) - 2.0 * count_us, "{at}: a gap of {gap_us} us");
                    // The stop has an edge, and is what its protocol says.
                    let stop = EscCommand::from(Command::saturating_from_bits(settings.stop));
                    let stop_us = us(scale.to_width_ticks(stop));
                    let expected_us = match protocol {
                        PulseProtocol::RawDuty => 20.0,
                        PulseProtocol::StandardPwm => 1000.0,
                        _ => 125.0,
                    };
                    assert!((stop_us - expected_us).abs() <= count_us, "{at}: a stop of {stop_us} us");
                    assert_eq!(scale.to_width_ticks(EscCommand::NO_PULSE), 0);
                    count += 1;
                }
            }
        }
    }
    println!("{count} plans");
    assert_eq!(count, 2 * 7 * ((1500 - 39) + (495 - 39) + (3703 - 39)));
}

#[test]
fn every_protocol_at_the_input_suits_every_clock() {
    for timer_hz in timers_hz() {
        for (protocol, fastest) in PROTOCOLS {
            for frame_hz in 40..=fastest {
                let settings = with(Pulse { protocol, frame_hz }, Settings::default().output);
                for apart in [true, false] {
                    assert!(Plan::new(&settings, timer_hz, apart).is_some(), "{protocol:?}, {frame_hz} at {timer_hz}");
                }
            }
        }
    }
}

/// A controller without usable settings starts with the defaults, so these must suit whatever clock runs.
#[test]
fn the_defaults_suit_every_timer_that_the_controller_uses() {
    let mut timer_hz = SLOWEST_TIMER_HZ;
    loop {
        assert!(Plan::new(&Validated::default(), timer_hz, false).is_some(), "{timer_hz}");
        // Steps of 0.1 % up to the fastest that there can be.
        let Some(next) = timer_hz.checked_add(timer_hz / 1000) else { break };
        timer_hz = next;
    }
}

proptest! {
    #![proptest_config(cases(2000))]

    /// The last link: whatever the settings and the input, without a signal, locked, disarmed or lost no width in a compare
    /// register is above that of the stop, on any clock.
    #[test]
    fn at_rest_no_pulse_is_wider_than_the_stop(
        settings in any_settings(),
        inputs in proptest::collection::vec((any_input(), 1..300_u32), 1..30),
        clock in 0..7_usize,
    ) {
        let timer_hz = timers_hz()[clock];
        let plan = Plan::new(&settings, timer_hz, true).expect("valid settings suit every clock");
        let (scale, _) = plan.output.pulses().unwrap();
        let stop = Command::saturating_from_bits(settings.stop);
        let stop_ticks = scale.to_width_ticks(stop.into());
        let [mut channel, ..] = channels(&settings, filters(&settings).unwrap()).unwrap();
        for (input, ticks) in inputs {
            for _ in 0..ticks {
                let width = scale.to_width_ticks(channel.tick(input));
                if channel.state().is_at_rest() {
                    prop_assert!(width <= stop_ticks, "{width} in {:?}, the stop is {stop_ticks}", channel.state());
                }
                prop_assert!(width <= longest_pulse_ticks(&settings, scale));
            }
        }
    }
}

fn any_input() -> impl Strategy<Value = Input> {
    let any_command = prop_oneof![0..=1_i32 << 29, 0..1_i32 << 26, Just(0)].prop_map(Command::saturating_from_bits);
    prop_oneof![
        5 => any_command.prop_map(Input::Command),
        2 => Just(Input::Unchanged),
        1 => Just(Input::Lost),
        1 => Just(Input::Nothing),
    ]
}

#[test]
fn without_an_exact_clock_every_pulse_counts_as_an_armed_one() {
    let settings = Validated::default();
    let plan = Plan::new(&settings, 84_000_000, false).unwrap();
    for width_us in [900, 1000, 1030, 1500] {
        let signal = Signal::Pulse { width_ticks: 84 * width_us, period_ticks: 210_000 };
        assert_eq!(Input::from_reading(signal.into(), &plan.input_scale), Input::Command(Command::ONE));
    }
}

#[test]
fn only_a_crystal_that_is_not_known_to_be_wrong_tells_pulses_apart() {
    let wrong = CrystalCheck::Wrong { measured_hz: 16_000_000 };
    let right = CrystalCheck::Right { measured_hz: 8_010_000 };
    let of = |report: ClockReport| report.tells_pulses_apart();
    assert!(of(CRYSTAL) && of(ClockReport { crystal: right, ..CRYSTAL }));
    assert!(!of(ClockReport { crystal: wrong, ..CRYSTAL }));
    assert!(!of(ClockReport { timer_as_promised: false, ..CRYSTAL }));
    assert!(!of(INTERNAL) && !of(INTERNAL_PLL));
}

/// HSI runs at 16 MHz, -8 to +4.5 %.
#[test]
fn a_crystal_is_judged_by_an_oscillator_within_its_tolerance() {
    // As on the board: 31 * 8 * 32 periods of the crystal.
    let periods = 31 * 8 * 32;
    let counts = |crystal_hz: f64, oscillator_hz: f64| (f64::from(periods) / crystal_hz * oscillator_hz).round() as u32;
    let check = |crystal_hz: f64, error: f64| {
        check_crystal(8_000_000, 16_000_000, periods, counts(crystal_hz, 16e6 * (1.0 + error)))
    };
    for error in [-0.0799, -0.04, -0.01, 0.0, 0.01, 0.0449] {
        assert!(matches!(check(8e6, error), CrystalCheck::Right { .. }), "8 MHz by an oscillator {error} off");
        // What other boards have.
        for other in [4e6, 6e6, 9.216e6, 10e6, 12e6, 16e6, 24e6, 25e6, 26e6] {
            assert!(
                matches!(check(other, error), CrystalCheck::Wrong { .. }),
                "{other} Hz by an oscillator {error} off"
            );
        }
    }
    assert_eq!(check(16e6, 0.0), CrystalCheck::Wrong { measured_hz: 16_000_000 });
    assert_eq!(check_crystal(8_000_000, 16_000_000, periods, 0), CrystalCheck::NotChecked);
    assert_eq!(check_crystal(8_000_000, 16_000_000, 0, 100), CrystalCheck::NotChecked);
}

#[test]
fn a_timer_that_is_not_what_was_promised_is_measured() {
    assert_eq!(check_timer(168_000_000, 84_000_000, 10_000, 5000), (84_000_000, true));
    assert_eq!(check_timer(168_000_000, 84_000_000, 10_000, 5049), (84_000_000, true), "the comparison's own error");
    assert_eq!(check_timer(168_000_000, 84_000_000, 10_000, 10_000), (168_000_000, false));
    // An emulator's.
    assert_eq!(check_timer(16_000_000, 16_000_000, 160, 10_000), (1_000_000_000, false));
    // One that stands still, or a core that cannot be counted.
    assert_eq!(check_timer(168_000_000, 84_000_000, 10_000, 0), (84_000_000, false));
    assert_eq!(check_timer(168_000_000, 84_000_000, 0, 5000), (84_000_000, false));
    assert_eq!(check_timer(u32::MAX, 84_000_000, 1, u32::MAX), (84_000_000, false));
}

#[test]
fn the_clock_sources_have_the_clocks_of_their_documentation() {
    assert_eq!((CRYSTAL.source, CRYSTAL.core_hz, CRYSTAL.timer_hz), (Clock::Crystal, 168_000_000, 84_000_000));
    assert_eq!((INTERNAL.source, INTERNAL.core_hz, INTERNAL.timer_hz), (Clock::Internal, 16_000_000, 16_000_000));
}

#[test]
fn two_late_ticks_in_a_row_end_an_excitation_and_one_does_not() {
    let mut supervisor = Supervisor::new(5000);
    assert!(!supervisor.late(1), "the first");
    assert!(!supervisor.late(3), "not in a row");
    assert!(supervisor.late(4));
    assert!(supervisor.late(5));
    assert!(!supervisor.late(9));
    assert_eq!(supervisor.missed(), 5);
    // The count of ticks wraps.
    let mut supervisor = Supervisor::new(5000);
    assert!(!supervisor.late(u32::MAX));
    assert!(supervisor.late(0));
}

/// What `docs/wiring.md` says of the outputs' timer.
#[test]
fn the_page_on_wiring_has_the_counts_and_the_rate_of_the_outputs() {
    let page = include_str!("../../../docs/wiring.md").split_whitespace().collect::<Vec<_>>().join(" ");
    let frames = |settings: &Validated| Plan::new(settings, CRYSTAL.timer_hz, true).unwrap().output.pulses().unwrap().1;
    let default = frames(&Validated::default());
    let raw = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    let raw = frames(&with(Settings::default().input, raw));
    let thousands = |number: u32| format!("{} {:03}", number / 1000, number % 1000);
    let hz = (f64::from(default.counter_hz) / f64::from(default.shortest)).round();
    for said in [
        format!("With the default settings TIM3 counts at {} MHz", default.counter_hz / 1_000_000),
        format!("the 1000 µs of a standard pulse into {} steps", thousands(default.counter_hz / 1000)),
        format!("At 600 Hz it counts at {} MHz", raw.counter_hz / 1_000_000),
        format!("a raw duty has {} steps", thousands(raw.shortest)),
        format!("1000 µs, {hz} times a second"),
    ] {
        assert!(page.contains(&said), "docs/wiring.md does not say: {said}");
    }
}

proptest! {
    #![proptest_config(cases(5000))]

    #[test]
    fn an_excitations_ramp_takes_its_time_at_every_loop_rate(settings in any_settings()) {
        let limits = channel_settings(&settings, 0).excitation;
        let ticks = limits.max_command.to_bits().cast_unsigned().div_ceil(limits.ramp_per_tick.to_bits().cast_unsigned());
        let set = settings.loop_rate_hz * u32::from(settings.excitation.ramp_ms) / 1000;
        // A step of the command per tick more or less.
        let step = set / limits.ramp_per_tick.to_bits().cast_unsigned() + 1;
        prop_assert!(ticks.abs_diff(set) <= step, "{} ticks, set {}", ticks, set);
    }
}

//! The safety states of a channel: each test says what the output did.

use std::num::NonZeroU32;

use host_tests::line::{LOOP_HZ, Line, TICKS_PER_POLL, TIMER_HZ, us};
use host_tests::{any_filter, cases, paper_design, paper_filters, settled};
use proptest::prelude::*;
use rotorlead::capture::{Decoder, Timing};
use rotorlead::channel::{
    COMMANDS_TO_ARM, Channel, ChannelSettings, ChannelSettingsError, End, Excitation, ExcitationLimits,
    ExcitationRequest, Input, NoSignal, Phase, Refusal, State,
};
use rotorlead::compensator::{Compensator, Filter};
use rotorlead::controller::{channels, filters};
use rotorlead::excitation::{ExcitationError, Multisine, ODD_LINES_30_HZ};
use rotorlead::settings::{HIGHEST_IDLE, Pulse, PulseProtocol};
use rotorlead::throttle::{Command, EscCommand};

const STOP: Command = Command::ZERO;
const NO_PULSE: EscCommand = EscCommand::NO_PULSE;

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

fn live(value: f64) -> Input {
    Input::Command(command(value))
}

/// The defaults, but that an excitation does not wait for an ESC to arm.
fn settings() -> ChannelSettings {
    let excitation = ExcitationLimits { arm_ticks: 0, ..ExcitationLimits::default() };
    ChannelSettings { excitation, ..ChannelSettings::default() }
}

fn fresh() -> Channel {
    Channel::new(&settings(), *paper_design().coefficients()).unwrap()
}

fn fresh_with(filter: Filter) -> Channel {
    Channel::new(&settings(), filter).unwrap()
}

/// The first commands at `level` of a disarmed channel, of which the last arms it: what that gives.
fn arm(channel: &mut Channel, level: f64) -> EscCommand {
    for _ in 1..COMMANDS_TO_ARM {
        assert_eq!(channel.tick(live(level)), channel.settings().stop);
        assert_eq!(channel.state(), State::Disarmed);
    }
    let output = channel.tick(live(level));
    assert_eq!(channel.state(), State::Armed);
    output
}

/// Armed for long enough that a loss is held, and at rest at `level`.
fn armed(level: f64) -> Channel {
    armed_with((*paper_design().coefficients()).into(), level)
}

fn armed_with(filter: Filter, level: f64) -> Channel {
    let mut channel = fresh_with(filter);
    channel.tick(live(0.0));
    assert_eq!(arm(&mut channel, level), steady(&filter, level));
    for _ in 0..=settings().hold_ticks {
        assert_eq!(channel.tick(live(level)), steady(&filter, level));
    }
    assert_eq!(channel.state(), State::Armed);
    channel
}

/// The output at rest at `level`.
fn steady(filter: &Filter, level: f64) -> Command {
    settled(filter, command(level))
}

fn request(nominal: f64, amplitude: f64, duration_ticks: u32) -> ExcitationRequest {
    ExcitationRequest {
        lines: ODD_LINES_30_HZ,
        nominal: command(nominal),
        amplitude: command(amplitude),
        duration_ticks,
    }
}

fn excitation(duration_ticks: u32) -> Excitation {
    Excitation::new(&settings(), &request(0.5, 0.05, duration_ticks), f64::from(LOOP_HZ)).unwrap()
}

#[test]
fn without_a_signal_there_is_no_pulse_unless_the_settings_ask_for_stop_pulses() {
    for (no_signal, expected) in [(NoSignal::NoPulses, NO_PULSE), (NoSignal::StopPulses, STOP.into())] {
        let settings = ChannelSettings { no_signal, ..settings() };
        let mut channel = Channel::new(&settings, *paper_design().coefficients()).unwrap();
        for input in [Input::Nothing, Input::Unchanged, Input::Lost, Input::Nothing] {
            assert_eq!(channel.tick(input), expected);
            assert_eq!(channel.state(), State::NoSignal);
        }
        // Nor for a command that nobody has seen disarmed: a full throttle at power-up calibrates no ESC.
        for value in [1.0, 0.5, 0.045] {
            assert_eq!(channel.tick(live(value)), expected);
            assert_eq!(channel.state(), State::Locked);
        }
    }
}

#[test]
fn below_the_arming_threshold_there_are_stop_pulses() {
    let mut channel = fresh();
    for value in [0.0, 0.01, 0.0399, 0.001, 0.0499] {
        assert_eq!(channel.tick(live(value)), STOP);
        assert_eq!(channel.tick(Input::Unchanged), STOP);
        assert_eq!(channel.state(), State::Disarmed);
    }
    assert_eq!(arm(&mut channel, 0.05), settings().idle, "the threshold itself is armed");
}

/// The stop pulse of a flight controller whose clock is 3 % off is 1030 us.
#[test]
fn a_steady_1030_us_never_arms_and_never_becomes_an_idle_pulse() {
    let mut channel = fresh();
    for _ in 0..50_000 {
        assert_eq!(channel.tick(live(0.03)), STOP);
        assert_eq!(channel.state(), State::Disarmed);
    }
}

#[test]
fn a_command_that_trembles_about_the_threshold_arms_once() {
    let mut channel = fresh();
    channel.tick(live(0.0));
    let tremble = |channel: &mut Channel| {
        (0..1000)
            .map(|n| {
                channel.tick(live(if n % 2 == 0 { 0.0501 } else { 0.0499 }));
                channel.state()
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(tremble(&mut channel), [State::Disarmed; 1000]);
    arm(&mut channel, 0.0501);
    assert_eq!(tremble(&mut channel), [State::Armed; 1000]);
    assert_eq!(channel.tick(live(0.04)), settings().idle, "the lower threshold itself is armed");
    assert_eq!(channel.tick(live(0.0399)), STOP);
    assert_eq!(channel.state(), State::Disarmed);
}

#[test]
fn arming_makes_no_kick() {
    for filter in paper_filters() {
        let idle = steady(&filter, settings().idle.to_f64()).max(settings().idle);
        for level in [0.05, 0.1, 0.5, 1.0] {
            let mut channel = fresh_with(filter);
            channel.tick(live(0.0));
            let first = arm(&mut channel, level);
            assert!(first >= settings().idle && first <= steady(&filter, level).max(idle), "{level}: {first:?}");
            for _ in 0..1000 {
                assert_eq!(channel.tick(live(level)), first);
            }
        }
    }
}

#[test]
fn a_motor_stop_passes_on_its_own_tick_whatever_the_filter_does() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.3);
        for n in 0..50 {
            channel.tick(live(0.3 + 0.01 * f64::from(n)));
        }
        assert_eq!(channel.tick(live(0.0)), STOP);
        assert_eq!(channel.state(), State::Disarmed);
        // And nothing of what the filter did is left.
        assert_eq!(arm(&mut channel, 0.2), steady(&filter, 0.2));
        assert_eq!(channel.tick(Input::Unchanged), steady(&filter, 0.2));
    }
}

#[test]
fn armed_the_output_is_the_compensator_bit_for_bit() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.5);
        let mut compensator = Compensator::new(filter, settings().idle, settings().max);
        compensator.reset(command(0.5));
        for n in 0..5000 {
            let value = command(0.5 + 0.2 * (f64::from(n) * 0.01).sin());
            assert_eq!(channel.tick(Input::Command(value)), compensator.update(value));
        }
    }
}

/// Unclamped, the lead's answer to this step is below zero for 20 ms. The lowest output of an inverse is the first multiple
/// of its step that is not below idle.
#[test]
fn a_step_down_while_armed_stops_at_idle_and_not_at_stop() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.5);
        let outputs: Vec<EscCommand> = (0..4000).map(|_| channel.tick(live(0.3))).collect();
        let lowest = outputs.iter().min().unwrap().command().unwrap();
        let idle = settings().idle;
        assert!(lowest >= idle && lowest.to_bits() - idle.to_bits() < 1 << 13, "{lowest:?}");
        let at_lowest = outputs.iter().filter(|&&output| output == lowest).count();
        println!("{at_lowest} ticks at idle");
        assert!(at_lowest > 100);
        assert_eq!(outputs.last(), Some(&steady(&filter, 0.3).into()));
    }
}

#[test]
fn on_loss_the_last_command_is_held_then_come_stop_pulses_and_then_none() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.6);
        for n in 1..=settings().hold_ticks {
            assert_eq!(channel.tick(Input::Lost), steady(&filter, 0.6), "tick {n}");
            assert_eq!(channel.state(), State::Holding);
        }
        for _ in 0..settings().stop_pulse_ticks {
            assert_eq!(channel.tick(Input::Lost), STOP);
            assert_eq!(channel.state(), State::Lost);
        }
        for _ in 0..10_000 {
            assert_eq!(channel.tick(Input::Lost), NO_PULSE);
            assert_eq!(channel.state(), State::Lost);
        }
    }
}

/// Lost at the peak of the answer to a step, which is three times the step: that is not what is held.
#[test]
fn the_hold_settles_on_the_command_and_not_on_the_filters_peak() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.4);
        let peak = (0..60).map(|_| channel.tick(live(0.5))).max().unwrap();
        assert!(peak > command(0.6), "{peak:?}");
        let mut output = NO_PULSE;
        for _ in 0..settings().hold_ticks {
            output = channel.tick(Input::Lost);
        }
        assert!((output.command().unwrap().to_f64() - 0.5).abs() < 0.01, "{output:?}");
    }
}

#[test]
fn a_loss_while_disarmed_leaves_stop_pulses_for_their_time_and_then_none() {
    let mut channel = fresh();
    channel.tick(live(0.02));
    for _ in 0..settings().stop_pulse_ticks {
        assert_eq!(channel.tick(Input::Lost), STOP);
        assert_eq!(channel.state(), State::Lost);
    }
    assert_eq!(channel.tick(Input::Lost), NO_PULSE);
}

#[test]
fn without_a_hold_time_stop_comes_at_once() {
    let settings = ChannelSettings { hold_ticks: 0, ..settings() };
    let mut channel = Channel::new(&settings, *paper_design().coefficients()).unwrap();
    channel.tick(live(0.0));
    arm(&mut channel, 0.5);
    assert_eq!(channel.tick(Input::Lost), STOP);
    // For however long it was armed.
    channel.tick(live(0.0));
    arm(&mut channel, 0.5);
    for _ in 0..1000 {
        channel.tick(live(0.5));
    }
    assert_eq!(channel.tick(Input::Lost), STOP);
}

#[test]
fn a_return_within_the_hold_time_starts_where_the_output_is() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.5);
        for _ in 0..settings().hold_ticks {
            assert_eq!(channel.tick(Input::Lost), command(0.5));
        }
        // 0.7 would kick a filter to the end of the range: the lead to 0.5 + 3.43 * 0.2. What is left over fades by |k| / 2 or
        // B / 2 a tick.
        let fade = match filter {
            Filter::Lead(lead) => -f64::from(lead.coefficients.k()) / 2.0_f64.powi(33),
            Filter::Inverse(inverse) => f64::from(inverse.coefficients.b()) / 2.0_f64.powi(31),
        };
        let end = steady(&filter, 0.7);
        let mut last = command(0.5);
        for n in 0..5000 {
            let output = channel.tick(live(0.7)).command().unwrap();
            assert!(output >= last && output <= end, "tick {n}: {output:?} after {last:?}");
            assert!(output.to_f64() - last.to_f64() <= 0.2001 * fade + 1e-8, "tick {n}");
            last = output;
        }
        assert_eq!(last, end);
        assert_eq!(channel.state(), State::Armed);

        // To the same command: no bit changes.
        channel.tick(Input::Lost);
        for _ in 0..1000 {
            assert_eq!(channel.tick(live(0.7)), end);
        }
    }
}

#[test]
fn a_return_after_the_stop_must_be_seen_disarmed_first() {
    let mut channel = armed(0.5);
    for _ in 0..=settings().hold_ticks {
        channel.tick(Input::Lost);
    }
    // One of the stop pulses has come.
    for n in 1..20_000 {
        let expected = if n < settings().stop_pulse_ticks { STOP.into() } else { NO_PULSE };
        assert_eq!(channel.tick(live(0.5)), expected, "tick {n}");
        assert_eq!(channel.state(), State::Locked);
    }
    // Lost again: still nothing, no hold of a command that never was let through.
    assert_eq!(channel.tick(Input::Lost), NO_PULSE);
    assert_eq!(channel.tick(live(0.5)), NO_PULSE);
    assert_eq!(channel.tick(live(0.0)), STOP);
    assert_eq!(channel.state(), State::Disarmed);
    assert_eq!(arm(&mut channel, 0.5), command(0.5));
}

/// A brown-out: the flight controller goes on flying, the channel starts anew.
#[test]
fn a_reset_while_armed_leaves_the_motor_stopped_until_a_disarmed_command_was_seen() {
    for filter in paper_filters() {
        let mut channel = armed_with(filter, 0.5);
        channel.tick(live(0.5));
        for mut channel in [fresh_with(filter), channel.fresh_copy(true)] {
            for _ in 0..20 * LOOP_HZ {
                assert_eq!(channel.tick(live(0.5)), NO_PULSE);
            }
            assert_eq!(channel.tick(live(0.01)), STOP);
            assert_eq!(arm(&mut channel, 0.5), command(0.5));
        }
    }
}

/// Whatever it did before.
#[test]
fn made_afresh_a_channel_is_as_it_was_made() {
    for filter in paper_filters() {
        for is_enabled in [true, false] {
            let mut used = armed_with(filter, 0.5);
            for n in 0..50 {
                used.tick(live(0.5 + 0.001 * f64::from(n)));
            }
            used.set_enabled(!is_enabled);
            used.tick(live(0.9));
            let mut new = fresh_with(filter);
            new.set_enabled(is_enabled);
            let mut fresh_copy = used.fresh_copy(is_enabled);
            for input in [0.0, 0.3, 0.35, 0.6, 0.2, 0.0, 0.5].map(live) {
                for _ in 0..100 {
                    assert_eq!(fresh_copy.tick(input), new.tick(input));
                    assert_eq!((fresh_copy.state(), fresh_copy.command()), (new.state(), new.command()));
                }
            }
        }
    }
}

#[test]
fn switched_out_the_channel_is_a_wire_within_its_limits() {
    for filter in paper_filters() {
        let mut channel = fresh_with(filter);
        channel.set_enabled(false);
        channel.tick(live(0.0));
        arm(&mut channel, 0.2);
        for value in [0.5, 0.9, 0.045, 0.31] {
            assert_eq!(channel.tick(live(value)), command(value).max(settings().idle));
        }
        for _ in 0..=settings().hold_ticks {
            channel.tick(live(0.31));
        }
        assert_eq!(channel.tick(Input::Lost), command(0.31));
        assert_eq!(channel.tick(live(0.8)), command(0.8), "a return has nothing to smooth");
    }
}

/// Everything from the pin to the pulse: good pulses, silence, noise, good pulses again.
#[test]
fn a_wire_that_comes_off_stops_the_motor_and_a_noisy_one_does_not_start_it() {
    let scale = PulseProtocol::StandardPwm.at(400).scale(TIMER_HZ).unwrap();
    let servo = |start_us: f64, width_us: f64, count| Line::pulses(us(start_us), us(2500.0), us(width_us), count);
    // 0.25 s disarmed, 0.25 s armed, off; from 1 s on every 0.7 ms an edge: an open wire beside a motor.
    let mut line = servo(1000.0, 1000.0, 100).then(&servo(251_000.0, 1500.0, 100));
    for n in 0..2000 {
        let level = if n % 2 == 0 { rotorlead::capture::Level::High } else { rotorlead::capture::Level::Low };
        line.level(us(1e6 + 700.0 * f64::from(n)), level);
    }
    let line = line.then(&servo(2_600_000.0, 1500.0, 100)).then(&servo(2_900_000.0, 1000.0, 100));
    let line = line.then(&servo(3_200_000.0, 1250.0, 100));

    let mut decoder = Decoder::new(Timing::new(PulseProtocol::StandardPwm.at(400), TIMER_HZ, LOOP_HZ).unwrap());
    let mut channel = fresh();
    let signals = host_tests::line::decode(&mut decoder, &line, 0, us(3.449e6));
    let outputs: Vec<(f64, u32)> = signals
        .into_iter()
        .map(|(time, signal)| {
            let output = scale.to_width_ticks(channel.tick(Input::from_reading(signal.into(), &scale)));
            (time as f64 / f64::from(TIMER_HZ), output)
        })
        .collect();
    let all = |from: f64, to: f64, ticks: u64| {
        outputs.iter().filter(|(time, _)| *time >= from && *time < to).all(|&(_, output)| u64::from(output) == ticks)
    };
    // Live with the third pulse of which all is seen, which ends at 9.5 ms.
    assert!(all(0.0, 0.0095, 0));
    // The third pulse of 1500 us ends at 257.5 ms.
    assert!(all(0.0098, 0.2574, us(1000.0)));
    assert!(all(0.2578, 0.4999, us(1500.0)), "armed");
    // The last pulse ends at 0.5 s: 100 ms of timeout, 100 ms of hold.
    assert!(all(0.5, 0.6998, us(1500.0)), "held");
    assert!(all(0.7004, 1.0, us(1000.0)), "stopped");
    assert!(all(1.0, 2.6, us(1000.0)), "noise turns no motor");
    assert!(all(2.6, 2.7, us(1000.0)), "armed commands that come back are not let through before disarmed ones");
    assert!(all(2.7010, 2.9010, 0), "two seconds of stop pulses are over");
    assert!(all(2.9013, 3.2, us(1000.0)), "disarmed");
    assert!(all(3.2065, 3.4499, us(1250.0)), "armed again");
    assert_eq!(TICKS_PER_POLL, 16_800);
}

#[test]
fn an_excitation_ramps_up_plays_the_lines_bit_for_bit_and_ramps_down() {
    let mut channel = fresh();
    channel.set_enabled(false);
    channel.start_excitation(excitation(100_000)).unwrap();
    assert_eq!(channel.last_end(), None);
    let mut outputs = Vec::new();
    let mut phases = Vec::new();
    while !matches!(channel.state(), State::NoSignal) {
        channel.keep_alive();
        outputs.push(channel.tick(Input::Nothing));
        phases.push(channel.state());
    }
    let step = settings().excitation.ramp_per_tick.to_bits();
    let ramp_ticks = (command(0.5).to_bits() as usize).div_ceil(step as usize);
    let idle = settings().idle;
    let limited = |bits: i32| {
        let command = Command::saturating_from_bits(bits);
        if command < settings().arming_threshold { command } else { command.max(idle) }
    };
    for (n, &output) in outputs[..ramp_ticks].iter().enumerate() {
        assert_eq!(output, limited((n as i32 + 1) * step).min(command(0.5)), "ramp up, tick {n}");
    }
    // The amplitude is the command's, not the decimal's: 0.05 lies between two commands.
    let mut multisine = Multisine::new(ODD_LINES_30_HZ, 0.5, command(0.05).to_f64(), 5000.0).unwrap();
    multisine.start(NonZeroU32::new(2));
    for (n, &output) in outputs[ramp_ticks..ramp_ticks + 100_000].iter().enumerate() {
        assert_eq!(output, multisine.update(), "sample {n}");
    }
    let last = outputs[ramp_ticks + 100_000 - 1].to_bits();
    for (n, &output) in outputs[ramp_ticks + 100_000..].iter().enumerate() {
        assert_eq!(output, limited(last - (n as i32 + 1) * step), "ramp down, tick {n}");
    }
    assert_eq!(outputs.last(), Some(&STOP.into()));
    assert_eq!(channel.last_end(), Some(End::Completed));
    assert!(phases.contains(&State::Excitation(Phase::RampUp)) && phases.contains(&State::Excitation(Phase::RampDown)));
    // The motor is the pilot's again, who has to disarm first; without one the stop pulses end.
    assert_eq!(channel.tick(live(0.5)), STOP);
    for _ in 0..settings().stop_pulse_ticks - 2 {
        assert_eq!(channel.tick(Input::Nothing), STOP);
    }
    assert_eq!(channel.tick(Input::Nothing), NO_PULSE);
}

#[test]
fn before_an_excitation_the_esc_has_stop_pulses_for_3_s_to_arm() {
    let settings = ChannelSettings::default();
    let mut channel = Channel::new(&settings, *paper_design().coefficients()).unwrap();
    let excitation = Excitation::new(&settings, &request(0.5, 0.05, 1000), f64::from(LOOP_HZ)).unwrap();
    assert_eq!(channel.tick(Input::Nothing), NO_PULSE);
    channel.start_excitation(excitation).unwrap();
    for _ in 0..3 * LOOP_HZ {
        channel.keep_alive();
        assert_eq!(channel.tick(Input::Nothing), STOP);
        assert_eq!(channel.state(), State::Excitation(Phase::Arming));
    }
    assert_eq!(channel.tick(Input::Nothing), settings.excitation.ramp_per_tick);
    assert_eq!(channel.state(), State::Excitation(Phase::RampUp));
}

#[test]
fn an_excitation_goes_through_the_filter_where_it_is_in_the_path() {
    for filter in paper_filters() {
        let mut channel = fresh_with(filter);
        let mut compensator = Compensator::new(filter, settings().idle, settings().max);
        channel.start_excitation(excitation(1000)).unwrap();
        let (mut was_armed, mut played, mut differs) = (false, 0, 0);
        while played < 1000 {
            channel.keep_alive();
            let output = channel.tick(Input::Nothing);
            let level = channel.command();
            let is_armed = level >= settings().arming_threshold;
            if is_armed {
                if !was_armed {
                    compensator.reset(level);
                }
                assert_eq!(output, compensator.update(level), "the filter's own answer");
                assert!(output >= settings().idle);
            }
            was_armed = is_armed;
            if channel.state() == State::Excitation(Phase::Playing) {
                played += 1;
                differs += u32::from(output != level);
            }
        }
        assert!(differs > 900);
    }
}

/// The host vanishes: on the ramp up, or while the lines are played.
#[test]
fn without_a_keep_alive_for_200_ms_the_motor_is_ramped_down() {
    let limits = settings().excitation;
    assert_eq!(limits.dead_man_ticks, LOOP_HZ / 5);
    for last_keep_alive in [0_u32, 3000, 9999, 20_000] {
        let mut channel = fresh();
        channel.set_enabled(false);
        channel.start_excitation(excitation(400_000)).unwrap();
        for _ in 0..last_keep_alive {
            channel.keep_alive();
            channel.tick(Input::Nothing);
        }
        channel.keep_alive();
        for _ in 0..limits.dead_man_ticks {
            channel.tick(Input::Nothing);
            assert_ne!(channel.state(), State::Excitation(Phase::RampDown));
        }
        let from = channel.command();
        let mut last = channel.tick(Input::Nothing);
        assert_eq!(channel.state(), State::Excitation(Phase::RampDown));
        let ticks = (from.to_bits() as u32).div_ceil(limits.ramp_per_tick.to_bits() as u32);
        for _ in 1..ticks {
            // A host that comes back does not revive it.
            channel.keep_alive();
            let output = channel.tick(Input::Nothing);
            assert!(output <= last);
            last = output;
        }
        assert_eq!((last, channel.last_end()), (STOP.into(), Some(End::DeadMan)), "after {last_keep_alive}");
        assert_eq!(channel.tick(Input::Nothing), STOP);
        assert_eq!(channel.state(), State::NoSignal);
    }
}

#[test]
fn a_host_can_end_an_excitation_early() {
    let mut channel = fresh();
    channel.start_excitation(excitation(400_000)).unwrap();
    for _ in 0..15_000 {
        channel.keep_alive();
        channel.tick(Input::Nothing);
    }
    channel.stop_excitation();
    let ticks = (0..).take_while(|_| channel.tick(Input::Nothing) > STOP).count();
    // 0.55 at 0.25 a second.
    assert!(ticks <= 11_001, "{ticks}");
    assert_eq!(channel.last_end(), Some(End::Requested));
}

#[test]
fn a_disarmed_pulse_ends_an_excitation_at_once_and_an_armed_one_down_the_ramp() {
    let run = || {
        let mut channel = fresh();
        channel.start_excitation(excitation(400_000)).unwrap();
        for _ in 0..12_000 {
            channel.keep_alive();
            channel.tick(Input::Nothing);
        }
        channel
    };
    let mut channel = run();
    assert_eq!(channel.tick(live(0.01)), STOP);
    assert_eq!((channel.state(), channel.last_end()), (State::Disarmed, Some(End::PulseInput)));

    let mut channel = run();
    let ticks = (0..)
        .take_while(|_| {
            channel.keep_alive();
            channel.tick(live(0.9)) > STOP
        })
        .count();
    assert!((9_000..=11_001).contains(&ticks), "{ticks}");
    assert_eq!((channel.state(), channel.last_end()), (State::Locked, Some(End::PulseInput)));
    for _ in 0..1000 {
        assert_eq!(channel.tick(live(0.9)), STOP);
    }
}

#[test]
fn an_excitation_is_refused_while_a_pulse_input_has_the_motor() {
    let start = |channel: &mut Channel| channel.start_excitation(excitation(1000));
    let mut channel = fresh();
    channel.tick(live(0.5));
    assert_eq!((channel.state(), start(&mut channel)), (State::Locked, Err(Refusal::InputLive)));
    channel.tick(live(0.0));
    assert_eq!((channel.state(), start(&mut channel)), (State::Disarmed, Err(Refusal::InputLive)));
    for _ in 0..settings().hold_ticks + 4 {
        channel.tick(live(0.5));
    }
    assert_eq!((channel.state(), start(&mut channel)), (State::Armed, Err(Refusal::InputLive)));
    channel.tick(Input::Lost);
    assert_eq!((channel.state(), start(&mut channel)), (State::Holding, Err(Refusal::InputHeld)));
    // None of this touched the output.
    assert_eq!(channel.tick(Input::Lost), command(0.5));
    for _ in 0..settings().hold_ticks {
        channel.tick(Input::Lost);
    }
    assert_eq!((channel.state(), start(&mut channel)), (State::Lost, Ok(())));
    assert_eq!(start(&mut channel), Err(Refusal::AlreadyRunning));

    let other = ChannelSettings { max: command(0.6), ..settings() };
    let mut channel = Channel::new(&other, *paper_design().coefficients()).unwrap();
    assert_eq!(start(&mut channel), Err(Refusal::OtherSettings));
    assert_eq!(channel.tick(Input::Nothing), NO_PULSE);
}

#[test]
fn an_excitation_outside_the_limits_is_refused_with_the_limit() {
    let refusal = |nominal, amplitude, ticks, rate_hz| {
        Excitation::new(&settings(), &request(nominal, amplitude, ticks), rate_hz).map(|_| ()).unwrap_err()
    };
    let limits = settings().excitation;
    let text = |refusal: Refusal, part: &str| assert!(refusal.to_string().contains(part), "{refusal}");

    let error = refusal(0.5, 0.11, 1000, 5000.0);
    assert_eq!(error, Refusal::AmplitudeTooHigh { amplitude: command(0.11), max: limits.max_amplitude });
    text(error, "0.1");
    assert!(matches!(refusal(0.09, 0.05, 1000, 5000.0), Refusal::BelowIdle { idle, .. } if idle == settings().idle));
    assert!(matches!(refusal(0.78, 0.05, 1000, 5000.0), Refusal::AboveMax { max, .. } if max == limits.max_command));
    assert!(matches!(refusal(1.0, 0.1, 1000, 5000.0), Refusal::AboveMax { .. }));
    for ticks in [0, limits.max_ticks + 1, u32::MAX] {
        assert_eq!(refusal(0.5, 0.05, ticks, 5000.0), Refusal::Duration { ticks, max_ticks: limits.max_ticks });
    }
    assert!(matches!(refusal(0.5, 0.0, 1000, 5000.0), Refusal::Generator(ExcitationError::OutOfRange { .. })));
    assert!(matches!(refusal(0.5, 0.05, 1000, 50.0), Refusal::Generator(ExcitationError::AboveNyquist { .. })));
    text(refusal(0.5, 0.05, 1000, f64::NAN), "loop_rate_hz");
    assert!(Excitation::new(&settings(), &request(0.1, 0.05, limits.max_ticks), 5000.0).is_ok());
    // A lower `max` of the channel counts too.
    let low = ChannelSettings { max: command(0.54), ..settings() };
    assert!(matches!(
        Excitation::new(&low, &request(0.5, 0.05, 1000), 5000.0),
        Err(Refusal::AboveMax { max, .. }) if max == low.max
    ));
}

#[test]
fn settings_that_contradict_each_other_make_no_channel() {
    let good = settings();
    let limits = good.excitation;
    let tried = [
        (ChannelSettings { stop: good.disarming_threshold, ..good }, ChannelSettingsError::DisarmingNotAboveStop),
        (ChannelSettings { arming_threshold: command(0.039), ..good }, ChannelSettingsError::ArmingBelowDisarming),
        (ChannelSettings { idle: command(0.049), ..good }, ChannelSettingsError::IdleBelowThreshold),
        (ChannelSettings { max: good.idle, ..good }, ChannelSettingsError::MaxNotAboveIdle),
        (
            ChannelSettings {
                excitation: ExcitationLimits {
                    ramp_per_tick: Command::saturating_from_bits(limits.max_command.to_bits() >> 17),
                    ..limits
                },
                ..good
            },
            ChannelSettingsError::RampTooSlow,
        ),
        (
            ChannelSettings { excitation: ExcitationLimits { dead_man_ticks: 0, ..limits }, ..good },
            ChannelSettingsError::NoDeadMan,
        ),
    ];
    for (settings, error) in tried {
        assert_eq!(Channel::new(&settings, *paper_design().coefficients()).map(|_| ()).unwrap_err(), error);
    }
}

/// Raw duty has no pulse at 0: its stop is above.
#[test]
fn the_stop_pulse_is_the_one_that_is_set() {
    let settings = ChannelSettings { stop: command(0.02), no_signal: NoSignal::StopPulses, ..settings() };
    let mut channel = Channel::new(&settings, *paper_design().coefficients()).unwrap();
    assert_eq!(channel.tick(Input::Nothing), command(0.02));
    assert_eq!(channel.tick(live(0.6)), command(0.02));
    assert_eq!(channel.tick(live(0.01)), command(0.02));
    for _ in 0..settings.hold_ticks + 4 {
        channel.tick(live(0.6));
    }
    for _ in 0..settings.hold_ticks {
        assert_eq!(channel.tick(Input::Lost), command(0.6));
    }
    assert_eq!(channel.tick(Input::Lost), command(0.02));
    channel.start_excitation(Excitation::new(&settings, &request(0.5, 0.05, 10), 5000.0).unwrap()).unwrap();
    let mut lowest = EscCommand::from(Command::ONE);
    while channel.last_end().is_none() {
        channel.keep_alive();
        lowest = lowest.min(channel.tick(Input::Lost));
    }
    assert_eq!(lowest, command(0.02));
}

/// As many as make an input live; what comes in between starts the count again.
#[test]
fn fewer_commands_than_three_in_a_row_turn_no_motor() {
    let mut channel = fresh();
    channel.tick(live(0.0));
    for n in 0..1000 {
        // Ticks without news are no commands, and take none back.
        for input in [live(0.7), Input::Unchanged, live(0.7), Input::Unchanged, live(f64::from(n % 5) / 100.0)] {
            assert_eq!(channel.tick(input), STOP);
        }
    }
    for input in [live(0.7), Input::Unchanged, live(0.9), Input::Unchanged] {
        assert_eq!(channel.tick(input), STOP);
    }
    assert_eq!(channel.tick(live(0.7)), command(0.7));
}

/// 40 disarmed pulses, a few of 1700 us, and silence: what made them was no pilot.
#[test]
fn what_has_armed_for_no_longer_than_the_hold_is_not_held() {
    for hold_ticks in [1, 500, 5000] {
        let settings = ChannelSettings { hold_ticks, ..settings() };
        let arm_for = |ticks: u32| {
            let mut channel = Channel::new(&settings, *paper_design().coefficients()).unwrap();
            channel.tick(live(0.0));
            arm(&mut channel, 0.7);
            for _ in 0..ticks {
                channel.tick(live(0.7));
            }
            channel
        };
        for ticks in [0, hold_ticks / 2, hold_ticks] {
            let mut channel = arm_for(ticks);
            // Ticks without news are none of somebody who flies: they end in the loss.
            for _ in 0..600 {
                assert_eq!(channel.tick(Input::Unchanged), command(0.7));
            }
            assert_eq!(
                (channel.tick(Input::Lost), channel.state()),
                (STOP.into(), State::Lost),
                "{ticks} of {hold_ticks}"
            );
            assert_eq!(channel.tick(live(0.7)), STOP);
            assert_eq!(channel.state(), State::Locked);
        }
        let mut channel = arm_for(hold_ticks + 1);
        assert_eq!((channel.tick(Input::Lost), channel.state()), (command(0.7).into(), State::Holding));
        // Once held, it is held again.
        channel.tick(live(0.7));
        assert_eq!((channel.tick(Input::Lost), channel.state()), (command(0.7).into(), State::Holding));
    }
}

/// With the levels of a DShot input there is no gap: each throttle turns the motor, and each stop stops it.
#[test]
fn equal_levels_arm_with_three_and_disarm_with_one() {
    let lowest = rotorlead::dshot::Value::LOWEST_THROTTLE.command();
    let levels = ChannelSettings { disarming_threshold: lowest, arming_threshold: lowest, idle: lowest, ..settings() };
    let mut channel = Channel::new(&levels, *paper_design().coefficients()).unwrap();
    channel.set_enabled(false);
    channel.tick(Input::Command(STOP));
    assert_eq!(arm(&mut channel, 0.01), command(0.01));
    for value in [lowest, command(0.002), lowest] {
        assert_eq!(channel.tick(Input::Command(value)), value);
    }
    assert_eq!((channel.tick(Input::Command(STOP)), channel.state()), (STOP.into(), State::Disarmed));
}

#[test]
fn a_hosts_command_arms_at_once() {
    let mut channel = fresh();
    assert_eq!(channel.inject(command(0.5)), NO_PULSE, "and only a disarmed channel");
    assert_eq!(channel.inject(STOP), STOP);
    assert_eq!((channel.inject(command(0.5)), channel.state()), (command(0.5).into(), State::Armed));
}

#[test]
fn how_long_a_channel_is_at_rest_is_known() {
    let mut channel = fresh();
    assert_eq!(channel.rest_ticks(), 0, "nobody knows what was before");
    channel.tick(live(0.0));
    assert_eq!(channel.rest_ticks(), 1);
    arm(&mut channel, 0.5);
    for _ in 0..1000 {
        channel.tick(live(0.5));
        assert_eq!(channel.rest_ticks(), 0);
    }
    for n in 1..100 {
        channel.tick(live(0.0));
        assert_eq!(channel.rest_ticks(), n);
    }
    assert_eq!(channel.fresh_copy(true).rest_ticks(), 99);
    channel.tick(Input::Lost);
    assert_eq!(channel.rest_ticks(), 100);
    channel.start_excitation(excitation(10)).unwrap();
    channel.tick(Input::Nothing);
    assert_eq!(channel.rest_ticks(), 0);
}

/// What a reset takes away is what a loss of the input would have been held with.
#[test]
fn a_resumed_channel_holds_for_what_is_left_and_goes_on() {
    for filter in paper_filters() {
        let mut before = armed_with(filter, 0.5);
        let (level, ticks_left) = before.hold_state().unwrap();
        assert_eq!((level, ticks_left), (command(0.5), settings().hold_ticks));
        for _ in 0..100 {
            before.tick(Input::Lost);
        }
        let (level, ticks_left) = before.hold_state().unwrap();
        assert_eq!(ticks_left, settings().hold_ticks - 100);
        let resumed = || {
            let mut channel = fresh_with(filter);
            channel.resume(level, ticks_left);
            channel
        };
        let mut channel = resumed();
        for _ in 0..ticks_left {
            assert_eq!((channel.tick(Input::Nothing), channel.state()), (steady(&filter, 0.5).into(), State::Holding));
        }
        assert_eq!((channel.tick(Input::Nothing), channel.state()), (STOP.into(), State::Lost));
        let mut channel = resumed();
        channel.tick(Input::Nothing);
        channel.tick(live(0.5));
        assert_eq!(channel.state(), State::Armed);
        let mut channel = resumed();
        assert_eq!((channel.tick(live(0.0)), channel.state()), (STOP.into(), State::Disarmed));
    }
    // No more than the settings hold, nothing that means a stop, and nothing while anything else goes on.
    let mut channel = fresh();
    channel.resume(command(0.5), u32::MAX);
    assert_eq!(channel.hold_state(), Some((command(0.5), settings().hold_ticks)));
    for mut channel in [fresh(), armed(0.3)] {
        let before = channel.state();
        channel.resume(command(if before == State::Armed { 0.9 } else { 0.039 }), 500);
        assert_eq!(channel.state(), before);
    }
    for (input, ticks) in [(live(0.5), 1), (live(0.0), 1), (live(0.5), 2)] {
        let mut channel = fresh();
        for _ in 0..ticks {
            channel.tick(input);
        }
        assert_eq!(channel.hold_state(), None, "{:?}", channel.state());
    }
    let mut channel = fresh();
    channel.start_excitation(excitation(1000)).unwrap();
    (0..5000).for_each(|_| {
        channel.keep_alive();
        channel.tick(Input::Nothing);
    });
    assert_eq!(channel.hold_state(), None);
}

/// What happens to a channel in one tick of a random life.
#[derive(Clone, Copy, Debug)]
enum Event {
    /// The input has this, for so many ticks.
    Input(Input, u32),
    Start,
    Stop,
    KeepAlive,
    SetEnabled(bool),
}

fn any_event() -> impl Strategy<Value = Event> {
    let near = |value: f64| Just(command(value).to_bits());
    let any_command = prop_oneof![0..=1_i32 << 29, 0..1_i32 << 25, Just(0), near(0.04), near(0.05)]
        .prop_map(Command::saturating_from_bits);
    let input = prop_oneof![
        4 => any_command.prop_map(Input::Command),
        2 => Just(Input::Unchanged),
        2 => Just(Input::Lost),
        1 => Just(Input::Nothing),
    ];
    let ticks = prop_oneof![Just(1_u32), 1..50_u32, 300..700_u32];
    prop_oneof![
        12 => (input, ticks).prop_map(|(input, ticks)| Event::Input(input, ticks)),
        2 => Just(Event::Start),
        1 => Just(Event::Stop),
        2 => Just(Event::KeepAlive),
        1 => any::<bool>().prop_map(Event::SetEnabled),
    ]
}

/// Any limits that a channel takes, in control ticks that a random life sees the end of.
fn any_settings() -> impl Strategy<Value = ChannelSettings> {
    let levels = proptest::collection::vec(0.0..1.0_f64, 4);
    let ticks = || prop_oneof![Just(0_u32), Just(1), 2..600_u32];
    let no_signal = prop_oneof![Just(NoSignal::NoPulses), Just(NoSignal::StopPulses)];
    (0.0..0.03_f64, levels, ticks(), ticks(), 0..50_u32, no_signal).prop_filter_map(
        "levels too close to each other",
        |(stop, mut levels, hold_ticks, stop_pulse_ticks, arm_ticks, no_signal)| {
            levels.sort_by(f64::total_cmp);
            // Where a multisine around 0.5 fits.
            let level = |n: usize, low: f64, high: f64| command(low + (high - low) * levels[n]);
            let settings = ChannelSettings {
                stop: command(stop),
                disarming_threshold: level(0, 0.031, 0.4),
                arming_threshold: level(1, 0.031, 0.4),
                idle: level(2, 0.031, 0.4),
                max: level(3, 0.6, 1.0),
                hold_ticks,
                stop_pulse_ticks,
                no_signal,
                // Fast, so that random lives see all of a ramp.
                excitation: ExcitationLimits { ramp_per_tick: command(0.01), arm_ticks, ..settings().excitation },
            };
            settings.validate().ok().map(|()| settings)
        },
    )
}

proptest! {
    #![proptest_config(cases(1500))]

    /// A second, much simpler account of what a motor may do, beside the channel, over all settings that a channel takes.
    #[test]
    fn whatever_happens_no_motor_turns_that_should_not(
        events in proptest::collection::vec(any_event(), 1..60),
        settings in any_settings(),
        filter in any_filter(),
    ) {
        let made = Excitation::new(&settings, &request(0.5, 0.05, 200), 5000.0).unwrap();
        let mut channel = Channel::new(&settings, filter.filter).unwrap();
        let (mut last_live, mut lost_ticks, mut disarmed_seen) = (None, 0_u32, false);
        // Commands in a row that arm, and whether a motor that stands has seen enough of them.
        let (mut arming, mut has_armed) = (0_u8, false);
        let (mut excited, mut silent_ticks) = (false, 0_u32);
        // Ticks since somebody had the motor.
        let mut unattended = u32::MAX;
        for event in events {
            let (input, ticks) = match event {
                Event::Input(input, ticks) => (input, ticks),
                Event::Start => {
                    let allowed = last_live.is_none() && matches!(channel.state(), State::NoSignal | State::Lost);
                    prop_assert_eq!(channel.start_excitation(made.clone()).is_ok(), allowed);
                    if allowed {
                        (excited, silent_ticks, disarmed_seen) = (true, 0, false);
                    }
                    continue;
                }
                Event::Stop => { channel.stop_excitation(); continue; }
                Event::KeepAlive => { channel.keep_alive(); silent_ticks = 0; continue; }
                Event::SetEnabled(enabled) => { channel.set_enabled(enabled); continue; }
            };
            for _ in 0..ticks {
                match input {
                    Input::Command(command) => { last_live = Some(command); lost_ticks = 0; }
                    Input::Unchanged if last_live.is_some() => {}
                    _ => { last_live = None; lost_ticks += 1; }
                }
                silent_ticks += 1;
                unattended = unattended.saturating_add(1);
                if lost_ticks > settings.hold_ticks {
                    disarmed_seen = false;
                }
                let was_excited = excited;
                let output = channel.tick(input);
                match input {
                    Input::Command(command) if command >= settings.arming_threshold => arming = arming.saturating_add(1),
                    Input::Command(_) => arming = 0,
                    Input::Unchanged if last_live.is_some() => {}
                    _ => arming = 0,
                }
                has_armed |= arming >= COMMANDS_TO_ARM;
                if last_live.is_some_and(|live| live < settings.disarming_threshold) {
                    has_armed = false;
                }
                if last_live.is_some_and(|live| live < settings.disarming_threshold) {
                    disarmed_seen = true;
                    excited = false;
                    unattended = 0;
                    prop_assert_eq!(output, settings.stop, "a disarmed command stops the motor");
                }
                excited &= matches!(channel.state(), State::Excitation(_));
                let has_owner = matches!(channel.state(), State::Disarmed | State::Armed | State::Holding);
                if excited || was_excited || has_owner {
                    unattended = 0;
                }
                if !excited && !disarmed_seen {
                    prop_assert!(output <= settings.stop, "turns before a disarmed command, or after loss and hold");
                }
                if channel.state().is_at_rest() {
                    prop_assert!(output <= settings.stop, "{:?} is above the stop", channel.state());
                }
                if unattended > settings.stop_pulse_ticks && settings.no_signal == NoSignal::NoPulses {
                    prop_assert_eq!(output, NO_PULSE, "pulses that nobody has asked for");
                }
                // 200 ms of dead-man and 0.55 at 0.01 a tick.
                if excited {
                    prop_assert!(silent_ticks <= settings.excitation.dead_man_ticks + 56, "nobody watches");
                }
                if channel.state() == State::Armed {
                    prop_assert!(disarmed_seen && has_armed && output >= settings.idle && output <= settings.max);
                    prop_assert!(last_live.is_some_and(|live| live >= settings.disarming_threshold));
                }
                let is_ramp = matches!(channel.state(), State::Excitation(_)) && output < settings.arming_threshold;
                prop_assert!(
                    output <= settings.stop || output >= settings.idle || is_ramp, "{output:?} between stop and idle"
                );
            }
        }
    }

    #[test]
    fn after_loss_and_hold_the_motor_is_stopped(
        levels in proptest::collection::vec((0.0..1.0_f64, 1..400_u32), 1..10),
        hold_ticks in 0..1000_u32,
        filter in any_filter(),
    ) {
        let settings = ChannelSettings { hold_ticks, ..settings() };
        let mut channel = Channel::new(&settings, filter.filter).unwrap();
        channel.tick(live(0.0));
        for (level, ticks) in levels {
            for _ in 0..ticks {
                channel.tick(live(level));
            }
        }
        for n in 1..=hold_ticks + 100 {
            let output = channel.tick(Input::Lost);
            prop_assert!(n <= hold_ticks || output <= STOP, "{output:?} {n} ticks after the loss");
        }
    }

    /// A slip in a setting (0.5 for 0.05) must not turn a motor at half its throttle when it is armed: over all valid settings,
    /// with and without frames at the input, compensated or not.
    #[test]
    fn at_the_lowest_command_that_arms_no_output_is_above_a_fifth(
        settings in host_tests::any_settings(),
        has_frames: bool,
    ) {
        let mut settings = settings.into_settings();
        if has_frames {
            settings.input = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 1000 };
        }
        // Levels of pulses that are too near each other for these protocols are another matter.
        let Ok(settings) = settings.validate() else { return Ok(()) };
        let Ok(filters) = filters(&settings) else { return Ok(()) };
        let fifth = Command::saturating_from_bits(HIGHEST_IDLE);
        for mut channel in channels(&settings, filters).unwrap() {
            let lowest = channel.settings().arming_threshold;
            channel.tick(Input::Command(channel.settings().stop));
            for _ in 0..2000 {
                let output = channel.tick(Input::Command(lowest));
                prop_assert!(output <= fifth, "{output:?} at {lowest:?}");
            }
            prop_assert_eq!(channel.state(), State::Armed);
        }
    }
}

//! The image that would be flashed, in QEMU, driven over its link. `cargo xtask test` builds the images and runs these.

use std::time::{Duration, Instant};

use host_tests::emulator::{HostLate, Machine, PATIENCE, PortWrite, Start, image, keeping_up, panicking_image};
use host_tests::flash::Flash;
use host_tests::scenario::table::{self, Column};
use host_tests::scenario::yes;
use host_tests::{TABLE_1, multisine};
use rotorlead::channel::{Channel, Excitation, ExcitationRequest, Input};
use rotorlead::controller::{Frames, Plan, channel_settings, channels, filters, load};
use rotorlead::link::{
    ChannelState, Clock, ExciteRequest, InjectRequest, LineSet, MAX_LOAD_PERCENT, Message, NO_PULSE, Record,
    RecordRequest, Refusal, Request, ResetReason, Series, Source,
};
use rotorlead::settings::{NoSignal, Origin, Pulse, PulseProtocol, Settings, Store, Validated};
use rotorlead::throttle::{Command, EscCommand, PulseScale};

/// Where there is nothing to be executed.
const NOTHING: u32 = 0x6000_0000;
/// Prescaler and reload registers of TIM3, which puts out the pulses.
const PRESCALER: u32 = 0x4000_0428;
const RELOAD: u32 = 0x4000_042C;
/// Compare register of the first output: channel 1 of TIM3.
const OUTPUT_1: u32 = 0x4000_0434;
/// Bytes of a sector of the settings.
const SECTOR: usize = 128 * 1024;

/// The defaults, with the longest hold time: the emulated time runs ahead of a host.
fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.motors.iter_mut().for_each(|motor| motor.hold_ms = 1000);
    settings
}

/// The same, with stop pulses where there is no signal.
fn with_stop_pulses() -> Settings {
    Settings { no_signal: NoSignal::StopPulses, ..settings() }
}

fn valid(settings: &Settings) -> Validated {
    settings.clone().validate().unwrap_or_else(|error| panic!("{error}"))
}

/// The sectors of the settings after these were saved.
fn saved(settings: &Settings) -> Vec<u8> {
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&valid(settings)).unwrap();
    store.into_flash().bytes
}

/// Sets them over the link.
fn set(machine: &mut Machine, settings: &Settings) {
    let taken = machine.link.ask(&Request::SetSettings(settings.clone()));
    assert_eq!(taken, Message::SettingsTaken(valid(settings).warnings()), "{settings:?}");
}

/// A controller that a host has given settings.
fn ready(start: &Start, settings: &Settings) -> Machine {
    let mut machine = Machine::boot(start);
    set(&mut machine, settings);
    machine
}

/// The host library's channel of motor 0 with these settings.
fn reference(settings: &Validated) -> Channel {
    let [mut channel, ..] = channels(settings, filters(settings).unwrap()).unwrap();
    channel.set_enabled(true);
    channel
}

fn run(channel: &mut Channel, commands: &[Command]) -> Vec<i32> {
    commands.iter().map(|command| channel.inject(*command).to_bits()).collect()
}

/// What these settings mean for the timers of this controller.
fn plan(machine: &mut Machine, settings: &Settings) -> Plan {
    let info = machine.link.info();
    Plan::new(&valid(settings), info.timer_hz, info.may_arm).unwrap()
}

/// What the pulses of its outputs mean.
fn scale(plan: &Plan) -> PulseScale {
    plan.output.pulses().expect("outputs with pulses").0
}

/// The frames of its outputs.
fn frames(plan: &Plan) -> Frames {
    plan.output.pulses().expect("outputs with pulses").1
}

/// Counts of the stop pulse.
fn stop_width(plan: &Plan, settings: &Settings) -> u32 {
    scale(plan).to_ticks(Command::saturating_from_bits(settings.stop))
}

/// What stands in the compare registers.
fn widths(machine: &mut Machine) -> [u32; 4] {
    [0, 1, 2, 3].map(|output| machine.monitor.word(OUTPUT_1 + 4 * output))
}

/// Whether motor 0 still follows the host.
fn is_injected(machine: &mut Machine) -> Result<(), HostLate> {
    match machine.link.info().motors[0] {
        ChannelState::Injected => Ok(()),
        ChannelState::Holding | ChannelState::Lost => Err(HostLate),
        other => panic!("{other:?}"),
    }
}

/// Motor 0 armed by the host, at `level`.
fn arm(machine: &mut Machine, level: f64) -> Result<u32, HostLate> {
    machine.link.take_over();
    let commands: Vec<Command> =
        (0..300).map(|n| Command::saturating_from_f64(if n < 10 { 0.0 } else { level })).collect();
    let outputs = machine.link.inject(0, &commands)?;
    assert_eq!(outputs.last(), Some(&Command::saturating_from_f64(level).to_bits()), "settled");
    is_injected(machine)?;
    Ok(commands.len() as u32)
}

/// A controller that has settings in its flash, and whose motor 0 is armed by the host, at `level`.
fn armed(start: &Start, level: f64) -> Machine {
    assert!(start.settings_flash.is_some());
    keeping_up(|| {
        let mut machine = Machine::boot(start);
        arm(&mut machine, level).map(|_| machine)
    })
}

/// Asks until it is so.
fn wait(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "{what} does not come");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_image_boots_on_the_clock_that_runs_and_answers() {
    let image = image();
    let mut machine = Machine::boot(&Start::new(&image));
    let info = machine.link.info();
    // The emulator has neither crystal nor PLL.
    assert_eq!((info.clock, info.core_hz), (Clock::Internal, 16_000_000));
    assert_eq!(info.settings, Origin::DefaultsBad, "the emulator's empty flash reads as zeros");
    assert!(!info.may_arm && info.bench_enabled);
    assert_eq!(info.motors, [ChannelState::NoSignal; 4]);
    assert_eq!(machine.link.ask(&Request::GetSettings), Message::Settings(Settings::default()));
    let later = machine.link.info();
    assert!(later.ticks > info.ticks, "the control task does not run");
    assert_eq!(machine.link.faults().missed_deadlines, 0);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn without_settings_that_somebody_has_chosen_there_are_no_pulses_and_no_motor_is_driven() {
    let image = image();
    let mut machine = Machine::boot(&Start::new(&image));
    assert!(!machine.link.info().outputs_enabled);
    assert_eq!(widths(&mut machine), [0; 4]);
    let mode = |source| Request::SetMode { motor: 0, source, compensate: true };
    assert_eq!(machine.link.ask(&mode(Source::Inject)), Message::Refused(Refusal::NoSettings));
    assert_eq!(machine.link.ask(&Request::Excite(odd_30_hz(2))), Message::Refused(Refusal::NoSettings));
    let before = machine.link.info().ticks;
    wait("a tick", || machine.link.info().ticks > before);
    assert_eq!(widths(&mut machine), [0; 4]);

    // A host chooses them: pulses may go out, and without a signal none do unless the settings say so.
    set(&mut machine, &settings());
    assert!(machine.link.info().outputs_enabled);
    assert_eq!(widths(&mut machine), [0; 4]);
    let chosen = with_stop_pulses();
    set(&mut machine, &chosen);
    let stop = stop_width(&plan(&mut machine, &chosen), &chosen);
    assert!(stop > 0);
    wait("the stop pulse", || widths(&mut machine) == [stop; 4]);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn injected_commands_come_out_as_on_the_host() {
    let image = image();
    let settings = settings();
    let (u_nom, ..) = TABLE_1[2];
    let commands: Vec<Command> = [0.0; 10]
        .into_iter()
        .chain(multisine(u_nom, 0.05, 5000.0).into_iter().take(5000))
        .map(Command::saturating_from_f64)
        .collect();
    keeping_up(|| {
        let mut machine = ready(&Start::new(&image), &settings);
        machine.link.take_over();
        let outputs = machine.link.inject(0, &commands)?;
        assert_eq!(outputs, run(&mut reference(&valid(&settings)), &commands));
        is_injected(&mut machine)
    });
}

/// Samples that a host has under way, and those of one request.
const WINDOW: usize = 3 * BLOCK;
const BLOCK: usize = 128;

/// Injects ramps of commands, and reads the compare register in the middle of each: the emulated time stands still while
/// samples are left in the controller's queue. Every output along a ramp has a width of its own, that of no command near it.
fn pulses_are_as_planned(settings: &Settings) {
    let image = image();
    // Slow enough for the emulated line to bring the next commands while the last are played.
    let settings = &Settings { loop_rate_hz: 1000, ..settings.clone() };
    let valid = valid(settings);
    let command = |n: usize, from: f64, to: f64| from + (to - from) * n as f64 / WINDOW as f64;
    let arming: Vec<Command> = (0..300).map(|n| Command::saturating_from_f64(if n < 10 { 0.0 } else { 0.3 })).collect();
    let ramps = [(0.3, 0.6), (0.6, 0.2), (0.2, 0.5), (0.5, 0.3)]
        .map(|(from, to)| (0..WINDOW).map(|n| Command::saturating_from_f64(command(n, from, to))).collect::<Vec<_>>());
    keeping_up(|| {
        let mut machine = ready(&Start::new(&image), settings);
        let plan = plan(&mut machine, settings);
        assert_eq!(machine.monitor.word(PRESCALER), frames(&plan).divider - 1, "{settings:?}");
        // No input is live.
        assert_eq!(machine.monitor.word(RELOAD), frames(&plan).shortest - 1, "{settings:?}");
        assert_eq!(widths(&mut machine), [0; 4], "{settings:?}");

        machine.link.take_over();
        let mut channel = reference(&valid);
        assert_eq!(machine.link.inject(0, &arming)?, run(&mut channel, &arming), "{settings:?}");
        let mut first = arming.len();
        let mut seen = 0;
        for ramp in ramps.iter().cycle().take(4 * ramps.len()) {
            for (n, block) in ramp.chunks(BLOCK).enumerate() {
                machine.link.send_commands((first + n * BLOCK) as u32, block);
            }
            let expected = run(&mut channel, ramp);
            let mut outputs = machine.link.injected(first as u32)?;
            machine.monitor.stop();
            let register = machine.monitor.word(OUTPUT_1);
            machine.monitor.go_on();
            while outputs.len() < ramp.len() {
                outputs.extend(machine.link.injected((first + outputs.len()) as u32)?);
            }
            is_injected(&mut machine)?;
            assert_eq!(outputs, expected, "{settings:?}");
            let width = |bits: i32| scale(&plan).to_width_ticks(EscCommand::from_bits(bits));
            first += ramp.len();
            let is_held = ramp.chunks(BLOCK).any(|block| register == width(block[BLOCK - 1].to_bits()));
            let played = outputs[BLOCK - 1..].iter().filter(|&&bits| width(bits) == register).count();
            // Between two requests the last command is held.
            assert!(is_held || (1..=3).contains(&played), "{register} is the width of {played} outputs: {settings:?}");
            seen += usize::from(played > 0);
            if seen == ramps.len() {
                return Ok(());
            }
        }
        Err(HostLate)
    });
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn standard_pwm_of_injected_commands_stands_in_the_registers_of_the_timer() {
    pulses_are_as_planned(&settings());
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn oneshot125_of_injected_commands_stands_in_the_registers_of_the_timer() {
    let pulse = |frame_hz| Pulse { protocol: PulseProtocol::OneShot125, frame_hz };
    pulses_are_as_planned(&Settings { input: pulse(2000), output: pulse(2200), ..settings() });
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_papers_raw_duty_of_injected_commands_stands_in_the_registers_of_the_timer() {
    let pulse = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    let bits = |command| Command::saturating_from_f64(command).to_bits();
    let mut settings = Settings { input: pulse, output: pulse, stop: bits(0.0125), ..settings() };
    settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.98));
    pulses_are_as_planned(&settings);
    // Duty for duty, of all counts of the frame.
    let image = image();
    settings.no_signal = NoSignal::StopPulses;
    let mut machine = ready(&Start::new(&image), &settings);
    let plan = plan(&mut machine, &settings);
    let stop = (0.0125 * f64::from(frames(&plan).shortest)).round() as u32;
    assert_eq!(stop_width(&plan, &settings), stop);
    wait("the stop pulse", || widths(&mut machine) == [stop; 4]);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_host_that_goes_silent_at_a_peak_leaves_the_command_and_then_the_stop() {
    let image = image();
    let settings = Settings { stop_pulses_ms: 8000, ..settings() };
    let command = Command::saturating_from_f64(0.5);
    let mut commands: Vec<Command> =
        (0..300).map(|n| Command::saturating_from_f64(if n < 10 { 0.0 } else { 0.4 })).collect();
    let step = commands.len();
    commands.resize(step + 500, command);
    let outputs = run(&mut reference(&valid(&settings)), &commands);
    let peak = (step..outputs.len()).max_by_key(|&n| outputs[n]).unwrap();
    commands.truncate(peak + 1);
    keeping_up(|| {
        let mut machine = ready(&Start::new(&image), &settings);
        let plan = plan(&mut machine, &settings);
        let width = |bits: i32| scale(&plan).to_width_ticks(EscCommand::from_bits(bits));
        machine.link.take_over();
        assert_eq!(machine.link.inject(0, &commands)?, outputs[..=peak]);
        // The peak's output can be here before the tick after it.
        let peak = width(outputs[peak]);
        let mut silent = peak;
        wait("the tick after the peak", || {
            silent = machine.monitor.word(OUTPUT_1);
            silent != peak
        });
        is_injected(&mut machine)?;
        assert_eq!(silent, width(command.to_bits()), "the command");
        assert!(silent + 1000 < peak, "the peak is another pulse");

        let mut seen = vec![silent];
        wait("the end of the stop pulses", || {
            let register = machine.monitor.word(OUTPUT_1);
            if seen.last() != Some(&register) {
                seen.push(register);
            }
            register == 0
        });
        assert_eq!(seen, [silent, stop_width(&plan, &settings), 0]);
        assert_eq!(machine.link.info().motors[0], ChannelState::Lost);
        Ok(())
    });
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_controller_designs_the_same_filter_as_the_host() {
    let image = image();
    for (omega_z_rad_s, omega_f_rad_s, damping, loop_rate_hz) in
        [(14.1275, 94.2, 0.7, 5000), (12.0, 60.0, 0.6, 4000), (9.123, 31.7, 1.1, 1000), (45.0, 250.0, 0.9, 10_000)]
    {
        let mut settings = Settings { loop_rate_hz, ..settings() };
        settings.lead.omega_z_rad_s = omega_z_rad_s;
        settings.lead.omega_f_rad_s = omega_f_rad_s;
        settings.lead.damping = damping;
        let valid = valid(&settings);
        // A step excites every coefficient; 27 bits of it must come out the same for 1500 ticks.
        let commands: Vec<Command> = (0..1500)
            .map(|n| Command::saturating_from_f64([0.0, 0.4, 0.45][usize::from(n > 3) + usize::from(n > 200)]))
            .collect();
        let outputs = keeping_up(|| {
            let mut machine = ready(&Start::new(&image), &settings);
            machine.link.take_over();
            machine.link.inject(0, &commands)
        });
        assert_eq!(outputs, run(&mut reference(&valid), &commands), "{settings:?}");
    }
    // What the host's design refuses, the controller's does.
    let mut machine = Machine::boot(&Start::new(&image));
    let mut settings = Settings::default();
    settings.lead.omega_z_rad_s = 3.0;
    assert!(filters(&settings.clone().validate().unwrap()).is_err());
    assert_eq!(machine.link.ask(&Request::SetSettings(settings)), Message::Refused(Refusal::Design));
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_excitation_is_the_host_generators_bit_for_bit() {
    let image = image();
    let settings = excitation_settings();
    let request = odd_30_hz(2);
    let records = keeping_up(|| {
        let mut machine = ready(&Start::new(&image), &settings);
        let records = excite(&mut machine, &request, true);
        let faults = machine.link.faults();
        // Each keep-alive was answered, and no byte of one was lost.
        assert_eq!((faults.link_overruns, faults.link.total()), (0, 0));
        assert_eq!(faults.missed_deadlines, 0);
        match faults.dead_man {
            0 => Ok(records),
            _ => Err(HostLate),
        }
    });

    let settings = valid(&settings);
    let (nominal, amplitude) =
        (Command::saturating_from_bits(request.nominal), Command::saturating_from_bits(request.amplitude));
    let limits = channel_settings(&settings, 0);
    let checked = ExcitationRequest {
        lines: LineSet::Odd30Hz.lines(),
        nominal,
        amplitude,
        duration_ticks: 20 * settings.loop_rate_hz,
    };
    let mut channel = channels(&settings, filters(&settings).unwrap()).unwrap()[0].clone();
    channel.start_excitation(Excitation::new(&limits, &checked, f64::from(settings.loop_rate_hz)).unwrap()).unwrap();
    // Commands before and after the filter, from the first tick of the ramp.
    let expected: Vec<(i32, i32)> = std::iter::from_fn(|| {
        channel.keep_alive();
        let output = channel.tick(Input::Nothing);
        Some((channel.command().to_bits(), output.to_bits()))
    })
    .take(40 * LOOP_RATE_HZ)
    .collect();

    let samples: Vec<(u32, i32, i32)> = records
        .iter()
        .flat_map(|record| {
            let ticks = (0..).map(|n| record.first_tick + n * u32::from(record.divisor));
            let commands = record.before.as_slice().iter().zip(record.after.as_slice());
            ticks.zip(commands).map(|(tick, (&before, &after))| (tick, before, after))
        })
        .collect();
    let played = samples.iter().filter(|(_, before, _)| *before > limits.idle.to_bits()).count();
    assert!(played > 20 * LOOP_RATE_HZ / usize::from(DIVISOR), "{played} samples of the excitation");
    // The ramp has a level of its own in every tick, which tells when it began.
    let begin = samples.iter().position(|&(_, before, _)| before > 0).expect("a ramp");
    let (tick, level, _) = samples[begin];
    let offset = expected.iter().position(|&(before, _)| before == level).expect("a level of the ramp") as u32;
    for &(at, before, after) in &samples {
        let n = i64::from(at) - i64::from(tick) + i64::from(offset);
        // No pulse before its begin, and none when the stop pulses are over.
        let host = usize::try_from(n).ok().and_then(|n| expected.get(n)).copied().unwrap_or((0, NO_PULSE));
        assert_eq!((before, after), host, "tick {n} of the excitation");
    }
    let arming = samples.iter().filter(|(_, before, after)| (*before, *after) == (0, 0)).count();
    assert!(arming > 2 * LOOP_RATE_HZ / usize::from(DIVISOR), "{arming} stop pulses, before it and for 2 s behind it");
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn an_excitation_that_leaves_the_link_no_time_is_refused() {
    let image = image();
    let mut machine = ready(&Start::new(&image), &settings());
    let info = machine.link.info();
    let loop_rate_hz = Settings::default().loop_rate_hz;
    let lines = LineSet::Odd30Hz.lines();
    let percent = load::percent(lines.per_tick(loop_rate_hz * lines.period_s()), loop_rate_hz, info.core_hz);
    assert!(percent > MAX_LOAD_PERCENT);
    let refusal = Refusal::TooSlow { lines: 150, loop_rate_hz, core_hz: 16_000_000, percent };
    assert_eq!(machine.link.ask(&Request::Excite(odd_30_hz(1))), Message::Refused(refusal));
    assert_eq!(machine.link.info().motors, [ChannelState::NoSignal; 4]);
    assert_eq!(widths(&mut machine), [0; 4]);
}

/// Rate at which a core at 16 MHz plays 150 lines.
const LOOP_RATE_HZ: usize = 1000;

/// For an excitation, with a short time for an ESC to arm.
fn excitation_settings() -> Settings {
    let mut settings = Settings { loop_rate_hz: LOOP_RATE_HZ as u32, ..settings() };
    settings.excitation.arm_ms = 50;
    settings
}

/// So many periods of 150 lines around one half.
fn odd_30_hz(periods: u16) -> ExciteRequest {
    let bits = |command| Command::saturating_from_f64(command).to_bits();
    ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal: bits(0.5), amplitude: bits(0.05), periods }
}

/// Requests on their way: the controller works on these while the host is held up.
const STORE: i32 = 2000;

/// One in so many ticks is recorded: what the emulated line carries.
const DIVISOR: u16 = 2;

/// Plays and records it, with a host that stays there to the end or vanishes in the middle of the first period.
fn excite(machine: &mut Machine, request: &ExciteRequest, stays: bool) -> Vec<Record> {
    assert_eq!(machine.link.ask(&Request::Record(Some(RecordRequest { motor: 0, divisor: DIVISOR }))), Message::Done);
    let started = machine.link.send(&Request::Excite(*request));
    let mut records = Vec::new();
    let mut running = false;
    let mut alive = 0_u32;
    let mut ended = false;
    // The stop pulses behind the excitation of a host that stays are recorded to their end.
    let mut pulses_over = !stays;
    // A store of them is on its way at all times: the emulated time does not wait for a host that is held up.
    let mut under_way = 0;
    loop {
        while running && stays && !ended && under_way < STORE {
            machine.link.send(&Request::KeepAlive);
            under_way += 1;
        }
        let answer = machine.link.receive();
        match answer.message {
            Message::Record(record) => {
                let stop = record.before.as_slice().last() == Some(&0);
                let no_pulse = record.after.as_slice().last() == Some(&NO_PULSE);
                records.push(record);
                alive += 1;
                if running && stop && alive > 100 {
                    ended = true;
                }
                pulses_over |= ended && no_pulse;
            }
            Message::Done if answer.tag == started && !running => running = true,
            Message::Done => under_way -= 1,
            other => panic!("{other:?}"),
        }
        if ended && pulses_over && under_way <= 0 {
            break;
        }
    }
    let stopped = machine.link.send(&Request::Record(None));
    loop {
        let answer = machine.link.receive();
        match answer.message {
            Message::Record(record) => records.push(record),
            Message::Done if answer.tag == stopped => return records,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_host_that_vanishes_during_an_excitation_lets_it_ramp_down_to_the_stop() {
    let image = image();
    // Stop pulses that last longer than the test.
    let settings = Settings { stop_pulses_ms: 60_000, ..excitation_settings() };
    let mut machine = ready(&Start::new(&image), &settings);
    let request = odd_30_hz(2);
    let records = excite(&mut machine, &request, false);
    // The dead-man's time and the ramp from where it was: never up again once it went down, and at the end the stop.
    let levels: Vec<i32> = records.iter().flat_map(|record| record.before.as_slice().iter().copied()).collect();
    let top = (0..levels.len()).max_by_key(|&n| levels[n]).unwrap();
    assert!(levels[top] > 0 && levels[top] < request.nominal, "the ramp up takes longer than the dead-man's 200 ms");
    assert!(levels[top..].is_sorted_by(|before, after| before >= after), "up again");
    let turning = levels.iter().filter(|&&level| level > 0).count() * usize::from(DIVISOR);
    assert!(turning <= 2 * settings.loop_rate_hz as usize * 200 / 1000 + 2 * usize::from(DIVISOR), "{turning} ticks");
    assert_eq!(machine.link.faults().dead_man, 1);
    assert_eq!(machine.link.info().motors[0], ChannelState::NoSignal);
    let outputs = records.iter().flat_map(|record| record.after.as_slice().iter().copied());
    let at_stop: Vec<i32> = outputs.rev().take_while(|&output| output == 0).collect();
    assert!(at_stop.len() > 100, "{} stop pulses", at_stop.len());
    let stop = stop_width(&plan(&mut machine, &settings), &settings);
    assert_eq!(widths(&mut machine), [stop, 0, 0, 0]);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_flood_of_garbage_is_counted_and_changes_neither_settings_nor_outputs() {
    let image = image();
    let settings = with_stop_pulses();
    let mut machine = ready(&Start::new(&image), &settings);
    let before = machine.link.ask(&Request::GetSettings);
    let mut noise = 0x2545_F491_4F6C_DD1D_u64;
    for _ in 0..20 {
        let garbage: Vec<u8> = (0..1000)
            .map(|_| {
                noise ^= noise << 13;
                noise ^= noise >> 7;
                noise ^= noise << 17;
                noise as u8
            })
            .collect();
        machine.link.write(&garbage);
    }
    // The zero in front of the next frame ends whatever the garbage began.
    assert_eq!(machine.link.ask(&Request::GetSettings), before);
    let faults = machine.link.faults();
    assert!(faults.link.total() > 0, "{faults:?}");
    assert_eq!(faults.missed_deadlines, 0);
    assert_eq!(machine.link.info().motors, [ChannelState::NoSignal; 4]);
    let stop = stop_width(&plan(&mut machine, &settings), &settings);
    assert_eq!(widths(&mut machine), [stop; 4]);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_host_that_vanishes_during_an_injection_loses_the_motor_which_stops() {
    let image = image();
    let settings = with_stop_pulses();
    let (mut machine, first) = keeping_up(|| {
        let mut machine = ready(&Start::new(&image), &settings);
        let first = arm(&mut machine, 0.5)?;
        let saved = machine.link.ask(&Request::SaveSettings);
        is_injected(&mut machine)?;
        assert_eq!(saved, Message::Refused(Refusal::NotDisarmed { motor: 0 }));
        Ok((machine, first))
    });
    wait("the loss", || machine.link.info().motors[0] == ChannelState::Lost);
    let stop = stop_width(&plan(&mut machine, &settings), &settings);
    assert_eq!(widths(&mut machine), [stop; 4]);
    let samples = Series::try_from(&[0][..]).unwrap();
    let late = machine.link.ask(&Request::Inject(InjectRequest { motor: 0, first, samples }));
    assert_eq!(late, Message::Refused(Refusal::NotInjecting));
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_reset_while_armed_comes_back_with_no_pulses_or_stop_pulses_as_the_settings_say() {
    let image = image();
    for settings in [settings(), with_stop_pulses()] {
        let flash = saved(&settings);
        let mut machine = armed(&Start { settings_flash: Some(&flash), ..Start::new(&image) }, 0.6);
        machine.monitor.reset();
        machine.link.wait_for_start();
        let info = machine.link.info();
        assert_eq!((info.settings, info.outputs_enabled), (Origin::Stored, true));
        assert_eq!(info.motors, [ChannelState::NoSignal; 4]);
        let stop = stop_width(&plan(&mut machine, &settings), &settings);
        let expected = if settings.no_signal == NoSignal::StopPulses { stop } else { 0 };
        assert_eq!(widths(&mut machine), [expected; 4]);
    }
}

/// The four outputs are taken low before their pins are taken from the timer: port C, reset of bits 6 to 9, then mode
/// "output" for them.
fn outputs_were_forced_low(writes: &[PortWrite]) -> bool {
    const MODE: u32 = 0x00;
    const SET_RESET: u32 = 0x18;
    let low = PortWrite { offset: SET_RESET, value: 0b1111 << (16 + 6) };
    let Some(lowered) = writes.iter().position(|write| *write == low) else { return false };
    writes
        .get(lowered + 1)
        .is_some_and(|write| write.offset == MODE && (6..10).all(|pin| (write.value >> (2 * pin)) & 0b11 == 0b01))
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_fault_of_the_core_forces_the_outputs_low_and_is_reported_after_the_reset() {
    let image = image();
    let settings = with_stop_pulses();
    let flash = saved(&settings);
    let start = Start { settings_flash: Some(&flash), trace: true, debugger: true, ..Start::new(&image) };
    let mut machine = armed(&start, 0.6);
    let mark = machine.trace.mark();
    let debugger = machine.debugger.as_mut().unwrap();
    debugger.halt();
    debugger.jump(NOTHING);
    debugger.go_on();
    machine.link.wait_for_start();
    match machine.link.info().reset {
        ResetReason::Fault { program_counter, status } => {
            assert_eq!(program_counter & !1, NOTHING);
            assert_ne!(status, 0);
        }
        other => panic!("{other:?}"),
    }
    assert!(outputs_were_forced_low(&machine.trace.outputs_since(mark)));
    let stop = stop_width(&plan(&mut machine, &settings), &settings);
    assert_eq!(widths(&mut machine), [stop; 4]);
}

/// Entry of the supply's interrupt in the vector table: the second after the 16 of the core.
const SUPPLY_VECTOR: u32 = 0x0800_0000 + 4 * (16 + 1);

/// The emulator has no voltage detector: the core is led to the handler of its interrupt.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_low_supply_forces_the_outputs_low_and_is_reported_after_the_reset() {
    let image = image();
    let settings = with_stop_pulses();
    let flash = saved(&settings);
    let start = Start { settings_flash: Some(&flash), trace: true, debugger: true, ..Start::new(&image) };
    let mut machine = armed(&start, 0.6);
    let handler = machine.monitor.word(SUPPLY_VECTOR) & !1;
    let mark = machine.trace.mark();
    let debugger = machine.debugger.as_mut().unwrap();
    debugger.halt();
    debugger.jump(handler);
    debugger.go_on();
    machine.link.wait_for_start();
    assert_eq!(machine.link.info().reset, ResetReason::SupplyLow);
    assert!(outputs_were_forced_low(&machine.trace.outputs_since(mark)));
}

/// ST's procedure chooses the sector in one write and starts the erase in the next. The emulated flash takes neither.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn an_erase_is_started_after_its_sector_is_chosen() {
    const CONTROL: u32 = 0x10;
    let (sector_erase, sector_10, start_bit) = (1 << 1, 10 << 3, 1 << 16);
    let image = image();
    let mut machine = ready(&Start { trace: true, ..Start::new(&image) }, &settings());
    let mark = machine.trace.mark();
    // A flash of zeros has no free page, so the save begins with an erase, and then finds that nothing was written.
    assert_eq!(machine.link.ask(&Request::SaveSettings), Message::Refused(Refusal::SaveFailed));
    let writes: Vec<u32> = machine
        .trace
        .flash_since(mark)
        .into_iter()
        .filter(|write| write.offset == CONTROL)
        .map(|write| write.value)
        .collect();
    let chosen = writes.iter().position(|value| value & sector_erase != 0).expect("a sector is chosen");
    assert_eq!(writes[chosen] & (sector_10 | start_bit), sector_10, "{writes:#x?}");
    assert_eq!(writes[chosen + 1] & start_bit, start_bit, "{writes:#x?}");
}

/// In flight nothing is connected to it. The emulator has no port, and reads each register as 0 before a change.
#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_receive_line_of_the_link_is_pulled_up() {
    const PULLS: u32 = 0x0C;
    let (pin_11, up) = (2 * 11, 0b01);
    let image = image();
    let machine = Machine::boot(&Start { trace: true, ..Start::new(&image) });
    let pulls: Vec<PortWrite> =
        machine.trace.outputs_since(0).into_iter().filter(|write| write.offset == PULLS).collect();
    assert!(pulls.iter().any(|write| write.value >> pin_11 & 0b11 == up), "{pulls:#x?}");
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_panic_forces_the_outputs_low_and_is_reported_after_the_reset() {
    let image = panicking_image();
    let settings = with_stop_pulses();
    let flash = saved(&settings);
    let mut machine = Machine::boot(&Start { settings_flash: Some(&flash), trace: true, ..Start::new(&image) });
    machine.link.take_over();
    let mark = machine.trace.mark();
    // Beyond one half the image panics.
    let bits = [0, Command::saturating_from_f64(0.6).to_bits()];
    machine.link.send(&Request::Inject(InjectRequest {
        motor: 0,
        first: 0,
        samples: Series::try_from(&bits[..]).unwrap(),
    }));
    wait("the end of the outputs", || outputs_were_forced_low(&machine.trace.outputs_since(mark)));
    machine.link.wait_for_start();
    match machine.link.info().reset {
        ResetReason::Panic(place) => assert!(place.to_string().contains("controller/control.rs:"), "{place}"),
        other => panic!("{other:?}"),
    }
    let stop = stop_width(&plan(&mut machine, &settings), &settings);
    assert_eq!(widths(&mut machine), [stop; 4]);
    table::hold(table::PANIC, Column::Stm32, &yes());
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn stored_settings_are_loaded_and_survive_wrong_bytes_in_one_copy() {
    let image = image();
    let mut settings = with_stop_pulses();
    settings.lead.omega_z_rad_s = 12.5;
    let whole = saved(&settings);
    let used = whole[..SECTOR].iter().rposition(|&byte| byte != 0xff).unwrap() + 1;
    // Settings, where they come from, and whether the compare registers hold stop pulses or nothing.
    let loaded = |flash: &[u8]| {
        let mut machine = Machine::boot(&Start { settings_flash: Some(flash), ..Start::new(&image) });
        let Message::Settings(settings) = machine.link.ask(&Request::GetSettings) else { panic!("no settings") };
        let info = machine.link.info();
        let stop = stop_width(&plan(&mut machine, &settings), &settings);
        let expected = if info.outputs_enabled && settings.no_signal == NoSignal::StopPulses { stop } else { 0 };
        assert_eq!(widths(&mut machine), [expected; 4]);
        (settings, info.settings, info.outputs_enabled)
    };
    assert_eq!(loaded(&whole), (settings.clone(), Origin::Stored, true));
    assert_eq!(loaded(&saved(&self::settings())), (self::settings(), Origin::Stored, true), "no signal, no pulses");
    // Every byte is a test of the host; here some, each in a controller that boots.
    for address in (0..used).step_by(used / 6) {
        let mut first = whole.clone();
        first[address] ^= 0x20;
        assert_eq!(loaded(&first), (settings.clone(), Origin::StoredOnce, true), "byte {address}");
        let mut both = first;
        both[SECTOR + address] ^= 0x20;
        assert_eq!(loaded(&both), (Settings::default(), Origin::DefaultsBad, false), "byte {address} of both");
    }
}

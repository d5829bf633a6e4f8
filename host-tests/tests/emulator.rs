//! The image that would be flashed, in QEMU, driven over its link. `cargo xtask test` builds the images and runs these.

use std::time::{Duration, Instant};

use host_tests::emulator::{HostLate, Machine, PATIENCE, PortWrite, Start, image, keeping_up, panicking_image};
use host_tests::flash::Flash;
use host_tests::{TABLE_1, multisine};
use rotorlead::channel::{Channel, Excitation, ExcitationRequest, Input};
use rotorlead::controller::{channel_settings, channels, coefficients};
use rotorlead::link::{
    ChannelState, Clock, ExciteRequest, InjectRequest, LineSet, Message, Record, RecordRequest, Refusal, Request,
    ResetReason, Series,
};
use rotorlead::settings::{Origin, Settings, Store, Validated};
use rotorlead::throttle::{Command, PulseScale};

/// Where there is nothing to be executed.
const NOTHING: u32 = 0x6000_0000;
/// Compare register of the first output: channel 1 of TIM3.
const OUTPUT_1: u32 = 0x4000_0434;

/// The host library's channel of motor 0 with these settings.
fn reference(settings: &Validated) -> Channel {
    let [mut channel, ..] = channels(settings, coefficients(settings).unwrap()).unwrap();
    channel.set_enabled(true);
    channel
}

fn run(channel: &mut Channel, commands: &[Command]) -> Vec<i32> {
    commands.iter().map(|command| channel.tick(Input::Command(*command)).to_bits()).collect()
}

/// What stands in the compare register for a command.
fn width(machine: &mut Machine, command: Command) -> u32 {
    let output = Settings::default().output;
    let timer_hz = machine.link.info().timer_hz;
    // The smallest divider with which a frame fits 16 bits.
    let divider = timer_hz.div_ceil(u32::from(output.frame_hz) << 16);
    PulseScale::new(output.protocol(), timer_hz / divider).unwrap().to_ticks(command)
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

/// A controller whose motor 0 is armed by the host, at `level`.
fn armed(start: &Start, level: f64) -> Machine {
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
    assert_eq!(info.motors, [ChannelState::NoSignal; 4]);
    assert_eq!(machine.link.ask(&Request::GetSettings), Message::Settings(Settings::default()));
    let later = machine.link.info();
    assert!(later.ticks > info.ticks, "the control task does not run");
    assert_eq!(machine.link.faults().missed_deadlines, 0);
    let stop = width(&mut machine, Command::ZERO);
    for output in 0..4 {
        assert_eq!(machine.monitor.word(OUTPUT_1 + 4 * output), stop, "output {output}");
    }
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn injected_commands_come_out_as_on_the_host_and_stand_in_the_compare_register() {
    let image = image();
    let settings = Validated::default();
    let (u_nom, ..) = TABLE_1[2];
    let commands: Vec<Command> = [0.0; 10]
        .into_iter()
        .chain(multisine(u_nom, 0.05, 5000.0).into_iter().take(5000))
        .map(Command::saturating_from_f64)
        .collect();
    keeping_up(|| {
        let mut machine = Machine::boot(&Start::new(&image));
        machine.link.take_over();
        let outputs = machine.link.inject(0, &commands)?;
        assert_eq!(outputs, run(&mut reference(&settings), &commands));
        let last = Command::saturating_from_bits(*outputs.last().unwrap());
        // The time stands still while the register is read, for a host that is silent loses the motor.
        machine.monitor.stop();
        let register = machine.monitor.word(OUTPUT_1);
        machine.monitor.go_on();
        is_injected(&mut machine)?;
        assert_eq!(register, width(&mut machine, last));
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
        let mut settings = Settings { loop_rate_hz, ..Settings::default() };
        settings.lead.omega_z_rad_s = omega_z_rad_s;
        settings.lead.omega_f_rad_s = omega_f_rad_s;
        settings.lead.damping = damping;
        let valid = settings.clone().validate().unwrap();
        // A step excites every coefficient; 27 bits of it must come out the same for 1500 ticks.
        let commands: Vec<Command> = (0..1500)
            .map(|n| Command::saturating_from_f64([0.0, 0.4, 0.45][usize::from(n > 3) + usize::from(n > 200)]))
            .collect();
        let outputs = keeping_up(|| {
            let mut machine = Machine::boot(&Start::new(&image));
            let taken = machine.link.ask(&Request::SetSettings(settings.clone()));
            assert_eq!(taken, Message::SettingsTaken(valid.warnings()), "{settings:?}");
            machine.link.take_over();
            machine.link.inject(0, &commands)
        });
        assert_eq!(outputs, run(&mut reference(&valid), &commands), "{settings:?}");
    }
    // What the host's design refuses, the controller's does.
    let mut machine = Machine::boot(&Start::new(&image));
    let mut settings = Settings::default();
    settings.lead.omega_z_rad_s = 3.0;
    assert!(coefficients(&settings.clone().validate().unwrap()).is_err());
    assert_eq!(machine.link.ask(&Request::SetSettings(settings)), Message::Refused(Refusal::Design));
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn the_excitation_is_the_host_generators_bit_for_bit() {
    let image = image();
    let settings = Validated::default();
    let (nominal, amplitude) = (Command::saturating_from_f64(0.5), Command::saturating_from_f64(0.05));
    let request = ExciteRequest {
        motor: 0,
        lines: LineSet::Odd30Hz,
        nominal: nominal.to_bits(),
        amplitude: amplitude.to_bits(),
        periods: 2,
    };
    let records = keeping_up(|| {
        let mut machine = Machine::boot(&Start::new(&image));
        let records = excite(&mut machine, &request, true);
        match machine.link.faults().dead_man {
            0 => Ok(records),
            _ => Err(HostLate),
        }
    });

    let limits = channel_settings(&settings, 0);
    let checked = ExcitationRequest {
        lines: LineSet::Odd30Hz.lines(),
        nominal,
        amplitude,
        duration_ticks: 20 * settings.loop_rate_hz,
    };
    let mut channel = channels(&settings, coefficients(&settings).unwrap()).unwrap()[0].clone();
    channel.start_excitation(Excitation::new(&limits, &checked, f64::from(settings.loop_rate_hz)).unwrap()).unwrap();
    // Commands before and after the filter, from the first tick of the ramp.
    let expected: Vec<(i32, i32)> = std::iter::from_fn(|| {
        channel.keep_alive();
        let output = channel.tick(Input::Nothing);
        Some((channel.command().to_bits(), output.to_bits()))
    })
    .take(25 * 5000)
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
    assert!(played > 20 * 5000 / usize::from(DIVISOR), "{played} samples of the excitation");
    // The ramp has a level of its own in every tick, which tells when it began.
    let begin = samples.iter().position(|&(_, before, _)| before > 0).expect("a ramp");
    let (tick, level, _) = samples[begin];
    let offset = expected.iter().position(|&(before, _)| before == level).expect("a level of the ramp") as u32;
    for &(at, before, after) in &samples[begin..] {
        let n = (at - tick + offset) as usize;
        let (host_before, host_after) = expected.get(n).copied().unwrap_or((0, 0));
        assert_eq!((before, after), (host_before, host_after), "tick {n} of the excitation");
    }
}

/// Requests on their way: the controller works on these while the host is held up.
const STORE: i32 = 2000;

/// One in so many ticks is recorded: what the emulated line carries.
const DIVISOR: u16 = 7;

/// Plays and records it, with a host that stays there to the end or vanishes in the middle of the first period.
fn excite(machine: &mut Machine, request: &ExciteRequest, stays: bool) -> Vec<Record> {
    assert_eq!(machine.link.ask(&Request::Record(Some(RecordRequest { motor: 0, divisor: DIVISOR }))), Message::Done);
    let started = machine.link.send(&Request::Excite(*request));
    let mut records = Vec::new();
    let mut running = false;
    let mut alive = 0_u32;
    let mut ended = false;
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
                records.push(record);
                alive += 1;
                if running && stop && alive > 100 {
                    ended = true;
                }
            }
            Message::Done if answer.tag == started && !running => running = true,
            Message::Done => under_way -= 1,
            other => panic!("{other:?}"),
        }
        if ended && under_way <= 0 {
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
    let mut machine = Machine::boot(&Start::new(&image));
    let settings = Validated::default();
    let level = Command::saturating_from_f64(0.5);
    let amplitude = Command::saturating_from_f64(0.05).to_bits();
    let request = ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal: level.to_bits(), amplitude, periods: 2 };
    let records = excite(&mut machine, &request, false);
    // The dead-man's time and the ramp from where it was: never up again once it went down, and at the end the stop.
    let levels: Vec<i32> = records.iter().flat_map(|record| record.before.as_slice().iter().copied()).collect();
    let top = (0..levels.len()).max_by_key(|&n| levels[n]).unwrap();
    assert!(levels[top] > 0 && levels[top] < level.to_bits(), "the ramp up takes longer than the dead-man's 200 ms");
    assert!(levels[top..].is_sorted_by(|before, after| before >= after), "up again");
    let turning = levels.iter().filter(|&&level| level > 0).count() * usize::from(DIVISOR);
    assert!(turning <= 2 * settings.loop_rate_hz as usize * 200 / 1000 + 2 * usize::from(DIVISOR), "{turning} ticks");
    assert_eq!(machine.link.faults().dead_man, 1);
    assert_eq!(machine.link.info().motors[0], ChannelState::NoSignal);
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_flood_of_garbage_is_counted_and_changes_neither_settings_nor_outputs() {
    let image = image();
    let mut machine = Machine::boot(&Start::new(&image));
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
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_host_that_vanishes_during_an_injection_loses_the_motor_which_stops() {
    let image = image();
    let (mut machine, first) = keeping_up(|| {
        let mut machine = Machine::boot(&Start::new(&image));
        let first = arm(&mut machine, 0.5)?;
        let saved = machine.link.ask(&Request::SaveSettings);
        is_injected(&mut machine)?;
        assert_eq!(saved, Message::Refused(Refusal::NotDisarmed { motor: 0 }));
        Ok((machine, first))
    });
    wait("the loss", || machine.link.info().motors[0] == ChannelState::Lost);
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
    let samples = Series::try_from(&[0][..]).unwrap();
    let late = machine.link.ask(&Request::Inject(InjectRequest { motor: 0, first, samples }));
    assert_eq!(late, Message::Refused(Refusal::NotInjecting));
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_reset_while_armed_comes_back_with_stop_pulses() {
    let image = image();
    let mut machine = armed(&Start::new(&image), 0.6);
    machine.monitor.reset();
    machine.link.wait_for_start();
    let info = machine.link.info();
    assert_eq!(info.motors, [ChannelState::NoSignal; 4]);
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
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
    let start = Start { trace: true, debugger: true, ..Start::new(&image) };
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
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn a_panic_forces_the_outputs_low_and_is_reported_after_the_reset() {
    let image = panicking_image();
    let mut machine = Machine::boot(&Start { trace: true, ..Start::new(&image) });
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
        ResetReason::Panic(place) => assert!(place.to_string().contains("src/wiring.rs"), "{place}"),
        other => panic!("{other:?}"),
    }
    let stop = width(&mut machine, Command::ZERO);
    assert_eq!(machine.monitor.word(OUTPUT_1), stop);
}

#[test]
#[ignore = "needs the image and the emulator: cargo xtask test"]
fn stored_settings_are_loaded_and_survive_wrong_bytes_in_one_copy() {
    const SECTOR: usize = 128 * 1024;
    let image = image();
    let mut settings = Settings::default();
    settings.lead.omega_z_rad_s = 12.5;
    let settings = settings.validate().unwrap();
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&settings).unwrap();
    let whole = store.into_flash().bytes;
    let used = whole[..SECTOR].iter().rposition(|&byte| byte != 0xff).unwrap() + 1;
    let loaded = |flash: &[u8]| {
        let mut machine = Machine::boot(&Start { settings_flash: Some(flash), ..Start::new(&image) });
        match machine.link.ask(&Request::GetSettings) {
            Message::Settings(settings) => (settings, machine.link.info().settings),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(loaded(&whole), (Settings::clone(&settings), Origin::Stored));
    // Every byte is a test of the host; here some, each in a controller that boots.
    for address in (0..used).step_by(used / 6) {
        let mut first = whole.clone();
        first[address] ^= 0x20;
        assert_eq!(loaded(&first), (Settings::clone(&settings), Origin::StoredOnce), "byte {address}");
        let mut both = first;
        both[SECTOR + address] ^= 0x20;
        assert_eq!(loaded(&both), (Settings::default(), Origin::DefaultsBad), "byte {address} of both");
    }
}

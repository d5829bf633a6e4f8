//! What the outputs do when something is wrong.

use emulator::rp2040::Edge;
use host_tests::pins::{INPUT_1, ms, us};
use host_tests::scenario::{
    LINES_BEGIN, Miss, Outcome, Play, Proof, STARTED, Scenario, Target, first_after_start, hold, yes,
};
use rotorlead::dshot::{Checksum, Frame, Speed, Value};
use rotorlead::link::{Message, Refusal, Request, Source};
use rotorlead::settings::{Levels, NoSignal, Pulse, PulseProtocol, Settings};

use super::bench::excite;
use super::frames::{frame, settings};
use super::pulses::lose_edge;

pub const SILENT_WITH_PULSES: Scenario = Scenario {
    name: "no signal, or stuck lines: no pulse",
    prove: silent_with_pulses,
    controls: &[("an input has stops", stops_at_an_input)],
};

pub const SILENT_WITH_FRAMES: Scenario = Scenario {
    name: "no signal, or stuck lines: no frame of DShot",
    prove: silent_with_frames,
    controls: &[("an input has stops", stops_at_an_input)],
};

pub const FULL_THROTTLE: Scenario = Scenario {
    name: "full throttle at the start, never disarmed: nothing goes out",
    prove: full_throttle,
    controls: &[("it is disarmed first", |play| {
        let end = play.end;
        play.edges.retain(|edge| edge.pin != INPUT_1);
        play.pulses(0, PERIOD, end, |n| if n < first_after_start(PERIOD) { 1000.0 } else { 1500.0 });
    })],
};

pub const NO_SETTINGS: Scenario = Scenario {
    name: "nobody has chosen settings: nothing goes out, and the lamp flickers",
    prove: no_settings,
    controls: &[("somebody has", |play| play.settings = Some(Settings::default()))],
};

pub const NO_SETTINGS_ASKED: Scenario = Scenario {
    name: "nobody has chosen settings: no host turns a motor",
    prove: no_settings_asked,
    controls: &[("somebody has", |play| play.settings = Some(Settings::default()))],
};

pub const WRONG_PROTOCOL: Scenario = Scenario {
    name: "an input has another protocol than is set: counted, and nothing goes out",
    prove: wrong_protocol,
    controls: &[("one has the right one", |play| {
        let Some(settings) = &play.settings else { return };
        let (speed, end) = (settings.input.protocol.dshot(), play.end);
        play.edges.retain(|edge| edge.pin != INPUT_1);
        match speed {
            Some(line) => play.frames(0, line.speed, us(250.0), |_| Some(frame(0, false))),
            None => play.pulses(0, PERIOD, end, |_| 1000.0),
        }
    })],
};

pub const LOST_PULSES: Scenario = Scenario {
    name: "a line is lost: pulses are held, then stops, then none",
    prove: lost_pulses,
    controls: &[("the hold time is 10 ms longer", |play| {
        if let Some(settings) = &mut play.settings {
            settings.motors[0].hold_ms += 10;
        }
    })],
};

pub const LOST_TO_THE_TICK: Scenario = Scenario {
    name: "a line is lost: time-out, hold and stops, each to the tick",
    prove: lost_to_the_tick,
    controls: &[
        ("the hold time is a tick longer", |play| {
            if let Some(settings) = &mut play.settings {
                settings.motors[0].hold_ms += 1;
            }
        }),
        ("the hold time is a tick shorter", |play| {
            if let Some(settings) = &mut play.settings {
                settings.motors[0].hold_ms -= 1;
            }
        }),
        ("stops last for a tick longer", |play| {
            if let Some(settings) = &mut play.settings {
                settings.stop_pulses_ms += 1;
            }
        }),
        ("the last edge is lost", |play| {
            let last = play.edges.iter().rposition(|edge| edge.pin == INPUT_1).expect("the line has edges");
            play.edges.remove(last);
        }),
    ],
};

pub const GLITCHES: Scenario = Scenario {
    name: "spikes and gaps under 2 µs change nothing",
    prove: glitches,
    controls: &[
        ("they are three times as long", |play| {
            let mut before = None;
            for edge in &mut play.edges {
                let Some(Edge { cycle, .. }) = before.replace(*edge) else { continue };
                if edge.cycle > cycle && edge.cycle - cycle < us(2.0) {
                    edge.cycle = cycle + 3 * (edge.cycle - cycle);
                }
            }
        }),
        ("an edge is lost", lose_edge),
    ],
};

pub const THRESHOLDS: Scenario = Scenario {
    name: "a motor arms at `arming`, and disarms below `disarming`",
    prove: thresholds,
    controls: &[
        ("`disarming` is 0.002 higher", |play| {
            if let Some(settings) = &mut play.settings {
                settings.motors[0].disarming = Some(Levels::PULSES.disarming + (1 << 29) / 500);
            }
        }),
        ("`disarming` is 0.002 lower", |play| {
            if let Some(settings) = &mut play.settings {
                settings.motors[0].disarming = Some(Levels::PULSES.disarming - (1 << 29) / 500);
            }
        }),
        ("`arming` is 0.002 lower", |play| {
            if let Some(settings) = &mut play.settings {
                settings.motors[0].arming = Some(Levels::PULSES.arming - (1 << 29) / 500);
            }
        }),
    ],
};

/// 400 Hz.
const PERIOD: u64 = 312_500;

fn stops_at_an_input(play: &mut Play) {
    let end = play.end;
    play.pulses(0, PERIOD, end, |_| 1000.0);
}

/// Lines that are open, low, high, and high from the start of the controller on.
fn stuck(settings: &Settings) -> Play {
    let mut play = Play::new(settings, STARTED + ms(60.0));
    play.stick(1, 0, false);
    play.stick(2, 0, true);
    play.stick(3, STARTED, true);
    play
}

fn silent_with_pulses(target: &dyn Target) -> Proof {
    target.play(&stuck(&Settings::default()))?.hold_low(0..4)?;
    yes()
}

fn silent_with_frames(target: &dyn Target) -> Proof {
    target.play(&stuck(&settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600)))?.hold_low(0..4)?;
    yes()
}

fn full_throttle(target: &dyn Target) -> Proof {
    let mut play = Play::new(&Settings::default(), STARTED + ms(60.0));
    for motor in 0..4 {
        play.pulses(motor, PERIOD, play.end, |_| 1200.0 + 200.0 * f64::from(motor));
    }
    target.play(&play)?.hold_low(0..4)?;
    yes()
}

/// Wrong unless the lamp went on so many times in the second before the end: its patterns last for one.
fn hold_flashes(outcome: &Outcome, end: u64, count: usize) -> Result<(), Miss> {
    let flashes = outcome.flashes()?.into_iter().filter(|cycle| *cycle > end - ms(1000.0)).count();
    hold(flashes == count, || format!("{flashes} flashes in a second, and not {count}"))
}

fn no_settings(target: &dyn Target) -> Proof {
    let mut play = Play::without_settings(STARTED + ms(1000.0));
    for motor in 0..4 {
        play.pulses(motor, PERIOD, play.end, |n| if n < first_after_start(PERIOD) { 1000.0 } else { 1500.0 });
    }
    let outcome = target.play(&play)?;
    outcome.hold_low(0..4)?;
    hold_flashes(&outcome, play.end, 5)?;
    yes()
}

fn no_settings_asked(target: &dyn Target) -> Proof {
    let mut play = Play::without_settings(STARTED + ms(40.0));
    play.fit_jumper(0, true);
    play.ask(STARTED, Request::SetMode { motor: 0, source: Source::Inject, compensate: false });
    play.ask(STARTED + ms(10.0), excite(0.5, 0.05));
    let outcome = target.play(&play)?;
    outcome.hold_low(0..4)?;
    let refused = Message::Refused(Refusal::NoSettings);
    hold(outcome.answers == [refused.clone(), refused], || format!("{:?}", outcome.answers))?;
    yes()
}

/// A flight controller that is disarmed and then armed, whose frames have the checksum of bidirectional DShot.
fn bidirectional(play: &mut Play, motor: u8, speed: Speed) {
    let first = first_after_start(us(250.0));
    play.frames(motor, speed, us(250.0), |n| {
        let value = Value::new(if n < first { 0 } else { 1047 })?;
        Some(Frame::new(value, false, Checksum::Inverted).to_bits())
    });
}

fn wrong_protocol(target: &dyn Target) -> Proof {
    let pulses_us = |n: u64| if n < first_after_start(PERIOD) { 1000.0 } else { 1500.0 };
    let first = first_after_start(us(250.0));
    let armed = |n: u64| Some(frame(if n < first { 0 } else { 1047 }, false));

    // Frames are set: pulses come, frames of half the speed, and those of bidirectional DShot.
    let mut play = Play::new(&settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600), STARTED + ms(1000.0));
    play.pulses(0, PERIOD, STARTED + ms(60.0), pulses_us);
    let end = std::mem::replace(&mut play.end, STARTED + ms(60.0));
    play.frames(1, Speed::Dshot300, us(250.0), armed);
    bidirectional(&mut play, 2, Speed::Dshot600);
    bidirectional(&mut play, 3, Speed::Dshot150);
    play.end = end;
    play.ask(STARTED + ms(60.0), Request::Faults);
    let outcome = target.play(&play)?;
    outcome.hold_low(0..4)?;
    let faults = outcome.faults()?;
    let bad = faults.motors.map(|motor| motor.bad_frames);
    hold(bad.iter().all(|bad| *bad > 20), || format!("bad frames: {bad:?}"))?;
    hold_flashes(&outcome, play.end, 1)?;

    // Pulses are set: frames come, and pulses of other lengths.
    let mut play = Play::new(&settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600), STARTED + ms(60.0));
    play.frames(0, Speed::Dshot600, us(250.0), armed);
    play.frames(1, Speed::Dshot150, us(250.0), armed);
    play.pulses(2, PERIOD, play.end, |n| pulses_us(n) / 8.0);
    play.pulses(3, us(500.0), play.end, |n| pulses_us(n) / 8.0);
    play.ask(STARTED + ms(50.0), Request::Faults);
    let outcome = target.play(&play)?;
    outcome.hold_low(0..4)?;
    let motors = outcome.faults()?.motors;
    println!("  {motors:?}");
    let counted = motors.map(|motor| motor.masked + motor.out_of_range + motor.too_soon);
    hold(counted.iter().all(|count| *count > 0), || format!("{motors:?}"))?;
    yes()
}

fn lost_pulses(target: &dyn Target) -> Proof {
    let mut settings = Settings { stop_pulses_ms: 100, no_signal: NoSignal::NoPulses, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.hold_ms = 30);
    let lost = STARTED + ms(50.0);
    let mut play = Play::new(&settings, lost + ms(350.0));
    play.pulses(0, PERIOD, lost, |n| if n < first_after_start(PERIOD) { 1000.0 } else { 1500.0 });
    let found = target.play(&play)?.pulses(0)?;
    // The last pulse is good for 100 ms, its command for 30 more; then stops for 100.
    let [held, stopped] = [lost + ms(130.0), lost + ms(230.0)];
    for pulse in &found {
        let expected = match pulse.rise {
            rise if rise < STARTED + ms(11.0) => continue,
            rise if rise < held - ms(5.0) => us(1500.0),
            rise if rise < held + ms(3.0) => continue,
            _ => us(1000.0),
        };
        let after_ms = (pulse.rise as f64 - lost as f64) / 125e3;
        hold(pulse.width == expected, || format!("{} cycles {after_ms} ms after the loss", pulse.width))?;
    }
    let last = found.last().map_or(0, |pulse| pulse.rise);
    let after_ms = (last as f64 - lost as f64) / 125e3;
    hold(last.abs_diff(stopped) < ms(6.0), || format!("the last pulse {after_ms} ms after the loss"))?;
    yes()
}

/// Pulses in and a frame of DShot in each tick of 1 ms, so that ticks can be counted at the output.
fn by_the_tick() -> Settings {
    let output = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 1000 };
    Settings { loop_rate_hz: 1000, output, ..Settings::default() }
}

fn lost_to_the_tick(target: &dyn Target) -> Proof {
    let mut settings = Settings { stop_pulses_ms: 60, ..by_the_tick() };
    settings.motors[0].hold_ms = 10;
    let lost = STARTED + ms(30.0);
    let mut play = Play::new(&settings, lost + ms(250.0));
    // The last one is longer, so that the tick shows which took it.
    let last = (lost - LINES_BEGIN).div_ceil(PERIOD) - 1;
    let first = first_after_start(PERIOD);
    play.pulses(0, PERIOD, lost, |n| match n {
        n if n < first => 1000.0,
        n if n < last => 1250.0,
        _ => 1300.0,
    });
    let sent = target.play(&play)?.frames(0, Speed::Dshot600)?;
    let mut runs: Vec<(u16, usize)> = Vec::new();
    for (_, bits) in &sent {
        match runs.last_mut() {
            Some((last, count)) if last == bits => *count += 1,
            _ => runs.push((*bits, 1)),
        }
    }
    // 0.3 from its tick on until 100 ms after the pulse, and for the hold time; then stops.
    let expected = [(frame(647, false), 100 + 10), (frame(0, false), 60)];
    let found = &runs[runs.len().saturating_sub(2)..];
    hold(found == expected, || format!("{found:x?} ticks, and not {expected:x?}"))?;
    let silent_from = sent.last().map_or(0, |(start, _)| *start);
    hold(silent_from + ms(20.0) < play.end, || "it goes on".to_owned())?;
    Ok(format!("{} + {} ticks", found[0].1, found[1].1))
}

fn glitches(target: &dyn Target) -> Proof {
    let mut play = Play::new(&Settings::default(), STARTED + ms(60.0));
    play.pulses(0, PERIOD, play.end, |n| if n < first_after_start(PERIOD) { 1000.0 } else { 1500.0 });
    // A spike of 0.2 to 1.8 µs in each gap, and as long a gap in each pulse.
    for (n, rise) in (LINES_BEGIN..play.end - ms(3.0)).step_by(PERIOD as usize).enumerate() {
        let long = us(0.2 + 0.2 * (n % 9) as f64);
        for (from, is_high) in [(rise + us(400.0), false), (rise + us(2100.0), true)] {
            let pin = INPUT_1;
            play.edges.push(Edge { cycle: from, pin, is_high });
            play.edges.push(Edge { cycle: from + long, pin, is_high: !is_high });
        }
    }
    play.ask(play.end - ms(1.0), Request::Faults);
    let outcome = target.play(&play)?;
    let found = outcome.pulses(0)?;
    let late: Vec<_> = found.iter().filter(|pulse| pulse.rise > STARTED + ms(11.0)).collect();
    hold(late.len() >= 18, || format!("{} pulses", late.len()))?;
    let wrong = late.iter().find(|pulse| pulse.width != us(1500.0));
    hold(wrong.is_none(), || format!("{wrong:?}"))?;
    let gap = late.windows(2).find(|pair| pair[1].rise - pair[0].rise > PERIOD + us(250.0));
    hold(gap.is_none(), || format!("none goes out between {gap:?}"))?;
    let faults = outcome.faults()?.motors[0];
    println!("  {faults:?}");
    hold(faults.missing_edges == 0 && faults.out_of_range == 0, || format!("{faults:?}"))?;
    yes()
}

fn thresholds(target: &dyn Target) -> Proof {
    let mut play = Play::new(&by_the_tick(), STARTED + ms(100.0));
    let first = first_after_start(PERIOD);
    // Below `arming`, 0.05; above; above `disarming`, 0.04, where the output is `idle`; below; and not armed by less.
    let levels_us = [1049.0, 1051.0, 1041.0, 1039.0, 1049.0];
    play.pulses(0, PERIOD, play.end, |n| match n.checked_sub(first) {
        None => 1000.0,
        Some(since) => levels_us[(since / 7).min(4) as usize],
    });
    let sent = target.play(&play)?.frames(0, Speed::Dshot600)?;
    let mut values: Vec<u16> = sent.into_iter().filter(|(start, _)| *start > STARTED).map(|(_, bits)| bits).collect();
    values.dedup();
    let expected = [0, 47 + 102, 47 + 100, 0].map(|value| frame(value, false));
    hold(values == expected, || format!("{values:x?}, and not {expected:x?}"))?;
    yes()
}

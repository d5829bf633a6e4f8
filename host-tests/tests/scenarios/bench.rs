//! What a host does over the link: settings, injection, excitation, the recorder, and the jumper that allows it.

use host_tests::pins::{ms, us};
use host_tests::scenario::{Miss, Outcome, Play, Proof, STARTED, Scenario, Target, hold, yes};
use rotorlead::channel::{Channel, Excitation, ExcitationRequest, Input};
use rotorlead::controller::{channel_settings, channels, filters};
use rotorlead::dshot::{Checksum, Frame, Speed, Value};
use rotorlead::link::{
    ExciteRequest, INJECT_SAMPLES, InjectRequest, LineSet, Message, NO_PULSE, Record, RecordRequest, Refusal, Request,
    Series, Source,
};
use rotorlead::settings::{Origin, Pulse, PulseProtocol, Settings, Validated};
use rotorlead::throttle::Command;

pub const STORED_SETTINGS: Scenario = Scenario {
    name: "stored settings are loaded, and told to a host",
    prove: stored_settings,
    controls: &[("one is another", |play| {
        if let Some(settings) = &mut play.settings {
            settings.motors[2].hold_ms += 1;
        }
    })],
};

pub const INJECTION: Scenario = Scenario {
    name: "injected commands come out as the library's, bit for bit; the last is held",
    prove: injection,
    controls: &[
        ("the filter is not in the path", |play| {
            for (_, request) in &mut play.requests {
                if let Request::SetMode { compensate, .. } = request {
                    *compensate = false;
                }
            }
        }),
        ("a command is another", |play| {
            for (_, request) in &mut play.requests {
                if let Request::Inject(InjectRequest { first: 128, samples, .. }) = request {
                    let mut bits = samples.as_slice().to_vec();
                    bits[60] += 1;
                    *samples = Series::try_from(&bits[..]).expect("a block");
                }
            }
        }),
    ],
};

pub const EXCITATION: Scenario = Scenario {
    name: "an excitation of 150 lines through the lead, at an output, tick for tick",
    prove: excitation,
    controls: &[
        ("the amplitude is 0.002 higher", |play| {
            for (_, request) in &mut play.requests {
                if let Request::Excite(request) = request {
                    request.amplitude += (1 << 29) / 500;
                }
            }
        }),
        ("no keep-alive comes", |play| {
            play.requests.retain(|(_, request)| *request != Request::KeepAlive);
        }),
        ("it waits for a tick longer", |play| {
            if let Some(settings) = &mut play.settings {
                settings.excitation.arm_ms += 1;
            }
        }),
    ],
};

pub const TOO_SLOW: Scenario = Scenario {
    name: "an excitation that the ticks have no time for is refused",
    prove: too_slow,
    controls: &[("it has fewer lines, and ticks are slower", |play| {
        if let Some(settings) = &mut play.settings {
            settings.loop_rate_hz = 1000;
        }
        for (_, request) in &mut play.requests {
            if let Request::Excite(request) = request {
                request.lines = LineSet::Odd30Hz;
            }
        }
    })],
};

pub const RECORDER: Scenario = Scenario {
    name: "an excitation recorded: its commands before and after the lead, bit for bit",
    prove: recorder,
    controls: &[
        ("the amplitude is 0.00001 higher", |play| {
            for (_, request) in &mut play.requests {
                if let Request::Excite(request) = request {
                    request.amplitude += 1 << 12;
                }
            }
        }),
        ("another motor is recorded", |play| {
            for (_, request) in &mut play.requests {
                if let Request::Record(Some(request)) = request {
                    request.motor = 1;
                }
            }
        }),
    ],
};

pub const CONVERTER: Scenario = Scenario {
    name: "the thrust sensor's counts in the recorder",
    prove: converter,
    controls: &[("a count is one lower", |play| play.thrust[1].1 -= 1)],
};

pub const JUMPER: Scenario = Scenario {
    name: "no jumper: refused; fitted: allowed; pulled while a motor turns: it stops",
    prove: jumper,
    controls: &[
        ("it is never pulled", |play| {
            play.edges.retain(|edge| !edge.is_high);
        }),
        ("it is fitted from the start", |play| play.fit_jumper(0, true)),
    ],
};

/// Steps of a command.
fn bits(command: f64) -> i32 {
    Command::saturating_from_f64(command).to_bits()
}

/// 150 lines around a command of motor 0.
pub fn excite(nominal: f64, amplitude: f64) -> Request {
    Request::Excite(request(nominal, amplitude))
}

fn request(nominal: f64, amplitude: f64) -> ExciteRequest {
    let (nominal, amplitude) = (bits(nominal), bits(amplitude));
    ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal, amplitude, periods: 1 }
}

/// With the lead in the path of motor 0, short ramps, and a host that may be slow.
fn settings(loop_rate_hz: u32) -> Settings {
    let mut settings = Settings { loop_rate_hz, ..Settings::default() };
    for motor in &mut settings.motors {
        (motor.compensate, motor.hold_ms) = (true, 1000);
    }
    (settings.excitation.arm_ms, settings.excitation.ramp_ms) = (10, 100);
    settings
}

/// The same at the rate at which the slowest core plays 150 lines, with a frame of DShot in each tick at the outputs.
fn by_the_tick() -> Settings {
    Settings { output: Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 1000 }, ..settings(1000) }
}

fn valid(settings: &Settings) -> Validated {
    settings.clone().validate().unwrap_or_else(|error| panic!("{error}"))
}

/// The library's channel of motor 0, its filter in the path.
fn reference(settings: &Validated) -> Channel {
    let [channel, ..] = channels(settings, filters(settings).expect("a lead")).expect("valid");
    channel
}

/// The library's channel with an excitation that starts with its next tick.
fn excited(settings: &Settings, request: &ExciteRequest) -> Channel {
    let settings = valid(settings);
    let loop_rate_hz = settings.loop_rate_hz;
    let [nominal, amplitude] = [request.nominal, request.amplitude].map(Command::saturating_from_bits);
    let checked =
        ExcitationRequest { lines: request.lines.lines(), nominal, amplitude, duration_ticks: 10 * loop_rate_hz };
    let excitation = Excitation::new(&channel_settings(&settings, 0), &checked, f64::from(loop_rate_hz));
    let mut channel = reference(&settings);
    channel.start_excitation(excitation.expect("within the limits")).expect("a channel at rest");
    channel
}

/// A host that is there from an excitation on.
fn keep_alive(play: &mut Play, from: u64, to: u64, apart_ms: f64) {
    for cycle in (from..to).step_by(ms(apart_ms) as usize) {
        play.ask(cycle, Request::KeepAlive);
    }
    play.requests.sort_by_key(|(cycle, _)| *cycle);
}

fn stored_settings(target: &dyn Target) -> Proof {
    let mut settings = settings(2000);
    settings.motors[2].hold_ms = 345;
    let mut play = Play::new(&settings, STARTED + ms(40.0));
    play.ask(STARTED, Request::Info);
    play.ask(STARTED + ms(10.0), Request::GetSettings);
    let outcome = target.play(&play)?;
    let [Message::Info(info), Message::Settings(told)] = &outcome.answers[..] else {
        return Err(Miss::Wrong(format!("{:?}", outcome.answers)));
    };
    hold(info.settings == Origin::Stored && info.outputs_enabled, || format!("{info:?}"))?;
    hold(*told == settings, || format!("{told:?}"))?;
    outcome.hold_low(0..4)?;
    yes()
}

fn injection(target: &dyn Target) -> Proof {
    let settings = settings(1000);
    // The stop, a step, and what crosses the range, back to one half.
    let commands: Vec<Command> = (0..3 * INJECT_SAMPLES)
        .map(|n| {
            Command::saturating_from_f64(match n {
                0..10 => 0.0,
                10..100 => 0.4,
                100..300 => 0.5 + 0.3 * (0.1 * n as f64).sin(),
                _ => 0.5,
            })
        })
        .collect();
    let mut play = Play::new(&settings, STARTED + ms(480.0));
    play.fit_jumper(0, true);
    play.ask(STARTED, Request::SetMode { motor: 0, source: Source::Inject, compensate: true });
    for (n, block) in commands.chunks(INJECT_SAMPLES).enumerate() {
        let block: Vec<i32> = block.iter().map(|command| command.to_bits()).collect();
        let samples = Series::try_from(&block[..]).expect("a block");
        let first = (n * INJECT_SAMPLES) as u32;
        play.ask(STARTED + ms(10.0 * (n + 1) as f64), Request::Inject(InjectRequest { motor: 0, first, samples }));
    }
    let outcome = target.play(&play)?;
    let mut channel = reference(&valid(&settings));
    channel.set_enabled(true);
    let expected: Vec<i32> = commands.iter().map(|command| channel.inject(*command).to_bits()).collect();
    let outputs = outcome.answers.iter().filter_map(|answer| match answer {
        Message::Injected(injected) => Some(injected.outputs.as_slice()),
        _ => None,
    });
    let outputs: Vec<i32> = outputs.flatten().copied().collect();
    let different = outputs.iter().zip(&expected).position(|(output, expected)| output != expected);
    hold(outputs.len() == expected.len() && different.is_none(), || {
        format!("{} outputs, of which number {different:?} is the first that differs", outputs.len())
    })?;
    let width_us = outcome.last_width_us(0);
    hold((width_us - 1500.0).abs() < 0.1, || format!("{width_us} µs while 0.5 is held"))?;
    outcome.hold_low(1..4)?;
    Ok(format!("{} samples", outputs.len()))
}

fn excitation(target: &dyn Target) -> Proof {
    let settings = Settings { stop_pulses_ms: 20, ..by_the_tick() };
    let request = request(0.5, 0.05);
    let mut play = Play::new(&settings, STARTED + ms(320.0));
    play.fit_jumper(0, true);
    play.ask(STARTED, Request::Excite(request));
    keep_alive(&mut play, STARTED + ms(20.0), STARTED + ms(195.0), 25.0);
    play.ask(STARTED + ms(215.0), Request::StopExcitation);
    play.ask(STARTED + ms(315.0), Request::Faults);
    let outcome = target.play(&play)?;
    let sent = outcome.frames(0, Speed::Dshot600)?;
    let faults = outcome.faults()?;
    hold(faults.missed_deadlines == 0, || format!("{} ticks missed their deadline", faults.missed_deadlines))?;
    // A frame goes out when its tick has reckoned it: on the slowest core half a tick later while lines are played.
    let wrong = sent.windows(2).find(|pair| (pair[1].0 - pair[0].0).abs_diff(ms(1.0)) > us(600.0));
    hold(wrong.is_none(), || format!("not a frame in each tick: {wrong:?}"))?;
    // The library is stopped in the tick in which the request was heard: some of those around its time.
    let asked = sent.iter().position(|(start, _)| *start > STARTED + ms(215.0));
    let Some(asked) = asked else { return Err(Miss::Wrong(format!("{} frames only", sent.len()))) };
    let sent: Vec<u16> = sent.into_iter().map(|(_, bits)| bits).collect();
    let played = |stop: usize| -> Vec<u16> {
        let mut channel = excited(&settings, &request);
        let outputs = (0..).map_while(|tick| {
            if tick == stop {
                channel.stop_excitation();
            }
            channel.keep_alive();
            channel.tick(Input::Nothing).command()
        });
        outputs.map(|command| Frame::new(Value::from_command(command), false, Checksum::Normal).to_bits()).collect()
    };
    let all: Vec<Vec<u16>> = (asked.saturating_sub(2)..asked + 3).map(played).collect();
    let is_played = all.contains(&sent);
    hold(is_played, || {
        let same = |expected: &Vec<u16>| expected.iter().zip(&sent).take_while(|(a, b)| a == b).count();
        let best = all.iter().map(same).max().unwrap_or(0);
        format!("{} frames, of which the first {best} are the library's", sent.len())
    })?;
    outcome.hold_low(1..4)?;
    Ok(format!("{} ticks", sent.len()))
}

fn too_slow(target: &dyn Target) -> Proof {
    let settings = settings(10_000);
    let mut play = Play::new(&settings, STARTED + ms(40.0));
    play.fit_jumper(0, true);
    play.ask(STARTED, Request::Excite(ExciteRequest { lines: LineSet::Odd45Hz, ..request(0.5, 0.05) }));
    play.ask(STARTED + ms(30.0), Request::Faults);
    let outcome = target.play(&play)?;
    let refused = matches!(outcome.answers[..], [Message::Refused(Refusal::TooSlow { lines: 225, .. }), _]);
    hold(refused, || format!("{:?}", outcome.answers))?;
    hold(outcome.faults()?.missed_deadlines == 0, || "a tick missed its deadline".to_owned())?;
    outcome.hold_low(0..4)?;
    yes()
}

/// The records of a play.
fn records(outcome: &Outcome) -> Vec<&Record> {
    let records = outcome.answers.iter().filter_map(|answer| match answer {
        Message::Record(record) => Some(record),
        _ => None,
    });
    records.collect()
}

/// One tick in so many is recorded: what QEMU's line carries.
const DIVISOR: u16 = 2;

fn recorder(target: &dyn Target) -> Proof {
    // The rate at which the slowest clock plays so many lines.
    let settings = settings(1000);
    let request = request(0.5, 0.05);
    let mut play = Play::new(&settings, STARTED + ms(420.0));
    play.fit_jumper(0, true);
    play.ask(STARTED, Request::Record(Some(RecordRequest { motor: 0, divisor: DIVISOR })));
    play.ask(STARTED + ms(10.0), Request::Excite(request));
    keep_alive(&mut play, STARTED + ms(30.0), STARTED + ms(390.0), 50.0);
    play.ask(STARTED + ms(390.0), Request::Record(None));
    let outcome = target.play(&play)?;
    let records = records(&outcome);
    let samples: Vec<(u32, i32, i32)> = records
        .iter()
        .flat_map(|record| {
            let ticks = (0..).map(|n| record.first_tick + n * u32::from(record.divisor));
            let commands = record.before.as_slice().iter().zip(record.after.as_slice());
            ticks.zip(commands).map(|(tick, (before, after))| (tick, *before, *after))
        })
        .collect();
    let mut channel = excited(&settings, &request);
    let expected: Vec<(i32, i32)> = std::iter::from_fn(|| {
        channel.keep_alive();
        let output = channel.tick(Input::Nothing);
        Some((channel.command().to_bits(), output.to_bits()))
    })
    .take(2000)
    .collect();
    // The ramp has a level of its own in every tick, which tells when it began.
    let begin = samples.iter().find(|(_, before, _)| *before > 0);
    let Some((tick, level, _)) = begin else { return Err(Miss::Wrong(format!("{} samples at rest", samples.len()))) };
    let offset = expected.iter().position(|(before, _)| before == level);
    let Some(offset) = offset else { return Err(Miss::Wrong(format!("the ramp has no level of {level}"))) };
    for &(at, before, after) in &samples {
        let n = i64::from(at) - i64::from(*tick) + offset as i64;
        // No pulse before its begin.
        let library = usize::try_from(n).ok().and_then(|n| expected.get(n)).copied().unwrap_or((0, NO_PULSE));
        hold((before, after) == library, || format!("{before} and {after} in tick {n}, and not {library:?}"))?;
    }
    let nominal = request.nominal - request.amplitude;
    let played = samples.iter().filter(|(_, before, _)| *before >= nominal).count();
    hold(played >= 100, || format!("{played} samples of the lines"))?;
    let inputs = records.iter().flat_map(|record| record.input.as_slice());
    hold(inputs.clone().all(|input| *input == rotorlead::link::NO_INPUT), || "there is no input".to_owned())?;
    yes()
}

fn converter(target: &dyn Target) -> Proof {
    let settings = settings(1000);
    let mut play = Play::new(&settings, STARTED + ms(170.0));
    let counts = [(0, 7), (STARTED + ms(50.0), 1234), (STARTED + ms(100.0), 4095)];
    play.thrust = counts.to_vec();
    play.ask(STARTED, Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
    play.ask(STARTED + ms(150.0), Request::Record(None));
    let outcome = target.play(&play)?;
    let found: Vec<i32> = records(&outcome).iter().flat_map(|record| record.adc.as_slice()).copied().collect();
    let mut runs: Vec<(i32, usize)> = Vec::new();
    for count in &found {
        match runs.last_mut() {
            Some((last, ticks)) if last == count => *ticks += 1,
            _ => runs.push((*count, 1)),
        }
    }
    let values: Vec<i32> = runs.iter().map(|(count, _)| *count).collect();
    hold(values == counts.map(|(_, count)| i32::from(count)), || format!("{runs:?}"))?;
    hold(runs[1].1.abs_diff(50) <= 1, || format!("{runs:?}"))?;
    yes()
}

fn jumper(target: &dyn Target) -> Proof {
    let settings = Settings { stop_pulses_ms: 20, ..by_the_tick() };
    let mut play = Play::new(&settings, STARTED + ms(300.0));
    let [fitted, started, pulled] = [30.0, 40.0, 120.0].map(|at| STARTED + ms(at));
    play.ask(STARTED, excite(0.5, 0.05));
    play.ask(STARTED + ms(10.0), Request::SetMode { motor: 0, source: Source::Inject, compensate: false });
    play.ask(STARTED + ms(20.0), Request::KeepAlive);
    play.fit_jumper(fitted, true);
    play.ask(started, excite(0.5, 0.05));
    keep_alive(&mut play, started + ms(20.0), STARTED + ms(260.0), 20.0);
    play.fit_jumper(pulled, false);
    let outcome = target.play(&play)?;
    let disabled = Message::Refused(Refusal::BenchDisabled);
    let answers: Vec<bool> = outcome.answers.iter().map(|answer| *answer == disabled).collect();
    let others = outcome.answers.iter().find(|answer| **answer != disabled && **answer != Message::Done);
    hold(others.is_none(), || format!("{others:?}"))?;
    // Three refusals; the start and keep-alives at 60 to 120 ms; refusals of the rest.
    let expected = [vec![true; 3], vec![false; 1 + 3], vec![true; 7]].concat();
    hold(answers == expected, || format!("refused: {answers:?}, and not {expected:?}"))?;
    let sent = outcome.frames(0, Speed::Dshot600)?;
    hold(sent.first().is_some_and(|(start, _)| *start > started), || "a frame before it is fitted".to_owned())?;
    let turning = |(_, bits): &&(u64, u16)| *bits != Frame::new(Value::STOP, false, Checksum::Normal).to_bits();
    let (first, last) = (sent.iter().find(turning), sent.iter().rfind(turning));
    let (Some((first, _)), Some((last, _))) = (first, last) else {
        return Err(Miss::Wrong("it never turns".to_owned()));
    };
    // The ramp up begins when the stops are over; the ramp down with the next keep-alive, and from at most one half.
    hold(*first < started + ms(20.0) && *last > pulled, || format!("turns from {first} to {last}"))?;
    let stopped_ms = (last - pulled) as f64 / ms(1.0) as f64;
    hold(stopped_ms < 20.0 + 70.0, || format!("it turns for {stopped_ms} ms after the jumper was pulled"))?;
    let silent = play.end - sent.last().map_or(0, |(start, _)| *start);
    hold(silent > ms(20.0), || "it goes on".to_owned())?;
    outcome.hold_low(1..4)?;
    Ok(format!("stops in {stopped_ms:.0} ms"))
}

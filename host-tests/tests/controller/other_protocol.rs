//! A flight controller whose pulses are not those of the settings is a flight controller all the same.

use host_tests::rig::Rig;
use rotorlead::capture::InputReading;
use rotorlead::link::{ExciteRequest, InjectRequest, LineSet, Message, Refusal, Request, Sensed, Source};
use rotorlead::settings::{MOTORS, Settings};
use rotorlead::throttle::{Command, EscCommand};

fn bits(value: f64) -> i32 {
    Command::saturating_from_f64(value).to_bits()
}

fn excite() -> Request {
    let request =
        ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal: bits(0.5), amplitude: bits(0.05), periods: 8 };
    Request::Excite(request)
}

fn inject() -> Request {
    Request::SetMode { motor: 0, source: Source::Inject, compensate: true }
}

/// A controller that arms at once, and ticks of it.
fn rig() -> Rig {
    let mut settings = Settings::default();
    settings.excitation.arm_ms = 0;
    Rig::with(settings)
}

fn run(rig: &mut Rig, readings: [InputReading; MOTORS]) -> EscCommand {
    rig.hardware.tick_mut().run(readings, |_| Sensed::adc(0))[0]
}

fn unreadable_at(input: usize) -> [InputReading; MOTORS] {
    let mut readings = [InputReading::NOTHING; MOTORS];
    readings[input] = InputReading::UNREADABLE;
    readings
}

#[test]
fn nothing_is_driven_while_an_input_has_pulses_of_another_protocol() {
    for input in 0..MOTORS {
        for request in [excite(), inject()] {
            let mut rig = rig();
            assert_eq!(run(&mut rig, unreadable_at(input)), EscCommand::NO_PULSE);
            let refusal = Message::Refused(Refusal::InputLive { motor: input as u8 });
            assert_eq!(rig.ask(&request), refusal, "{request:?}");
            // Gone, it may be.
            run(&mut rig, [InputReading::NOTHING; MOTORS]);
            assert_eq!(rig.ask(&request), Message::Done, "{request:?}");
        }
    }
}

#[test]
fn an_excitation_ends_down_its_ramp_when_they_come_up() {
    for input in 0..MOTORS {
        let mut rig = rig();
        assert_eq!(rig.ask(&excite()), Message::Done);
        let mut output = EscCommand::NO_PULSE;
        for n in 0..8000 {
            if n % 250 == 0 {
                assert_eq!(rig.ask(&Request::KeepAlive), Message::Done);
            }
            output = run(&mut rig, [InputReading::NOTHING; MOTORS]);
        }
        assert!(output > Command::saturating_from_f64(0.4), "{output:?}");
        // The host goes on, and the pulses were there for one tick only. The ramp from 0.5 takes 1.5 s of 2.
        run(&mut rig, unreadable_at(input));
        for n in 0..8000 {
            if n % 250 == 0 {
                rig.ask(&Request::KeepAlive);
            }
            output = run(&mut rig, [InputReading::NOTHING; MOTORS]);
        }
        assert!(output <= Command::ZERO, "{output:?}");
    }
}

#[test]
fn an_injection_stops_at_once_when_they_come_up() {
    for input in 0..MOTORS {
        let mut rig = rig();
        assert_eq!(rig.ask(&inject()), Message::Done);
        let mut commands = [bits(0.3); 128];
        commands[0] = 0;
        let samples = commands[..].try_into().unwrap();
        rig.send(&Request::Inject(InjectRequest { motor: 0, first: 0, samples }));
        rig.serve(usize::MAX);
        let mut output = EscCommand::NO_PULSE;
        for _ in 0..100 {
            output = run(&mut rig, [InputReading::NOTHING; MOTORS]);
        }
        assert!(output > Command::saturating_from_f64(0.2), "{output:?}");
        // Common to all motors from the next tick on.
        run(&mut rig, unreadable_at(input));
        assert_eq!(run(&mut rig, unreadable_at(input)), Command::ZERO);
    }
}

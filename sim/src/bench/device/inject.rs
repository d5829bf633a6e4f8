//! Commands from the host, sample by sample, and what the controller makes of them.

use std::collections::VecDeque;

use rotorlead::link::{INJECT_SAMPLES, INJECT_WINDOW, InjectRequest, Message, Request, Series, Source};
use rotorlead::throttle::Command;

use super::{DeviceError, Session};

/// Sends `commands` to a motor's path, one per control tick, and gives what it would have sent to the ESC. The path
/// starts afresh, and afterwards is given back to the pulses.
///
/// # Errors
/// [`DeviceError`]; also when a frame is lost on the way: the path's state is then not known any more, so nothing is
/// repeated.
pub fn inject(
    session: &mut Session,
    motor: u8,
    compensate: bool,
    commands: &[Command],
) -> Result<Vec<Command>, DeviceError> {
    session.set_mode(motor, Source::Inject, compensate)?;
    let outputs = stream(session, motor, commands).and_then(|outputs| {
        disarm(session, motor, &outputs)?;
        Ok(outputs)
    });
    let released = session.set_mode(motor, Source::Pulse, compensate);
    let outputs = outputs?;
    released?;
    Ok(outputs)
}

/// Brings the motor to a stop, which it must be at before the path starts afresh.
fn disarm(session: &mut Session, motor: u8, outputs: &[Command]) -> Result<(), DeviceError> {
    let mut samples = Series::new();
    samples.push(Command::ZERO.to_bits()).expect("a request holds more than one");
    let first = outputs.len() as u32;
    let tag = session.send(&Request::Inject(InjectRequest { motor, first, samples }))?;
    collect(session, &mut VecDeque::from([(tag, 1)]), &mut Vec::new())
}

fn stream(session: &mut Session, motor: u8, commands: &[Command]) -> Result<Vec<Command>, DeviceError> {
    let mut outputs = Vec::with_capacity(commands.len());
    let mut under_way = VecDeque::with_capacity(INJECT_WINDOW);
    for block in commands.chunks(INJECT_SAMPLES) {
        if under_way.len() == INJECT_WINDOW {
            collect(session, &mut under_way, &mut outputs)?;
        }
        let mut samples = Series::new();
        for command in block {
            samples.push(command.to_bits()).expect("a block is as long as a request");
        }
        let sent: usize = outputs.len() + under_way.iter().map(|&(_, length)| length).sum::<usize>();
        // Numbers wrap, as the controller's do.
        let request = InjectRequest { motor, first: sent as u32, samples };
        under_way.push_back((session.send(&Request::Inject(request))?, block.len()));
    }
    while !under_way.is_empty() {
        collect(session, &mut under_way, &mut outputs)?;
    }
    Ok(outputs)
}

/// Waits for the answer to the oldest request.
fn collect(
    session: &mut Session,
    under_way: &mut VecDeque<(u8, usize)>,
    outputs: &mut Vec<Command>,
) -> Result<(), DeviceError> {
    let Some((tag, expected)) = under_way.pop_front() else { return Ok(()) };
    let Message::Injected(injected) = session.answer(tag, session.limit(), "inject")? else {
        return Err(DeviceError::Unexpected { request: "inject" });
    };
    let got = injected.outputs.len();
    let first = outputs.len() as u32;
    if got != expected || injected.first != first {
        return Err(DeviceError::Outputs { first, expected, got });
    }
    outputs.extend(injected.outputs.as_slice().iter().map(|&bits| Command::saturating_from_bits(bits)));
    Ok(())
}

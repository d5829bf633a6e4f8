//! From what the flash holds to a running controller.

use embedded_storage::nor_flash::NorFlash;
use heapless::spsc::{Consumer, Producer};

use super::hardware::{BoardFacts, CaptureTimer, ControlHardware, ControlParts};
use super::plan::Plan;
use super::resume::{ResumeSource, Resumption};
use super::{
    Control, HandlerQueues, INJECT_QUEUE, Inputs, Motor, MotorQueues, Outputs, RECORD_QUEUE, RequestHandler, Tick,
    channels, filters,
};
use crate::channel::{Channel, State};
use crate::compensator::Filter;
use crate::link::Sample;
use crate::settings::{MOTORS, Origin, Store, Validated};
use crate::throttle::{Command, EscCommand};

/// Both ends of a queue.
pub type Ends<T, const N: usize> = (Producer<'static, T, N>, Consumer<'static, T, N>);

/// The queues between the control task and the lowest priority.
pub struct Queues {
    /// Commands to be injected, per motor.
    pub inject: [Ends<Command, INJECT_QUEUE>; MOTORS],
    /// What they came to.
    pub outputs: [Ends<EscCommand, INJECT_QUEUE>; MOTORS],
    /// The recorder's samples.
    pub samples: Ends<Sample, RECORD_QUEUE>,
}

/// A controller whose ticks wait for [`Control::start_ticks`].
pub struct Started<C, H: ControlHardware, F> {
    /// For the capture interrupt and the control task.
    pub inputs: Inputs<C>,
    /// For the control task.
    pub control: Control<H>,
    /// For the lowest priority.
    pub handler: RequestHandler<F>,
    /// Where the settings come from.
    pub origin: Origin,
}

/// Settings as a controller runs with them.
struct Usable {
    channels: [Channel; MOTORS],
    filters: [Filter; MOTORS],
    plan: Plan,
}

impl Usable {
    /// `None` where the filter cannot be designed, or a timer does not suit the pulses.
    fn new(settings: &Validated, facts: &BoardFacts) -> Option<Self> {
        let filters = filters(settings).ok()?;
        Self::with(settings, filters, channels(settings, filters)?, facts)
    }

    /// Of a controller that goes on after a reset.
    fn resumed(resumption: &Resumption, facts: &BoardFacts) -> Option<Self> {
        Self::with(&resumption.settings, resumption.filters, resumption.channels()?, facts)
    }

    fn with(
        settings: &Validated,
        filters: [Filter; MOTORS],
        channels: [Channel; MOTORS],
        facts: &BoardFacts,
    ) -> Option<Self> {
        let plan = Plan::new(settings, facts.clocks.timer_hz, facts.clocks.tells_pulses_apart())
            .filter(|_| facts.suits(settings))?;
        Some(Self { channels, filters, plan })
    }
}

/// What goes on after a reset: nothing on clocks that would make other pulses of the same commands.
// Apart from the start, whose stack holds the controller in the making.
#[inline(never)]
fn resume(source: &ResumeSource, facts: &BoardFacts) -> Option<(Validated, Origin, Usable)> {
    let resumption = source.memory.take(facts.reset, source.is_debugged)?;
    let usable = Usable::resumed(&resumption, facts).filter(|_| facts.clocks.tells_pulses_apart())?;
    Some((resumption.settings, resumption.origin, usable))
}

/// Settings from the flash, with their filters.
#[inline(never)]
fn load<F: NorFlash>(store: &mut Store<F>, facts: &BoardFacts) -> (Validated, Origin, Usable) {
    let loaded = store.load();
    match Usable::new(&loaded.settings, facts) {
        Some(usable) => (loaded.settings, loaded.origin, usable),
        None => {
            let settings = Validated::default();
            let usable = Usable::new(&settings, facts);
            (settings, Origin::DefaultsBad, usable.expect("the defaults suit every clock"))
        }
    }
}

/// Loads the settings, and designs the filter. The ticks wait for [`Control::start_ticks`].
///
/// After a reset in flight that the controller itself has caused, everything is taken from the memory that `resume` names instead:
/// neither flash nor design is waited for, and the motors hold their last commands from the first tick on.
///
/// Without settings that somebody has chosen and that suit this clock, every output stays low until a host has set some:
/// the stop pulse of the default protocol may be full speed for another one's ESC.
///
/// # Panics
/// Where the defaults do not suit the clock. A test runs through every clock that
/// [`check_timer`](super::check_timer) may give.
pub fn start<C: CaptureTimer, H: ControlHardware, F: NorFlash>(
    capture: C,
    parts: ControlParts<H>,
    mut store: Store<F>,
    facts: &BoardFacts,
    queues: Queues,
    resume_from: Option<ResumeSource>,
) -> Started<C, H, F> {
    let resumed = resume_from.as_ref().and_then(|source| resume(source, facts));
    let (settings, origin, usable) = resumed.unwrap_or_else(|| load(&mut store, facts));
    let Usable { channels, filters, plan } = usable;
    let memory = resume_from.map(|source| source.memory);
    if let Some(memory) = memory {
        memory.write_settings(&settings, origin, &filters);
    }
    let resumed = channels.each_ref().map(|channel| channel.state() == State::Holding);
    let outputs = if origin.is_chosen() { Outputs::Enabled } else { Outputs::Low };
    let (inject_in, inject_out) = unzip(queues.inject);
    let (outputs_in, outputs_out) = unzip(queues.outputs);
    let (samples_in, samples_out) = queues.samples;
    let motors = zip(channels, zip(inject_out, outputs_in));
    let motors = motors.map(|(channel, (inject, outputs))| Motor::new(channel, MotorQueues { inject, outputs }));
    let tick = Tick::new(motors, outputs, plan.input_scale, settings.loop_rate_hz, samples_in);
    let queues = HandlerQueues { inject: inject_in, outputs: outputs_out, samples: samples_out };
    let mut started = Started {
        inputs: Inputs::new(capture, plan.input.timing()),
        control: Control::new(parts, tick, &plan, settings.loop_rate_hz),
        handler: RequestHandler::new(settings, origin, store, queues),
        origin,
    };
    started.control.set_memory(memory);
    started.handler.set_memory(memory, resumed);
    started
}

fn unzip<A, B>(pairs: [(A, B); MOTORS]) -> ([A; MOTORS], [B; MOTORS]) {
    let [(a, e), (b, f), (c, g), (d, h)] = pairs;
    ([a, b, c, d], [e, f, g, h])
}

fn zip<A, B>(left: [A; MOTORS], right: [B; MOTORS]) -> [(A, B); MOTORS] {
    let ([a, b, c, d], [e, f, g, h]) = (left, right);
    [(a, e), (b, f), (c, g), (d, h)]
}

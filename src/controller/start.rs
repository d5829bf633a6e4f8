//! From what the flash holds to a running controller.

use embedded_storage::nor_flash::NorFlash;
use heapless::spsc::{Consumer, Producer};

use super::hardware::{BoardFacts, CaptureTimer, ControlHardware};
use super::plan::Plan;
use super::{
    Control, HandlerQueues, INJECT_QUEUE, Inputs, Motor, MotorQueues, Outputs, RECORD_QUEUE, RequestHandler, Tick,
    channels, filters,
};
use crate::channel::Channel;
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

/// A controller whose ticks run.
pub struct Started<C, H, F> {
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
    plan: Plan,
}

impl Usable {
    /// `None` where the filter cannot be designed, or a timer does not suit the pulses.
    fn new(settings: &Validated, facts: &BoardFacts, tells_pulses_apart: bool) -> Option<Self> {
        let channels = channels(settings, filters(settings).ok()?)?;
        let plan = Plan::new(settings, facts.clocks.timer_hz, tells_pulses_apart).filter(|_| facts.suits(settings))?;
        Some(Self { channels, plan })
    }
}

/// Loads the settings, and designs the filter. The ticks wait for [`Control::start_ticks`].
///
/// Without settings that somebody has chosen and that suit this clock, every output stays low until a host has set some:
/// the stop pulse of the default protocol may be full speed for another one's ESC.
///
/// # Panics
/// Where the defaults do not suit the clock. A test runs through every clock that
/// [`check_timer`](super::check_timer) may give.
pub fn start<C: CaptureTimer, H: ControlHardware, F: NorFlash>(
    capture: C,
    hardware: H,
    mut store: Store<F>,
    facts: &BoardFacts,
    tells_pulses_apart: bool,
    queues: Queues,
) -> Started<C, H, F> {
    let loaded = store.load();
    let usable = Usable::new(&loaded.settings, facts, tells_pulses_apart);
    let (settings, origin, usable) = match usable {
        Some(usable) => (loaded.settings, loaded.origin, usable),
        None => {
            let settings = Validated::default();
            let usable = Usable::new(&settings, facts, tells_pulses_apart);
            (settings, Origin::DefaultsBad, usable.expect("the defaults suit every clock"))
        }
    };
    let Usable { channels, plan } = usable;
    let outputs = if origin.is_chosen() { Outputs::Enabled } else { Outputs::Low };
    let (inject_in, inject_out) = unzip(queues.inject);
    let (outputs_in, outputs_out) = unzip(queues.outputs);
    let (samples_in, samples_out) = queues.samples;
    let motors = zip(channels, zip(inject_out, outputs_in));
    let motors = motors.map(|(channel, (inject, outputs))| Motor::new(channel, MotorQueues { inject, outputs }));
    let tick = Tick::new(motors, outputs, plan.input_scale, settings.loop_rate_hz, samples_in);
    let queues = HandlerQueues { inject: inject_in, outputs: outputs_out, samples: samples_out };
    Started {
        inputs: Inputs::new(capture, plan.input.timing()),
        control: Control::new(hardware, tick, &plan, settings.loop_rate_hz),
        handler: RequestHandler::new(settings, origin, store, queues),
        origin,
    }
}

fn unzip<A, B>(pairs: [(A, B); MOTORS]) -> ([A; MOTORS], [B; MOTORS]) {
    let [(a, e), (b, f), (c, g), (d, h)] = pairs;
    ([a, b, c, d], [e, f, g, h])
}

fn zip<A, B>(left: [A; MOTORS], right: [B; MOTORS]) -> [(A, B); MOTORS] {
    let ([a, b, c, d], [e, f, g, h]) = (left, right);
    [(a, e), (b, f), (c, g), (d, h)]
}

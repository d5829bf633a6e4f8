//! What the tests share: the paper's numbers, random designs, and the compensator computed a second way.

pub mod board;
pub mod emulator;
pub mod flash;
pub mod fuzz;
pub mod line;
pub mod live_pico;
pub mod pins;
pub mod rig;
pub mod rotor;
pub mod scenario;
pub mod spikes;
pub mod stand_in;

use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use rotorlead::compensator::{CommandRange, Filter};
use rotorlead::controller;
use rotorlead::design::{
    CurvePoint, InverseDesign, LeadDesign, LeadParameters, ReferenceModel, RotorCurve, SpeedCurve,
};
use rotorlead::inverse::OUTPUT_BITS;
use rotorlead::settings::{
    CompensatorKind, ExcitationLimits, FASTEST_RAW_DUTY_HZ, HIGHEST_IDLE, HIGHEST_STOP, Inverse, Lead, MOTORS,
    MotorSettings, NoSignal, PulseProtocol, SHORTEST_LEVEL_US, Settings, Validated,
};
use rotorlead::throttle::{Command, FRACTION_BITS};
pub use rotorlead_records::shared_data::{data, real_log};

/// A plan of two nominal commands with a multisine and a square wave at each, 200 rows a second, in noise.
#[must_use]
pub fn stand_plan() -> String {
    let mut plan = "format = 1\nname = \"stand\"\nseed = 3\nloop_rate_hz = 200\nsample_rate_hz = 200\n".to_owned();
    plan += "[noise]\nsigma_n = 0.01\n";
    for nominal in ["0.5", "0.65"] {
        plan += &format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\namplitude = 0.05\nlines = 150\nperiods = 3\n\
             [[record]]\nnominal = {nominal}\nexcitation = \"square\"\namplitude = 0.05\nhalf_period_s = 5\nperiods = 3\n"
        );
    }
    plan
}

/// The paper's Table 1: nominal command, gain in newtons per unit of command, pole `omega_s = 1 / tau_s` in rad/s.
pub const TABLE_1: [(f64, f64, f64); 6] = [
    (0.40, 9.9955, 6.2758),
    (0.45, 10.4556, 7.3524),
    (0.50, 10.1718, 9.2889),
    (0.55, 10.9196, 9.9130),
    (0.60, 13.4519, 11.7439),
    (0.65, 16.1063, 14.1275),
];

/// The highest frequency the paper amplifies, eq. (6): 2 pi 100 rad/s.
pub const OMEGA_G_RAD_S: f64 = 200.0 * std::f64::consts::PI;

/// The paper's compensator at its loop rate of 5 kHz.
///
/// # Panics
/// When the paper's own design is refused.
#[must_use]
pub fn paper_design() -> LeadDesign {
    let lead = LeadParameters::from_poles(&TABLE_1.map(|(_, _, pole)| pole), OMEGA_G_RAD_S).expect("the paper's poles");
    LeadDesign::new(lead, 5000.0, None).expect("the paper's design")
}

/// The time constants of Table 1. Outside of it the curve is assumed: 2.6 rad/s at 0 and 24 rad/s at 1.
#[must_use]
pub fn paper_curve() -> Vec<CurvePoint> {
    let table = TABLE_1.map(|(command, _, pole)| (command, pole));
    let poles = [(0.0, 2.6)].into_iter().chain(table).chain([(1.0, 24.0)]);
    poles.map(|(command, pole)| CurvePoint { command, tau_s: 1.0 / pole }).collect()
}

/// `1 / tau` of a curve at `command`, interpolated linearly, rad/s.
///
/// # Panics
/// For a curve without points.
#[must_use]
pub fn pole_at(curve: &[CurvePoint], command: f64) -> f64 {
    let pole = |point: &CurvePoint| 1.0 / point.tau_s;
    let upper = curve.iter().position(|point| point.command >= command);
    match upper {
        None => pole(&curve[curve.len() - 1]),
        Some(0) => pole(&curve[0]),
        Some(upper) => {
            let (low, high) = (&curve[upper - 1], &curve[upper]);
            pole(low) + (command - low.command) / (high.command - low.command) * (pole(high) - pole(low))
        }
    }
}

/// An ESC that holds a command until its next frame, for a loop at 5 kHz.
pub struct EscFrames {
    per_tick: f64,
    /// Of a frame that has begun.
    part: f64,
    held: f64,
}

impl EscFrames {
    /// One that has `held` already.
    #[must_use]
    pub fn new(frame_hz: f64, held: f64) -> Self {
        Self { per_tick: frame_hz / 5000.0, part: 1.0, held }
    }

    /// What the rotor gets in a tick whose command is `command`.
    pub fn hold(&mut self, command: f64) -> f64 {
        if self.part >= 1.0 {
            self.part -= 1.0;
            self.held = command;
        }
        self.part += self.per_tick;
        self.held
    }
}

/// Gain from `input` to `output` at a multiple of the frequency of which they are one period.
#[must_use]
pub fn gain_at(input: &[f64], output: &[f64], harmonic: usize) -> f64 {
    let magnitude = |signal: &[f64]| {
        let turn = std::f64::consts::TAU * harmonic as f64 / signal.len() as f64;
        let (mut re, mut im) = (0.0, 0.0);
        for (n, value) in signal.iter().enumerate() {
            let (sin, cos) = (turn * n as f64).sin_cos();
            (re, im) = (re + value * cos, im + value * sin);
        }
        f64::hypot(re, im)
    };
    magnitude(output) / magnitude(input)
}

/// The inverse of the paper's motors with the paper's poles, at 5 kHz.
///
/// # Panics
/// When it is refused.
#[must_use]
pub fn paper_inverse() -> InverseDesign {
    let reference = ReferenceModel { omega_f_rad_s: paper_design().lead().omega_f_rad_s, damping: 0.5_f64.sqrt() };
    InverseDesign::new(reference, 5000.0, &paper_curve()).expect("the paper's motors")
}

/// What compensators run for the paper's motors: the lead, and the inverse with a slew of 2 % per millisecond.
///
/// # Panics
/// When one is refused.
#[must_use]
pub fn paper_filters() -> [Filter; 2] {
    let inverse = paper_inverse().filter(20.0, CommandRange::FULL).expect("a slew of many steps per tick");
    [(*paper_design().coefficients()).into(), inverse.into()]
}

/// What a filter makes of a constant command once it has settled: an inverse, the nearest multiple of its output's step.
#[must_use]
pub fn settled(filter: &Filter, command: Command) -> Command {
    const STEP: i32 = 1 << (FRACTION_BITS - OUTPUT_BITS);
    match filter {
        Filter::Lead(_) => command,
        Filter::Inverse(_) => Command::saturating_from_bits((command.to_bits() + STEP / 2) / STEP * STEP),
    }
}

/// Property tests with a fixed seed: the same cases on every machine and every day.
#[must_use]
pub fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, rng_seed: RngSeed::Fixed(20_260), ..ProptestConfig::default() }
}

/// Parameters of designs over the whole range that may be accepted, and somewhat beyond it: poles from a thousandth of
/// the loop rate to its limit, any damping, zeros down to a thirtieth of the poles, half of them prewarped.
pub fn any_parameters() -> impl Strategy<Value = (LeadParameters, f64, Option<f64>)> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let prewarp = proptest::option::of(0.05..1.0);
    (log(50.0, 100_000.0), log(0.001, 0.4), log(1.01, 30.0), 0.3..2.0, prewarp).prop_map(
        |(loop_rate_hz, pole, ratio, damping, prewarp)| {
            let omega_f_rad_s = pole * loop_rate_hz;
            let lead = LeadParameters { omega_z_rad_s: omega_f_rad_s / ratio, omega_f_rad_s, damping };
            (lead, loop_rate_hz, prewarp.map(|part: f64| part * omega_f_rad_s))
        },
    )
}

/// Accepted designs. Six in ten of [`any_parameters`] are.
pub fn any_design() -> impl Strategy<Value = LeadDesign> {
    any_parameters().prop_filter_map("refused", |(lead, rate, prewarp)| LeadDesign::new(lead, rate, prewarp).ok())
}

/// Accepted inverses with the curves they were made from: loop rates of 200 Hz to 10 kHz, `omega_f T` up to its limit of 0.4,
/// curves of 1 to 9 points.
pub fn any_inverse() -> impl Strategy<Value = (InverseDesign, Vec<CurvePoint>)> {
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let reference = (log(200.0, 10_000.0), log(20.0, 4000.0), 0.3..2.0_f64);
    let curve = (proptest::collection::vec(0.5..1.6_f64, 1..=9), log(0.5, 20.0));
    (reference, curve).prop_filter_map("refused", |((loop_rate_hz, omega_f_rad_s, damping), (ratios, slowest))| {
        let last = (ratios.len() - 1).max(1) as f64;
        let mut tau_s = slowest / omega_f_rad_s;
        let mut curve = Vec::new();
        for (i, ratio) in ratios.iter().enumerate() {
            tau_s *= ratio;
            curve.push(CurvePoint { command: i as f64 / last, tau_s });
        }
        let design = InverseDesign::new(ReferenceModel { omega_f_rad_s, damping }, loop_rate_hz, &curve).ok()?;
        Some((design, curve))
    })
}

/// Seconds after which an inverse rests on a constant command. Towards one that is a step of the output from the end of the
/// range, the limited command moves the rotor for up to `ln 2^16` time constants.
#[must_use]
pub fn settling_s(design: &InverseDesign, curve: &[CurvePoint], slew_per_tick: f64) -> f64 {
    let slowest_s = curve.iter().map(|point| point.tau_s).fold(0.0, f64::max);
    let reference = design.reference();
    12.0 * slowest_s
        + 30.0 * reference.damping.max(1.0) / reference.damping.min(1.0) / reference.omega_f_rad_s
        + 3.0 / (slew_per_tick * design.loop_rate_hz())
}

/// Ticks after which a lead rests on a constant command: 30 time constants of the slower pole, the drift of the section, and with a
/// slew limit the way and the time constants of the rotor that the section reckons with.
#[must_use]
pub fn lead_settling_ticks(design: &LeadDesign) -> u64 {
    let slowest = 1.0 / (1.0 - design.check().pole_radii[0]);
    let drift = 1.0 / f64::from(design.coefficients().c()) * 2.0_f64.powi(32);
    let limited = design.slew_per_s().map_or(0.0, |slew_per_s| {
        // A prewarped section has another zero, by less than 3 %.
        12.0 * design.loop_rate_hz() / design.lead().omega_z_rad_s + 3.0 * design.loop_rate_hz() / slew_per_s
    });
    (30.0 * slowest + 10.0 * drift + limited) as u64
}

/// What a compensator runs, with what tests hold it to.
#[derive(Clone, Copy, Debug)]
pub struct AnyFilter {
    /// It.
    pub filter: Filter,
    /// Ticks after which it rests on a constant command, and the offset of a switch is gone.
    pub settling_ticks: u64,
}

impl AnyFilter {
    /// Whether it is in the path where it is enabled.
    #[must_use]
    pub fn covers(&self, command: Command) -> bool {
        match self.filter {
            Filter::Lead(_) => true,
            Filter::Inverse(inverse) => (inverse.range.lowest..=inverse.range.highest).contains(&command),
        }
    }
}

/// Accepted leads and inverses, some with a slew limit, some for a part of the range only.
pub fn any_filter() -> impl Strategy<Value = AnyFilter> {
    let slew_per_s = || prop_oneof![Just(0.0), (4_f64.ln()..500_f64.ln()).prop_map(f64::exp)];
    let lead = (any_design(), slew_per_s()).prop_filter_map("refused", |(design, slew_per_s)| {
        let design = design.with_slew(slew_per_s).ok()?;
        Some(AnyFilter { filter: design.filter().into(), settling_ticks: lead_settling_ticks(&design) })
    });
    let range = proptest::option::of((0.0..0.5_f64, 0.5..1.0_f64));
    let inverse =
        (any_inverse(), slew_per_s(), range).prop_filter_map("refused", |((design, curve), slew_per_s, range)| {
            let command = Command::saturating_from_f64;
            let range = range
                .map_or(CommandRange::FULL, |(from, to)| CommandRange { lowest: command(from), highest: command(to) });
            let filter = design.filter(slew_per_s, range).ok()?;
            let slew_per_tick = f64::from(filter.slew.per_tick()) / f64::from(Command::ONE.to_bits());
            let response_ticks = settling_s(&design, &curve, slew_per_tick) * design.loop_rate_hz();
            // The offset loses B / 2 of itself in a tick, and a step of 2^-29 at least.
            let decay_ticks = 50.0 * 2.0_f64.powi(30) / f64::from(design.coefficients().b());
            Some(AnyFilter { filter: filter.into(), settling_ticks: (response_ticks + decay_ticks) as u64 })
        });
    prop_oneof![lead, inverse]
}

/// Valid settings over the whole range of each, whose filter can be designed: protocols with pulses, rates, levels, times,
/// leads.
pub fn any_settings() -> impl Strategy<Value = Validated> {
    let pulses: Vec<PulseProtocol> = PulseProtocol::ALL.into_iter().filter(|one| one.dshot().is_none()).collect();
    let pulse = move || {
        (select(pulses.clone()), 40..=3703_u16).prop_map(|(protocol, frame_hz)| {
            let fastest = match protocol.range_us() {
                Some((_, longest_us)) => (1_000_000 / (longest_us + SHORTEST_LEVEL_US)) as u16,
                None => FASTEST_RAW_DUTY_HZ,
            };
            protocol.at(40 + (frame_hz - 40) % (fastest - 39))
        })
    };
    // Parts of what is left between the stop and the highest duty; the ends of it, too.
    let motor = || {
        let levels = proptest::collection::vec(0.0..1.0_f64, 4);
        let chosen = any::<[bool; 3]>();
        (levels, chosen, any::<[bool; 3]>(), 0..=1000_u16).prop_map(
            |(mut levels, chosen, [compensate, lowest, highest], hold_ms)| {
                levels.sort_by(f64::total_cmp);
                if lowest {
                    levels[0] = 0.0;
                }
                if highest {
                    levels[3] = 1.0;
                }
                (levels, chosen, compensate, hold_ms)
            },
        )
    };
    let excitation = (1..=600_u16, 0.0..=1.0_f64, 0.001..=0.25_f64, 0..=10_000_u16, 100..=10_000_u16).prop_map(
        |(max_duration_s, max_command, max_amplitude, arm_ms, ramp_ms)| ExcitationLimits {
            max_duration_s,
            max_command: Command::saturating_from_f64(max_command).to_bits(),
            max_amplitude: Command::saturating_from_f64(max_amplitude).to_bits(),
            arm_ms,
            ramp_ms,
        },
    );
    let no_signal = prop_oneof![Just(NoSignal::NoPulses), Just(NoSignal::StopPulses)];
    let motors = [motor(), motor(), motor(), motor()];
    let log = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    let lead = proptest::option::of((log(0.001, 0.4), log(1.01, 30.0), 0.3..2.0_f64));
    // Time constants at rest and at full throttle, times the natural frequency.
    let inverse = (log(0.002, 0.4), 0.3..2.0_f64, log(0.6, 30.0), 0.3..1.0_f64, any::<[bool; 2]>(), 0.0..0.5_f64);
    let rates = (prop_oneof![Just(5000_u32), 1000..=10_000_u32], lead, inverse, 1..=5000_u16);
    let rest = (no_signal, 0..=60_000_u16, 0.0..=1.0_f64);
    (rates, rest, pulse(), pulse(), motors, excitation).prop_filter_map(
        "no filter",
        |(
            (loop_rate_hz, lead, inverse, recorder_divisor),
            (no_signal, stop_pulses_ms, stop),
            input,
            output,
            motors,
            excitation,
        )| {
            let shortest = f64::from(SHORTEST_LEVEL_US) * 1e-6 * f64::from(output.frame_hz);
            let (stop, highest) = match output.protocol {
                PulseProtocol::RawDuty => (
                    Command::saturating_from_f64(shortest + (0.03 - shortest) * stop).to_bits().min(HIGHEST_STOP),
                    Command::saturating_from_f64(1.0 - shortest).to_bits(),
                ),
                _ => (0, Command::ONE.to_bits()),
            };
            let level = |part: f64| stop + 1 + (part * f64::from(highest - stop - 1)) as i32;
            let (angle, damping, lag, shrink, [is_inverse, is_limited], from) = inverse;
            let natural_rad_s = angle * f64::from(loop_rate_hz);
            let inverse = Inverse {
                natural_rad_s,
                damping,
                compensate_from: Command::saturating_from_f64(from).to_bits(),
                compensate_to: Command::saturating_from_f64(from + 0.5).to_bits(),
            };
            let compensator = if is_inverse { CompensatorKind::Inverse } else { CompensatorKind::Lead };
            let ends = [(0.0, lag), (1.0, lag * shrink)];
            let ends = ends.map(|(command, lag)| CurvePoint { command, tau_s: lag / natural_rad_s });
            let curve = is_inverse.then(|| RotorCurve::through(&ends).ok()).flatten();
            let motors = motors.map(|(levels, chosen, compensate, hold_ms)| {
                let low = |index: usize| {
                    let bits = stop + 1 + (levels[index] * f64::from(HIGHEST_IDLE - stop - 1)) as i32;
                    chosen[index].then_some(bits)
                };
                let [disarming, arming, idle] = [0, 1, 2].map(low);
                let max = level(levels[3]);
                MotorSettings { compensate, disarming, arming, idle, max, hold_ms, curve }
            });
            let lead = lead.map_or(Settings::default().lead, |(pole, ratio, damping)| {
                let omega_f_rad_s = pole * f64::from(loop_rate_hz);
                Lead { omega_z_rad_s: omega_f_rad_s / ratio, omega_f_rad_s, damping }
            });
            let known = SpeedCurve::new(
                Command::saturating_from_f64(from),
                Command::saturating_from_f64(from + 0.25),
                [20_000, 30_001, 39_000],
            );
            let settings = Settings {
                loop_rate_hz,
                compensator,
                lead,
                inverse,
                input,
                output,
                slew_per_s: if is_limited { 20.0 } else { 0.0 },
                stop,
                no_signal,
                stop_pulses_ms,
                resume: true,
                motors,
                excitation,
                recorder_divisor,
                speeds: [is_inverse.then_some(known); MOTORS],
            };
            let settings = settings.validate().ok()?;
            controller::filters(&settings).ok().map(|_| settings)
        },
    )
}

/// The unrounded Tustin image of eq. (3) as a direct-form section in `f64`: the textbook coefficients, computed without
/// any of the controller's code.
#[derive(Clone, Debug)]
pub struct DirectForm {
    b: [f64; 3],
    a: [f64; 2],
    x: [f64; 2],
    y: [f64; 2],
}

impl DirectForm {
    /// The section of `lead` at `loop_rate_hz`, at rest at `level`.
    #[must_use]
    pub fn tustin(lead: &LeadParameters, loop_rate_hz: f64, prewarp_rad_s: Option<f64>, level: f64) -> Self {
        let s = prewarp_rad_s.map_or(2.0 * loop_rate_hz, |w| w / (w / (2.0 * loop_rate_hz)).tan());
        let wf2 = lead.omega_f_rad_s.powi(2);
        let a0 = s * s + 2.0 * lead.damping * lead.omega_f_rad_s * s + wf2;
        Self {
            b: [wf2 * (s / lead.omega_z_rad_s + 1.0) / a0, 2.0 * wf2 / a0, wf2 * (1.0 - s / lead.omega_z_rad_s) / a0],
            a: [2.0 * (wf2 - s * s) / a0, (s * s - 2.0 * lead.damping * lead.omega_f_rad_s * s + wf2) / a0],
            x: [level; 2],
            y: [level; 2],
        }
    }

    /// `b0, b1, b2, a1, a2`, with `a0 = 1` and the sign convention `y = b x - a y`.
    #[must_use]
    pub fn coefficients(&self) -> [f64; 5] {
        [self.b[0], self.b[1], self.b[2], self.a[0], self.a[1]]
    }

    /// One tick.
    pub fn update(&mut self, x: f64) -> f64 {
        let y = self.b[0] * x + self.b[1] * self.x[0] + self.b[2] * self.x[1]
            - self.a[0] * self.y[0]
            - self.a[1] * self.y[1];
        self.x = [x, self.x[0]];
        self.y = [y, self.y[0]];
        y
    }
}

/// A sum of sinusoids like the paper's: 150 lines of equal size at odd multiples of 0.1 Hz, Schroeder's phases for a
/// flat spectrum (phi_k = -pi k^2 / n), peak `delta_u` around `u_nom`; one period of 10 s.
#[must_use]
pub fn multisine(u_nom: f64, delta_u: f64, loop_rate_hz: f64) -> Vec<f64> {
    let ticks = (10.0 * loop_rate_hz).round() as usize;
    let turn = 2.0 * std::f64::consts::PI;
    let sum: Vec<f64> = (0..ticks)
        .map(|n| {
            (0..150)
                .map(|k| {
                    let (k, n) = (f64::from(k), n as f64);
                    let turns = (2.0 * k + 1.0) * n / ticks as f64;
                    (turn * turns.fract() - std::f64::consts::PI * k * k / 150.0).sin()
                })
                .sum()
        })
        .collect();
    let peak = sum.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    sum.iter().map(|value| u_nom + delta_u * value / peak).collect()
}

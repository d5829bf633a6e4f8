//! A model that may be the true one: lags, a misalignment of the clocks, and effects, as numbers that can be fitted.

use num_complex::Complex64;
use rotorlead_identify::simulation::fit_offset_and_initial_state;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::effect::parameter_error;
use rotorlead_plant::effect::{Kind, Part, Site};
use rotorlead_plant::{
    ActiveEffect, Actuator, Catalog, CommandSignal, EscTiming, Lag, OperatingPoint, PlantError, RotorBase, Start,
    Trace, simulate, simulate_interpolated, simulate_periodic_interpolated, simulate_response,
};

use super::candidate::{Candidate, from_coordinate, to_coordinate};
use super::frame_hold;
use crate::data::columns::Column;
use crate::data::dataset::{Dataset, PreparedRecord};

/// How far a value may leave its plausible range in a search, in widths of the range. Chosen: five times what a plausible one may, so that
/// a search ends where it would, and not on the border. Farther, a flat direction runs off.
const BEYOND: f64 = 0.5;

/// Shortest time constant that is searched, seconds. Chosen: a tenth of a row at 1000 rows per second, and no rotor's. Shorter ones look
/// the same and take more steps to simulate.
const LEAST_TIME_CONSTANT_S: f64 = 1e-4;
/// And none is longer. Chosen: beyond any rotor's by two orders. It only keeps a search finite where the records do not say how long the
/// lag is.
const GREATEST_TIME_CONSTANT_S: f64 = 100.0;

/// Gain of a lag that does not respond: its logarithm is searched. Chosen: any gain that no sensor shows, only to keep that logarithm
/// finite.
const LEAST_GAIN: f64 = 1e-9;

/// Time between rows at which what drifts is seen, seconds. Derived: a line over it is off by `(h / time_s)^2 / 8` of the drift, 2e-6 at
/// the shortest plausible time constant, 5 s.
const QUIET_S: f64 = 0.02;
/// Time constants of the lag at the begin of a record in which it is seen at every row. Derived: `e^-15`, 3e-7, of the lag's own motion is
/// left after them, which is less than that.
const BEGIN: f64 = 15.0;

/// The lag at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BasePoint {
    /// Response units per unit of command.
    pub gain: f64,
    /// Seconds.
    pub time_constant_s: f64,
    /// Seconds; not fitted.
    pub delay_s: f64,
}

/// Lags, alignment and effects with their values.
#[derive(Clone, Debug)]
pub(crate) struct Hypothesis {
    /// One per nominal command.
    pub base: Vec<BasePoint>,
    /// By how much the response is late beyond the rest, seconds: rows are not stamped more finely than they are apart.
    pub time_offset_s: f64,
    /// The effects, in the order in which they were found.
    pub effects: Vec<Candidate>,
    /// Whether commands that were applied between the rows are taken as a straight line from row to row: several times as quick, and
    /// good enough for what is small beside the response itself. See [`Hypothesis::in_rows`].
    pub in_rows: bool,
    /// No time constant is searched below this, seconds: rows that are much farther apart do not show it, and a chain with it is
    /// simulated in as short steps.
    pub least_s: f64,
    /// Whether no gain is searched, since the static map is free.
    pub has_free_map: bool,
}

/// What one coordinate of a search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coordinate {
    /// Logarithm of the gain at a nominal command.
    Gain(usize),
    /// Logarithm of the time constant at a nominal command.
    TimeConstant(usize),
    /// The misalignment.
    TimeOffset,
    /// A value of an effect.
    Effect {
        /// Which effect.
        effect: usize,
        /// Which of its values.
        value: usize,
    },
}

impl Hypothesis {
    /// Lags only.
    pub fn from_lags(base: Vec<BasePoint>) -> Self {
        Self {
            base,
            time_offset_s: 0.0,
            effects: Vec::new(),
            in_rows: false,
            least_s: LEAST_TIME_CONSTANT_S,
            has_free_map: false,
        }
    }

    /// The same with what logs show: no time constant that is much shorter than the time between rows, and no gain where the static
    /// map is free.
    pub fn limited_by(mut self, data: &Dataset) -> Self {
        self.has_free_map = data.records.iter().all(PreparedRecord::has_free_map);
        // Of several records that with the shortest interval shows most.
        let shortest = data.records.iter().map(PreparedRecord::least_time_constant_s).fold(f64::INFINITY, f64::min);
        self.least_s =
            self.least_s.max(if shortest.is_finite() { shortest.min(GREATEST_TIME_CONSTANT_S) } else { 0.0 });
        self
    }

    /// With one more effect.
    pub fn with(&self, candidate: Candidate) -> Self {
        let mut more = self.clone();
        more.effects.push(candidate);
        more
    }

    /// The same in rows, where that is quicker and nothing acts on single commands.
    pub fn in_rows(&self, record: &PreparedRecord) -> Option<Self> {
        let is_quicker = !record.first_order_hold.is_empty() && self.effects.iter().all(Candidate::is_even);
        is_quicker.then(|| Self { in_rows: true, ..self.clone() })
    }

    /// Without one of its effects.
    pub fn without(&self, effect: usize) -> Self {
        let mut fewer = self.clone();
        fewer.effects.remove(effect);
        fewer
    }

    /// What a search changes; the lags only where `lags` says so.
    pub fn coordinates(&self, lags: bool) -> Vec<Coordinate> {
        let mut all = Vec::new();
        if lags {
            for point in 0..self.base.len() {
                all.extend((!self.has_free_map).then_some(Coordinate::Gain(point)));
                all.push(Coordinate::TimeConstant(point));
            }
        }
        all.push(Coordinate::TimeOffset);
        for (effect, candidate) in self.effects.iter().enumerate() {
            // With known phases the rate of frames is, too: hundreds of frames have to stay where they are. And derivatives say
            // nothing of what the response depends on in jumps.
            if candidate.phases.is_empty() && !candidate.is_non_smooth() {
                all.extend(candidate.numbers().map(|(value, _)| Coordinate::Effect { effect, value }));
            }
        }
        all
    }

    /// The value of a coordinate.
    pub fn get(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Gain(point) => self.base[point].gain.abs().ln(),
            Coordinate::TimeConstant(point) => self.base[point].time_constant_s.ln(),
            Coordinate::TimeOffset => self.time_offset_s,
            Coordinate::Effect { effect, value } => {
                let candidate = &self.effects[effect];
                to_coordinate(&candidate.kind.parameters[value], candidate.values[value])
            }
        }
    }

    /// Sets it, as far as it goes.
    pub fn set(&mut self, coordinate: Coordinate, to: f64) {
        match coordinate {
            Coordinate::Gain(point) => {
                let gain = &mut self.base[point].gain;
                *gain = to.exp().max(LEAST_GAIN).copysign(*gain);
            }
            Coordinate::TimeConstant(point) => {
                self.base[point].time_constant_s = to.exp().clamp(self.least_s, GREATEST_TIME_CONSTANT_S)
            }
            Coordinate::TimeOffset => self.time_offset_s = to,
            Coordinate::Effect { effect, value } => {
                let candidate = &mut self.effects[effect];
                let parameter = &candidate.kind.parameters[value];
                let (low, high) = parameter.plausible;
                let (low, high) = (to_coordinate(parameter, low), to_coordinate(parameter, high));
                let room = BEYOND * (high - low);
                let (least, most) = parameter.possible;
                let before = candidate.values[value];
                candidate.values[value] =
                    from_coordinate(parameter, to.clamp(low - room, high + room)).clamp(least, most);
                if (candidate.kind.check)(&candidate.values).is_err() {
                    candidate.values[value] = before;
                }
            }
        }
    }

    /// Where a coordinate of an effect is when the effect is not there, and twice its plausible range; `None` where there is no
    /// such place. Twice is chosen for a weak prior: a value a whole range away costs a quarter in the chi-square.
    pub fn prior(&self, coordinate: Coordinate) -> Option<(f64, f64)> {
        let Coordinate::Effect { effect, value } = coordinate else { return None };
        let parameter = &self.effects[effect].kind.parameters[value];
        let (low, high) = parameter.plausible;
        let wide = 2.0 * (to_coordinate(parameter, high) - to_coordinate(parameter, low));
        let null = to_coordinate(parameter, parameter.null);
        null.is_finite().then_some((null, wide))
    }

    /// The plausible range of a coordinate of an effect; nothing for any other.
    pub fn width(&self, coordinate: Coordinate) -> f64 {
        let Coordinate::Effect { effect, value } = coordinate else { return 0.0 };
        let parameter = &self.effects[effect].kind.parameters[value];
        let (low, high) = parameter.plausible;
        to_coordinate(parameter, high) - to_coordinate(parameter, low)
    }

    /// What was measured less the response, over a whole record. `None` for values that no actuator has.
    pub fn difference(&self, data: &Dataset, record: &PreparedRecord) -> Option<Vec<f64>> {
        let simulated = self.simulate(data, record, record.time_s.len()).ok()?;
        let difference: Vec<f64> = record.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
        difference.iter().all(|left| left.is_finite()).then_some(difference)
    }

    /// The decay at the begin of a record that it leaves, and what it leaves beside that and an offset.
    pub fn aligned(&self, data: &Dataset, record: &PreparedRecord) -> Option<(f64, Vec<f64>)> {
        let rows = record.rows();
        let simulated = self.simulate(data, record, rows).ok()?;
        let (time_s, measured) = (&record.time_s[..rows], &record.measured[..rows]);
        let tau_s = self.base[record.point].time_constant_s;
        let (offset, start) = fit_offset_and_initial_state(time_s, measured, &simulated, tau_s);
        let decay = |time: &f64| (-(time - time_s[0]) / tau_s).exp();
        let moved = simulated.iter().zip(time_s).map(|(model, time)| model + offset + start * decay(time));
        Some((start, measured.iter().zip(moved).map(|(y, model)| y - model).collect()))
    }

    /// Whether the steady response changes with time.
    pub fn drifts(&self) -> bool {
        self.effects.iter().any(Candidate::drifts)
    }

    /// The response at the first `rows` rows of a record. Where frames may lie anywhere, it is the mean over where they may.
    ///
    /// # Errors
    /// [`PlantError`] for values that no actuator has.
    pub fn simulate(&self, data: &Dataset, record: &PreparedRecord, rows: usize) -> Result<Vec<f64>, PlantError> {
        let Some(waits) = self.waits() else {
            return self.simulate_known(data, record, rows);
        };
        let mut mean = vec![0.0; rows];
        for late in waits {
            let response = late.simulate_known(data, record, rows)?;
            mean.iter_mut().zip(&response).for_each(|(mean, y)| *mean += 0.5 * y);
        }
        Ok(mean)
    }

    /// Where frames may lie anywhere: two without them whose mean is what they do.
    fn waits(&self) -> Option<[Self; 2]> {
        let effect = self.effects.iter().position(Candidate::is_hidden_hold)?;
        let waits = frame_hold::mean_waits(self.effects[effect].values[0])?;
        Some(waits.map(|wait| {
            let mut late = self.clone();
            late.effects[effect] = wait;
            late
        }))
    }

    fn simulate_known(&self, data: &Dataset, record: &PreparedRecord, rows: usize) -> Result<Vec<f64>, PlantError> {
        let base = &self.base[record.point];
        let steady = record.mean_response - base.gain * (record.mean_command - record.nominal);
        let response = self.simulate_around(data, record, rows, steady)?;
        if rows == 0 || !self.drifts() {
            return Ok(response);
        }
        // What changes with time changes the steady response too, of which only the mean was measured. The response moves in
        // proportion to the steady one, so two of them tell for which the mean is right.
        let off = mean(&record.measured[..rows]) - mean(&response[..rows]);
        let moved = self.steady_part(data, record, &response, (steady, off))?;
        let rise = mean(&moved[..rows]);
        if rise == 0.0 {
            return Ok(response);
        }
        Ok(response.iter().zip(&moved).map(|(response, moved)| response + moved * (off / rise)).collect())
    }

    /// What is added to the `response` around a steady one where that is larger by `off`.
    ///
    /// The command has no part in it unless the level moves the voltage, and it is slow but for the lag's own begin: a quiet
    /// run says it, at rows far apart.
    fn steady_part(
        &self,
        data: &Dataset,
        record: &PreparedRecord,
        response: &[f64],
        (steady, off): (f64, f64),
    ) -> Result<Vec<f64>, PlantError> {
        let rows = response.len();
        if self.effects.iter().any(|candidate| candidate.kind.site == Site::Supply) {
            let moved = self.simulate_around(data, record, rows, steady + off)?;
            return Ok(moved.iter().zip(response).map(|(moved, response)| moved - response).collect());
        }
        let apart = ((QUIET_S * record.rate_hz) as usize).max(1);
        let begin = ((BEGIN * self.base[record.point].time_constant_s * record.rate_hz) as usize).min(rows);
        let mut seen: Vec<usize> = (0..begin).chain((begin..rows).step_by(apart)).chain(rows.checked_sub(1)).collect();
        seen.dedup();
        let quiet = |response: f64| {
            let (mut actuator, start, stamps) = self.actuator(data, record, rows, response)?;
            let seen: Vec<f64> = seen.iter().map(|&row| stamps[row]).collect();
            let drive = CommandSignal { time_s: &record.command_s[..1], command: &record.command[..1] };
            simulate_response(&mut actuator, drive, start, &seen)
        };
        let (with, without) = (quiet(off)?, quiet(0.0)?);
        let at = |place: usize| with[place] - without[place];
        let mut part = Vec::with_capacity(rows);
        for (place, pair) in seen.windows(2).enumerate() {
            let width = (pair[1] - pair[0]) as f64;
            part.extend((pair[0]..pair[1]).map(|row| {
                let beyond = (row - pair[0]) as f64 / width;
                at(place) + (at(place + 1) - at(place)) * beyond
            }));
        }
        part.resize(rows, at(with.len() - 1));
        Ok(part)
    }

    fn point(&self, record: &PreparedRecord, response: f64) -> OperatingPoint {
        let base = &self.base[record.point];
        let lag = Lag { gain: base.gain, time_constant_s: base.time_constant_s, delay_s: base.delay_s };
        OperatingPoint { nominal: record.nominal, lag, response }
    }

    /// The frequency response of all that is behind the effects on the command, as far as it is linear. Frames make it late by their
    /// mean wait: what another wait of one change does is not smoothed by the hold of all.
    pub fn frequency_response(&self, record: &PreparedRecord, omega_rad_s: f64) -> Complex64 {
        let point = self.point(record, record.mean_response);
        self.effects.iter().fold(point.lag.frequency_response(omega_rad_s), |product, effect| {
            if effect.has_frames() {
                product * Complex64::cis(-0.5 * omega_rad_s / effect.values[0])
            } else if effect.kind.site > Site::Command {
                product * (effect.kind.response)(&effect.values, &point, omega_rad_s)
            } else {
                product
            }
        })
    }

    /// How long a second of the logger is for the controller, seconds.
    pub fn clock(&self, record: &PreparedRecord) -> f64 {
        let base = RotorBase::Linear(self.point(record, record.mean_response));
        let at_logger = self.effects.iter().filter(|effect| effect.kind.site == Site::Logger);
        let skew = |effect: &Candidate| match (effect.kind.part)(&effect.values, &base) {
            Part::Clock { skew } => Some(1.0 + skew),
            _ => None,
        };
        at_logger.filter_map(skew).product()
    }

    /// The speed and the voltage over a record, where it has columns to compare them with; the rest stays empty. `None` for values
    /// that no actuator has.
    pub fn trace(&self, data: &Dataset, record: &PreparedRecord) -> Option<Trace> {
        if let Some(waits) = self.waits() {
            let [mut mean, other] = [waits[0].trace(data, record)?, waits[1].trace(data, record)?];
            mean.speed.iter_mut().zip(&other.speed).for_each(|(mean, speed)| *mean = 0.5 * (*mean + speed));
            return Some(mean);
        }
        let wants = |column| record.columns().any(|there| there == column);
        let supplied = self.effects.iter().any(|effect| open_circuit(effect.kind).is_some());
        if !(wants(Column::Speed) || (wants(Column::Voltage) && supplied)) {
            return Some(Trace::default());
        }
        let base = &self.base[record.point];
        let steady = record.mean_response - base.gain * (record.mean_command - record.nominal);
        let mut known = self.clone();
        for effect in &mut known.effects {
            // The voltage over that without load, which is free.
            if let Some(place) = open_circuit(effect.kind) {
                effect.values[place] = 1.0;
            }
        }
        let (mut actuator, start, stamps) = known.actuator(data, record, record.time_s.len(), steady).ok()?;
        let drive = CommandSignal { time_s: &record.command_s, command: &record.command };
        simulate(&mut actuator, drive, start, &stamps).ok()
    }

    /// The same with the steady response at the nominal command.
    fn simulate_around(
        &self,
        data: &Dataset,
        record: &PreparedRecord,
        rows: usize,
        response: f64,
    ) -> Result<Vec<f64>, PlantError> {
        let (mut actuator, start, stamps) = self.actuator(data, record, rows, response)?;
        let drive = record.input_signal(rows, self.in_rows);
        if !record.repeats {
            return simulate_interpolated(&mut actuator, drive, start, &stamps);
        }
        simulate_periodic_interpolated(&mut actuator, drive, start, &stamps, record.period_rows)
    }

    /// The actuator, what was before a record, and the moments of its rows.
    fn actuator(
        &self,
        data: &Dataset,
        record: &PreparedRecord,
        rows: usize,
        response: f64,
    ) -> Result<(Actuator, Start, Vec<f64>), PlantError> {
        let base = &self.base[record.point];
        let point = self.point(record, response);
        let mut effects = Vec::with_capacity(self.effects.len());
        for candidate in &self.effects {
            let mut values = candidate.values.clone();
            if let Some(phase) = candidate.phases.get(record.place) {
                values[frame_hold::PHASE] = *phase;
            }
            effects.push(ActiveEffect::new(candidate.kind, values)?);
        }
        Catalog::standard().sort(&mut effects);
        let timing = EscTiming { frame_hz: data.esc_frame_hz, frame_phase: 0.0 };
        let actuator = match data.operating_curve(record) {
            Some((curve, given)) => {
                // The numbers of the level, all off by the part by which those at the nominal command are.
                let off = |found: f64, given: f64| found / given - 1.0;
                let errors = vec![off(base.gain, given.gain), off(base.time_constant_s, given.time_constant_s)];
                let mut all = vec![ActiveEffect::new(parameter_error()?, errors)?];
                all.append(&mut effects);
                Actuator::following_level(curve.clone(), record.command[0], &all, timing)?
            }
            None => Actuator::with_effects(point, &effects, timing)?,
        };
        let actuator = actuator.in_longer_steps(record.step_factor());
        let stamps: Vec<f64> = record.time_s[..rows].iter().map(|time_s| time_s - self.time_offset_s).collect();
        let start = record.initial_condition(actuator.memory());
        Ok((actuator, start, stamps))
    }
}

/// The place of the voltage without load among the values of a kind that says one.
fn open_circuit(kind: &Kind) -> Option<usize> {
    kind.parameters.iter().position(|parameter| parameter.name == "open_circuit_v")
}

/// The kind that stands for other numbers of the lag.
fn parameter_error() -> Result<&'static Kind, PlantError> {
    let standard = Catalog::standard();
    standard.find(parameter_error::ID).ok_or(PlantError::Setting {
        parameter: "kinds with other numbers of the lag",
        value: 0.0,
        limit: "one",
    })
}

//! A model that may be the true one: lags, a misalignment of the clocks, and effects, as numbers that can be fitted.

use super::channel::Column;
use super::frames;
use super::trial::{Before, Trial, Trials};
use crate::plant::effect::{Kind, Linearity, Parameter, Scale, Site, Use};
use crate::plant::{
    ActiveEffect, Actuator, Catalog, Drive, EscTiming, Lag, Memory, OperatingPoint, PlantError, Start, Trace, simulate,
    simulate_periodic_response, simulate_response,
};

/// How far a value may leave its plausible range in a search, in widths of the range.
const BEYOND: f64 = 0.5;

/// Part of its plausible range by which a value may lie beyond it, being an estimate.
const AT_MOST_OFF: f64 = 0.1;

/// Gain of a lag that does not respond: its logarithm is searched.
const LEAST_GAIN: f64 = 1e-9;

/// Time between rows at which what drifts is seen, seconds: a thousandth of a drift's time constant or so, and off by less than
/// `1e-6` of it in between. At the begin of a record, for so many time constants of the lag, it is every row.
const QUIET_S: f64 = 0.02;
const BEGIN: f64 = 15.0;

/// Most pieces of the plausible range of a single value that are tried on all records.
pub(super) const GRID: u32 = 12;

/// The lag at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BasePoint {
    /// Response units per unit of command.
    pub gain: f64,
    /// Seconds.
    pub time_constant_s: f64,
    /// Seconds; not fitted.
    pub delay_s: f64,
}

/// Lags, alignment and effects with their values.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    /// One per nominal command.
    pub base: Vec<BasePoint>,
    /// By how much the response is late beyond the rest, seconds: rows are not stamped more finely than they are apart.
    pub late_s: f64,
    /// The effects, in the order in which they were found.
    pub effects: Vec<Candidate>,
}

/// An effect with its values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    /// What it is.
    pub kind: &'static Kind,
    /// All its values.
    pub values: Vec<f64>,
    /// Of frames: the part of a frame from the first command of each record to its first frame, by the record's place. Empty
    /// where it is not known.
    pub phases: Vec<f64>,
    /// Standard deviation of the coordinate of its single value where a profile of the misfit says it; else infinite.
    pub profiled_std: f64,
}

/// What one coordinate of a search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coordinate {
    /// Logarithm of the gain at a nominal command.
    Gain(usize),
    /// Logarithm of the time constant at a nominal command.
    TimeConstant(usize),
    /// The misalignment.
    Late,
    /// A value of an effect.
    Effect {
        /// Which effect.
        effect: usize,
        /// Which of its values.
        value: usize,
    },
}

impl Candidate {
    /// An effect whose frames, if it has any, may lie anywhere.
    pub fn new(kind: &'static Kind, values: Vec<f64>) -> Self {
        Self { kind, values, phases: Vec::new(), profiled_std: f64::INFINITY }
    }

    /// Whether the response depends in jumps on its single value.
    pub fn jumps(&self) -> bool {
        Self::searched(self.kind).any(|(_, parameter)| parameter.pieces > GRID)
    }

    /// Whether the steady response changes with time.
    pub fn drifts(&self) -> bool {
        self.kind.site >= Site::Air && self.kind.linearity == Linearity::Absent
    }

    /// Whether it has frames.
    pub fn has_frames(&self) -> bool {
        frames::has_frames(self.kind)
    }

    /// Whether it has frames that may lie anywhere.
    pub fn is_hidden_hold(&self) -> bool {
        self.has_frames() && self.phases.is_empty()
    }

    /// Whether no value lies beyond its plausible range, seen from where the effect vanishes, by more than it may be `off`, which
    /// is asked for by the value's place.
    pub fn is_plausible(&self, off: impl Fn(usize) -> f64) -> bool {
        let beyond = |(index, parameter): (usize, &Parameter)| {
            let (value, (low, high)) = (self.values[index], parameter.plausible);
            // Of a value without such a place, whose null is no number, both ends count.
            let vanishes_above = parameter.null >= high;
            let vanishes_below = parameter.null <= low;
            let off = off(index).min(AT_MOST_OFF * (high - low));
            let (above, below) = (value > high + off && !vanishes_above, value < low - off && !vanishes_below);
            above || below
        };
        !Self::searched(self.kind).any(beyond)
    }

    /// Places of the values that a search may change.
    pub fn searched(kind: &'static Kind) -> impl Iterator<Item = (usize, &'static Parameter)> {
        let is_searched = |parameter: &Parameter| match parameter.usage {
            Use::Fitted => true,
            // An optional one with several starts has to be right for the rest to fit at all.
            Use::Optional(_) => parameter.starts.len() > 1,
        };
        kind.parameters.iter().enumerate().filter(move |(_, parameter)| is_searched(parameter))
    }

    /// Where searches of a value start. One that has a sign may have the other one: speed is bent the other way than thrust.
    fn both_ways(parameter: &Parameter) -> Vec<f64> {
        let mut starts = parameter.starts.to_vec();
        let is_one_sided = parameter.scale == Scale::Linear && parameter.starts.iter().all(|start| *start > 0.0);
        if is_one_sided && parameter.null == 0.0 && parameter.plausible.0 < 0.0 {
            let others = parameter.starts.iter().flat_map(|start| [-start, -0.4 * start]);
            starts.extend(others.filter(|start| *start >= parameter.plausible.0));
        }
        starts
    }

    /// Every combination of starts, of either sign where `both_ways` says so; of a single value its whole plausible range as well, since a limit that no command reaches
    /// does not say which way to go.
    pub fn starts(kind: &'static Kind, both_ways: bool) -> Vec<Self> {
        let mut all = vec![kind.null()];
        let searched: Vec<_> = Self::searched(kind).collect();
        if let [(index, parameter)] = searched[..] {
            let mut starts = Self::grid(kind, GRID.min(parameter.pieces));
            starts.extend(parameter.starts.iter().map(|&start| {
                let mut values = all[0].clone();
                values[index] = start;
                Self::new(kind, values)
            }));
            starts.retain(|start| (kind.check)(&start.values).is_ok());
            return starts;
        }
        for (index, parameter) in searched {
            let with = |values: &Vec<f64>, start: f64| {
                let mut values = values.clone();
                values[index] = start;
                values
            };
            let starts = if both_ways { Self::both_ways(parameter) } else { parameter.starts.to_vec() };
            all = all.iter().flat_map(|values| starts.iter().map(|&start| with(values, start))).collect();
        }
        all.into_iter()
            .map(|values| Self::new(kind, values))
            .filter(|start| (kind.check)(&start.values).is_ok())
            .collect()
    }
}

impl Candidate {
    /// The plausible range of a single value from end to end, in so many pieces. Empty for several values.
    pub fn grid(kind: &'static Kind, pieces: u32) -> Vec<Self> {
        let searched: Vec<_> = Self::searched(kind).collect();
        let [(index, parameter)] = searched[..] else { return Vec::new() };
        let (low, high) = parameter.plausible;
        let (low, high) = (to_coordinate(parameter, low), to_coordinate(parameter, high));
        let at = |k: u32| {
            let mut values = kind.null();
            values[index] = from_coordinate(parameter, low + (high - low) * f64::from(k) / f64::from(pieces));
            Self::new(kind, values)
        };
        (0..=pieces).map(at).filter(|candidate| (kind.check)(&candidate.values).is_ok()).collect()
    }

    /// Around it on both sides: `share` of a piece of its single value's range away, in so many steps. Empty for several values.
    pub fn around(&self, share: f64, steps: u32) -> Vec<Self> {
        let searched: Vec<_> = Self::searched(self.kind).collect();
        let [(index, parameter)] = searched[..] else { return Vec::new() };
        let (low, high) = parameter.plausible;
        let piece = (to_coordinate(parameter, high) - to_coordinate(parameter, low)) / f64::from(parameter.pieces);
        let here = to_coordinate(parameter, self.values[index]);
        let at = |offset: f64| {
            let mut values = self.values.clone();
            values[index] = from_coordinate(parameter, here + offset * piece);
            Self::new(self.kind, values)
        };
        let offsets = (1..=steps).map(|step| share * f64::from(step) / f64::from(steps));
        let around = offsets.flat_map(|offset| [at(-offset), at(offset)]);
        around.filter(|candidate| (candidate.kind.check)(&candidate.values).is_ok()).collect()
    }

    /// Half way from the best of some starts of a single value to its neighbors on either side.
    pub fn around_best<T>(judged: &[(f64, Self, T)]) -> Vec<Self> {
        let best = judged.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(((_, best, _), (index, parameter))) =
            best.zip(best.and_then(|best| Self::searched(best.1.kind).next()))
        else {
            return Vec::new();
        };
        let at = |candidate: &Self| to_coordinate(parameter, candidate.values[index]);
        let here = at(best);
        let others = || judged.iter().map(|(_, other, _)| at(other));
        let below = others().filter(|other| *other < here).fold(f64::NEG_INFINITY, f64::max);
        let above = others().filter(|other| *other > here).fold(f64::INFINITY, f64::min);
        let between = [below, above].into_iter().filter(|other| other.is_finite()).map(|other| {
            let mut values = best.values.clone();
            values[index] = from_coordinate(parameter, 0.5 * (here + other));
            Self::new(best.kind, values)
        });
        between.filter(|start| (start.kind.check)(&start.values).is_ok()).collect()
    }
}

impl Candidate {
    /// Where a parabola through the best of some starts of a single value and its neighbors has its vertex: closer than halving
    /// comes where the effect is much smaller than the spacing of the starts. `None` where there is none between the neighbors.
    pub fn vertex<T>(judged: &[(f64, Self, T)]) -> Option<Self> {
        let best = judged.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (index, parameter) = Self::searched(best.1.kind).next()?;
        let mut points: Vec<(f64, f64)> =
            judged.iter().map(|(left, other, _)| (to_coordinate(parameter, other.values[index]), *left)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0 == b.0);
        let place = points.iter().position(|point| point.1 == best.0)?;
        let [(a, at_a), (b, at_b), (c, at_c)] = *points.get(place.checked_sub(1)?..place + 2)? else { return None };
        let (before, after) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
        let bend = (after - before) / (c - a);
        let vertex = 0.5 * (a + b) - 0.5 * before / bend;
        let mut values = best.1.values.clone();
        values[index] = from_coordinate(parameter, vertex);
        let is_between = bend > 0.0 && a < vertex && vertex < c;
        Some(Self::new(best.1.kind, values)).filter(|start| is_between && (start.kind.check)(&start.values).is_ok())
    }
}

/// A value as a coordinate in which a unit step is a fair step.
fn to_coordinate(parameter: &Parameter, value: f64) -> f64 {
    match parameter.scale {
        Scale::Log => value.ln(),
        Scale::Linear => value / (parameter.plausible.1 - parameter.plausible.0),
    }
}

fn from_coordinate(parameter: &Parameter, coordinate: f64) -> f64 {
    match parameter.scale {
        Scale::Log => coordinate.exp(),
        Scale::Linear => coordinate * (parameter.plausible.1 - parameter.plausible.0),
    }
}

/// How fast the value moves with its coordinate.
pub(super) fn slope(parameter: &Parameter, value: f64) -> f64 {
    match parameter.scale {
        Scale::Log => value,
        Scale::Linear => parameter.plausible.1 - parameter.plausible.0,
    }
}

impl Hypothesis {
    /// Lags only.
    pub fn of_lags(base: Vec<BasePoint>) -> Self {
        Self { base, late_s: 0.0, effects: Vec::new() }
    }

    /// With one more effect.
    pub fn with(&self, candidate: Candidate) -> Self {
        let mut more = self.clone();
        more.effects.push(candidate);
        more
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
                all.extend([Coordinate::Gain(point), Coordinate::TimeConstant(point)]);
            }
        }
        all.push(Coordinate::Late);
        for (effect, candidate) in self.effects.iter().enumerate() {
            // With known phases the rate of frames is, too: hundreds of frames have to stay where they are. And derivatives say
            // nothing of what the response depends on in jumps.
            if candidate.phases.is_empty() && !candidate.jumps() {
                all.extend(Candidate::searched(candidate.kind).map(|(value, _)| Coordinate::Effect { effect, value }));
            }
        }
        all
    }

    /// The value of a coordinate.
    pub fn get(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Gain(point) => self.base[point].gain.abs().ln(),
            Coordinate::TimeConstant(point) => self.base[point].time_constant_s.ln(),
            Coordinate::Late => self.late_s,
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
            Coordinate::TimeConstant(point) => self.base[point].time_constant_s = to.exp().clamp(1e-4, 100.0),
            Coordinate::Late => self.late_s = to,
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
    /// such place.
    pub fn tie(&self, coordinate: Coordinate) -> Option<(f64, f64)> {
        let Coordinate::Effect { effect, value } = coordinate else { return None };
        let parameter = &self.effects[effect].kind.parameters[value];
        let (low, high) = parameter.plausible;
        let wide = 2.0 * (to_coordinate(parameter, high) - to_coordinate(parameter, low));
        let null = to_coordinate(parameter, parameter.null);
        null.is_finite().then_some((null, wide))
    }

    /// What was measured less the response, over a whole record. `None` for values that no actuator has.
    pub fn difference(&self, trials: &Trials, trial: &Trial) -> Option<Vec<f64>> {
        let simulated = self.simulate(trials, trial, trial.time_s.len()).ok()?;
        let difference: Vec<f64> = trial.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
        difference.iter().all(|left| left.is_finite()).then_some(difference)
    }

    /// [`Self::difference`] and [`Self::trace`] in one run where one will do, at the rows that are looked at.
    pub fn seen(&self, trials: &Trials, trial: &Trial) -> Option<(Vec<f64>, Trace)> {
        let trace = self.trace(trials, trial)?;
        let difference = if trace.response.is_empty() || self.drifts() {
            self.difference(trials, trial)?
        } else {
            trial.measured.iter().zip(&trace.response).map(|(y, model)| y - model).collect()
        };
        Some((difference, trace))
    }

    /// Whether the steady response changes with time.
    fn drifts(&self) -> bool {
        self.effects.iter().any(Candidate::drifts)
    }

    /// The response at the first `rows` rows of a record. Where frames may lie anywhere, it is the mean over where they may.
    ///
    /// # Errors
    /// [`PlantError`] for values that no actuator has.
    pub fn simulate(&self, trials: &Trials, trial: &Trial, rows: usize) -> Result<Vec<f64>, PlantError> {
        let Some(waits) = self.waits() else {
            return self.simulate_known(trials, trial, rows);
        };
        let mut mean = vec![0.0; rows];
        for late in waits {
            let response = late.simulate_known(trials, trial, rows)?;
            mean.iter_mut().zip(&response).for_each(|(mean, y)| *mean += 0.5 * y);
        }
        Ok(mean)
    }

    /// Where frames may lie anywhere: two without them whose mean is what they do.
    fn waits(&self) -> Option<[Self; 2]> {
        let effect = self.effects.iter().position(Candidate::is_hidden_hold)?;
        let waits = frames::mean_waits(self.effects[effect].values[0])?;
        Some(waits.map(|wait| {
            let mut late = self.clone();
            late.effects[effect] = wait;
            late
        }))
    }

    fn simulate_known(&self, trials: &Trials, trial: &Trial, rows: usize) -> Result<Vec<f64>, PlantError> {
        let base = &self.base[trial.point];
        let steady = trial.mean_response - base.gain * (trial.mean_command - trial.nominal);
        let response = self.simulate_around(trials, trial, rows, steady)?;
        if rows == 0 || !self.drifts() {
            return Ok(response);
        }
        // What changes with time changes the steady response too, of which only the mean was measured. The response moves in
        // proportion to the steady one, so two of them tell for which the mean is right.
        let mean = |values: &[f64]| values[..rows].iter().sum::<f64>() / rows as f64;
        let off = mean(&trial.measured) - mean(&response);
        let moved = self.steady_part(trials, trial, &response, (steady, off))?;
        let rise = mean(&moved);
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
        trials: &Trials,
        trial: &Trial,
        response: &[f64],
        (steady, off): (f64, f64),
    ) -> Result<Vec<f64>, PlantError> {
        let rows = response.len();
        if self.effects.iter().any(|candidate| candidate.kind.site == Site::Supply) {
            let moved = self.simulate_around(trials, trial, rows, steady + off)?;
            return Ok(moved.iter().zip(response).map(|(moved, response)| moved - response).collect());
        }
        let apart = ((QUIET_S * trial.rate_hz) as usize).max(1);
        let begin = ((BEGIN * self.base[trial.point].time_constant_s * trial.rate_hz) as usize).min(rows);
        let mut seen: Vec<usize> = (0..begin).chain((begin..rows).step_by(apart)).chain(rows.checked_sub(1)).collect();
        seen.dedup();
        let quiet = |response: f64| {
            let (mut actuator, start, stamps) = self.actuator(trials, trial, rows, response)?;
            let seen: Vec<f64> = seen.iter().map(|&row| stamps[row]).collect();
            let drive = Drive { time_s: &trial.told_s[..1], command: &trial.told[..1] };
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

    /// The speed and the voltage over a record, where it has columns to compare them with; the rest stays empty. `None` for values
    /// that no actuator has.
    pub fn trace(&self, trials: &Trials, trial: &Trial) -> Option<Trace> {
        if let Some(waits) = self.waits() {
            let [mut mean, other] = [waits[0].trace(trials, trial)?, waits[1].trace(trials, trial)?];
            mean.speed.iter_mut().zip(&other.speed).for_each(|(mean, speed)| *mean = 0.5 * (*mean + speed));
            return Some(mean);
        }
        let wants = |column| trial.columns().any(|there| there == column);
        let supplied = self.effects.iter().any(|effect| open_circuit(effect.kind).is_some());
        if !(wants(Column::Speed) || (wants(Column::Voltage) && supplied)) {
            return Some(Trace::default());
        }
        let base = &self.base[trial.point];
        let steady = trial.mean_response - base.gain * (trial.mean_command - trial.nominal);
        let mut known = self.clone();
        for effect in &mut known.effects {
            // The voltage over that without load, which is free.
            if let Some(place) = open_circuit(effect.kind) {
                effect.values[place] = 1.0;
            }
        }
        let (mut actuator, start, stamps) = known.actuator(trials, trial, trial.time_s.len(), steady).ok()?;
        let drive = Drive { time_s: &trial.told_s, command: &trial.told };
        let Some(log) = &trial.log else { return simulate(&mut actuator, drive, start, &stamps).ok() };
        // Only what is looked at; 0 elsewhere.
        let rows: Vec<usize> = (0..stamps.len()).filter(|&row| log.searched[row]).collect();
        let seen: Vec<f64> = rows.iter().map(|&row| stamps[row]).collect();
        let trace = simulate(&mut actuator, drive, start, &seen).ok()?;
        let spread = |values: &[f64]| {
            let mut all = vec![0.0; if values.is_empty() { 0 } else { stamps.len() }];
            rows.iter().zip(values).for_each(|(&row, value)| all[row] = *value);
            all
        };
        Some(Trace {
            response: spread(&trace.response),
            speed: spread(&trace.speed),
            voltage_v: spread(&trace.voltage_v),
            current_a: spread(&trace.current_a),
        })
    }

    /// The same with the steady response at the nominal command.
    fn simulate_around(
        &self,
        trials: &Trials,
        trial: &Trial,
        rows: usize,
        response: f64,
    ) -> Result<Vec<f64>, PlantError> {
        let (mut actuator, start, stamps) = self.actuator(trials, trial, rows, response)?;
        let told = (rows.saturating_sub(1) * trial.told_per_row + 1).min(trial.told_s.len());
        let drive = Drive { time_s: &trial.told_s[..told], command: &trial.told[..told] };
        if !trial.repeats {
            return simulate_response(&mut actuator, drive, start, &stamps);
        }
        simulate_periodic_response(&mut actuator, drive, start, &stamps, trial.period_rows)
    }

    /// The actuator, what was before a record, and the moments of its rows.
    fn actuator(
        &self,
        trials: &Trials,
        trial: &Trial,
        rows: usize,
        response: f64,
    ) -> Result<(Actuator, Start, Vec<f64>), PlantError> {
        let base = &self.base[trial.point];
        let lag = Lag { gain: base.gain, time_constant_s: base.time_constant_s, delay_s: base.delay_s };
        let point = OperatingPoint { nominal: trial.nominal, lag, response };
        let mut effects = Vec::with_capacity(self.effects.len());
        for candidate in &self.effects {
            let mut values = candidate.values.clone();
            if let Some(phase) = candidate.phases.get(trial.place) {
                values[frames::PHASE] = *phase;
            }
            effects.push(ActiveEffect::new(candidate.kind, values)?);
        }
        Catalog::standard().sort(&mut effects);
        let timing = EscTiming { frame_hz: trials.esc_frame_hz, frame_phase: 0.0 };
        let actuator = match trials.curve_of(trial) {
            Some((curve, given)) => {
                // The numbers of the level, all off by the part by which those at the nominal command are.
                let off = |found: f64, given: f64| found / given - 1.0;
                let errors = vec![off(base.gain, given.gain), off(base.time_constant_s, given.time_constant_s)];
                let mut all = vec![ActiveEffect::new(parameter_error()?, errors)?];
                all.append(&mut effects);
                Actuator::following_level(curve.clone(), trial.told[0], &all, timing)?
            }
            None => Actuator::with_effects(point, &effects, timing)?,
        };
        let stamps: Vec<f64> = trial.time_s[..rows].iter().map(|time_s| time_s - self.late_s).collect();
        let start = match trial.before {
            _ if trial.log.is_some() => Start::Rest(trial.told[0]),
            Before::Rest => Start::Rest(trial.nominal),
            Before::Periods => {
                let period_s = trial.period_rows as f64 / trial.rate_hz;
                let lead_s = match actuator.memory() {
                    Memory::Seconds(memory_s) => memory_s.min(period_s),
                    Memory::TurningPoints(_) | Memory::Lasting => period_s,
                };
                Start::Running { period_s, lead_s }
            }
        };
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
    standard.find("parameter_error").ok_or(PlantError::Setting {
        parameter: "kinds with other numbers of the lag",
        value: 0.0,
        limit: "one",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skewed(skew_ppm: f64) -> Candidate {
        let kind = Catalog::standard().find("clock_skew").unwrap();
        Candidate::new(kind, vec![skew_ppm])
    }

    #[test]
    fn a_vertex_is_found_between_starts_that_are_all_worse_than_nothing() {
        let judged = |skews: &[f64]| -> Vec<(f64, Candidate, ())> {
            skews.iter().map(|skew| ((skew - 18.0).powi(2), skewed(*skew), ())).collect()
        };
        let vertex = Candidate::vertex(&judged(&[-300.0, 0.0, 300.0, -40.0, 41.0])).unwrap();
        assert!((vertex.values[0] - 18.0).abs() < 1e-9, "{:?}", vertex.values);
        // The best is at the end: there is nothing between.
        assert_eq!(Candidate::vertex(&judged(&[0.0, -40.0])), None);
    }

    #[test]
    fn a_value_beyond_its_range_is_plausible_by_as_much_as_it_may_be_off() {
        let most = skewed(0.0).kind.parameters[0].plausible.1;
        assert!(skewed(most).is_plausible(|_| 0.0) && !skewed(1.01 * most).is_plausible(|_| 0.0));
        assert!(skewed(1.01 * most).is_plausible(|_| 0.02 * most));
        // A value that is not known at all is no excuse.
        assert!(!skewed(1.5 * most).is_plausible(|_| f64::INFINITY));
    }
}

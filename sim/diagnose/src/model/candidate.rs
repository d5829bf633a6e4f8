//! An effect that may be there, with its values, and where searches of them start.

use rotorlead_numerics::extremum::Parabola;
use rotorlead_plant::effect::{Kind, Linearity, Parameter, Scale, Search, Site, Use};

/// Part of its plausible range by which a value may lie beyond it, being an estimate. Chosen: the ends of the ranges are round numbers,
/// known no better. As a standard deviation it charges half a unit of log evidence for a tenth beyond, and 2 for two tenths.
pub(crate) const AT_MOST_OFF: f64 = 0.1;

/// Most pieces of the plausible range of a single value that are tried on all records. Derived: a parameter has 12 unless its kind says
/// otherwise, and one with more has a response that jumps as it moves.
pub(crate) const GRID: u32 = 12;
/// Starts closer than this in all coordinates are one: a quarter of a range, or of a factor of e. Chosen: half of the longest step of a
/// linearization. Lower, one minimum is fitted twice, which costs time; higher, a second minimum may be missed.
const NEAR: f64 = 0.25;

/// An effect with its values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Candidate {
    /// What it is.
    pub kind: &'static Kind,
    /// All its values.
    pub values: Vec<f64>,
    /// Of frames: the part of a frame from the first command of each record to its first frame, by the record's place. Empty
    /// where it is not known.
    pub phases: Vec<f64>,
    /// Whether its law may be another one than the catalog's: its shape is searched along.
    pub bends: bool,
    /// Standard deviation of the coordinate of its single value, from a profile of the chi-square; infinite without one.
    pub profiled_std: f64,
}

impl Candidate {
    /// An effect whose frames, if it has any, may lie anywhere.
    pub fn new(kind: &'static Kind, values: Vec<f64>) -> Self {
        Self { kind, values, phases: Vec::new(), bends: false, profiled_std: f64::INFINITY }
    }

    /// Whether the response depends in jumps on its single value.
    pub fn is_non_smooth(&self) -> bool {
        Self::searched(self.kind).any(|(_, parameter)| parameter.pieces > GRID)
    }

    /// Whether the steady response changes with time.
    pub fn drifts(&self) -> bool {
        self.kind.site >= Site::Air && self.kind.linearity == Linearity::Absent
    }

    /// Whether it has frames.
    pub fn has_frames(&self) -> bool {
        self.kind.search == Search::Frames
    }

    /// Whether it has frames that may lie anywhere.
    pub fn is_hidden_hold(&self) -> bool {
        self.has_frames() && self.phases.is_empty()
    }

    /// Whether it acts on no single command, so that a straight line from row to row serves as well.
    pub fn is_even(&self) -> bool {
        self.kind.site > Site::Command || self.is_hidden_hold()
    }

    /// Whether a search from here ends where one from the other does, as far as the values say: where the response does not jump
    /// about as they move.
    pub fn is_near(&self, other: &Self) -> bool {
        Self::searched(self.kind).all(|(place, parameter)| {
            let [here, there] = [self, other].map(|one| to_coordinate(parameter, one.values[place]));
            parameter.pieces <= GRID && (here - there).abs() < NEAR
        })
    }

    /// How far its values lie beyond their plausible ranges: the sum of squares, each in tenths of its range.
    pub fn beyond_range_square(&self) -> f64 {
        self.numbers().map(|(index, _)| (self.beyond(index) / AT_MOST_OFF).powi(2)).sum()
    }

    /// Which value lies beyond its plausible range by more than this `part` of it, in words.
    pub fn beyond_range(&self, part: f64) -> Option<String> {
        let (index, parameter) = self.numbers().find(|(index, _)| self.beyond(*index) > part)?;
        let (low, high) = parameter.plausible;
        let unit = if parameter.unit.is_empty() { String::new() } else { format!(" {}", parameter.unit) };
        Some(format!("plausible range: {} {:.3}{unit}, expected {low} to {high}", parameter.name, self.values[index]))
    }

    /// How far a value lies beyond its plausible range, seen from where the effect vanishes, in parts of that range in the coordinates of a
    /// search. 0 for the time constant of something of no size.
    fn beyond(&self, index: usize) -> f64 {
        let parameter = &self.kind.parameters[index];
        let is_of_nothing = matches!(parameter.usage, Use::Fitted)
            && parameter.null.is_nan()
            && self.values[0] == self.kind.parameters[0].null;
        if is_of_nothing {
            return 0.0;
        }
        let (low, high) = parameter.plausible;
        let [at, low, high] = [self.values[index], low, high].map(|value| to_coordinate(parameter, value));
        // Of a value without such a place, whose null is no number, both ends count.
        let null = to_coordinate(parameter, parameter.null);
        // How long a lag may be is said by the rotor's, which is the longest.
        let above = if null >= high || parameter.is_lag { 0.0 } else { (at - high).max(0.0) };
        let below = if null <= low { 0.0 } else { (low - at).max(0.0) };
        (above + below) / (high - low)
    }

    /// Places of the values that a search may change.
    pub fn searched(kind: &'static Kind) -> impl Iterator<Item = (usize, &'static Parameter)> {
        let is_searched = |parameter: &Parameter| match parameter.usage {
            Use::Fitted => true,
            // An optional one with several starts has to be right for the rest to fit at all.
            Use::Optional(_) => parameter.starts.len() > 1,
            Use::Shape { .. } => false,
        };
        kind.parameters.iter().enumerate().filter(move |(_, parameter)| is_searched(parameter))
    }

    /// Whether all values that a search changes have coordinates: where an effect vanishes not all do.
    pub fn has_coordinates(&self) -> bool {
        self.numbers().all(|(index, parameter)| to_coordinate(parameter, self.values[index]).is_finite())
    }

    /// Places of the values that a search changes: those of its kind, and its shape where it bends.
    pub fn numbers(&self) -> impl Iterator<Item = (usize, &'static Parameter)> {
        Self::searched(self.kind).chain(self.kind.shape().filter(|_| self.bends))
    }

    /// The same with each shape of which a search starts. None where its kind has none, where it bends already, and where the response
    /// depends on it in jumps.
    pub fn bent(&self) -> Vec<Self> {
        let Some((place, shape)) = self.kind.shape().filter(|_| !self.bends && !self.is_non_smooth()) else {
            return Vec::new();
        };
        let at = |start: &f64| {
            let mut bent = Self { bends: true, ..self.clone() };
            bent.values[place] = *start;
            bent
        };
        shape.starts.iter().map(at).filter(|bent| (bent.kind.check)(&bent.values).is_ok()).collect()
    }

    /// The same bent, where the response depends in jumps on its value and on its shape: with its own value and those up to `share` of a
    /// piece of the plausible range away, in so many steps to either side; each with all shapes, or with those as near its own where it
    /// bends already. Empty for any other.
    pub fn bent_in_jumps(&self, share: f64, steps: u32) -> Vec<Self> {
        let Some((place, shape)) = self.kind.shape().filter(|_| self.is_non_smooth()) else { return Vec::new() };
        let (low, high) = shape.plausible;
        let piece = (high - low) / f64::from(shape.pieces);
        let near = |step: i32| self.values[place] + share * piece * f64::from(step) / f64::from(steps);
        let shapes: Vec<f64> = if self.bends {
            (-(steps as i32)..=steps as i32).map(near).collect()
        } else {
            (0..=shape.pieces).map(|k| low + piece * f64::from(k)).collect()
        };
        let values = self.around(share, steps).into_iter().chain([self.clone()]);
        let bent = values.flat_map(|value| {
            let at = |shape: &f64| {
                let mut bent = Self { bends: true, ..value.clone() };
                bent.values[place] = *shape;
                bent
            };
            shapes.iter().map(at).collect::<Vec<_>>()
        });
        bent.filter(|bent| (bent.kind.check)(&bent.values).is_ok()).collect()
    }

    /// Where searches of a value start. One that has a sign may have the other one: speed is bent the other way than thrust. Chosen: 0.4
    /// of a start as well, since the range of a curvature goes 3 down and 8 up.
    fn both_ways(parameter: &Parameter) -> Vec<f64> {
        let mut starts = parameter.starts.to_vec();
        let is_one_sided = parameter.scale == Scale::Linear && parameter.starts.iter().all(|start| *start > 0.0);
        if is_one_sided && parameter.null == 0.0 && parameter.plausible.0 < 0.0 {
            let others = parameter.starts.iter().flat_map(|start| [-start, -0.4 * start]);
            starts.extend(others.filter(|start| *start >= parameter.plausible.0));
        }
        starts
    }

    /// Every combination of starts, of either sign where `both_ways` says so; of a single value its whole plausible range as well,
    /// since a limit that no command reaches does not say which way to go.
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
    /// Starts of a kind whose law may be far from the catalog's, which is one with searches that start near to it and beyond: each with
    /// each shape.
    pub fn starts_bent_far(kind: &'static Kind) -> Vec<Self> {
        let bends_far = kind.shape().is_some_and(|(_, shape)| shape.starts.len() > 2);
        let starts = if bends_far { Self::starts(kind, false) } else { Vec::new() };
        starts.iter().flat_map(Self::bent).collect()
    }

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
    pub fn around_best<T>(evaluated: &[(f64, Self, T)]) -> Vec<Self> {
        let best = evaluated.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(((_, best, _), (index, parameter))) =
            best.zip(best.and_then(|best| Self::searched(best.1.kind).next()))
        else {
            return Vec::new();
        };
        let at = |candidate: &Self| to_coordinate(parameter, candidate.values[index]);
        let here = at(best);
        let others = || evaluated.iter().map(|(_, other, _)| at(other));
        let below = others().filter(|other| *other < here).fold(f64::NEG_INFINITY, f64::max);
        let above = others().filter(|other| *other > here).fold(f64::INFINITY, f64::min);
        let between = [below, above].into_iter().filter(|other| other.is_finite()).map(|other| {
            let mut values = best.values.clone();
            values[index] = from_coordinate(parameter, 0.5 * (here + other));
            Self::new(best.kind, values)
        });
        between.filter(|start| (start.kind.check)(&start.values).is_ok()).collect()
    }

    /// Where a parabola through the best of some starts of a single value and its neighbors has its vertex: closer than halving
    /// comes where the effect is much smaller than the spacing of the starts. `None` where there is none between the neighbors.
    pub fn vertex<T>(evaluated: &[(f64, Self, T)]) -> Option<Self> {
        let best = evaluated.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (index, parameter) = Self::searched(best.1.kind).next()?;
        let mut points: Vec<(f64, f64)> =
            evaluated.iter().map(|(left, other, _)| (to_coordinate(parameter, other.values[index]), *left)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0 == b.0);
        let place = points.iter().position(|point| point.1 == best.0)?;
        let three: [(f64, f64); 3] = points.get(place.checked_sub(1)?..place + 2)?.try_into().ok()?;
        let vertex = Parabola::through(three).lowest()?;
        let mut values = best.1.values.clone();
        values[index] = from_coordinate(parameter, vertex);
        let is_between = three[0].0 < vertex && vertex < three[2].0;
        Some(Self::new(best.1.kind, values)).filter(|start| is_between && (start.kind.check)(&start.values).is_ok())
    }
}

/// A value as a coordinate in which a unit step is a fair step.
pub(crate) fn to_coordinate(parameter: &Parameter, value: f64) -> f64 {
    match parameter.scale {
        Scale::Log => value.ln(),
        Scale::Linear => value / (parameter.plausible.1 - parameter.plausible.0),
    }
}

pub(crate) fn from_coordinate(parameter: &Parameter, coordinate: f64) -> f64 {
    match parameter.scale {
        Scale::Log => coordinate.exp(),
        Scale::Linear => coordinate * (parameter.plausible.1 - parameter.plausible.0),
    }
}

/// How fast the value moves with its coordinate.
pub(crate) fn slope(parameter: &Parameter, value: f64) -> f64 {
    match parameter.scale {
        Scale::Log => value,
        Scale::Linear => parameter.plausible.1 - parameter.plausible.0,
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;

    fn skewed(skew_ppm: f64) -> Candidate {
        let kind = Catalog::standard().find("clock_skew").unwrap();
        Candidate::new(kind, vec![skew_ppm])
    }

    #[test]
    fn starts_are_one_where_all_values_are_close_and_the_response_does_not_jump() {
        let candidate = |id: &str, values: &[f64]| {
            let mut all = Candidate::new(Catalog::standard().find(id).unwrap(), Vec::new());
            all.values = all.kind.null();
            all.values[..values.len()].copy_from_slice(values);
            all
        };
        let pole = |time_constant_s: f64| candidate("second_pole", &[time_constant_s]);
        assert!(pole(0.010).is_near(&pole(0.012)) && !pole(0.010).is_near(&pole(0.015)));
        let grid = candidate("command_quantization", &[0.01]);
        assert!(!grid.is_near(&grid.clone()));
    }

    #[test]
    fn a_vertex_is_found_between_starts_that_are_all_worse_than_nothing() {
        let evaluated = |skews: &[f64]| -> Vec<(f64, Candidate, ())> {
            skews.iter().map(|skew| ((skew - 18.0).powi(2), skewed(*skew), ())).collect()
        };
        let vertex = Candidate::vertex(&evaluated(&[-300.0, 0.0, 300.0, -40.0, 41.0])).unwrap();
        assert!((vertex.values[0] - 18.0).abs() < 1e-9, "{:?}", vertex.values);
        // The best is at the end: there is nothing between.
        assert_eq!(Candidate::vertex(&evaluated(&[0.0, -40.0])), None);
    }

    #[test]
    fn a_value_is_plausible_a_tenth_beyond_its_range_and_not_farther() {
        let most = skewed(0.0).kind.parameters[0].plausible.1;
        assert_eq!(skewed(most).beyond_range_square(), 0.0);
        assert_eq!(skewed(1.01 * most).beyond_range(AT_MOST_OFF), None);
        assert!(skewed(1.01 * most).beyond_range(0.0).is_some());
        assert!(
            skewed(1.5 * most).beyond_range(AT_MOST_OFF).is_some() && skewed(1.5 * most).beyond_range_square() > 1.0
        );
        let kind = Catalog::standard().find("supply_sag").unwrap();
        let sag = |polarization_drop: f64| {
            let mut values = kind.null();
            (values[0], values[1], values[2]) = (polarization_drop, 400.0, 0.03);
            Candidate::new(kind, values)
        };
        assert!(sag(0.05).beyond_range(AT_MOST_OFF).is_some());
        assert_eq!(sag(0.0).beyond_range(0.0), None, "nothing has no time constant");
    }
}

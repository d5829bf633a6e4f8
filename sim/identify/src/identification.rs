//! From an experiment to a model, by the kind of records that it has.

use rotorlead_numerics::sample::median;
use rotorlead_plant::{Model, Provenance};
use rotorlead_records::{CommandShape, Excitation, Experiment, Finding, Record, Role, Severity, Topic};

use crate::error::IdentifyError;
use crate::flight::{FlightIdentification, identify_flights, is_flight_to_fit};
use crate::lag::chirp::{ChirpIdentification, identify_chirps, is_chirp_to_fit};
use crate::lag::first_order::FirstOrderOptions;
use crate::lag::multisine::{IdentifyWarning, PeriodicIdentification, PeriodicOptions, identify_periodic};
use crate::lag::steps::{StaircaseFit, StepsError, fit_staircase};
use crate::spectra::Spectrum;
use crate::stand::StandModel;
use crate::static_map::{StaticMapError, StaticMapFit, SteadyPoints, SteadySource, fit_static_map};

/// What an identification takes beside the records.
#[derive(Clone, Copy, Debug)]
pub struct IdentifyOptions<'a> {
    /// Level of the likelihood ratio test that decides whether a lag of the frequency domain has a dead time: 0 for never, 1
    /// for wherever the best one is above zero.
    pub delay_level: f64,
    /// The stand whose response is divided out of multisines and chirps.
    pub stand: Option<&'a StandModel>,
    /// Spectra of further multisine records, whose rows were too many to be read at once ([`Spectrum::from_long_record`]).
    pub long: &'a [(Record, Spectrum)],
}

impl Default for IdentifyOptions<'_> {
    fn default() -> Self {
        Self { delay_level: FirstOrderOptions::default().delay_level, stand: None, long: &[] }
    }
}

/// The lags, with what they were found by.
#[derive(Clone, Debug)]
pub enum Lags {
    /// From multisines in the frequency domain, one per nominal command.
    Multisines(PeriodicIdentification),
    /// From chirps in the frequency domain, one per nominal command.
    Chirps(ChirpIdentification),
    /// From a step or staircase record in the time domain, one per level and direction.
    Steps(Box<StaircaseFit>),
    /// From flights, in closed loop.
    Flights(FlightIdentification),
    /// None: the records are tables of steady points, which show a static map alone.
    None,
}

impl Lags {
    /// The frequency responses behind the lags; `None` for steps.
    #[must_use]
    pub fn in_frequency(&self) -> Option<&PeriodicIdentification> {
        match self {
            Self::Multisines(found) => Some(found),
            Self::Chirps(found) => Some(&found.lags),
            Self::Steps(_) | Self::Flights(_) | Self::None => None,
        }
    }

    /// What chirps show; `None` for the others.
    #[must_use]
    pub fn chirps(&self) -> Option<&ChirpIdentification> {
        match self {
            Self::Chirps(found) => Some(found),
            Self::Multisines(_) | Self::Steps(_) | Self::Flights(_) | Self::None => None,
        }
    }

    /// The fit of steps; `None` for the others.
    #[must_use]
    pub fn in_time(&self) -> Option<&StaircaseFit> {
        match self {
            Self::Steps(fit) => Some(fit.as_ref()),
            Self::Multisines(_) | Self::Chirps(_) | Self::Flights(_) | Self::None => None,
        }
    }

    /// What flights show; `None` for the others.
    #[must_use]
    pub fn in_flight(&self) -> Option<&FlightIdentification> {
        match self {
            Self::Flights(found) => Some(found),
            Self::Multisines(_) | Self::Chirps(_) | Self::Steps(_) | Self::None => None,
        }
    }
}

/// A motor that was identified.
#[derive(Clone, Debug)]
pub struct Identification {
    /// The model: a lag at each nominal command, and the static map where records show one.
    pub model: Model,
    /// Where its lags come from.
    pub lags: Lags,
    /// The static map and the steady points that it was fitted to; `None` where records show fewer than four levels.
    pub static_map: Option<(SteadyPoints, StaticMapFit)>,
    /// What the user should know of it.
    pub warnings: Vec<Finding>,
}

/// Identifies a motor from all records of an experiment that may be fitted.
///
/// With a multisine among them, each nominal command gets the lag `gain e^(-s delay) / (tau s + 1)` that fits its frequency
/// response best (maximum likelihood, weighted by the noise that the periods show), and square waves judge it. Without,
/// the one step or staircase record is fitted in time, one lag per level and direction; without those too, chirps are
/// fitted in the frequency domain, and without those flights in closed loop. A static map is fitted to all levels on which the motor runs steadily; tables of steady points
/// give that alone.
///
/// # Errors
/// [`IdentifyError`] where no record may be fitted, several might be and one has to be chosen, or a record cannot be used.
///
/// # Examples
///
/// A motor on a simulated stand, with noise:
///
/// ```
/// use rotorlead_identify::identification::{IdentifyOptions, identify};
/// use rotorlead_plant::Model;
/// use rotorlead_plant::bench::{Plan, run};
///
/// let motor: Model = toml::from_str("
///     format = 1
///     [[point]]
///     nominal = 0.5
///     gain = 10.0
///     time_constant_s = 0.1
/// ")?;
/// let plan = Plan { loop_rate_hz: 500, sample_rate_hz: 500, esc_frame_hz: None, ..Plan::paper(&motor) };
/// let stand = run(&plan, &motor, None, &|_| ())?;
///
/// let found = identify(&stand, &IdentifyOptions::default())?;
/// let point = &found.model.points[0];
/// assert!((point.time_constant_s - 0.1).abs() < 4.0 * point.time_constant_s_std.unwrap());
/// assert!(found.warnings.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn identify(experiment: &Experiment, options: &IdentifyOptions) -> Result<Identification, IdentifyError> {
    let records = || experiment.records.iter().chain(options.long.iter().map(|(record, _)| record));
    let has_multisine = records().any(|record| may_fit(record) && record.excitation == Excitation::Multisine);
    let has_steps = experiment.records.iter().any(|record| may_fit(record) && is_steps(record));
    let fit = FirstOrderOptions { delay_level: options.delay_level, ..FirstOrderOptions::default() };
    let mut identification = if has_multisine {
        from_multisines(experiment, options, fit)?
    } else if !has_steps && experiment.records.iter().any(is_chirp_to_fit) {
        from_chirps(experiment, options, &fit)?
    } else if !has_steps && records().any(|record| may_fit(record) && record.excitation == Excitation::Steady) {
        from_steady_points(experiment)
    } else if !has_steps && experiment.records.iter().any(is_flight_to_fit) {
        from_flights(experiment)?
    } else {
        from_steps(experiment, options).map_err(|error| with_shape(experiment, error))?
    };
    match (identification.add_static_map(experiment), &identification.lags) {
        (Err(reason), Lags::None) => Err(IdentifyError::NoStaticMap { experiment: experiment.name.clone(), reason }),
        _ => {
            let model = &mut identification.model;
            model.provenance.iter_mut().for_each(|provenance| provenance.experiment = Some(experiment.name.clone()));
            model.check().map_err(|fault| IdentifyError::NoActuator { experiment: experiment.name.clone(), fault })?;
            Ok(identification)
        }
    }
}

fn from_multisines(
    experiment: &Experiment,
    options: &IdentifyOptions,
    fit: FirstOrderOptions,
) -> Result<Identification, IdentifyError> {
    let options = PeriodicOptions { fit, stand: options.stand, long: options.long, ..PeriodicOptions::default() };
    let found = identify_periodic(experiment, &options)?;
    Ok(Identification {
        model: found.to_model(experiment),
        warnings: warnings(&found).chain(left_out(experiment, None)).collect(),
        lags: Lags::Multisines(found),
        static_map: None,
    })
}

fn from_chirps(
    experiment: &Experiment,
    options: &IdentifyOptions,
    fit: &FirstOrderOptions,
) -> Result<Identification, IdentifyError> {
    let found = identify_chirps(experiment, fit, options.stand)?;
    let mut model = found.lags.to_model(experiment);
    if let Some(provenance) = &mut model.provenance {
        provenance.records.clone_from(&found.files);
    }
    Ok(Identification { model, warnings: warnings(&found.lags).collect(), lags: Lags::Chirps(found), static_map: None })
}

fn from_steps(experiment: &Experiment, options: &IdentifyOptions) -> Result<Identification, IdentifyError> {
    let record = step_record(experiment)?;
    if options.stand.is_some() {
        return Err(IdentifyError::StandOfSteps);
    }
    let fit = fit_staircase(record, experiment.output, experiment.esc_frame_hz)?;
    let warning = |message: String| Finding {
        severity: Severity::Warning,
        topic: Topic::Identification,
        file: Some(record.file.clone()),
        row: None,
        message: format!("{}: {message}", record.file),
        remedy: None,
    };
    let warnings = fit.warnings.iter().map(|found| warning(found.to_string()));
    Ok(Identification {
        model: fit.to_model(env!("CARGO_PKG_VERSION"))?,
        warnings: warnings.chain(left_out(experiment, Some(record))).collect(),
        lags: Lags::Steps(Box::new(fit)),
        static_map: None,
    })
}

fn from_flights(experiment: &Experiment) -> Result<Identification, IdentifyError> {
    let found = identify_flights(experiment)?;
    let model = Model {
        format: 1,
        points: found.points.clone(),
        static_map: None,
        time_constant_curve: found.curve.clone(),
        effects: Vec::new(),
        provenance: Some(Provenance {
            experiment: None,
            records_crc32: None,
            records: found.motors.iter().map(|motor| motor.file.clone()).collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            output: experiment.output,
            excitation: Some(Excitation::Flight),
            command_rate_hz: experiment.command_rate_hz,
            esc_frame_hz: experiment.esc_frame_hz,
            judgement: None,
        }),
    };
    Ok(Identification { model, lags: Lags::Flights(found), static_map: None, warnings: Vec::new() })
}

/// Nothing of a lag; the static map is added to it.
fn from_steady_points(experiment: &Experiment) -> Identification {
    let used = experiment.records.iter().filter(|record| may_fit(record) && record.excitation == Excitation::Steady);
    let model = Model {
        format: 1,
        points: Vec::new(),
        static_map: None,
        time_constant_curve: None,
        effects: Vec::new(),
        provenance: Some(Provenance {
            experiment: None,
            records_crc32: None,
            records: used.map(|record| record.file.clone()).collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            output: experiment.output,
            excitation: None,
            command_rate_hz: None,
            esc_frame_hz: None,
            judgement: None,
        }),
    };
    Identification { model, lags: Lags::None, static_map: None, warnings: Vec::new() }
}

impl Identification {
    /// Fits the static map to all records that may be fitted and are not compensated, and puts it in the model.
    fn add_static_map(&mut self, experiment: &Experiment) -> Result<(), StaticMapError> {
        let lag_s = median(self.model.points.iter().map(|point| point.time_constant_s + point.delay_s));
        let mut points = SteadyPoints { running: Vec::new(), still: None, source: SteadySource::Plateaus };
        for record in experiment.records.iter().filter(|record| shows_levels(record)) {
            // Most records are no staircase, and that is no fault of theirs.
            if let Ok(found) = SteadyPoints::from_record(record, experiment.output, lag_s) {
                points.join(found);
            }
        }
        let fit = fit_static_map(&points)?;
        self.model.static_map.get_or_insert_with(|| points.levels()).polynomial = Some(fit.polynomial());
        self.warnings.extend(fit.warnings.iter().map(|found| Finding {
            severity: Severity::Warning,
            topic: Topic::Identification,
            file: None,
            row: None,
            message: found.to_string(),
            remedy: None,
        }));
        self.static_map = Some((points, fit));
        Ok(())
    }
}

impl PeriodicIdentification {
    /// The model of these lags, with where it is from.
    #[must_use]
    pub fn to_model(&self, experiment: &Experiment) -> Model {
        Model {
            format: 1,
            points: self.points(),
            static_map: None,
            time_constant_curve: None,
            effects: Vec::new(),
            provenance: Some(Provenance {
                experiment: None,
                records_crc32: None,
                records: self.fitted_files().map(str::to_owned).collect(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                output: experiment.output,
                excitation: None,
                command_rate_hz: experiment.command_rate_hz,
                esc_frame_hz: experiment.esc_frame_hz,
                judgement: None,
            }),
        }
    }
}

/// Whether its plateaus are steady points of the motor. In flight the vehicle's own wind is in each.
fn shows_levels(record: &Record) -> bool {
    may_fit(record) && !record.compensated && record.excitation != Excitation::Flight
}

fn may_fit(record: &Record) -> bool {
    record.role != Some(Role::Validate)
}

fn is_steps(record: &Record) -> bool {
    matches!(record.excitation, Excitation::Step | Excitation::Staircase)
}

fn warnings(found: &PeriodicIdentification) -> impl Iterator<Item = Finding> {
    let all = found.warnings.iter().chain(found.nominals.iter().flat_map(|nominal| &nominal.warnings));
    all.map(|warning: &IdentifyWarning| Finding::new(Severity::Warning, warning.topic(), warning.file(), warning))
}

/// The one step or staircase record that is to be fitted.
///
/// # Errors
/// [`IdentifyError::NoRecord`] or [`IdentifyError::Free`] where there is none, [`IdentifyError::SeveralSteps`] where one of
/// several has to be chosen.
pub fn step_record(experiment: &Experiment) -> Result<&Record, IdentifyError> {
    let of_role = |role: Option<Role>| {
        experiment.records.iter().filter(move |record| is_steps(record) && record.role == role).collect::<Vec<_>>()
    };
    let (marked, unmarked) = (of_role(Some(Role::Fit)), of_role(None));
    let candidates = if marked.is_empty() { unmarked } else { marked };
    match candidates[..] {
        [record] => Ok(record),
        [] => Err(nothing_to_fit(experiment)),
        _ => Err(IdentifyError::SeveralSteps { experiment: experiment.name.clone(), count: candidates.len() }),
    }
}

/// The true reason where no step carries a lag, or nothing says what was played, and the command shows what it is.
fn with_shape(experiment: &Experiment, error: IdentifyError) -> IdentifyError {
    let is_unclear = matches!(
        error,
        IdentifyError::Steps(StepsError::NoUsableStep { .. } | StepsError::NoPlateaus { .. })
            | IdentifyError::Free { .. }
    );
    let records = experiment.records.iter().filter(|record| may_fit(record) && !record.compensated);
    let shape = |record: &Record| record.command_shape().map(|shape| (record.file.clone(), shape));
    match records.filter(|_| is_unclear).find_map(shape) {
        Some((file, CommandShape::Random)) => IdentifyError::RandomCommand { file },
        Some((file, CommandShape::Ramp)) => IdentifyError::RampCommand { file },
        None => error,
    }
}

/// Why there is no record to fit: those that do not say what was played are named.
fn nothing_to_fit(experiment: &Experiment) -> IdentifyError {
    let free = experiment.records.iter().filter(|record| record.excitation == Excitation::Free);
    let files: Vec<&str> = free.map(|record| record.file.as_str()).collect();
    let experiment = experiment.name.clone();
    match files[..] {
        [] => IdentifyError::NoRecord { experiment },
        [file] => IdentifyError::Free { experiment, files: file.to_owned(), verb: "is" },
        _ => IdentifyError::Free { experiment, files: files.join(", "), verb: "are" },
    }
}

/// The records that a lag might be fitted to by another way, and are not: multisines were, or `fitted` was. Squares are
/// for validation.
fn left_out(experiment: &Experiment, fitted: Option<&Record>) -> Vec<Finding> {
    let reason =
        fitted.map_or_else(|| String::from("multisine records come first"), |r| format!("{} is fitted", r.file));
    let others = experiment.records.iter().filter(|record| fitted.is_none_or(|fitted| fitted.file != record.file));
    let finding = |record: &Record| {
        let (what, levels) = match record.excitation {
            // A table of steady points has no lag in it.
            Excitation::Multisine | Excitation::Square | Excitation::Steady => return None,
            Excitation::Step => ("a step", "; its levels are in the static map"),
            Excitation::Staircase => ("a staircase", "; its levels are in the static map"),
            Excitation::Triangle => ("a triangle", ""),
            Excitation::Chirp => ("a chirp", ""),
            Excitation::Flight => ("a flight", ""),
            Excitation::Random => ("a random command", ""),
            Excitation::Free => ("`free`", ""),
        };
        Some(Finding {
            severity: Severity::Warning,
            topic: Topic::Roles,
            file: Some(record.file.clone()),
            row: None,
            message: format!("{} is {what}, and no lag is fitted to it: {reason}{levels}", record.file),
            remedy: Some("identify it in a folder of its own, or give it role = \"validate\"".to_owned()),
        })
    };
    others.filter(|record| may_fit(record)).filter_map(finding).collect()
}

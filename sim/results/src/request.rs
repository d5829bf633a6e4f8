//! What is asked of a design, and what is designed where only a purpose is known.

use miette::Diagnostic;
use rotorlead::design::DEFAULT_LOOP_RATE_HZ;
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{CompensatorError, DesignOptions, InverseOptions, Setting, design};
use rotorlead_plant::{Judgement, Model, PlantError};
use rotorlead_records::Finding;
use rotorlead_vehicle::{Asked, Choice, MotorControlKind, Purpose, Recommendation, VehicleError, recommend};
use thiserror::Error;

/// What is asked of a design. What is not given is the default of the kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DesignRequest {
    /// The kind; where none is given, that of the parameters that only one has, or else what is recommended.
    pub kind: Option<Kind>,
    /// Highest frequency that a lead is to amplify, rad/s.
    pub omega_g_rad_s: Option<f64>,
    /// Frequency at which a sampled lead matches the continuous one, rad/s.
    pub prewarp_rad_s: Option<f64>,
    /// Natural frequency of an inverse's reference model, rad/s.
    pub natural_rad_s: Option<f64>,
    /// Table of an inverse.
    pub setting: Option<Setting>,
    /// Lowest and highest command that the ESC gets, of an inverse, 0..1.
    pub output_range: Option<(f64, f64)>,
    /// Commands for which an inverse is in the path, 0..1.
    pub compensate_range: Option<(f64, f64)>,
    /// Damping ratio of the poles.
    pub damping: Option<f64>,
    /// Rate at which the filter runs, hertz.
    pub loop_rate_hz: Option<f64>,
    /// Most by which the ESC changes its output per second.
    pub slew_per_s: Option<f64>,
}

/// The kinds of compensator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The paper's lead.
    Lead,
    /// A conditioned inverse.
    Inverse,
}

/// What is to be designed for a model.
pub struct Chosen {
    /// The kind, and what is asked of it.
    pub options: KindOptions,
    /// What it was chosen from; `None` where its kind was asked for.
    pub recommendation: Option<Recommendation>,
    /// Where the model does not allow a default.
    pub findings: Vec<Finding>,
}

/// Why there is no design.
#[derive(Debug, Error, Diagnostic)]
pub enum RequestError {
    /// None is best.
    #[error("none is recommended for {purpose}, as {why}")]
    #[diagnostic(help("{other}; the kind `lead` or `inverse` is designed all the same where it is asked for"))]
    NoneRecommended {
        /// What it would be for.
        purpose: &'static str,
        /// What speaks against all.
        why: String,
        /// What is for the other purpose.
        other: String,
    },
    /// The motor cannot be simulated.
    #[error("what to fly cannot be said: {0}")]
    #[diagnostic(help("ask for a kind, `lead` or `inverse`, or correct the model"))]
    NotCompared(#[from] VehicleError),
    /// The kind cannot be designed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    NotDesigned(#[from] CompensatorError),
    /// The model is impossible.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Impossible(#[from] PlantError),
}

impl DesignRequest {
    /// The parameters that only one kind has, by name, and whether they are given.
    fn parameters_of_one_kind(&self) -> [(Kind, &'static str, bool); 6] {
        [
            (Kind::Lead, "omega_g_rad_s", self.omega_g_rad_s.is_some()),
            (Kind::Lead, "prewarp_rad_s", self.prewarp_rad_s.is_some()),
            (Kind::Inverse, "natural_rad_s", self.natural_rad_s.is_some()),
            (Kind::Inverse, "setting", self.setting.is_some()),
            (Kind::Inverse, "output_range", self.output_range.is_some()),
            (Kind::Inverse, "compensate_range", self.compensate_range.is_some()),
        ]
    }

    /// The kind that is asked for, by itself or by a parameter that only one has.
    #[must_use]
    pub fn kind(&self) -> Option<Kind> {
        let implied =
            || self.parameters_of_one_kind().into_iter().find(|(_, _, is_given)| *is_given).map(|(kind, ..)| kind);
        self.kind.or_else(implied)
    }

    /// The first parameter that is given and that the kind asked for does not have.
    #[must_use]
    pub fn foreign(&self) -> Option<&'static str> {
        let kind = self.kind()?;
        self.parameters_of_one_kind()
            .into_iter()
            .find(|(of, _, is_given)| *is_given && *of != kind)
            .map(|(_, name, _)| name)
    }

    /// The options of a kind, with the defaults for what is not given.
    #[must_use]
    pub fn options(&self, kind: Kind) -> KindOptions {
        match kind {
            Kind::Lead => {
                let default = DesignOptions::default();
                KindOptions::Lead(DesignOptions {
                    omega_g_rad_s: self.omega_g_rad_s.unwrap_or(default.omega_g_rad_s),
                    damping: self.damping.unwrap_or(default.damping),
                    loop_rate_hz: self.loop_rate_hz.unwrap_or(default.loop_rate_hz),
                    prewarp_rad_s: self.prewarp_rad_s,
                    slew_per_s: self.slew_per_s,
                })
            }
            Kind::Inverse => {
                let default = InverseOptions::default();
                KindOptions::Inverse(InverseOptions {
                    setting: self.setting,
                    omega_f_rad_s: self.natural_rad_s,
                    damping: self.damping.unwrap_or(default.damping),
                    loop_rate_hz: self.loop_rate_hz.unwrap_or(default.loop_rate_hz),
                    range: self.output_range.unwrap_or(default.range),
                    slew_per_s: self.slew_per_s,
                    compensated: self.compensate_range,
                })
            }
        }
    }

    /// Rate at which the filter runs, hertz.
    #[must_use]
    pub fn loop_rate_hz(&self) -> f64 {
        self.loop_rate_hz.unwrap_or(DEFAULT_LOOP_RATE_HZ)
    }

    /// The kind that is asked for, or else a lead.
    #[must_use]
    pub fn chosen_or_lead(&self, model: &Model) -> Chosen {
        self.choose(self.kind().unwrap_or(Kind::Lead), model)
    }

    /// The kind that is asked for, or what is recommended for `purpose`: by `known`, unless that is yet to be found.
    ///
    /// # Errors
    /// Where none is recommended.
    pub fn chosen(
        &self,
        model: &Model,
        purpose: Purpose,
        known: Option<Recommendation>,
    ) -> Result<Chosen, RequestError> {
        if let Some(kind) = self.kind() {
            return Ok(self.choose(kind, model));
        }
        let asked = Asked { damping: self.damping, slew_per_s: self.slew_per_s, ..Asked::default() };
        let found = || recommend(model, model.judgement().and_then(Judgement::doubt), &asked);
        let recommendation = known.map_or_else(found, Ok)?;
        let choice = recommendation.choice(purpose);
        let chosen = match choice.actuator {
            MotorControlKind::Lead => self.choose(Kind::Lead, model),
            MotorControlKind::Inverse { omega_f_rad_s } => {
                Self { natural_rad_s: Some(omega_f_rad_s), ..*self }.choose(Kind::Inverse, model)
            }
            MotorControlKind::None | MotorControlKind::SpeedFeedback { .. } => {
                let other = match recommendation.choice(purpose.other()) {
                    Choice { actuator: MotorControlKind::None, .. } => "leave the motor as it is".to_owned(),
                    other => format!("for {}, {} is", purpose.other().words(), other.actuator.name()),
                };
                let why = choice.why.clone();
                return Err(RequestError::NoneRecommended { purpose: purpose.words(), why, other });
            }
        };
        Ok(Chosen { recommendation: Some(recommendation), ..chosen })
    }

    /// A kind for `model`: where no omega_g is asked for and the motor is too slow for the paper's, the highest that it allows.
    fn choose(&self, kind: Kind, model: &Model) -> Chosen {
        let mut options = self.options(kind);
        let mut findings = Vec::new();
        if let KindOptions::Lead(lead) = &mut options
            && self.omega_g_rad_s.is_none()
            && let Err(CompensatorError::TooMuchLead { largest_omega_g_rad_s, .. }) = design(model, lead)
        {
            let message = format!(
                "the lead amplifies up to {largest_omega_g_rad_s:.1} rad/s (omega_g), lower than the paper's {:.1}: the highest at which \
                 the controller's numbers hold it for so slow a motor",
                lead.omega_g_rad_s
            );
            findings.push(Finding::warning(message, None));
            lead.omega_g_rad_s = largest_omega_g_rad_s;
        }
        Chosen { options, recommendation: None, findings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_that_one_kind_has_asks_for_it() {
        let given = DesignRequest { natural_rad_s: Some(100.0), ..DesignRequest::default() };
        assert_eq!((given.kind(), given.foreign()), (Some(Kind::Inverse), None));
        let both = DesignRequest { omega_g_rad_s: Some(300.0), ..given };
        assert_eq!((both.kind(), both.foreign()), (Some(Kind::Lead), Some("natural_rad_s")));
        let other = DesignRequest { kind: Some(Kind::Lead), ..given };
        assert_eq!(other.foreign(), Some("natural_rad_s"));
        assert_eq!(DesignRequest::default().kind(), None);
    }
}

//! Effects with the values that they have in one actuator.

use num_complex::Complex64;
use rotorlead_records::files::KeyPath;

use super::{Catalog, Kind, Linearity, Parameter, Part, Use, slew_limit};
use crate::error::PlantError;
use crate::model::{Effect, Model};
use crate::operating::{OperatingCurve, OperatingPoint};
use crate::rotor::RotorBase;

/// An effect with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct ActiveEffect {
    kind: &'static Kind,
    values: Vec<f64>,
}

impl ActiveEffect {
    /// An effect of `kind` with one value per parameter, in the order of [`Kind::parameters`].
    ///
    /// # Errors
    /// [`PlantError::EffectValues`] when there are fewer or more, [`PlantError::Model`] when one is impossible or two do not
    /// go together.
    pub fn new(kind: &'static Kind, values: Vec<f64>) -> Result<Self, PlantError> {
        if values.len() != kind.parameters.len() {
            return Err(PlantError::EffectValues { kind: kind.id, given: values.len(), needed: kind.parameters.len() });
        }
        Catalog::check_values(kind, &values, &KeyPath::root().key(kind.id)).map_err(PlantError::Model)?;
        Ok(Self { kind, values })
    }

    /// After a check of the values.
    pub(super) fn checked(kind: &'static Kind, values: Vec<f64>) -> Self {
        Self { kind, values }
    }

    /// The effects of `model`, in the order of the chain.
    ///
    /// # Errors
    /// [`PlantError::Model`] when the model is impossible.
    pub fn from_model(model: &Model) -> Result<Vec<Self>, PlantError> {
        model.check().map_err(PlantError::Model)?;
        Catalog::standard().active_effects(model).map_err(PlantError::Model)
    }

    /// What it is.
    #[must_use]
    pub fn kind(&self) -> &'static Kind {
        self.kind
    }

    /// Its values, in the order of [`Kind::parameters`].
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value of the parameter of that name.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        let index = self.kind.parameters.iter().position(|parameter| parameter.name == name)?;
        Some(self.values[index])
    }

    /// The slower rate of a limit of the rate, 1/s; `None` of any other effect.
    #[must_use]
    pub fn slew_per_s(&self) -> Option<f64> {
        let is_limit = self.kind.id == slew_limit::ID;
        is_limit.then(|| Some(slew_limit::slower_per_s(self.value("rate_per_s")?, self.value("down_ratio")?)))?
    }

    /// The link of the chain, beside `base`.
    #[must_use]
    pub fn part(&self, base: &RotorBase) -> Part {
        (self.kind.part)(&self.values, base)
    }

    /// By what it multiplies the response of the lag around `point`; 1 where it has no frequency response
    /// ([`Linearity::Absent`]).
    #[must_use]
    pub fn response(&self, point: &OperatingPoint, omega_rad_s: f64) -> Complex64 {
        (self.kind.response)(&self.values, point, omega_rad_s)
    }

    /// As the `[[effect]]` of a model file, with the standard errors that are known (NaN or missing: not known). The catalog's law
    /// goes without its shape.
    #[must_use]
    pub fn to_effect(&self, std: &[f64]) -> Effect {
        let is_written = |place: usize, parameter: &Parameter| !matches!(parameter.usage, Use::Shape { neutral, .. } if neutral == self.values[place]);
        let named = |values: &[f64]| {
            let all = self.kind.parameters.iter().zip(values).enumerate();
            let written = all.filter(|(place, (parameter, value))| is_written(*place, parameter) && value.is_finite());
            written.map(|(_, (parameter, value))| (parameter.name.to_owned(), *value)).collect()
        };
        Effect { kind: self.kind.id.to_owned(), parameters: named(&self.values), std: named(std) }
    }
}

/// The linear model around one command, effects included where they are linear.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearChain {
    point: OperatingPoint,
    effects: Vec<ActiveEffect>,
}

impl LinearChain {
    /// The lag of `point` with these effects.
    #[must_use]
    pub fn new(point: OperatingPoint, effects: Vec<ActiveEffect>) -> Self {
        Self { point, effects }
    }

    /// `model` around `nominal`.
    ///
    /// # Errors
    /// [`PlantError`] when the model is impossible or has no points around `nominal`.
    pub fn from_model(model: &Model, nominal: f64) -> Result<Self, PlantError> {
        let point = OperatingCurve::around_without_effects(model, nominal)?;
        Ok(Self { point, effects: ActiveEffect::from_model(model)? })
    }

    /// Response units per unit of command at `omega_rad_s`: the lag ([`Lag::frequency_response`](crate::Lag)) times
    /// that of each effect. The holds of the control loop and of the experiment's frames are not in it.
    #[must_use]
    pub fn frequency_response(&self, omega_rad_s: f64) -> Complex64 {
        self.effects.iter().fold(self.point.lag.frequency_response(omega_rad_s), |response, effect| {
            response * effect.response(&self.point, omega_rad_s)
        })
    }

    /// The effects that it leaves out, since they have no frequency response.
    pub fn left_out(&self) -> impl Iterator<Item = &ActiveEffect> {
        self.effects.iter().filter(|effect| effect.kind.linearity == Linearity::Absent)
    }
}

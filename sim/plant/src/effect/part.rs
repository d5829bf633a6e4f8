//! What a kind puts into the chain.

use crate::filter::ResponseStage;
use crate::integrated::IntegratedTerm;
use crate::rotor::RotorEffect;
use crate::stage::CommandStage;

/// The link that an effect is, by where it acts.
pub enum Part {
    /// None: the effect's values are its null values.
    Nothing,
    /// Other numbers of the lag.
    Base {
        /// By what gains and steady responses are multiplied.
        gain: f64,
        /// By what time constants are multiplied.
        time_constant: f64,
    },
    /// A link between command and rotor.
    Command(Box<dyn CommandStage>),
    /// A change of the rotor, or of what it is fed.
    Rotor(Box<dyn IntegratedTerm>),
    /// A link between rotor and logger.
    Response(Box<dyn ResponseStage>),
    /// The logger's clock: rows stamped `t` are taken at `t (1 + skew)`.
    Clock {
        /// The part by which the controller's clock is faster.
        skew: f64,
    },
}

impl Part {
    /// Acts on the command, before the rotor.
    pub fn command(stage: impl CommandStage + 'static) -> Self {
        Self::Command(Box::new(stage))
    }

    /// A term of the rotor's equation.
    pub fn rotor(term: impl RotorEffect + 'static) -> Self {
        Self::Rotor(Box::new(term))
    }

    /// Acts on the response, between rotor and logger.
    pub fn response(stage: impl ResponseStage + 'static) -> Self {
        Self::Response(Box::new(stage))
    }
}

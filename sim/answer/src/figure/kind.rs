//! What is drawn at all.

/// Every figure is of one of these kinds. `docs/figures.md` says of each how to read it, and a test
/// asks it for every one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureKind {
    /// A step without, with the lead and with the inverse.
    FlightStep,
    /// Frequency responses of the same.
    FlightResponse,
    /// Response over command at rest: the paper's Fig. 2.
    StaticMap,
    /// Frequency response of the stand: the paper's Fig. 3.
    StandResponse,
    /// Poles and zeros of the stand: the paper's Fig. 3.
    PoleZeroMap,
    /// What was played, and its spectrum: the paper's Fig. 4.
    Excitation,
    /// All frequency responses and the lags fitted to them: the paper's Fig. 5.
    Responses,
    /// One periodic record beside the model: the paper's Fig. 6.
    FrequencyValidation,
    /// One record over time beside the model: the paper's Fig. 7.
    TimeValidation,
    /// The model without and with the compensator: the paper's Fig. 8.
    SimulatedResponse,
    /// The compensator: the paper's Fig. 9.
    Compensator,
    /// What was measured without and with the compensator: the paper's Fig. 10.
    MeasuredResponse,
    /// Bandwidth against nominal command: the paper's Fig. 11.
    Bandwidth,
    /// The compensated response, simulated and measured: the paper's Fig. 12.
    SimulationAndExperiment,
    /// Two levels of the demonstration, models and measurements together.
    Demonstration,
    /// Steps of the demonstration, without and with compensators.
    DemonstratedSteps,
    /// Command and response of a record.
    Record,
    /// Steps of a staircase laid over each other.
    Steps,
    /// Time constants over operating points.
    TimeConstants,
    /// Time constants of two models.
    ComparedLags,
    /// Where a model is wrong.
    Where,
    /// What each effect, tried alone, explains.
    Candidates,
    /// How far each record is from the models.
    Gap,
    /// What is left of one record.
    Residual,
    /// Rate-loop bandwidths of a vehicle with different actuators.
    VehicleBandwidth,
    /// The open rate loop of a vehicle with different actuators.
    VehicleLoop,
    /// How far a torque turns a vehicle.
    VehicleDisturbance,
    /// A step of lateral force.
    VehicleForce,
}

impl FigureKind {
    /// All of them, in the order of the work.
    pub const ALL: [Self; 28] = [
        Self::FlightStep,
        Self::FlightResponse,
        Self::Record,
        Self::Excitation,
        Self::StaticMap,
        Self::Steps,
        Self::TimeConstants,
        Self::ComparedLags,
        Self::StandResponse,
        Self::PoleZeroMap,
        Self::Responses,
        Self::FrequencyValidation,
        Self::TimeValidation,
        Self::SimulatedResponse,
        Self::Compensator,
        Self::MeasuredResponse,
        Self::Bandwidth,
        Self::SimulationAndExperiment,
        Self::Demonstration,
        Self::DemonstratedSteps,
        Self::Where,
        Self::Candidates,
        Self::Gap,
        Self::Residual,
        Self::VehicleBandwidth,
        Self::VehicleLoop,
        Self::VehicleDisturbance,
        Self::VehicleForce,
    ];

    /// How the names of its files begin.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::FlightStep => "flight_step",
            Self::FlightResponse => "flight_response",
            Self::StaticMap => "static_map",
            Self::StandResponse => "stand_response",
            Self::PoleZeroMap => "pole_zero_map",
            Self::Excitation => "excitation",
            Self::Responses => "responses",
            Self::FrequencyValidation => "validation_in_frequency",
            Self::TimeValidation => "validation_in_time",
            Self::SimulatedResponse => "simulated_response",
            Self::Compensator => "compensator_response",
            Self::MeasuredResponse => "measured_response",
            Self::Bandwidth => "bandwidth",
            Self::SimulationAndExperiment => "simulation_and_experiment",
            Self::Demonstration => "bode",
            Self::DemonstratedSteps => "demonstrated_steps",
            Self::Record => "record",
            Self::Steps => "steps",
            Self::TimeConstants => "time_constants",
            Self::ComparedLags => "compared_time_constants",
            Self::Where => "where",
            Self::Candidates => "candidates",
            Self::Gap => "gap",
            Self::Residual => "residual",
            Self::VehicleBandwidth => "vehicle_bandwidth",
            Self::VehicleLoop => "vehicle_loop",
            Self::VehicleDisturbance => "vehicle_disturbance",
            Self::VehicleForce => "vehicle_force",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FigureKind;

    #[test]
    fn every_kind_is_listed_once_under_a_name_of_its_own() {
        // `ALL` has every kind: they are numbered without gaps, and none is there twice.
        let mut numbers = FigureKind::ALL.map(|kind| kind as usize);
        numbers.sort_unstable();
        assert_eq!(numbers.to_vec(), (0..FigureKind::ALL.len()).collect::<Vec<_>>());
        assert_eq!(FigureKind::VehicleForce as usize + 1, FigureKind::ALL.len(), "the last one is listed");
        let mut ids = FigureKind::ALL.map(FigureKind::id).to_vec();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), FigureKind::ALL.len());
    }
}

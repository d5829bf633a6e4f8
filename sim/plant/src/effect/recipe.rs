//! Which records tell two kinds of effects apart.

/// Periods of a square wave.
pub const SQUARE_PERIODS: u32 = 3;

/// The records of an experiment that tells kinds apart, by the amplitude, the nominal commands and the periods of those that did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// Multisines of these multiples of the amplitude.
    pub multisines: &'static [f64],
    /// Square waves of these multiples.
    pub squares: &'static [f64],
    /// Half the period of the square waves, seconds.
    pub square_half_s: f64,
    /// Their periods.
    pub square_periods: u32,
    /// Whether slow triangles belong to it.
    pub triangles: bool,
    /// Whether multisines go up to 44.9 Hz, and not to 29.9.
    pub is_fast: bool,
    /// Periods of a multisine over those of the records.
    pub times_longer: u32,
    /// Periods of a multisine at least; three times as many at most.
    pub least_periods: u32,
    /// All nominal commands, the highest first, and not a few of them.
    pub is_reversed: bool,
    /// Once more around nominal commands that are lower by the amplitude.
    pub is_lowered: bool,
    /// What has to be done beside the records; empty where nothing has.
    pub needs: &'static str,
}

impl Recipe {
    /// The same records once more.
    pub const PLAIN: Self = Self {
        multisines: &[1.0],
        squares: &[],
        square_half_s: 5.0,
        square_periods: SQUARE_PERIODS,
        triangles: false,
        is_fast: false,
        times_longer: 1,
        least_periods: 4,
        is_reversed: false,
        is_lowered: false,
        needs: "",
    };

    /// What follows the rate of the ESC's frames, and what does not.
    pub const OTHER_FRAMES: Self = Self {
        is_fast: true,
        times_longer: 2,
        least_periods: 8,
        needs: "Where the ESC's protocol can be set to another frame rate, do it all once more at half the rate: half a frame of \
                delay goes with it.",
        ..Self::PLAIN
    };

    /// What happens where the command turns.
    pub const SLOW_TURNS: Self = Self { multisines: &[0.3, 1.0], triangles: true, ..Self::PLAIN };

    /// What only the highest commands reach.
    pub const LOWERED: Self = Self { multisines: &[0.5, 1.0], is_lowered: true, ..Self::PLAIN };

    /// What depends on the amplitude.
    pub const AMPLITUDES: Self = Self { multisines: &[0.25, 0.5, 1.0, 2.0], squares: &[0.5, 2.0], ..Self::PLAIN };

    /// What depends on the direction, or on the operating point.
    pub const DIRECTIONS: Self = Self { multisines: &[0.5, 2.0], squares: &[0.5, 2.0], triangles: true, ..Self::PLAIN };

    /// What a load does over time.
    pub const LONG_LOADS: Self = Self {
        is_fast: true,
        squares: &[1.0],
        square_half_s: 20.0,
        times_longer: 3,
        least_periods: 12,
        is_reversed: true,
        needs: "Log voltage and current too. A bench supply in place of the battery takes sag away.",
        ..Self::PLAIN
    };

    /// What grows over a record.
    pub const LONG: Self = Self { times_longer: 5, least_periods: 30, ..Self::PLAIN };

    /// What shows at high frequencies.
    pub const HIGH_FREQUENCIES: Self = Self {
        is_fast: true,
        times_longer: 3,
        least_periods: 12,
        needs: "Log the speed too: a pole or a mode of sensor and stand is not in it.",
        ..Self::PLAIN
    };
}

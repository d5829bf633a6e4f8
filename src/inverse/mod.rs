//! The conditioned inverse: it makes a rotor follow a reference model at every operating point, and knows what the
//! command cannot do.
//!
//! A rotor follows its command `u` with the lag `dv/dt = (u - v) / tau(v)`. Its state `v` is the command whose steady
//! thrust it has at the moment. The command under which `v` follows the reference model
//!
//! ```text
//! d2v/dt2 = omega_f^2 (r - v) - 2 zeta omega_f dv/dt
//! ```
//!
//! from the reference `r` is `u = v + tau(v) dv/dt`. With a constant `tau` that is the lead compensator of
//! [`compensator`](crate::compensator) with its zero on `1 / tau`. With `tau(v)` the zero moves with the rotor.
//!
//! # Recurrence
//!
//! Once per tick, with `x` for the increment of `v` over `A`, about `(dv/dt) / omega_f`:
//!
//! ```text
//! 1.  x* = x + A (r - v) - B x                                reference model
//! 2.  u* = v + g(v) x*                                        inverse of the rotor, rounded to the step of the output
//! 3.  u  = u* within [max(min, u_p - s), min(max, u_p + s)]   limits of the range and of the slew
//! 4.  x  = x* + (u - u*) h(v) where step 3 limits, else x*    the increment that u really makes
//! 5.  v' = v + A x                                            within [min, max]
//! ```
//!
//! `u_p` is the last output and `s` the largest change of the output per tick. With the tick `T`,
//! `E = exp(-zeta omega_f T)` and `omega_d = omega_f sqrt(1 - zeta^2)`,
//!
//! ```text
//! A^2 = 1 + E^2 - 2 E cos(omega_d T)      B = 1 - E^2
//! g_i = A / (1 - exp(-T / tau(i / 32)))   h_i = 1 / g_i       i = 0..32, linear in v between
//! ```
//!
//! These are exact for an output that is held over the tick. Step 4 conditions the state (Hanus): after a limited tick it
//! is that of a rotor that got `u`, not `u*`, so nothing winds up. It uses `u*` before rounding: from `(u - v) h(v)` in
//! its place, the error of interpolating both `g` and `1 / g` would enter the state.
//!
//! # Formats
//!
//! | symbol | what it is | format |
//! |---|---|---|
//! | `v`, `r`, `u` | command, within [0, 1] | Q2.29 in an `i32` |
//! | `x` | increment of `v`, over `A` | Q2.29 in an `i32` |
//! | `u*` | command before rounding and limits | 51 bits after the point in an `i64` |
//! | `A`, `B`, `h` | coefficients, within [0, 2) | Q1.30 in an `i32` |
//! | `g` | gain of the inverse, within (1/2, 512) | Q9.22 in an `i32` |
//!
//! Products are 64 bits wide and rounded to the nearest, halves upward. `r` is rounded to the step of the output, 2^-16, and
//! `min`, `max` and `s` inward to it.
//!
//! - **The steady output is the reference**, rounded to 2^-16, to the last bit. Condition: the rounding errors of steps 1
//!   and 5 move `u*` by less than half a step of the output, which [`crate::design::InverseDesign`] checks.
//! - **Nothing overflows**, whatever the inputs. Condition: `1/2 < g < 512`, and neighbors of the table differ by at most
//!   a factor of 1.25, which [`Coefficients`] guarantees.
//!
//! `docs/inverse.md` has both arguments.

mod coefficients;
mod fixed_point;
mod output_limits;
mod recurrence;

pub(crate) use coefficients::TableError;
pub use coefficients::{COEFFICIENT_BITS, Coefficients, GAIN_BITS, TABLE_POINTS};
pub use output_limits::{Limits, OUTPUT_BITS, SlewLimit};
pub use recurrence::ConditionedInverse;

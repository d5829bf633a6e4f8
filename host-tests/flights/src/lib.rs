//! Flights of a quadrotor with motors that are known, for proving what is estimated from logs of flights.
//!
//! - A **vehicle** ([`vehicle`]) is drawn from a seed: four motors that differ a little, a battery, a frame, a rate controller that is
//!   tuned for it, and a logger.
//! - A **motor** ([`motor`]) turns by `J dw/dt = K/R (u V - K w) - Q(w, inflow)`, with a drag torque that is the square of its speed,
//!   so that its time constant falls as it speeds up.
//! - A **flight** ([`flight`]) closes the loop around all of it: gyroscopes with noise, filters, PID, a mixer that saturates, gusts
//!   that reach rotors and frame alike, a pilot, and a battery that sags.
//! - The **telemetry** ([`telemetry`]) is that of bidirectional DShot: a period of nine bits with an exponent, repeated where a reply
//!   is lost, and held where replies are few.
//! - The **blackbox** ([`blackbox`]) is the flight as Betaflight logs it.
//!
//! The truth is the time constant of small motions of one motor at an operating point ([`vehicle::Vehicle::time_constant_s`]),
//! linearized from the physics, the battery's resistance included.

pub mod blackbox;
pub mod flight;
pub mod motor;
pub mod pilot;
pub mod telemetry;
pub mod vehicle;

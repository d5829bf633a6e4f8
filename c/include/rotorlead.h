/*
 * Rotorlead for firmware in C99 or later, or C++11 or later. MIT license.
 *
 * No function allocates memory, waits, or keeps anything but in the compensator that it gets. A compensator belongs to one
 * task at a time. Every function says how it ended: docs/c-interface.md.
 *
 * Written by `cargo xtask docs` from c/src.
 */

#ifndef ROTORLEAD_H
#define ROTORLEAD_H

#include <stddef.h>
#include <stdint.h>

// Words of a compensator.
#define ROTORLEAD_COMPENSATOR_WORDS 102

// What a call ends with: 0 where it did what was asked. `rotorlead_status_text` has the words.
enum rotorlead_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    ROTORLEAD_STATUS_OK = 0,
    // A pointer is NULL, or is not aligned for its type.
    ROTORLEAD_STATUS_BAD_POINTER = 1,
    // The compensator has no design, or others have written to it.
    ROTORLEAD_STATUS_NOT_DESIGNED = 2,
    // The command is infinite or NaN. It was taken for 0.
    ROTORLEAD_STATUS_COMMAND_NOT_FINITE = 3,
    // No pole or point was given.
    ROTORLEAD_STATUS_NO_POINTS = 4,
    // More than 33 poles or points were given.
    ROTORLEAD_STATUS_TOO_MANY_POINTS = 5,
    // A pole is not within 0.001 to 1e6 rad/s.
    ROTORLEAD_STATUS_POLE_OUT_OF_RANGE = 6,
    // `omega_g_rad_s` is not within 0.001 to 1e6 rad/s.
    ROTORLEAD_STATUS_OMEGA_G_OUT_OF_RANGE = 7,
    // `omega_z_rad_s` is not within 0.001 to 1e6 rad/s.
    ROTORLEAD_STATUS_OMEGA_Z_OUT_OF_RANGE = 8,
    // `omega_f_rad_s` is not within 0.001 to 1e6 rad/s.
    ROTORLEAD_STATUS_OMEGA_F_OUT_OF_RANGE = 9,
    // `damping` is not within 0.3 to 2.
    ROTORLEAD_STATUS_DAMPING_OUT_OF_RANGE = 10,
    // `loop_rate_hz` is not within 50 to 100000 Hz.
    ROTORLEAD_STATUS_LOOP_RATE_OUT_OF_RANGE = 11,
    // `min` or `max` is not within 0 to 1, or `min` is above `max`.
    ROTORLEAD_STATUS_LIMITS_OUT_OF_RANGE = 12,
    // The zero is not below the poles.
    ROTORLEAD_STATUS_ZERO_NOT_BELOW_POLES = 13,
    // `omega_f_rad_s` is too fast for the loop rate.
    ROTORLEAD_STATUS_TOO_CLOSE_TO_NYQUIST = 14,
    // A coefficient of the section does not fit its format.
    ROTORLEAD_STATUS_COEFFICIENT_OUT_OF_RANGE = 15,
    // The output of the section could leave its headroom.
    ROTORLEAD_STATUS_L1_GAIN_TOO_HIGH = 16,
    // The command of a point is not within 0 to 1.
    ROTORLEAD_STATUS_POINT_COMMAND_OUT_OF_RANGE = 17,
    // The time constant of a point is not within 1e-6 to 1000 s.
    ROTORLEAD_STATUS_POINT_TAU_OUT_OF_RANGE = 18,
    // The commands of the points do not increase.
    ROTORLEAD_STATUS_POINTS_NOT_INCREASING = 19,
    // The rotor is too fast for the reference model.
    ROTORLEAD_STATUS_ROTOR_TOO_FAST = 20,
    // The rotor is too slow for the reference model.
    ROTORLEAD_STATUS_ROTOR_TOO_SLOW = 21,
    // The time constant changes too fast over the command.
    ROTORLEAD_STATUS_CURVE_TOO_STEEP = 22,
    // The reference model settles in too many ticks.
    ROTORLEAD_STATUS_RESPONSE_TOO_LONG = 23,
    // Rounding could move the steady output.
    ROTORLEAD_STATUS_ROUNDING_TOO_LARGE = 24,
    // `slew_per_s` is not within 0 to 1e6.
    ROTORLEAD_STATUS_SLEW_OUT_OF_RANGE = 25,
    // `slew_per_s` is less than a step of the output per tick.
    ROTORLEAD_STATUS_SLEW_TOO_SLOW = 26,
    // `compensate_from` or `compensate_to` is not within 0 to 1, or the first is above the second.
    ROTORLEAD_STATUS_COMPENSATE_RANGE_OUT_OF_RANGE = 27,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rotorlead_status rotorlead_status;
#else
typedef int32_t rotorlead_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A command: 0 is the bottom of the pulse range and 1 its top. A structure, so that no number is taken for one in silence.
typedef struct rotorlead_command {
    // In steps of 2^-29: 0 to 536870912. Beyond these the nearer end is meant.
    int32_t q29;
} rotorlead_command;

// The compensator of one motor. It holds its design and its state, and no pointer: it may be copied, and one design serves as
// many motors as there are copies. It is for the functions of this header alone. Zeroed, it is one without a design. Whatever else
// writes to it, a step stays within it and gives 0 to 1.
typedef struct rotorlead_compensator {
    // Nothing for the caller.
    uint32_t words[ROTORLEAD_COMPENSATOR_WORDS];
} rotorlead_compensator;

// The lead compensator `omega_f^2 (s / omega_z + 1) / (s^2 + 2 damping omega_f s + omega_f^2)`.
typedef struct rotorlead_lead {
    // Frequency of the zero, which stands on the pole of the fastest motor, rad/s: 0.001 to 1e6, and below `omega_f_rad_s`.
    double omega_z_rad_s;
    // Frequency of the pair of poles, rad/s; at most 0.4 per tick.
    double omega_f_rad_s;
    // Damping ratio of the poles, 0.3 to 2. 0.7071 does not overshoot.
    double damping;
    // Largest change of the output, units of the command per second; 0 for no limit. The slowest that the ESC may have.
    double slew_per_s;
} rotorlead_lead;

// The conditioned inverse along the reference model `omega_f^2 / (s^2 + 2 damping omega_f s + omega_f^2)`.
typedef struct rotorlead_inverse {
    // Natural frequency, rad/s; at most 0.4 per tick.
    double omega_f_rad_s;
    // Damping ratio, 0.3 to 2.
    double damping;
    // Largest change of the output, units of the command per second; 0 for no limit. The slowest that the ESC may have.
    double slew_per_s;
    // The inverse is left out for commands below this, 0 to 1: where the time constant was not measured.
    double compensate_from;
    // The inverse is left out for commands above this, 0 to 1.
    double compensate_to;
} rotorlead_inverse;

// A rotor's time constant at an operating point.
typedef struct rotorlead_point {
    // The command at which the rotor rests, 0 to 1.
    double command;
    // Its time constant there, seconds, 1e-6 to 1000.
    double tau_s;
} rotorlead_point;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The command nearest to a number, 0 to 1. Beyond these it is the nearer end, and 0 for an infinity and NaN.
struct rotorlead_command rotorlead_command_from_float(float value);

// The number nearest to a command, 0 to 1.
float rotorlead_command_to_float(struct rotorlead_command command);

// One control tick: takes the command of the mixer and gives that for the ESC, within the limits of the design. Call it once per
// tick, at the rate of the design.
//
// Where it fails the output is 0. With a command that is infinite or NaN it goes on as with 0.
//
// `compensator` is NULL, or points to one that no one else uses meanwhile. `output` is NULL or points to a float.
rotorlead_status rotorlead_step_float(struct rotorlead_compensator *compensator,
                                      float command,
                                      float *output);

// The same with commands as they are in the filter, which saves the conversions.
//
// As of `rotorlead_step_float`.
rotorlead_status rotorlead_step(struct rotorlead_compensator *compensator,
                                struct rotorlead_command command,
                                struct rotorlead_command *output);

// Puts the compensator at rest at a command: as long as that is the command, it is the output. For the tick before the motor
// starts. The output may jump.
//
// As of `rotorlead_step_float`.
rotorlead_status rotorlead_reset(struct rotorlead_compensator *compensator,
                                 struct rotorlead_command level);

// Puts the filter at rest at a command while the motor runs, as after an outage of the commands. The output does not jump: it
// goes there with the time constant of the filter.
//
// As of `rotorlead_step_float`.
rotorlead_status rotorlead_restart(struct rotorlead_compensator *compensator,
                                   struct rotorlead_command level);

// Switches the filter into the path of the command (any number but 0, as it begins) or leaves it out (0), from the next tick on and
// without a jump of the output.
//
// As of `rotorlead_step_float`.
rotorlead_status rotorlead_set_enabled(struct rotorlead_compensator *compensator,
                                       int32_t enabled);

// The paper's lead from 1 to 33 identified poles `1 / tau` and the highest frequency that is to be amplified, all rad/s: the
// zero on the fastest pole, the poles at the geometric mean, and no overshoot.
//
// `slew_per_s` becomes 20, 2 % per millisecond: the slowest of the ESCs whose slew is known, and what Rotorlead's own controller
// begins with. Set it to your ESC's, or to 0 for the paper's lead, which has no limit.
//
// `poles_rad_s` is NULL or points to `count` doubles, and `lead` is NULL or points to a `rotorlead_lead`.
rotorlead_status rotorlead_lead_from_poles(const double *poles_rad_s,
                                           size_t count,
                                           double omega_g_rad_s,
                                           struct rotorlead_lead *lead);

// Designs a lead for a loop rate, 50 to 100000 Hz, with outputs within `min` to `max`, 0 to 1. It is at rest at `min`.
//
// Where it fails the compensator is what it was before.
//
// Each pointer is NULL or points to one of its type; nobody else uses the compensator meanwhile.
rotorlead_status rotorlead_design_lead(struct rotorlead_compensator *compensator,
                                       const struct rotorlead_lead *lead,
                                       double loop_rate_hz,
                                       double min,
                                       double max);

// Designs an inverse of the rotor with the curve through 1 to 33 points, in increasing order of the command, for a loop rate, 50
// to 100000 Hz, with outputs within `min` to `max`, 0 to 1. It is at rest at `min`.
//
// Where it fails the compensator is what it was before.
//
// Each pointer is NULL or points to one of its type, and `points` to `count` of them; nobody else uses the compensator
// meanwhile.
rotorlead_status rotorlead_design_inverse(struct rotorlead_compensator *compensator,
                                          const struct rotorlead_inverse *inverse,
                                          const struct rotorlead_point *points,
                                          size_t count,
                                          double loop_rate_hz,
                                          double min,
                                          double max);

// What a status means and what to do, in English; never NULL, and never to be freed.
const char *rotorlead_status_text(int32_t status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ROTORLEAD_H */

#if defined(__cplusplus)
static_assert(sizeof(rotorlead_compensator) == 4 * ROTORLEAD_COMPENSATOR_WORDS, "a packed compensator");
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
_Static_assert(sizeof(rotorlead_compensator) == 4 * ROTORLEAD_COMPENSATOR_WORDS, "a packed compensator");
#endif

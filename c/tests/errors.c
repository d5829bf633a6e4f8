/* Provokes every status, and prints its number and text; fails where another one comes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "rotorlead.h"

static int failed = 0;

static void expect(int line, rotorlead_status expected, rotorlead_status found)
{
    printf("%d %s\n", (int)found, rotorlead_status_text(found));
    if (found != expected) {
        fprintf(stderr, "line %d: expected %d\n", line, (int)expected);
        failed = 1;
    }
}

#define EXPECT(name, call) expect(__LINE__, ROTORLEAD_STATUS_##name, call)

static rotorlead_compensator compensator;

/* Each with the others right. */
static rotorlead_status lead_of(double omega_z, double omega_f, double damping, double rate)
{
    const rotorlead_lead lead = { omega_z, omega_f, damping, 20.0 };
    return rotorlead_design_lead(&compensator, &lead, rate, 0.0, 1.0);
}

static rotorlead_status lead_of_slew(double slew)
{
    const rotorlead_lead lead = { 14.0, 94.0, 0.7, slew };
    return rotorlead_design_lead(&compensator, &lead, 8000.0, 0.0, 1.0);
}

static rotorlead_status lead_within(double min, double max)
{
    const rotorlead_lead lead = { 14.0, 94.0, 0.7, 20.0 };
    return rotorlead_design_lead(&compensator, &lead, 8000.0, min, max);
}

static rotorlead_status inverse_of(double omega_f, double damping, double slew, double tau_s, double rate)
{
    const rotorlead_inverse inverse = { omega_f, damping, slew, 0.0, 1.0 };
    const rotorlead_point point = { 0.5, tau_s };
    return rotorlead_design_inverse(&compensator, &inverse, &point, 1, rate, 0.0, 1.0);
}

static rotorlead_status inverse_through(double command, double tau_s, double next, double next_tau_s)
{
    const rotorlead_inverse inverse = { 94.0, 0.7, 0.0, 0.0, 1.0 };
    const rotorlead_point points[] = { { command, tau_s }, { next, next_tau_s } };
    return rotorlead_design_inverse(&compensator, &inverse, points, 2, 8000.0, 0.0, 1.0);
}

static rotorlead_status inverse_for(double from, double to, double min, double max)
{
    const rotorlead_inverse inverse = { 94.0, 0.7, 0.0, from, to };
    const rotorlead_point point = { 0.5, 0.1 };
    return rotorlead_design_inverse(&compensator, &inverse, &point, 1, 8000.0, min, max);
}

static rotorlead_status from_pole(double pole, double omega_g)
{
    rotorlead_lead lead;
    return rotorlead_lead_from_poles(&pole, 1, omega_g, &lead);
}

/* The second word of some: no compensator, lead or double may begin there. */
static void *misaligned(void *pointer)
{
    return (char *)pointer + 1;
}

static void bad_pointers(void)
{
    static const rotorlead_lead lead = { 14.0, 94.0, 0.7, 20.0 };
    static const rotorlead_inverse inverse = { 94.0, 0.7, 0.0, 0.0, 1.0 };
    static const rotorlead_point point = { 0.5, 0.1 };
    static const rotorlead_command half = { 1 << 28 };
    double poles[2] = { 14.0, 14.0 };
    rotorlead_lead made;
    rotorlead_command command;
    float number;
    EXPECT(BAD_POINTER, rotorlead_lead_from_poles(NULL, 1, 600.0, &made));
    EXPECT(BAD_POINTER, rotorlead_lead_from_poles(misaligned(poles), 1, 600.0, &made));
    EXPECT(BAD_POINTER, rotorlead_lead_from_poles(poles, 1, 600.0, NULL));
    EXPECT(BAD_POINTER, rotorlead_design_lead(NULL, &lead, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_design_lead(misaligned(&compensator), &lead, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_design_lead(&compensator, NULL, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_design_inverse(NULL, &inverse, &point, 1, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_design_inverse(&compensator, NULL, &point, 1, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_design_inverse(&compensator, &inverse, NULL, 1, 8000.0, 0.0, 1.0));
    EXPECT(BAD_POINTER, rotorlead_step_float(NULL, 0.5f, &number));
    EXPECT(BAD_POINTER, rotorlead_step_float(misaligned(&compensator), 0.5f, &number));
    EXPECT(BAD_POINTER, rotorlead_step_float(&compensator, 0.5f, NULL));
    EXPECT(BAD_POINTER, rotorlead_step(NULL, half, &command));
    EXPECT(BAD_POINTER, rotorlead_step(&compensator, half, NULL));
    EXPECT(BAD_POINTER, rotorlead_reset(NULL, half));
    EXPECT(BAD_POINTER, rotorlead_restart(NULL, half));
    EXPECT(BAD_POINTER, rotorlead_set_enabled(NULL, 1));
}

/* A failed step gives 0, and a refused design leaves the one before. */
static void nothing_is_left_open(void)
{
    static rotorlead_compensator zeroed;
    static const rotorlead_command half = { 1 << 28 };
    rotorlead_compensator before;
    rotorlead_command command = half;
    float number = 0.5f;
    EXPECT(NOT_DESIGNED, rotorlead_step_float(&zeroed, 0.5f, &number));
    EXPECT(NOT_DESIGNED, rotorlead_step(&zeroed, half, &command));
    EXPECT(NOT_DESIGNED, rotorlead_reset(&zeroed, half));
    EXPECT(NOT_DESIGNED, rotorlead_restart(&zeroed, half));
    EXPECT(NOT_DESIGNED, rotorlead_set_enabled(&zeroed, 0));
    if (number != 0.0f || command.q29 != 0) {
        fprintf(stderr, "a step that fails gives no 0\n");
        failed = 1;
    }
    number = 0.5f;
    EXPECT(BAD_POINTER, rotorlead_step_float(NULL, 0.5f, &number));
    EXPECT(OK, lead_within(0.0, 1.0));
    EXPECT(OK, rotorlead_reset(&compensator, half));
    memcpy(&before, &compensator, sizeof before);
    EXPECT(LIMITS_OUT_OF_RANGE, lead_within(-0.1, 1.0));
    EXPECT(ROTOR_TOO_FAST, inverse_of(94.0, 0.7, 0.0, 0.001, 8000.0));
    if (number != 0.0f || memcmp(&before, &compensator, sizeof before) != 0) {
        fprintf(stderr, "a design that is refused changes the compensator\n");
        failed = 1;
    }
}

/* Not full throttle, as the number above 1 that it is: what divides by 0 asks for nothing. */
static void a_command_that_is_not_finite_is_0(void)
{
    static const float none[] = { NAN, INFINITY, -INFINITY };
    unsigned count;
    EXPECT(OK, lead_within(0.0, 1.0));
    for (count = 0; count < sizeof none / sizeof none[0]; count++) {
        rotorlead_compensator with_0 = compensator;
        float expected;
        float number;
        EXPECT(OK, rotorlead_reset(&compensator, rotorlead_command_from_float(0.5f)));
        with_0 = compensator;
        EXPECT(OK, rotorlead_step_float(&with_0, 0.0f, &expected));
        EXPECT(COMMAND_NOT_FINITE, rotorlead_step_float(&compensator, none[count], &number));
        if (number != expected || number >= 0.5f || rotorlead_command_from_float(none[count]).q29 != 0) {
            fprintf(stderr, "%g is not taken for 0\n", (double)none[count]);
            failed = 1;
        }
    }
}

/* Also one whose lowest bits are 0. A switch there and back changes nothing. */
static void any_number_but_0_switches_in(void)
{
    static const int32_t numbers[] = { 1, 2, 256, -1, INT32_MIN };
    unsigned count;
    EXPECT(OK, lead_within(0.0, 1.0));
    EXPECT(OK, rotorlead_reset(&compensator, rotorlead_command_from_float(0.5f)));
    for (count = 0; count < sizeof numbers / sizeof numbers[0]; count++) {
        rotorlead_compensator untouched = compensator;
        rotorlead_compensator switched = compensator;
        float expected;
        float number;
        EXPECT(OK, rotorlead_set_enabled(&switched, 0));
        EXPECT(OK, rotorlead_set_enabled(&switched, numbers[count]));
        EXPECT(OK, rotorlead_step_float(&untouched, 0.51f, &expected));
        EXPECT(OK, rotorlead_step_float(&switched, 0.51f, &number));
        if (number != expected) {
            fprintf(stderr, "%ld leaves the filter out\n", (long)numbers[count]);
            failed = 1;
        }
    }
}

int main(void)
{
    static double many[34];
    rotorlead_lead lead;
    bad_pointers();
    nothing_is_left_open();
    a_command_that_is_not_finite_is_0();
    any_number_but_0_switches_in();

    EXPECT(NO_POINTS, rotorlead_lead_from_poles(many, 0, 600.0, &lead));
    EXPECT(TOO_MANY_POINTS, rotorlead_lead_from_poles(many, 34, 600.0, &lead));
    EXPECT(TOO_MANY_POINTS, rotorlead_lead_from_poles(many, (size_t)-1, 600.0, &lead));
    EXPECT(POLE_OUT_OF_RANGE, from_pole(0.0, 600.0));
    EXPECT(OMEGA_G_OUT_OF_RANGE, from_pole(14.0, INFINITY));
    EXPECT(ZERO_NOT_BELOW_POLES, from_pole(14.0, 14.0));

    EXPECT(OMEGA_Z_OUT_OF_RANGE, lead_of(0.0, 94.0, 0.7, 8000.0));
    EXPECT(OMEGA_F_OUT_OF_RANGE, lead_of(14.0, NAN, 0.7, 8000.0));
    EXPECT(DAMPING_OUT_OF_RANGE, lead_of(14.0, 94.0, 0.2, 8000.0));
    EXPECT(LOOP_RATE_OUT_OF_RANGE, lead_of(14.0, 94.0, 0.7, 49.0));
    EXPECT(ZERO_NOT_BELOW_POLES, lead_of(94.0, 94.0, 0.7, 8000.0));
    EXPECT(TOO_CLOSE_TO_NYQUIST, lead_of(14.0, 94.0, 0.7, 200.0));
    EXPECT(COEFFICIENT_OUT_OF_RANGE, lead_of(14.0, 1900.0, 0.7, 5000.0));
    EXPECT(L1_GAIN_TOO_HIGH, lead_of(5.0, 94.0, 0.7, 8000.0));
    EXPECT(OK, lead_of_slew(0.0));
    EXPECT(SLEW_OUT_OF_RANGE, lead_of_slew(-1.0));
    EXPECT(SLEW_OUT_OF_RANGE, lead_of_slew(INFINITY));
    EXPECT(SLEW_TOO_SLOW, lead_of_slew(0.01));
    EXPECT(LIMITS_OUT_OF_RANGE, lead_within(0.6, 0.5));
    EXPECT(LIMITS_OUT_OF_RANGE, lead_within(0.0, NAN));

    EXPECT(OK, inverse_of(94.0, 0.7, 160.0, 0.1, 8000.0));
    EXPECT(OMEGA_F_OUT_OF_RANGE, inverse_of(-1.0, 0.7, 0.0, 0.1, 8000.0));
    EXPECT(DAMPING_OUT_OF_RANGE, inverse_of(94.0, 3.0, 0.0, 0.1, 8000.0));
    EXPECT(LOOP_RATE_OUT_OF_RANGE, inverse_of(94.0, 0.7, 0.0, 0.1, NAN));
    EXPECT(TOO_CLOSE_TO_NYQUIST, inverse_of(94.0, 0.7, 0.0, 0.1, 200.0));
    EXPECT(POINT_COMMAND_OUT_OF_RANGE, inverse_through(-0.1, 0.1, 0.5, 0.1));
    EXPECT(POINT_TAU_OUT_OF_RANGE, inverse_through(0.4, 0.1, 0.5, 0.0));
    EXPECT(POINTS_NOT_INCREASING, inverse_through(0.5, 0.1, 0.5, 0.1));
    EXPECT(CURVE_TOO_STEEP, inverse_through(0.5, 0.05, 0.51, 0.1));
    EXPECT(ROTOR_TOO_FAST, inverse_of(94.0, 0.7, 0.0, 0.001, 8000.0));
    EXPECT(ROTOR_TOO_SLOW, inverse_of(94.0, 0.7, 0.0, 10.0, 8000.0));
    EXPECT(RESPONSE_TOO_LONG, inverse_of(10.0, 2.0, 0.0, 0.1, 100000.0));
    EXPECT(ROUNDING_TOO_LARGE, inverse_of(94.0, 0.7, 0.0, 1.0, 20000.0));
    EXPECT(SLEW_OUT_OF_RANGE, inverse_of(94.0, 0.7, -1.0, 0.1, 8000.0));
    EXPECT(SLEW_TOO_SLOW, inverse_of(94.0, 0.7, 0.01, 0.1, 8000.0));
    EXPECT(COMPENSATE_RANGE_OUT_OF_RANGE, inverse_for(0.7, 0.3, 0.0, 1.0));
    EXPECT(COMPENSATE_RANGE_OUT_OF_RANGE, inverse_for(0.0, 1.1, 0.0, 1.0));
    EXPECT(LIMITS_OUT_OF_RANGE, inverse_for(0.0, 1.0, 1.0, 0.0));
    return failed;
}

/*
 * Four motors with the lead compensator, as a flight controller has them: designed once, then one step per motor and tick.
 * Prints what each ESC would get, as the bits of a float. Its arguments are the loop rate in Hz and the slew limit per second.
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "rotorlead.h"

enum { MOTORS = 4, TICKS = 5000 };

/* Command of a motor that is armed and idles, and what stops it. */
static const float IDLE = 0.05f;
static const float STOP = 0.0f;

static rotorlead_compensator motors[MOTORS];

/* Poles 1 / tau of the identified motors, and the highest frequency that is to be amplified, rad/s. The slew limit is the usual one
 * where it is NULL. */
static rotorlead_status design(double loop_rate_hz, const char *slew_per_s)
{
    static const double poles_rad_s[] = { 6.2758, 9.2889, 14.1275 };
    rotorlead_lead lead;
    rotorlead_status status = rotorlead_lead_from_poles(poles_rad_s, 3, 628.32, &lead);
    if (slew_per_s != NULL) {
        lead.slew_per_s = strtod(slew_per_s, NULL);
    }
    if (status == ROTORLEAD_STATUS_OK) {
        status = rotorlead_design_lead(&motors[0], &lead, loop_rate_hz, (double)IDLE, 1.0);
    }
    /* One design serves all: a compensator holds no pointer. */
    for (int motor = 1; motor < MOTORS; motor++) {
        motors[motor] = motors[0];
    }
    return status;
}

/* One tick of one motor. What stops it never passes through the filter, which waits at rest. */
static float esc_command(rotorlead_compensator *motor, bool is_armed, float command)
{
    float shaped;
    if (!is_armed) {
        (void)rotorlead_reset(motor, rotorlead_command_from_float(IDLE));
        return STOP;
    }
    if (rotorlead_step_float(motor, command, &shaped) != ROTORLEAD_STATUS_OK) {
        return STOP;
    }
    return shaped;
}

/* In place of a mixer: holds each command for 100 ticks. */
static float mixer(int tick, int motor)
{
    uint32_t random = (uint32_t)(tick / 100 * MOTORS + motor + 1) * UINT32_C(2654435761);
    return IDLE + (1.0f - IDLE) * (float)(random >> 8) / 16777216.0f;
}

int main(int count, char **arguments)
{
    double loop_rate_hz = count > 1 ? strtod(arguments[1], NULL) : 8000.0;
    rotorlead_status status = design(loop_rate_hz, count > 2 ? arguments[2] : NULL);
    if (status != ROTORLEAD_STATUS_OK) {
        fprintf(stderr, "%s\n", rotorlead_status_text(status));
        return 1;
    }
    for (int tick = 0; tick < TICKS; tick++) {
        /* Disarmed for a while in flight, too. */
        bool is_armed = tick >= 50 && tick / 1000 != 3;
        for (int motor = 0; motor < MOTORS; motor++) {
            float output = esc_command(&motors[motor], is_armed, mixer(tick, motor));
            uint32_t bits;
            memcpy(&bits, &output, sizeof bits);
            printf("%08" PRIx32 "\n", bits);
        }
    }
    return 0;
}

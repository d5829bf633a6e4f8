/*
 * Changes each word of a compensator behind the library's back, bit by bit and at random, in every state that it can be in, and
 * goes on: nothing faults, every output is within 0 to 1, and it is 0 with a status where the memory holds no compensator.
 * Prints for each kind how many of the bits, in all states, are refused by a call that looks at nothing but that.
 */
#include <stdbool.h>
#include <stdio.h>

#include "rotorlead.h"

enum { BITS = 32, CHANGES = 64, STEPS = 12 };

static const rotorlead_command LOW = { 1 << 26 };
static const rotorlead_command HALF = { 1 << 28 };
static const rotorlead_command HIGH = { 1 << 29 };

static int failed = 0;

static void expect(bool is_so, const char *what)
{
    if (!is_so) {
        fprintf(stderr, "%s\n", what);
        failed = 1;
    }
}

static uint32_t scattered(uint32_t number)
{
    number *= UINT32_C(2654435761);
    return number ^ number >> 15;
}

/* Ticks of both kinds under commands that every limit meets, and a switch. */
static void steps(rotorlead_compensator *motor)
{
    int tick;
    for (tick = 0; tick < STEPS; tick++) {
        rotorlead_command output = HALF;
        float number = 0.5f;
        rotorlead_status status = rotorlead_step(motor, tick % 4 < 2 ? LOW : HIGH, &output);
        expect(0 <= output.q29 && output.q29 <= HIGH.q29, "an output is beyond 0 to 1");
        expect(status == ROTORLEAD_STATUS_OK || output.q29 == 0, "a step that fails gives no 0");
        status = rotorlead_step_float(motor, 0.4f + 0.05f * (float)tick, &number);
        expect(0.0f <= number && number <= 1.0f, "an output is beyond 0 to 1");
        expect(status == ROTORLEAD_STATUS_OK || number == 0.0f, "a step that fails gives no 0");
        if (tick == STEPS / 2) {
            (void)rotorlead_set_enabled(motor, 0);
        }
    }
}

/* Puts the compensator into one of its states; false where there are no more. */
static bool put_into(int state, rotorlead_compensator *motor)
{
    rotorlead_command output;
    switch (state) {
    case 0:
        return true;
    case 1:
        return rotorlead_set_enabled(motor, 0) == ROTORLEAD_STATUS_OK;
    case 2:
        return rotorlead_restart(motor, LOW) == ROTORLEAD_STATUS_OK;
    case 3:
        /* With an offset that decays. */
        (void)rotorlead_restart(motor, LOW);
        return rotorlead_step(motor, HIGH, &output) == ROTORLEAD_STATUS_OK;
    case 4:
        (void)rotorlead_set_enabled(motor, 0);
        return rotorlead_reset(motor, HALF) == ROTORLEAD_STATUS_OK;
    default:
        return false;
    }
}

/* Each call on a copy: it finds the memory as it was changed. */
static bool use(const rotorlead_compensator *changed)
{
    rotorlead_compensator motor = *changed;
    steps(&motor);
    motor = *changed;
    (void)rotorlead_set_enabled(&motor, 0);
    steps(&motor);
    motor = *changed;
    (void)rotorlead_reset(&motor, HIGH);
    steps(&motor);
    motor = *changed;
    if (rotorlead_restart(&motor, HIGH) != ROTORLEAD_STATUS_OK) {
        return false;
    }
    steps(&motor);
    return true;
}

static void change(const char *kind, const rotorlead_compensator *designed)
{
    int refused = 0;
    int state;
    rotorlead_compensator before = *designed;
    for (state = 0; put_into(state, &before); state++, before = *designed) {
        int word;
        int number;
        expect(use(&before), "a compensator is refused that nobody has changed");
        for (word = 0; word < ROTORLEAD_COMPENSATOR_WORDS; word++) {
            for (number = 0; number < CHANGES; number++) {
                const bool is_bit = number < BITS;
                rotorlead_compensator changed = before;
                changed.words[word] ^= is_bit ? UINT32_C(1) << number : scattered((uint32_t)(word * CHANGES + number));
                refused += !use(&changed) && is_bit;
            }
        }
    }
    printf("%s %d\n", kind, refused);
}

int main(void)
{
    rotorlead_lead lead = { 14.0, 94.0, 0.7, 20.0 };
    const rotorlead_inverse inverse = { 94.0, 0.7, 160.0, 0.1, 0.9 };
    const rotorlead_point points[] = { { 0.4, 0.16 }, { 0.6, 0.08 } };
    static rotorlead_compensator motor;
    expect(rotorlead_design_lead(&motor, &lead, 8000.0, 0.05, 1.0) == ROTORLEAD_STATUS_OK, "no lead");
    (void)rotorlead_reset(&motor, HALF);
    change("lead", &motor);
    lead.slew_per_s = 0.0;
    expect(rotorlead_design_lead(&motor, &lead, 8000.0, 0.05, 1.0) == ROTORLEAD_STATUS_OK, "no lead");
    (void)rotorlead_reset(&motor, HALF);
    change("unlimited lead", &motor);
    expect(rotorlead_design_inverse(&motor, &inverse, points, 2, 8000.0, 0.05, 1.0) == ROTORLEAD_STATUS_OK, "no inverse");
    (void)rotorlead_reset(&motor, HALF);
    change("inverse", &motor);
    return failed;
}

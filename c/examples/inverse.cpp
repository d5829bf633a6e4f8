// One motor with the conditioned inverse in C++, with commands as integers: without a conversion in the loop.
// Prints what the ESC would get, in steps of 2^-29.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "rotorlead.h"

namespace {

// A compensator that was designed.
class Motor {
public:
    // `status` says whether it was.
    Motor(double loop_rate_hz, rotorlead_status &status)
    {
        // Time constants that were identified, and commands at which they were.
        static const rotorlead_point points[] = {
            {0.40, 0.1593}, {0.45, 0.1360}, {0.50, 0.1077}, {0.55, 0.1009}, {0.60, 0.0852}, {0.65, 0.0708},
        };
        // 16 % per millisecond, and 0.05 beyond what was measured.
        const rotorlead_inverse inverse = {94.2, 0.71, 160.0, 0.35, 0.70};
        status = rotorlead_design_inverse(&compensator, &inverse, points, sizeof points / sizeof points[0], loop_rate_hz, 0.05, 1.0);
    }

    // One tick.
    rotorlead_command step(rotorlead_command command)
    {
        rotorlead_command output;
        rotorlead_step(&compensator, command, &output);
        // Where it failed it is 0.
        return output;
    }

    void set_enabled(bool enabled) { rotorlead_set_enabled(&compensator, enabled); }

    // After an outage of the commands.
    void restart(rotorlead_command level) { rotorlead_restart(&compensator, level); }

private:
    rotorlead_compensator compensator{};
};

// In place of a mixer: holds each command for 100 ticks, most of them where the inverse is known.
rotorlead_command mixer(int tick)
{
    const std::uint32_t random = static_cast<std::uint32_t>(tick / 100 + 1) * UINT32_C(2654435761);
    return {static_cast<std::int32_t>((random >> 4) + (UINT32_C(1) << 27))};
}

} // namespace

int main(int count, char **arguments)
{
    rotorlead_status status;
    Motor motor(count > 1 ? std::strtod(arguments[1], nullptr) : 8000.0, status);
    if (status != ROTORLEAD_STATUS_OK) {
        std::fprintf(stderr, "%s\n", rotorlead_status_text(status));
        return 1;
    }
    for (int tick = 0; tick < 20000; tick++) {
        if (tick % 1500 == 0) {
            motor.set_enabled(tick / 1500 % 2 == 0);
        }
        if (tick % 7000 == 6999) {
            motor.restart(mixer(tick));
        }
        std::printf("%ld\n", static_cast<long>(motor.step(mixer(tick)).q29));
    }
    return 0;
}

"""From a motor on a stand to its compensator, and to what the model lacks: about ten seconds, and one figure.

    python example.py [FIGURE]

It needs matplotlib beside rotorlead. With a log of your own, leave out the simulation: `Records.from_log` gives what `identify` and
`diagnose` take in the place of `stand`.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import rotorlead

# A motor whose ESC has a second, faster lag of 12 ms, which no model of one lag has. Gains are in newtons for the whole command.
motor = rotorlead.Model.from_dict(
    {
        "point": [
            {"nominal": 0.3, "gain": 5.2, "time_constant_s": 0.110},
            {"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071},
            {"nominal": 0.7, "gain": 8.4, "time_constant_s": 0.054},
        ],
        "effect": [{"kind": "second_pole", "parameters": {"time_constant_s": 0.012}}],
    }
)

# 1. Records of the paper's experiment: a multisine and a square wave at each nominal command.
stand = rotorlead.simulate(motor, seed=1)

# 2. The lags that they show, and how well they are known.
found = rotorlead.identify(stand)
print(found.headline)
for point in found.points:
    print(
        f"  at {point.nominal:.1f}: {1e3 * point.time_constant_s:.1f} ms"
        f" (95 %: {1e3 * point.time_constant_s_low:.1f} to {1e3 * point.time_constant_s_high:.1f})"
    )
for warning in found.warnings:
    print("  warning:", warning)

# 3. What one lag misses.
diagnosis = rotorlead.diagnose(stand)
for effect in diagnosis.effects:
    for name, parameter in effect.parameters.items():
        std = "unknown" if parameter.std is None else f"{parameter.std:.2g}"
        print(f"missing: {effect.kind}, {name} = {parameter.value:.4g} +- {std} {parameter.unit}")

# 4. A compensator, and the same motor behind it.
lead = rotorlead.design(found.model, omega_g_rad_s=400)
for warning in lead.warnings:
    print(warning)
step = rotorlead.Plan.from_dict(
    {
        "name": "step",
        "seed": 1,
        "esc_frame_hz": 600,
        "noise": {"sigma_n": 0.02},
        "record": [{"nominal": 0.5, "excitation": "step", "amplitude": 0.05, "hold_s": 0.5}],
    }
)
(without,) = rotorlead.simulate(motor, step)
(with_lead,) = rotorlead.simulate(motor, step, compensator=lead.compensator)

# 5. All of it in one figure.
figure, axes = plt.subplots(2, 2, figsize=(11, 7.5), layout="constrained")
lags, gaps, response, steps = axes.flat

points = found.points
tau_ms = 1e3 * points.time_constant_s
ends = [tau_ms - 1e3 * points.time_constant_s_low, 1e3 * points.time_constant_s_high - tau_ms]
lags.errorbar(points.nominal, tau_ms, ends, fmt="o", capsize=4, label="identified, 95 %")
lags.plot(motor.points.nominal, 1e3 * motor.points.time_constant_s, "k_", ms=18, label="rotor alone")
lags.set(title="Time constant", xlabel="nominal command", ylabel="ms", ylim=(0, None))
lags.legend()

gap = diagnosis.gap
gaps.bar(["one lag", "with the effects", "noise"], [100 * part for part in (gap.before, gap.after, gap.noise_floor)])
gaps.set(title="Residual on held-out records", ylabel="% of the response, RMS")

curve = lead.frequency_response
omega = curve.omega_rad_s
for row, nominal in zip(curve.response, curve.nominal):
    lag = found.model.response(omega, nominal) / found.model.lag(nominal).gain
    response.plot(omega, 20 * np.log10(abs(lag)), "--", color="gray")
    response.plot(omega, 20 * np.log10(abs(row * lag)), label=f"at {nominal:.1f}, with the lead")
response.plot(omega, curve.magnitude_db[0], "k", label="the lead")
response.axhline(-3, color="gray", lw=0.5)
response.set(title="Magnitude (dashed: without)", xlabel="rad/s", ylabel="dB", xscale="log", xlim=(1, 1000), ylim=(-20, 20))
response.legend()

for record, label in ((without, "without"), (with_lead, "with the lead")):
    assert record.thrust_n is not None
    steps.plot(record.time_s, record.thrust_n, label=label)
steps.set(title="Step of 0.05 at 0.5", xlabel="s", ylabel="thrust, N", xlim=(0.4, 0.9))
steps.legend()

figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "example.png", dpi=90)

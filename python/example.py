"""From a motor on a stand to its compensator, and to what the model lacks: about ten seconds, and one figure.

    python example.py [FIGURE]

It needs matplotlib beside rotorlead. With a folder of your own, as `rotorlead import` makes it, leave out the simulation:
`identify` and `diagnose` take the folder's path in the place of `stand`.
"""

import sys
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import rotorlead

# A motor whose ESC has a second, faster lag of 12 ms, which no model of one lag has. Gains are in newtons for the whole command.
motor: dict[str, Any] = {
    "point": [
        {"nominal": 0.3, "gain": 5.2, "time_constant_s": 0.110},
        {"nominal": 0.5, "gain": 7.1, "time_constant_s": 0.071},
        {"nominal": 0.7, "gain": 8.4, "time_constant_s": 0.054},
    ],
    "effect": [{"kind": "second_pole", "parameters": {"time_constant_s": 0.012}}],
}

# 1. Records of the paper's experiment: a multisine and a square wave at each nominal command.
stand = rotorlead.simulate(motor, seed=1)

# 2. The lags that they show, and how well they are known.
found = rotorlead.identify(stand)
print(found["headline"])
for point, interval in zip(found["points"], found["intervals"]):
    tau = interval["time_constant_s"]
    print(
        f"  at {point['nominal']:.1f}: {1e3 * point['time_constant_s']:.1f} ms"
        f" (95 %: {1e3 * tau['low']:.1f} to {1e3 * tau['high']:.1f})"
    )
for warning in found["warnings"]:
    print("  warning:", warning)

# 3. What one lag misses.
diagnosis = rotorlead.diagnose(stand)
for effect in diagnosis["effects"]:
    for name, parameter in effect["parameters"].items():
        std = "unknown" if parameter["std"] is None else f"{parameter['std']:.2g}"
        print(f"missing: {effect['kind']}, {name} = {parameter['value']:.4g} +- {std} {parameter['unit']}")

# 4. A compensator, and the same motor behind it.
lead = rotorlead.design(found["model"], omega_g_rad_s=400)
for warning in lead["warnings"]:
    print(warning)
step = {
    "name": "step",
    "seed": 1,
    "esc_frame_hz": 600,
    "noise": {"sigma_n": 0.02},
    "record": [{"nominal": 0.5, "excitation": "step", "amplitude": 0.05, "hold_s": 0.5}],
}
without = rotorlead.simulate(motor, step)["records"][0]
with_lead = rotorlead.simulate(motor, step, compensator=lead["compensator"])["records"][0]

# 5. All of it in one figure.
figure, axes = plt.subplots(2, 2, figsize=(11, 7.5), layout="constrained")
lags, gaps, response, steps = axes.flat

nominal = [point["nominal"] for point in found["points"]]
tau_ms = np.array([1e3 * point["time_constant_s"] for point in found["points"]])
low, high = (np.array([1e3 * i["time_constant_s"][end] for i in found["intervals"]]) for end in ("low", "high"))
lags.errorbar(nominal, tau_ms, [tau_ms - low, high - tau_ms], fmt="o", capsize=4, label="identified, 95 %")
lags.plot(nominal, [1e3 * point["time_constant_s"] for point in motor["point"]], "k_", ms=18, label="rotor alone")
lags.set(title="Time constant", xlabel="nominal command", ylabel="ms", ylim=(0, None))
lags.legend()

gap = diagnosis["gap"]
gaps.bar(["one lag", "with the effects", "noise"], [100 * gap[key] for key in ("before", "after", "noise_floor")])
gaps.set(title="Residual on held-out records", ylabel="% of the response, RMS")

curve = lead["frequency_response"]
omega = curve["omega_rad_s"]
for row, point in zip(curve["response"], found["points"]):
    lag = 1 / (1 + 1j * omega * point["time_constant_s"])
    response.plot(omega, 20 * np.log10(abs(lag)), "--", color="gray")
    response.plot(omega, 20 * np.log10(abs(row * lag)), label=f"at {point['nominal']:.1f}, with the lead")
response.plot(omega, 20 * np.log10(abs(curve["response"][0])), "k", label="the lead")
response.axhline(-3, color="gray", lw=0.5)
response.set(title="Magnitude (dashed: without)", xlabel="rad/s", ylabel="dB", xscale="log", xlim=(1, 1000), ylim=(-20, 20))
response.legend()

for record, label in ((without, "without"), (with_lead, "with the lead")):
    steps.plot(record["time_s"], record["thrust_n"], label=label)
steps.set(title="Step of 0.05 at 0.5", xlabel="s", ylabel="thrust, N", xlim=(0.4, 0.9))
steps.legend()

figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "example.png", dpi=90)

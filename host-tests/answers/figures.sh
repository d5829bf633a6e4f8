cat > motor.toml <<'END'
format = 1
[[point]]
nominal = 0.4
gain = 10.5
time_constant_s = 0.15
[[point]]
nominal = 0.6
gain = 13.5
time_constant_s = 0.08
[static_map]
command = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
response = [0.1, 0.6, 1.4, 2.4, 3.5, 4.8, 6.2, 7.8]
END
cat > plan.toml <<'END'
format = 1
name = "run"
seed = 2
sample_rate_hz = 200
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.4
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.6
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.6
excitation = "square"
amplitude = 0.05
half_period_s = 5
periods = 2
END
rotorlead simulate --model motor.toml --plan plan.toml --out run
rotorlead identify --json 01-identify.json run --out model.toml
rotorlead validate --json 02-validate.json run --model model.toml
rotorlead design --kind lead --json 03-design.json --model model.toml --out compensator.toml
rotorlead simulate --model motor.toml --plan plan.toml --compensator compensator.toml --out fast
rotorlead bandwidth --json 04-bandwidth.json --model model.toml --compensator compensator.toml --records run --records fast
cat > stairs.toml <<'END'
format = 1
name = "stairs"
seed = 1
sample_rate_hz = 200
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.5
excitation = "staircase"
levels = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2]
hold_s = 2
END
rotorlead simulate --model motor.toml --plan stairs.toml --out stairs
rotorlead identify --json 05-identify.json stairs --out stairs.model.toml
cat > blow.awk <<'END'
BEGIN {
  print "time_s,command,thrust_n"
  n = 100; h = 1 / 2000 / n; w1 = 251.3; w2 = 691.2     # modes at 40 and 110 Hz
  for (row = 0; row < 4000; row++) {
    t = row / 2000
    noise = sin(row * row * 12.9898) * 43758.5453; noise -= int(noise)
    print t "," 20 * exp(-0.5 * ((t - 0.02) / 0.001) ^ 2) "," 0.7 * x1 + 0.3 * x2 + 0.003 * noise
    for (k = 0; k < n; k++) {
      u = 20 * exp(-0.5 * ((t + (k + 0.5) * h - 0.02) / 0.001) ^ 2)
      v1 += h * (w1 * w1 * (u - x1) - 0.08 * w1 * v1); x1 += h * v1
      v2 += h * (w2 * w2 * (u - x2) - 0.05 * w2 * v2); x2 += h * v2
    }
  }
}
END
mkdir -p hammer
cat > hammer/experiment.toml <<'END'
format = 1
name = "hammer"
command = "force_n"
output = "thrust_n"
[[record]]
file = "blow.csv"
nominal = 0
excitation = "free"
END
awk -f blow.awk > hammer/blow.csv
rotorlead identify --json 06-identify.json --stand hammer --order 4 --top 150 --out stand.toml
cat > ramp.toml <<'END'
format = 1
[[point]]
nominal = 0.4
gain = 10.5
time_constant_s = 0.15
[[point]]
nominal = 0.6
gain = 13.5
time_constant_s = 0.08
[[effect]]
kind = "slew_limit"
[effect.parameters]
rate_per_s = 0.6
END
sed 's/^seed/loop_rate_hz = 200\nseed/' plan.toml > slow.toml
rotorlead simulate --model ramp.toml --plan slow.toml --out ramp
rotorlead diagnose --json 07-diagnose.json ramp

cat > plan.toml <<'END'
format = 1
name = "stand"
seed = 3
loop_rate_hz = 200
sample_rate_hz = 200
[noise]
sigma_n = 0.01
[[record]]
nominal = 0.4
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.4
excitation = "square"
amplitude = 0.05
half_period_s = 5
periods = 3
[[record]]
nominal = 0.5
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.5
excitation = "square"
amplitude = 0.05
half_period_s = 5
periods = 3
[[record]]
nominal = 0.65
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.65
excitation = "square"
amplitude = 0.05
half_period_s = 5
periods = 3
END
cat > slew.toml <<'END'
format = 1
[[point]]
nominal = 0.40
gain = 9.9955
time_constant_s = 0.1593422
[[point]]
nominal = 0.50
gain = 10.1718
time_constant_s = 0.1076554
[[point]]
nominal = 0.65
gain = 16.1063
time_constant_s = 0.0707839
[[effect]]
kind = "slew_limit"
[effect.parameters]
rate_per_s = 0.6
END
rotorlead simulate --model slew.toml --plan plan.toml --out one
rotorlead diagnose --json 01-diagnose.json one --out-model one.toml
rotorlead diagnose --json 02-diagnose.json one --redesign --out-compensator c.toml
rotorlead diagnose --json 03-diagnose.json one --redesign --at-amplitude 0.02
cat > both.toml <<'END'
format = 1
[[point]]
nominal = 0.40
gain = 9.9955
time_constant_s = 0.1593422
[[point]]
nominal = 0.50
gain = 10.1718
time_constant_s = 0.1076554
[[point]]
nominal = 0.65
gain = 16.1063
time_constant_s = 0.0707839
[[effect]]
kind = "second_pole"
[effect.parameters]
time_constant_s = 0.02
[[effect]]
kind = "saturation"
[effect.parameters]
max = 0.68
END
rotorlead simulate --model both.toml --plan plan.toml --out two
rotorlead diagnose --json 04-diagnose.json two
cat > lags.toml <<'END'
format = 1
[[point]]
nominal = 0.40
gain = 9.9955
time_constant_s = 0.1593422
[[point]]
nominal = 0.50
gain = 10.1718
time_constant_s = 0.1076554
[[point]]
nominal = 0.65
gain = 16.1063
time_constant_s = 0.0707839
END
cat > shake.sh <<'END'
for file in unknown/*.csv; do
  awk -F, -v OFS=, 'NR > 1 { s = sin(2 * 3.141592653589793 * 3.7 * $1); $3 += 0.03 * s^3 } { print }' "$file" > shaken.csv
  mv shaken.csv "$file"
done
END
rotorlead simulate --model lags.toml --plan plan.toml --out unknown
sh shake.sh
rotorlead diagnose --json 05-diagnose.json unknown --out-plan next.toml

cat > motor.toml <<'END'
format = 1
[[point]]
nominal = 0.4
gain = 10.5                # newtons per unit of command, around 0.4
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
name = "first run"
seed = 5
sample_rate_hz = 200
loop_rate_hz = 200
[noise]
sigma_n = 0.02             # of the thrust sensor, newtons
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
periods = 2
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
rotorlead simulate --model motor.toml --plan plan.toml --out practice
rotorlead identify --json 01-identify.json practice --out practice.toml
rotorlead validate --json 02-validate.json practice --model practice.toml
cat > mine.toml <<'END'
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
[[effect]]
kind = "slew_limit"
[effect.parameters]
rate_per_s = 0.6
END
rotorlead simulate --model mine.toml --plan plan.toml --out session
mkdir logs
for run in u040_multisine u040_square u060_multisine u060_square; do
 awk -F, 'NR == 1 {print "Time (ms),ESC (us),Thrust (g)"; next}
 {printf "%.0f,%.2f,%.2f\n", 1000 * $1, 1000 + 1000 * $2, $3 / 0.00980665}' session/$run.csv > logs/$run.csv
done
rotorlead import logs/u040_multisine.csv logs/u060_multisine.csv --excitation multisine --period-s 10 --out bench
rotorlead import logs/u040_square.csv logs/u060_square.csv --excitation square --period-s 10 --append --out bench
rotorlead identify --json 03-identify.json bench --out model.toml
rotorlead diagnose --json 04-diagnose.json bench
rotorlead diagnose --json 05-diagnose.json bench --redesign --out-compensator compensator.toml
rotorlead simulate --model motor.toml --plan plan.toml --out again
rotorlead identify --json 06-identify.json again --out model.toml
rotorlead diagnose --json 07-diagnose.json again
rotorlead design --kind lead --json 08-design.json --model model.toml --out compensator.toml
rotorlead simulate --model model.toml --compensator compensator.toml --out proof
rotorlead bandwidth --json 09-bandwidth.json --model model.toml --compensator compensator.toml --records again --records proof
rotorlead design --json 10-design.json --model model.toml --out recommended.toml

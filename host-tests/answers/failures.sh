cat > motor.toml <<'END'
format = 1
[[point]]
nominal = 0.4
gain = 10.0
time_constant_s = 0.16
[[point]]
nominal = 0.6
gain = 13.5
time_constant_s = 0.085
END
cat > mapped.toml <<'END'
format = 1
[[point]]
nominal = 0.4
gain = 10.0
time_constant_s = 0.16
[[point]]
nominal = 0.6
gain = 13.5
time_constant_s = 0.085
[static_map]
command = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
response = [0.5, 1.25, 2.2, 3.3, 4.6, 6.0, 7.5]
END
cat > hasty.toml <<'END'
format = 1
name = "hasty"
seed = 1
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.5
excitation = "staircase"
levels = [0.4, 0.5, 0.6, 0.5, 0.4]
hold_s = 0.3
END
rotorlead simulate --model mapped.toml --plan hasty.toml --out hasty
rotorlead identify --json 01-identify.json hasty --out model.toml
cat > sines.toml <<'END'
format = 1
name = "sines"
seed = 1
sample_rate_hz = 200
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.5
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 2
warm_up_periods = 0
END
rotorlead simulate --model motor.toml --plan sines.toml --out sines
cp -r sines stopped
head -n 1501 sines/u050_multisine.csv > stopped/u050_multisine.csv
rotorlead identify --json 03-identify.json sines --out model.toml
cp -r sines cut
awk -F, 'BEGIN {OFS = FS} NR > 1 && $3 > 1.25 {$3 = 1.25} {print}' sines/u050_multisine.csv > cut/u050_multisine.csv
rotorlead identify --json 04-identify.json cut --out model.toml
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
levels = [0.3, 0.4, 0.5, 0.6, 0.7, 0.6, 0.5, 0.4, 0.3]
hold_s = 2.0
END
rotorlead simulate --model mapped.toml --plan stairs.toml --out stairs
cp -r stairs low
awk -F, 'BEGIN {OFS = FS} NR > 1 && $3 > 4.5 {$3 = 4.5} {print}' stairs/u050_staircase.csv > low/u050_staircase.csv
rotorlead identify --json 05-identify.json low --out model.toml
cat > near_full.toml <<'END'
format = 1
[[point]]
nominal = 0.9
gain = 16.0
time_constant_s = 0.07
END
cat > loud.toml <<'END'
format = 1
name = "loud"
seed = 1
sample_rate_hz = 1000
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.9
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 4
END
rotorlead design --kind lead --json 06-design.json --model near_full.toml --out compensator.toml
rotorlead simulate --model near_full.toml --plan loud.toml --compensator compensator.toml --out loud
rotorlead identify --json 07-identify.json loud --out model.toml
cat > loop.awk <<'END'
BEGIN {
    print "time_s,command,thrust_n"
    for (row = -500; row < 2000; row++) {
        added = 0
        for (h = 1; h <= 39; h += 2) added += 0.01 * sin(6.283185307 * h * row / 500 + h * h)
        seed = (seed * 16807 + 12345) % 2147483647
        thrust = motor + 0.2 * (seed / 2147483647 - 0.5)
        command = 0.5 + added - gain * (thrust - 5)
        if (row >= 0) printf "%.2f,%.9f,%.9f\n", row / 100, command, thrust
        motor += (10 * command - motor) * (1 - exp(-0.1))
    }
}
END
cat > experiment.toml <<'END'
format = 1
name = "held by a controller"
command = "duty"
output = "thrust_n"
[[record]]
file = "run.csv"
nominal = 0.5
excitation = "multisine"
period_s = 5
END
mkdir weak strong
cp experiment.toml weak
cp experiment.toml strong
awk -v gain=0.01 -f loop.awk > weak/run.csv
awk -v gain=0.2 -f loop.awk > strong/run.csv
rotorlead identify --json 08-identify.json weak --out model.toml
mkdir apart
cp sines/experiment.toml apart
awk -F, -v OFS=, 'NR == 1 {print $1, $2} NR > 1 {printf "%.4f,%s\n", $1 + 5000, $2}' sines/u050_multisine.csv > command.csv
awk -F, -v OFS=, 'NR == 1 {print $1, $3} NR > 1 {print $1, $3}' sines/u050_multisine.csv > apart/u050_multisine.csv
rotorlead identify --json 11-identify.json apart --align command.csv --align-near start --align-within 2 --out model.toml
